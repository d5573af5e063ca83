"""The free decay of a recording: after the release, before the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import SELECT, FitError, Setting, fault
from pydpend.kinematics import LinkAngles, find_rest
from pydpend.model import Model

Floats = NDArray[np.float64]

HELD_RAD_S = 1.0
"""Both links slower than this, high up, for `HELD_S`: held by hand (or balanced, which no law can use)."""
HELD_S = 0.1
RELEASED_RAD_S = 4.0
"""Rate at which a held link has been let go."""
SETTLE_S = 1.0
"""Time left out after a release by hand: the hand's last touch, and the first instants near the unstable
equilibrium, which no initial state describes."""
TOUCH_S = 0.2
"""Time left out after a gentle release: the hand's last touch."""
START_S = 0.5
"""A hold that begins within this of the motion's start is where it was released from."""
REST_RAD = np.radians(1.5)
"""Both links' swing over a second is below this: dry friction is about to stop them, or has."""


@dataclass(frozen=True)
class Decay:
    """The free decay of a recording."""

    start_s: float
    stop_s: float
    released: bool
    """Whether holding and a release were seen before it."""
    at_rest: bool
    """Whether the motion's end was seen."""
    message: str


def rates(t_s: Floats, phi_rad: Floats, span_s: float = 0.02) -> Floats:
    """Rough rates (T, L): differences over ``span_s``, interpolated over what was not seen."""
    out = np.zeros_like(phi_rad)
    dt = float(np.median(np.diff(t_s)))
    k = max(1, round(span_s / dt / 2))
    for j in range(phi_rad.shape[1]):
        seen = np.isfinite(phi_rad[:, j])
        if seen.sum() < 2:
            continue
        filled = np.interp(t_s, t_s[seen], phi_rad[seen, j])
        low, high = np.maximum(np.arange(t_s.size) - k, 0), np.minimum(np.arange(t_s.size) + k, t_s.size - 1)
        out[:, j] = (filled[high] - filled[low]) / (t_s[high] - t_s[low])
    return out


def check_pendulum(angles: LinkAngles) -> None:
    """Raises FitError for angles of more links than a pendulum of the fits has."""
    if angles.links > 2:
        raise FitError(
            fault(
                angles.name,
                f"angles of {angles.links} links ({', '.join(angles.link_names)}), and the equations of motion are of "
                "one or two",
                "Take the pendulum's by " + SELECT + ", from the pivot outwards",
            )
        )


def find_decay(
    angles: LinkAngles, model: Model, start_s: float | None = None, stop_s: float | None = None
) -> Decay:
    """The longest stretch before the end in which no energy comes in, from release to rest.

    The energy, averaged over a second, may rise by 30 % of its largest value: constants that are wrong make
    it go up and down, and are refused for that later; a lift by hand is far more. ``start_s``, ``stop_s``
    state an end instead of finding it.

    Raises FitError when the links do not move, or less than a second of free decay is left.
    """
    check_pendulum(angles)
    t, phi = angles.t_s, angles.phi_rad
    if t.size < 20:
        raise FitError(fault(angles.name, f"{t.size} samples are no recording of a motion", "Record longer"))
    swing = np.nanmax(phi, axis=0) - np.nanmin(phi, axis=0) if np.isfinite(phi).any() else np.zeros(1)
    if not np.nanmax(swing) > 2 * REST_RAD:
        raise FitError(
            fault(
                angles.name,
                f"there is no free decay: the links move by {np.degrees(np.nanmax(swing)):.2g} deg in all",
                "Give a recording of a release",
            )
        )
    w = rates(t, phi)
    filled = np.column_stack(
        [np.interp(t, t[np.isfinite(c)], c[np.isfinite(c)]) if np.isfinite(c).any() else 0 * t for c in phi.T]
    )
    pad = ((0, 0), (0, 2 - phi.shape[1]))  # a lower link that is not there rests
    energy = model.energy(np.pad(filled, pad), np.pad(w, pad))
    dt = float(np.median(np.diff(t)))
    energy = _running_mean(energy, max(1, round(1.0 / dt)))
    stop, at_rest = _rest(t, filled, dt)
    last = t.size - 1 if stop is None else int(np.searchsorted(t, stop))
    if stop_s is not None:
        last, at_rest = max(1, int(np.searchsorted(t, stop_s, side="right")) - 1), False
    first, released, after_s = 0, False, 0.0
    if start_s is None:
        later = np.maximum.accumulate(energy[: last + 1][::-1])[::-1]
        # A lift begins at rest near hanging; wrong constants only make the energy of a motion rise and fall,
        # which is judged later.
        resting = np.abs(w[: last + 1]).max(axis=1) < HELD_RAD_S
        brought_in = bool((resting & (energy[: last + 1] < 0.2 * later)).any())
        rising = np.flatnonzero(energy[: last + 1] < later - 0.3 * energy[: last + 1].max())
        first = int(rising[-1]) + 1 if brought_in else 0
        speed = np.abs(w).max(axis=1)
        held = (speed < HELD_RAD_S) & (energy > 0.5 * energy[first:].max())
        runs = _runs(held[: last + 1], max(1, round(HELD_S / dt)))
        lifted = first > 0
        runs = [(a, b) for a, b in runs if b >= first and (a <= first + round(0.5 / dt) or lifted)]
        if runs and (lifted or runs[0][0] <= round(START_S / dt)):
            moving = np.flatnonzero(speed[runs[-1][1] : last + 1] > RELEASED_RAD_S)
            if moving.size:
                let_go = t[runs[-1][1] + int(moving[0])]
                first, released = int(np.searchsorted(t, let_go + SETTLE_S)), True
                after_s = SETTLE_S
        if not released:
            hold = _hold(angles, float(t[first]), float(t[last]), lifted)
            if hold is not None:
                first, released = int(np.searchsorted(t, hold + TOUCH_S)), True
                after_s = TOUCH_S
    else:
        first = int(np.searchsorted(t, start_s))
    begin, end = float(t[min(first, t.size - 1)]), float(t[last])
    if end - begin < 1.0:
        raise FitError(
            fault(
                angles.name,
                f"the free decay lasts {max(end - begin, 0):.3g} s (from {begin:.3g} s to {end:.3g} s); "
                "a fit needs at least one second",
                "Record longer, or state the decay with " + Setting("start_s") + " and " + Setting("stop_s"),
            )
        )
    message = f"free decay from {begin:.3f} s" + (
        f" ({after_s} s after a release by hand)" if released else ""
    )
    message += f" to {end:.3f} s" + (" (then at rest)" if at_rest else "")
    return Decay(begin, end, released, at_rest, message)


def _hold(angles: LinkAngles, begin_s: float, end_s: float, lifted: bool) -> float | None:
    """The end of the rest with which the motion begins: a gentle release, which no rate tells."""
    ends = [
        rest.stop_s
        for rest in find_rest(angles)
        if begin_s <= rest.stop_s < end_s and (lifted or rest.start_s <= begin_s + START_S)
    ]
    return max(ends, default=None)


def _running_mean(x: Floats, width: int) -> Floats:
    kernel = np.ones(min(width, x.size))
    out: Floats = np.convolve(x, kernel, "same") / np.convolve(np.ones_like(x), kernel, "same")
    return out


def _runs(mask: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """Runs of true of at least ``least``: first and last index of each."""
    edge = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edge[::2], edge[1::2], strict=True) if b - a >= least]


def _rest(t: Floats, phi: Floats, dt: float) -> tuple[float | None, bool]:
    """Start of the final stretch in which both links swing less than `REST_RAD` over a second."""
    block = max(2, round(0.5 / dt))
    count = t.size // block
    if count < 4:
        return None, False
    swings = np.array(
        [np.ptp(phi[k * block : (k + 2) * block], axis=0).max() / 2 for k in range(count)], dtype=np.float64
    )
    moving = np.flatnonzero(swings > REST_RAD)
    if moving.size == 0 or moving[-1] >= count - 2:
        return None, False
    return float(t[min((int(moving[-1]) + 1) * block, t.size - 1)]), True
