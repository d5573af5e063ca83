"""Covariances that carry model error, and what the data cannot tell apart, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FULL, RATIOS, unit
from pydpend.damping.result_parts import Identifiability
from pydpend.damping.shooting import CAMERA, Solution
from pydpend.information import LEAST, invert, principal_axes

Floats = NDArray[np.float64]

BLOCK_S = 1.0
"""Length of the blocks whose scores are taken as independent, s: several swings' worth of correlated
residual."""
STRONG = 0.95
"""Correlation beyond which two coefficients are named as not told apart."""


@np.errstate(over="ignore", invalid="ignore")
def covariance(solution: Solution, *, model_error: bool) -> Floats:
    """Covariance (G, G) of the common unknowns.

    Each source of error counts with the variance it has, not with the one the fit allowed it: the angles' noise with
    chi-square, the jumps with what they show of the slack (`Solution.jumps_shown`; derived in
    docs/explanation/damping.md), the cameras with their prior.
    With model error also the sandwich from the scores of blocks of about a second, and of each standard error the
    larger one is taken. Where the angles determine nothing, it is not finite (`information.check_errors`).
    """
    bread = invert(solution.information)
    meat = solution.angle_information * max(1.0, solution.chi2) + solution.jump_information + _prior(solution)
    # What is not determined has no errors to add up: it keeps its huge variance.
    values, axes = principal_axes(solution.information)
    lost = axes[:, values < LEAST]
    plain: Floats = bread @ meat @ bread + lost @ lost.T / LEAST
    if not model_error:
        return plain
    segments = solution.segments
    block = np.floor(segments.times_s[:, 0] / BLOCK_S).astype(np.int64) + 1_000_000 * segments.rows[:, 0]
    _, label = np.unique(block, return_inverse=True)
    count = int(label.max()) + 1
    if count < 2 * len(solution.names):
        return plain
    sums = np.zeros((count, len(solution.names)))
    np.add.at(sums, label, solution.scores)
    scatter = sums.T @ sums * count / (count - len(solution.names))
    sandwich = bread @ (scatter + _prior(solution)) @ bread
    growth = np.sqrt(np.maximum(1.0, np.diag(sandwich) / np.diag(plain)))
    out: Floats = plain * np.outer(growth, growth)
    return out


def _prior(solution: Solution) -> Floats:
    """Information from the cameras' prior, whose errors are of unit variance."""
    return np.diag([1.0 if n.startswith(CAMERA) else 0.0 for n in solution.names])


def identifiability(
    names: Sequence[str],
    cov: Floats,
    values: Mapping[str, float],
    held: Sequence[str],
    duration_s: float,
    *,
    scale_known: bool = True,
) -> Identifiability:
    """Condition number, strong correlations and sentences for the coefficients and ratios ``names``."""
    sigma = np.sqrt(np.diag(cov))
    correlation = cov / np.outer(sigma, sigma)
    condition = float(np.linalg.cond(correlation)) if len(names) else 1.0
    pairs: dict[str, float] = {}
    sentences: list[str] = []
    for i in range(len(names)):
        for j in range(i):
            c = float(correlation[i, j])
            if abs(c) > 0.9:
                pairs[f"{names[j]}/{names[i]}"] = c
            if abs(c) > STRONG and names[i] in FULL and names[j] in FULL:
                sentences.append(
                    f"{names[j]} and {names[i]} are not told apart by these data (correlation {c:+.2f}): "
                    f"only their combination is determined."
                )
    for name, s in zip(names, sigma, strict=True):
        if name not in FULL:
            continue
        value, of = values[name], unit(name, scale_known=scale_known)
        if name in held:
            sentences.append(f"{name} is zero within error (upper limit {2 * s:.1e} {of}).")
        elif value < 2 * s:
            sentences.append(f"{name} is not determined: {value:.1e} +- {s:.1e} {of}; it may be zero.")
        elif value < 5 * s:
            sentences.append(f"{name} is known to {100 * s / value:.0f} % only.")
    for name, s in zip(names, sigma, strict=True):
        if name in RATIOS and s > 0.02 * abs(values[name]):
            sentences.append(f"The ratio {name}/psi is known to {100 * s / abs(values[name]):.1f} % only.")
    sentences.append(
        "The scale of the inertias is not observable in free motion: all coefficients are proportional to "
        "psi, which is the model's, and its relative uncertainty is a common factor on all of them."
        if scale_known
        else "All coefficients are over psi, half the upper link's inertia, which free motion does not tell."
    )
    return Identifiability(condition, pairs, duration_s, tuple(sentences))
