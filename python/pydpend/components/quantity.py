"""A measured quantity: a number with its uncertainty, its unit and where it is from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pydpend.errors import ModelError, fault


@dataclass(frozen=True)
class Quantity:
    """One row of a table of parts.

    ``value`` is None where the source prints none; ``sigma`` is the standard uncertainty in the same unit, 0
    where the source calls it negligible.
    """

    symbol: str
    description: str
    value: float | None
    sigma: float
    unit: str
    instrument: str
    method: str
    source: str


def values(quantities: Mapping[str, Quantity]) -> dict[str, float]:
    """The values by symbol. Raises ModelError naming the first quantity without one."""
    out = {}
    for symbol, quantity in quantities.items():
        if quantity.value is None:
            raise ModelError(
                fault(
                    f"{symbol} ({quantity.description})",
                    "its source gives no value",
                    f"Give one: values={{'{symbol}': ...}} in {quantity.unit}",
                )
            )
        out[symbol] = quantity.value
    return out


def covariance(
    quantities: Mapping[str, Quantity], groups: Iterable[Iterable[str]] = ()
) -> npt.NDArray[np.float64]:
    """Covariance of the quantities in their order.

    Quantities are independent, except that those of one group (identical parts weighed once) are fully
    correlated.
    """
    symbols = list(quantities)
    sigma = np.array([quantities[s].sigma for s in symbols])
    rho = np.eye(len(symbols))
    for group in groups:
        index = [symbols.index(s) for s in group]
        rho[np.ix_(index, index)] = 1.0
    return np.asarray(sigma[:, None] * rho * sigma[None, :])
