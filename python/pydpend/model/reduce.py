"""From parts to a `Model`: the constants with their covariance, and the paper's two sets of constants."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from pydpend.components import Configuration, Part, configuration, covariance, total, values
from pydpend.errors import ModelError, fault
from pydpend.model.pendulum import CONSTANTS, Model, uniform_bar
from pydpend.typed import typed

G_MM_S2 = 9810.0
"""Gravity as the paper's kappa implies it (erratum 28), mm/s2."""

_TO_SI = np.array([1e-9] * 6 + [1e-3, 1e-3, 1e-3])
"""From g mm2, g mm2/s2, g and mm to kg m2, J, kg and m, in the order of `CONSTANTS`."""


class ModelWarning(UserWarning):
    """Constants that can be used but should not be believed."""


def reduced_constants(
    parts: tuple[Part, ...], quantities: Mapping[str, Any], gravity: Any, length: str = "l_u"
) -> list[Any]:
    """The nine constants in the order of `CONSTANTS` and in the units of the quantities.

    Arithmetic only: floats, arrays of samples, complex steps and SymPy symbols may go in.
    """
    r = total(parts, quantities, length)
    return [
        r.psi,
        r.lam,
        r.zeta,
        r.a3,
        gravity * r.sigma_g,
        gravity * r.kappa_g,
        r.m1,
        r.m2,
        quantities[length],
    ]


def jacobian(
    parts: tuple[Part, ...], quantities: Mapping[str, float], gravity: float, length: str = "l_u"
) -> npt.NDArray[np.float64]:
    """Derivative of the nine constants by each quantity, (9, n), by complex steps (exact to rounding)."""
    step = 1e-30
    columns = []
    for symbol in quantities:
        moved: dict[str, Any] = dict(quantities)
        moved[symbol] = complex(quantities[symbol], step)
        columns.append([np.imag(c) / step for c in reduced_constants(parts, moved, gravity, length)])
    return np.array(columns, dtype=np.float64).T


def from_parts(
    pendulum: Configuration,
    *,
    gravity: float = G_MM_S2,
    given: Mapping[str, float] | None = None,
    name: str | None = None,
    extent: tuple[float, float] | None = None,
) -> Model:
    """The model of a configuration in g and mm.

    ``given`` replaces values; ``extent`` is the lower link's two ends in mm from the elbow (default: those
    of the uniform bar equal to the lower arm). Raises ModelError for a negative mass or inertia, a quantity
    without a value, or constants that no pendulum can have.
    """
    constants, cov, q = constants_of(pendulum, gravity=gravity, given=given)
    if extent is None and pendulum.lower_arm is not None:
        m, i, r = pendulum.lower_arm
        extent = uniform_bar(q[m], q[i], q[r])
    if extent is None:
        extent = (0.0, 0.0)
    return Model(
        **dict(zip(CONSTANTS, constants.tolist(), strict=True)),
        g_m_s2=gravity * 1e-3,
        lower_inner_m=extent[0] * 1e-3,
        lower_outer_m=extent[1] * 1e-3,
        covariance=cov,
        name=name or f"derived {pendulum.name}",
    ).checked()


def constants_of(
    pendulum: Configuration, *, gravity: float = G_MM_S2, given: Mapping[str, float] | None = None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], dict[str, float]]:
    """The constants (9,) of a configuration with their covariance (9, 9), SI, in the order of `CONSTANTS`.

    Also the values of its quantities in g and mm. Raises ModelError as `from_parts`.
    """
    quantities = dict(pendulum.quantities)
    q = values({s: v for s, v in quantities.items() if s not in (given or {})})
    for symbol, value in (given or {}).items():
        if symbol not in quantities:
            raise ModelError(fault(f"{symbol!r}", f"not a quantity of configuration {pendulum.name}"))
        q[symbol] = float(value)
    q = {symbol: q[symbol] for symbol in quantities}
    for part in pendulum.parts:
        for kind, key in (("mass", part.mass), ("inertia", part.inertia)):
            if key is not None and not (np.isfinite(q[key]) and q[key] >= 0):
                raise ModelError(
                    fault(
                        f"part {part.item} ({part.name})",
                        f"{kind} {key} is {q[key]}",
                        "It cannot be negative",
                    )
                )
    j = jacobian(pendulum.parts, q, gravity, pendulum.length) * _TO_SI[:, None]
    cov = j @ covariance(quantities, pendulum.identical) @ j.T
    constants = np.array(reduced_constants(pendulum.parts, q, gravity, pendulum.length), float) * _TO_SI
    return constants, cov, q


@typed()
def derived(config: str = "A", *, trackers: bool = False, given: Mapping[str, float] | None = None) -> Model:
    """The constants of a configuration from its parts (Table 8), corrected (ERRATA section 0), with covariance.

    Parameters
    ----------
    config : {"A", "B"}
        Configuration. B has no published values: `given` must have them all.
    trackers : bool
        Whether to add trackers and tape at assumed places (Table 8 gives none).
    given : dict of str to float, optional
        Values of quantities in g and mm, in place of Table 8's.

    Returns
    -------
    Model
        The model, SI.

    Raises
    ------
    ModelError
        For a configuration or quantity that is not known, a quantity without a value, or constants that no pendulum
        can have.
    """
    return from_parts(configuration(config, trackers=trackers), given=given)


# Table 7, g mm2 and g mm2/s2: value and uncertainty as printed.
TABLE_7 = {
    "psi_kg_m2": (5.47e6, 4e4),
    "lambda_kg_m2": (129_000.0, 6000.0),
    "zeta_kg_m2": (851.0, 9.0),
    "a3_kg_m2": (1.42e6, 3e4),
    "sigma_j": (6.81e8, 5e6),
    "kappa_j": (8.14e7, 1.5e6),
}


def published() -> Model:
    """The constants of Table 7 as printed: for comparison only.

    Masses and lengths, which Table 7 lacks, are the derived ones.

    Returns
    -------
    Model
        The model, SI.

    Warns
    -----
    ModelWarning
        That lambda breaks the parallel-axis bound and that psi and sigma disagree with Table 8, each with its number
        of standard deviations.
    """
    right = derived("A")
    sigmas = right.sigmas()
    numbers = {name: value * 1e-9 for name, (value, _) in TABLE_7.items()}
    variances = [
        (TABLE_7[name][1] * 1e-9) ** 2 if name in TABLE_7 else sigmas[name] ** 2 for name in CONSTANTS
    ]
    model = Model(
        **numbers,
        m1_kg=right.m1_kg,
        m2_kg=right.m2_kg,
        l1_m=right.l1_m,
        g_m_s2=right.g_m_s2,
        lower_inner_m=right.lower_inner_m,
        lower_outer_m=right.lower_outer_m,
        covariance=np.diag(variances),
        name="published (Table 7)",
        scale_known=True,
    )
    said = model.problems()
    for name in ("psi_kg_m2", "sigma_j"):
        ratio = numbers[name] / getattr(right, name) - 1
        off = (numbers[name] - getattr(right, name)) / np.hypot(TABLE_7[name][1] * 1e-9, sigmas[name])
        said.append(
            f"{name} of Table 7 is {100 * ratio:+.0f} % from what the parts of Table 8 give ({off:.0f} sigma)"
        )
    for text in said:
        warnings.warn(f"{model.name}: {text}", ModelWarning, stacklevel=2)
    return model
