"""Coefficients of the damping laws (paper Table 5 corrected, and what real recordings demand beside it)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from pydpend.errors import ModelError, fault


@dataclass(frozen=True)
class Damping:
    """One coefficient per law, SI, 0 where the law is off. docs/physics.md section 6 has the moments.

    Joint 2's moments act on both links, equal and opposite, and see the relative rate ``w2 - w1`` (errata 13,
    14); the drags see absolute rates.
    """

    mu_v1: float = 0.0
    """Viscous, joint 1, N m s: ``mu_v1 w1``."""
    mu_v2: float = 0.0
    """Viscous, joint 2, N m s: ``mu_v2 (w2 - w1)``."""
    mu_q1: float = 0.0
    """Quadratic air drag of the upper link, N m s2: ``mu_q1 |w1| w1``."""
    mu_q2: float = 0.0
    """Quadratic air drag of the lower link, N m s2: ``mu_q2 |w2| w2``."""
    rmu1: float = 0.0
    """Contact radius times friction coefficient, joint 1, m: ``rmu1 N1 sgn(w1)``."""
    rmu2: float = 0.0
    """Contact radius times friction coefficient, joint 2, m: ``rmu2 N2 sgn(w2 - w1)``."""
    tau_c1: float = 0.0
    """Constant dry torque of joint 1, N m: ``tau_c1 sgn(w1)``."""
    tau_c2: float = 0.0
    """Constant dry torque of joint 2, N m: ``tau_c2 sgn(w2 - w1)``."""
    strip_drag: float = 0.0
    """Air drag of the lower link in its true relative wind, N m s2: the moment is ``strip_drag |w2| w2``
    for the link turning alone about a fixed elbow."""

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not math.isfinite(value) or value < 0:
                raise ModelError(
                    fault(
                        "damping", f"{f.name} is {value}", "A damping coefficient is finite and not negative"
                    )
                )


UNITS = {
    "mu_v1": "N m s",
    "mu_v2": "N m s",
    "mu_q1": "N m s2",
    "mu_q2": "N m s2",
    "rmu1": "m",
    "rmu2": "m",
    "tau_c1": "N m",
    "tau_c2": "N m",
    "strip_drag": "N m s2",
}
"""Unit of each coefficient of `Damping`."""
