"""Intervals of the damping coefficients by profile likelihood.

Twice the negative log-likelihood, minimised over everything else at each value of one coefficient, rises by
chi-square's 95 % quantile of one degree of freedom at the ends of that coefficient's interval (Venzon and
Moolgavkar 1988). The likelihood takes all the slack for jumps that are there, and knows no model error beyond: its rise
is divided by the stated variance over its own (Chandler and Bate 2007), so that for a quadratic likelihood the
interval is the estimate +- 1.96 standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FULL, unit
from pydpend.damping import shooting
from pydpend.damping.result_parts import Estimate, Interval
from pydpend.damping.shooting import CAMERA, Progress, Solution, Track
from pydpend.errors import FitError
from pydpend.fit_status import FitStatus
from pydpend.information import invert

Floats = NDArray[np.float64]

LEVEL = 3.841
"""Rise of twice the negative log-likelihood at the ends of a 95 % interval."""
NEAR = 0.02
"""Distance from `LEVEL` at which an end is found: 0.005 standard errors. A refit's minimum is known to 0.002."""
MOST = 10
"""Refits for one end at most; one or two are the rule, four where another coefficient comes to its bound."""
STEPS = 20
"""Gauss-Newton steps of a refit at most; three are the rule."""
AT_ZERO = 0.01
"""Part of its standard error below which a coefficient is at its bound."""
FARTHER = 3.0
"""Most that one refit goes beyond the last."""


LARGEST = 10.0
"""Chi-square with the slack beyond which there is no likelihood to profile: less than a tenth of what is left of the
angles is noise. The rise is then that of model error, and one number per coefficient does not turn it into a
likelihood's: along a profile others come to their bound zero, and in the directions that remain model error has raised
the variance by quite another factor (7000 and 14000 in two of trial1's with Table 8's ratios held)."""


def refusal(solution: Solution) -> str:
    """The reason for which there are no intervals by profile likelihood; empty where there can be."""
    if solution.chi2 <= LARGEST:
        return ""
    return (
        f"no intervals by profile likelihood: chi-square is {solution.chi2:.0f} even with the slack, so what is left "
        "of the angles is not their noise, and its likelihood says nothing of the coefficients; the standard errors "
        "are from the scatter of the residuals. Give better constants or free the ratios, or truer uncertainties of "
        "the angles"
    )


@dataclass
class _Profile:
    """The rise along one coefficient, refit by refit."""

    tracks: Sequence[Track]
    best: Solution
    name: str
    scale: float
    huber: float
    known: dict[float, float] = field(default_factory=dict)

    def rise(self, value: float) -> float | None:
        """Rise at a value; None where the refit does not come to its end."""
        at = self.best.names.index(self.name)
        cov = invert(self.best.information)
        slope = cov[:, at] / cov[at, at]
        step = value - self.best.parameters.get(self.name, 0.0)
        free = [n for n in _common(self.best) if n != self.name]
        # Where a linear problem would have the others: a start that saves steps, no more.
        start = {n: self.best.parameters.get(n, 0.0) + step * slope[self.best.names.index(n)] for n in free}
        start = {n: max(v, 0.0) if n in FULL else float(v) for n, v in start.items()}
        values = self.best.parameters | start | {self.name: value}
        try:
            found = _solved(self.tracks, self.best, values, free, self.huber)
            pressed = (
                [] if found.status is FitStatus.CONVERGED else self._pressed(found, np.sqrt(np.diag(cov)))
            )
            if pressed:
                values = found.parameters | dict.fromkeys(pressed, 0.0)
                free = [n for n in free if n not in pressed]
                found = _solved(self.tracks, found, values, free, self.huber)
        except FitError:
            return None
        if found.status is not FitStatus.CONVERGED:
            return None
        self.known[value] = 2 * (found.cost - self.best.cost) / self.scale
        return self.known[value]

    def _pressed(self, found: Solution, sigma: Floats) -> list[str]:
        """Coefficients at zero that would go below it.

        Where one comes to its bound on the way, steps get ever shorter and the refit does not see its end; with it
        held there, it does.
        """
        spread = dict(zip(self.best.names, sigma.tolist(), strict=True))
        push = dict(zip(found.names, found.gradient.tolist(), strict=True))
        return [
            n
            for n in _common(found)
            if n in FULL and found.parameters.get(n, 0.0) < AT_ZERO * spread[n] and push[n] > 0
        ]

    def end(self, direction: int, sigma: float) -> float | None:
        """Distance from the estimate to an end; None where the bound zero is reached before.

        Raises FitError where there is none within `MOST` refits.
        """
        estimate = self.best.parameters.get(self.name, 0.0)
        limit = estimate if direction < 0 else float("inf")
        if limit <= 0.0:
            return None
        tried: list[tuple[float, float]] = []
        inside, outside = 0.0, float("inf")
        distance: float = min(LEVEL**0.5 * sigma, limit)
        for _ in range(MOST):
            rise = self.rise(0.0 if distance >= limit else estimate + direction * distance)
            if rise is not None:
                if abs(rise - LEVEL) < NEAR:
                    return distance
                if rise < LEVEL and distance >= limit:
                    return None
                tried.append((distance, rise))
            # Nearer to the estimate where a refit failed: an end is only where one has converged.
            if rise is not None and rise < LEVEL:
                inside = distance
            else:
                outside = distance
            distance = min(_next(tried, inside, outside), limit)
        raise FitError(
            f"{len(tried)} of {MOST} refits converged, none at a rise of {LEVEL}, up to "
            f"{max((d for d, _ in tried), default=0.0):.3g} {unit(self.name)} from the estimate"
        )


def profile_intervals(
    tracks: Sequence[Track],
    solution: Solution,
    coefficients: dict[str, Estimate],
    *,
    huber: float,
    progress: Progress | None = None,
) -> dict[str, Interval]:
    """95 % intervals of ``coefficients`` (SI), all else refitted at each value tried, with the solution's slack.

    ``tracks``: the angles as they were fitted (bias maps taken off; the maps are not refitted). ``coefficients``:
    estimates with their stated standard errors, which say in what units the likelihood is (module docstring).
    ``huber``: the limit the fit had. Ends that are not found are NaN and said so in the interval's note.
    """
    # The fit's own objective has its slack learned on the way: its minimum with that slack is a hair lower.
    best = _solved(tracks, solution, solution.parameters, _common(solution), huber)
    variance = np.diag(invert(best.information))
    out: dict[str, Interval] = {}
    for k, (name, stated) in enumerate(coefficients.items()):
        estimate = best.parameters.get(name, 0.0)
        line = _Profile(tracks, best, name, stated.sigma**2 / float(variance[best.names.index(name)]), huber)
        ends, notes = [estimate, estimate], []
        for side, direction in enumerate((-1, 1)):
            try:
                distance = line.end(direction, stated.sigma)
            except FitError as problem:
                ends[side] = float("nan")
                notes.append(f"the {('lower', 'upper')[side]} end was not found: {problem}")
            else:
                ends[side] = 0.0 if distance is None else estimate + direction * distance
                if distance is None:
                    notes.append("open at the bound zero, which the data do not exclude")
            if progress is not None:
                progress(2 * k + side + 1, 2 * len(coefficients), best.chi2)
        line.known[estimate] = 0.0
        values = tuple(sorted(line.known))
        rises = tuple(line.known[v] for v in values)
        if min(rises) < -NEAR:
            lowest = values[int(np.argmin(rises))]
            notes.append(f"the fit is not the likeliest: {lowest:.3g} {stated.unit} is likelier")
        out[name] = Interval(ends[0], ends[1], stated.unit, values, rises, "; ".join(notes))
    return out


def _common(solution: Solution) -> list[str]:
    """The free parameters of the equations of motion."""
    return [n for n in solution.names if n != "clock" and not n.startswith(("zero", CAMERA))]


def _solved(
    tracks: Sequence[Track], near: Solution, values: dict[str, float], free: Sequence[str], huber: float
) -> Solution:
    """The fit's objective minimised over ``free``, the states and the zeros, from those of a solution."""
    return shooting.solve(
        tracks,
        near.segments,
        values,
        near.zeros_rad,
        free=free,
        bounded=[n for n in free if n in FULL],
        slack=list(near.slack),
        learned=False,
        huber=huber,
        max_iterations=STEPS,
        clock="clock" in near.names,
        clock_scale=near.clock_scale,
        cameras=near.cameras,
    )


def _next(tried: Sequence[tuple[float, float]], inside: float, outside: float) -> float:
    """The value at which the rise should be `LEVEL`; always between ``inside`` and ``outside``.

    On the parabola through the estimate and the last two distances tried (it has a slope at a bound), or if only one
    is known on that without slope.

    On the parabola through the estimate and the last two distances tried (it has a slope at a bound), or if only one
    is known on that without slope.
    """
    if not tried:
        return (inside + outside) / 2
    last, rise = tried[-1]
    guess = last * (LEVEL / rise) ** 0.5 if rise > 0 else np.inf
    if len(tried) > 1:
        d = np.array([tried[-2][0], last])
        slope, bend = np.linalg.solve(np.column_stack([d, d**2]), [tried[-2][1], rise])
        root = slope**2 + 4 * bend * LEVEL
        guess = 2 * LEVEL / (slope + root**0.5) if root >= 0 and slope + root**0.5 > 0 else np.inf
    guess = min(guess, FARTHER * last)
    return float(guess) if inside < guess < outside else (inside + min(outside, FARTHER * last)) / 2
