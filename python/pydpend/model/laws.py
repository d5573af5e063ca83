"""Coefficients of the damping laws (paper Table 5 corrected, and what real recordings demand beside it)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from pydpend._native import Law, laws
from pydpend.errors import ModelError, fault
from pydpend.model.pendulum import Model
from pydpend.typed import typed_class

LAW_TABLE: dict[str, Law] = {law.name: law for law in laws()}
"""The laws by the names of their coefficients, in the order of powers and works: the compiled half's one table
(``dynamics::TERMS``). Lists of coefficients, units and words are made from it."""

FORCES = tuple(name for name, law in LAW_TABLE.items() if law.is_force)
"""Coefficients of the laws that are forces, and so have a work."""


@typed_class()
@dataclass(frozen=True)
class Damping:
    """One coefficient per law of damping, SI, 0 where the law is off (Table 5 corrected).

    Joint 2's moments act on both links, equal and opposite, and see the relative rate ``w2 - w1`` (errata 13, 14); the
    drags see absolute rates (docs/reference/physics.md section 6).

    Parameters
    ----------
    mu_v1, mu_v2 : float
        Viscous, joints 1 and 2, N m s: ``mu_v1 w1``, ``mu_v2 (w2 - w1)``.
    mu_q1, mu_q2 : float
        Quadratic air drag of the upper and the lower link, N m s2: ``mu_q1 |w1| w1``, ``mu_q2 |w2| w2``.
    rmu1, rmu2 : float
        Contact radius times friction coefficient, joints 1 and 2, m: ``rmu1 N1 sgn(w1)``, ``rmu2 N2 sgn(w2 - w1)``
        with the normal forces N of Eq. 34.
    tau_c1, tau_c2 : float
        Constant dry torque of joints 1 and 2, N m: ``tau_c1 sgn(w1)``, ``tau_c2 sgn(w2 - w1)``.
    strip_drag : float
        Air drag of the lower link in its true relative wind, N m s2: the moment is ``strip_drag |w2| w2`` for the
        link turning alone about a fixed elbow.
    offset1 : float
        Constant torque driving link 1, N m, positive counter-clockwise (negative brakes that way).
    offset2 : float
        Constant torque in joint 2, N m: on link 2, reacting on link 1.
    added_inertia : float
        Inertia about the elbow of the air that moves with the lower link, kg m2.
    tilt : float
        Direction of gravity in the plane, rad, counter-clockwise from where the angles are zero.

    Raises
    ------
    ModelError
        For a coefficient that is not finite, or negative where it cannot be.
    """

    mu_v1: float = 0.0
    mu_v2: float = 0.0
    mu_q1: float = 0.0
    mu_q2: float = 0.0
    rmu1: float = 0.0
    rmu2: float = 0.0
    tau_c1: float = 0.0
    tau_c2: float = 0.0
    strip_drag: float = 0.0
    offset1: float = 0.0
    offset2: float = 0.0
    added_inertia: float = 0.0
    tilt: float = 0.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not math.isfinite(value) or (value < 0 and not LAW_TABLE[f.name].is_signed):
                raise ModelError(
                    fault(
                        "damping", f"{f.name} is {value}", "A damping coefficient is finite and not negative"
                    )
                )


UNITS = {name: law.unit for name, law in LAW_TABLE.items()}
"""Unit of each coefficient of `Damping`."""


def constants(model: Model) -> dict[str, float]:
    """The model's constants, SI, under the names that the compiled half knows."""
    return {
        "psi": model.psi_kg_m2,
        "lambda": model.lambda_kg_m2,
        "zeta": model.zeta_kg_m2,
        "a3": model.a3_kg_m2,
        "sigma": model.sigma_j,
        "kappa": model.kappa_j,
        "m1": model.m1_kg,
        "m2": model.m2_kg,
        "l1": model.l1_m,
        "g": model.g_m_s2,
        "lower_inner": model.lower_inner_m,
        "lower_outer": model.lower_outer_m,
    }


def parameters(model: Model, damping: Damping) -> dict[str, float]:
    """The model and its damping under the names that the compiled half knows (`_native.simulate_motion`)."""
    return constants(model) | {f.name: float(getattr(damping, f.name)) for f in fields(damping)}
