"""Inverses of information matrices, true where a direction is not determined: its variance is huge, never 0."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import FitError, Message, fault

Floats = NDArray[np.float64]

LEAST = 1e-14
"""Part of the largest information, each unknown in its own scale, below which a direction is not determined at all."""


def principal_axes(information: Floats) -> tuple[Floats, Floats]:
    """Principal values (G,) of a symmetric information matrix scaled to a unit diagonal.

    Also what each is of, as columns (G, G) in the unknowns' own units.

    Also what each is of, as columns (G, G) in the unknowns' own units.

    Raises
    ------
        FitError: if the matrix has entries that are not finite.
    """
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = information / np.outer(scale, scale)
    if not np.isfinite(scaled).all():
        raise FitError(undetermined("what they tell of some unknowns is beyond any number"))
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2)
    return values, vectors / scale[:, None]


def invert(information: Floats) -> Floats:
    """Inverse of a symmetric information matrix (G, G), scaled first; directions it lacks get a huge variance.

    Raises
    ------
        FitError: if the matrix has entries that are not finite.
    """
    values, axes = principal_axes(information)
    out: Floats = (axes / np.maximum(values, LEAST)) @ axes.T
    return out


def check_errors(names: list[str], covariance: Floats) -> None:
    """Whether each of the unknowns ``names`` has a standard error that means something: a finite one above 0.

    Raises
    ------
        FitError: naming the first that has none.
    """
    for name, variance in zip(names, np.diag(covariance), strict=True):
        if not (np.isfinite(variance) and variance > 0):
            raise FitError(undetermined(f"{name} has no standard error"))


def undetermined(why: str) -> Message:
    """The message for angles that do not determine what is fitted."""
    return fault(
        "fit",
        f"these angles do not determine the coefficients: {why}",
        "Give a motion that swings, or fewer laws: where the damping is so strong that the links only creep back, "
        "its laws cannot be told",
    )
