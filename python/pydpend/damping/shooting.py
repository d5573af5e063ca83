"""The compiled multiple-shooting fit, in arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend.damping.pieces import cut_between, ends_of
from pydpend.damping.result_parts import Residuals
from pydpend.errors import FitError, fault
from pydpend.fit_status import FitStatus
from pydpend.kinematics.table import CAMERA_NUMBERS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Track = tuple[Floats, Floats, Floats]
"""Times (T,), angles (T, 2) and standard uncertainties (T, 2) of one recording; NaN where not seen."""

Progress = Callable[[int, int, float], object]
"""Called with the step, the most there will be, and chi-square."""


GROWTH = 300.0
"""Most that a segment may make of an error of its start, states in units of what a piece's samples determine. Passing
close by the upright makes 1e4 and more in a second: no linear step holds through that."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Pieces of recordings, each with its own free state."""

    rows: Ints
    """(K, 4): recording, first sample, one past the last, whether the next continues it."""
    times_s: Floats
    """(K, 2): start and end."""
    states: Floats
    """(K, 4): phi1, phi2, w1, w2 at the start: a guess or a solution."""

    def __len__(self) -> int:
        return len(self.rows)

    def take(self, keep: NDArray[Any]) -> Segments:
        """Some of them, in order (their chains must be cut by the caller)."""
        return Segments(self.rows[keep], self.times_s[keep], self.states[keep])

    def grouped(self, size: int) -> Segments:
        """Windows of ``size`` consecutive segments, each a chain of its own; incomplete ones are left out."""
        keep: list[int] = []
        run: list[int] = []
        for k in range(len(self)):
            run.append(k)
            if len(run) == size:
                keep += run
                run = []
            elif not self.rows[k, 3]:
                run = []
        out = self.take(np.array(keep, dtype=np.int64))
        rows = out.rows.copy()
        rows[:, 3] = (np.arange(len(rows)) % size != size - 1).astype(np.int64)
        return replace(out, rows=rows)

    def merged(self, size: int, transfer: Floats | None = None) -> Segments:
        """Every ``size`` consecutive segments of a chain as one, from the first one's state.

        What is left over at a chain's end is one too. With ``transfer`` (K, 4, 4), the derivatives of each segment's
        end with respect to its start in units that make them comparable, one ends where a start would grow beyond
        `GROWTH`.
        """
        rows: list[list[int]] = []
        times: list[list[float]] = []
        first: list[int] = []
        run = 0
        grown = np.eye(4)
        for k in range(len(self)):
            if transfer is not None:
                further = transfer[k] @ grown
                if run and np.linalg.norm(further, 2) > GROWTH:
                    run = 0
                grown = further if run else transfer[k]
            if run == 0:
                first.append(k)
                rows.append(self.rows[k].tolist())
                times.append(self.times_s[k].tolist())
            rows[-1][2:] = self.rows[k, 2:].tolist()
            times[-1][1] = float(self.times_s[k, 1])
            run = (run + 1) % size if self.rows[k, 3] else 0
        return Segments(np.array(rows, dtype=np.int64), np.array(times), self.states[first])


@dataclass(frozen=True, eq=False)
class Cameras:
    """Effect of the cameras of R recordings on their angles: measured = true + part @ numbers."""

    parts: Sequence[tuple[Floats, int] | None]
    """Of each recording the angles' changes (T, L, 5) for one standard deviation of each number, rad, and which of the
    cameras it is, from 0; None where nothing is stated."""
    numbers: Floats
    """Numbers (C, 5) of each camera, in units of their prior standard deviations: a guess or a solution."""

    def corrected(self, tracks: Sequence[Track]) -> list[Track]:
        """The recordings with the cameras' part taken off the angles."""
        out = []
        for (t, phi, sigma), part in zip(tracks, self.parts, strict=True):
            off = 0.0 if part is None else np.nan_to_num(part[0]) @ self.numbers[part[1]]
            out.append((t, phi - off, sigma))
        return out

    def one_by_one(self, tracks: Sequence[Track]) -> list[list[Track]]:
        """The recordings with each number of each camera in turn taken to be one standard deviation off."""
        steps = np.eye(self.numbers.size).reshape(-1, *self.numbers.shape)
        return [replace(self, numbers=step).corrected(tracks) for step in steps]


@dataclass(frozen=True, eq=False)
class Start:
    """Where a fit starts, besides the model and the segments."""

    zeros_rad: list[tuple[float, float]]
    camera_numbers: list[list[float]]
    clock_scale: float


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution of the compiled fit; see ``dynamics::shooting::Fit``."""

    parameters: dict[str, float]
    zeros_rad: Floats
    """(R, 2)"""
    cameras: Cameras | None
    segments: Segments
    names: tuple[str, ...]
    """Rows of `information`: free parameters, then two zeros per recording, then five numbers per camera."""
    information: Floats
    angle_information: Floats
    """Part of `information` from the angles, whose errors are their noise."""
    jump_information: Floats
    """Part from the jumps, times their variance over the slack's square, with the model's errors."""
    jumps_shown: Floats
    """Variance of the jumps over the slack squared, per component: 1 where the slack was learned, less at its floor."""
    gradient: Floats
    scores: Floats
    """Each segment's part of the gradient with the states eliminated, (K, G)."""
    slack: Floats
    own_sigma: Floats
    jump_chi2: Floats
    log_evidence: float
    cost: float
    squares: Floats
    counts: NDArray[np.int64]
    state_freedom: float
    state_covariance: Floats
    """Of each segment's state, (K, 4, 4)."""
    transfer: Floats
    """Derivatives of each segment's end with respect to its start, (K, 4, 4)."""
    stuck: int
    iterations: int
    status: FitStatus
    clock_scale: float

    @property
    def chi2(self) -> float:
        """Sum of squares over degrees of freedom, states and common unknowns counted."""
        freedom = float(self.counts.sum()) - self.state_freedom - len(self.names)
        return float(self.squares.sum()) / max(freedom, 1.0)

    def square(self, tracks: Sequence[Track]) -> list[Track]:
        """The recordings as their cameras would show them if they were as they were taken to be."""
        return list(tracks) if self.cameras is None else self.cameras.corrected(tracks)

    def merged(self, size: int) -> Segments:
        """Its segments, ``size`` to one where the motion allows it."""
        own = self.own_sigma
        return self.segments.merged(size, self.transfer * own[None, None, :] / own[None, :, None])


CAMERA = "camera"
"""How the names of the cameras' numbers among a fit's unknowns begin."""

FASTEST_RAD_S = 300.0
"""A first guess that turns faster is one from a handful of samples beside a gap; its segment is left out."""

GAP_S = 0.6
"""Longest gap in either link in a segment, s: over a longer one the motion near the upright is not known well enough
from the other side."""


def _longest_gap(t_s: Floats, phi_rad: Floats, edges_s: Floats) -> float:
    """Longest time between neighbouring samples (and edges) in which either link was not seen, s."""
    gaps = [
        np.diff(np.concatenate([edges_s[:1], t_s[np.isfinite(column)], edges_s[1:]])).max()
        for column in phi_rad.T
    ]
    return float(max(gaps))


def cut(
    tracks: Sequence[Track], spans: Sequence[tuple[float, float]], length_s: float, chained: bool = True
) -> Segments:
    """Segments of about ``length_s`` whose states are near the solution.

    Also the parameters found on the way: the fit of pieces, loosely tied.

    Also the parameters found on the way: the fit of pieces, loosely tied.
    """
    parts = []
    for r, (track, span) in enumerate(zip(tracks, spans, strict=True)):
        ends = ends_of(track[0], track[1], span, length_s)
        if ends is not None:
            parts.append(cut_between(track[0], track[1], ends, r, chained))
            continue
        rows, times, states = _native.shooting_segments([track], [span], length_s, chained)
        parts.append((np.asarray(rows, dtype=np.int64) + np.array([r, 0, 0, 0]), times, states))
    rows, times, states = (np.concatenate(each) for each in zip(*parts, strict=True))
    good: NDArray[np.bool_] = np.asarray(np.isfinite(states).all(axis=1))
    good &= np.abs(states[:, 2:]).max(axis=1, initial=0.0) < FASTEST_RAD_S
    for k, (r, first, last, _) in enumerate(rows.tolist()):
        t, phi, _ = tracks[r]
        good[k] &= _longest_gap(t[first:last], phi[first:last], times[k]) <= GAP_S
    segments = Segments(rows, times, states)
    if not good.all():
        rows = rows.copy()
        for k in np.flatnonzero(~good).tolist():
            if k > 0:
                rows[k - 1, 3] = 0
        segments = Segments(rows, times, states).take(good)
    return segments


def solve(
    tracks: Sequence[Track],
    segments: Segments,
    parameters: dict[str, float],
    zeros_rad: Floats,
    *,
    free: Sequence[str] = (),
    bounded: Sequence[str] = (),
    zeros: bool = True,
    slack: float | Sequence[float] = 0.02,
    learned: bool = True,
    huber: float = 3.5,
    max_iterations: int = 60,
    clock: bool = False,
    clock_scale: float = 1.0,
    cameras: Cameras | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Runs the fit. Raises FitError when there is nothing to fit or the motion is not determined."""
    try:
        settings = _native.ShootingSettings(
            free=list(free),
            bounded=list(bounded),
            clock=clock,
            zeros=zeros,
            slack=[slack] if isinstance(slack, float | int) else list(slack),
            learned=learned,
            huber=huber,
            max_iterations=max_iterations,
        )
        numbers = np.zeros((0, CAMERA_NUMBERS)) if cameras is None else cameras.numbers
        start = Start(
            [(float(a), float(b)) for a, b in np.asarray(zeros_rad, dtype=np.float64)],
            numbers.tolist(),
            clock_scale,
        )
        parts = [None] * len(tracks) if cameras is None else list(cameras.parts)
        out = _native.shooting_fit(
            tracks, segments, parameters, start, settings, cameras=parts, progress=progress
        )
    except ValueError as problem:
        advice = "Give angles with fewer gaps, and check that the model is this pendulum's"
        raise FitError(fault("trajectory fit", str(problem), advice)) from problem
    names = (*free, *(("clock",) if clock else ()))
    if zeros:
        names += tuple(f"zero{j}[{r}]" for r in range(len(tracks)) for j in (1, 2))
    names += tuple(f"{CAMERA}{n + 1}[{c}]" for c in range(len(numbers)) for n in range(CAMERA_NUMBERS))
    # One link's recordings have one zero each; the other's column says nothing.
    known = np.array([not (n.startswith("zero2") and tracks[0][1].shape[1] == 1) for n in names], dtype=bool)
    return Solution(
        {**parameters, **{k: v for k, v in sorted(out.parameters.items()) if k in parameters or v != 0.0}},
        out.zeros_rad,
        None if cameras is None else replace(cameras, numbers=out.camera_numbers),
        replace(segments, states=out.states),
        tuple(n for n, k in zip(names, known, strict=True) if k),
        out.information[np.ix_(known, known)],
        out.angle_information[np.ix_(known, known)],
        out.jump_information[np.ix_(known, known)],
        out.jumps_shown,
        out.gradient[known],
        out.scores[:, known],
        out.slack,
        out.own_sigma,
        out.jump_chi2,
        out.log_evidence,
        out.cost,
        out.squares,
        out.counts,
        out.state_freedom,
        out.state_covariance,
        out.transfer,
        out.stuck,
        out.iterations,
        FitStatus(out.status),
        out.clock_scale,
    )


PIECE_S = 0.25
"""Pieces that motions are settled in before they are followed for longer: in a second near the upright the error of
a first guess from a few samples grows beyond what Gauss-Newton steps come back from."""


def settled(
    tracks: Sequence[Track],
    spans: Sequence[tuple[float, float]],
    length_s: float,
    parameters: dict[str, float],
    zeros_rad: Floats,
    *,
    free: Sequence[str] = (),
    bounded: Sequence[str] = (),
    progress: Progress | None = None,
) -> Solution:
    """Segments of about ``length_s`` whose states are near the solution: the fit of pieces, loosely tied.

    With the parameters found on the way.
    """
    size = max(1, round(length_s / PIECE_S))
    pieces = cut(tracks, spans, length_s / size)
    loose = solve(
        tracks,
        pieces,
        parameters,
        zeros_rad,
        free=free,
        bounded=bounded,
        slack=1.0,
        learned=False,
        max_iterations=30,
        progress=progress,
    )
    return replace(loose, segments=loose.merged(size))


@dataclass(frozen=True, eq=False)
class Trace:
    """A solution's motion at the samples."""

    recording: Ints
    sample: Ints
    segment: Ints
    state: Floats
    """(M, 4), zeros not added."""
    unit_power: Floats
    """(M, terms), W per unit of each coefficient, in the order of `pydpend.coefficients.TERMS`."""


def trace(
    tracks: Sequence[Track], segments: Segments, parameters: dict[str, float], clock_scale: float = 1.0
) -> Trace:
    """Follows each segment from its state."""
    index, state, power = _native.shooting_trace(tracks, segments, parameters, clock_scale)
    return Trace(index[:, 0], index[:, 1], index[:, 2], state, power)


def residuals(tracks: Sequence[Track], path: Trace, zeros_rad: Floats) -> Floats:
    """Measured minus model, (M, 2), rad."""
    out = np.empty((path.sample.size, tracks[0][1].shape[1]))
    for r, (_, phi, _) in enumerate(tracks):
        here = path.recording == r
        out[here] = phi[path.sample[here]] - (path.state[here, :2] + zeros_rad[r])[:, : phi.shape[1]]
    return out


def residuals_of(tracks: Sequence[Track], path: Trace, zeros_rad: Floats) -> tuple[Residuals, ...]:
    """Residuals by recording, with their times and the standard deviations they were weighted by."""
    left = residuals(tracks, path, zeros_rad)
    out = []
    for r, (t, _, sigma) in enumerate(tracks):
        here = path.recording == r
        samples = path.sample[here]
        out.append(Residuals(t[samples], left[here], sigma[samples]))
    return tuple(out)
