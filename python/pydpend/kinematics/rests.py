"""The rest that hangs: a stretch at rest is the zero only if nothing in the recording contradicts it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics.swing import Swing, within_half_turn
from pydpend.kinematics.table import Floats
from pydpend.kinematics.vertical import ROLL_SIGMA_DEG, Down
from pydpend.kinematics.zero import GIVE_ZERO, Rest

GIVE_PIVOT = (
    "Point at the joint from which each link hangs with "
    + Setting("pivot")
    + " (px in the picture, by the links' names), name two points of each link with "
    + Setting("axis")
    + " and give "
    + Setting("zero", "vertical")
    + ", or give "
    + Setting("zero")
    + " with the links' angles in the rig's reference picture or a recording in which they hang at rest"
)
"""Advice where a joint is not known, so that the picture's vertical says nothing."""

HANGS_WITHIN_RAD = np.radians(60.0)
"""A link that hangs points down in the picture to within this, or the film is rolled."""

UPRIGHT_SIGMA_RAD = np.radians(2.0)
"""Where no swing says where the links hang, the picture must: a camera set up by eye is rolled by 1 deg, and the line
of a link's joints or markers misses its centre of mass by some 1.7 deg. A rest farther than three times this (6 deg)
from the picture's vertical is no zero."""

APART_SIGMAS = 2.0
"""A rest farther than so many standard uncertainties from the swing's zero is not known to hang: if it does, one in
twenty is that far off by chance, and is only said to be less sure."""

CONFIRMS_RAD = np.radians(1.5)
"""A swing whose own zero is less sure than this does not confirm a rest before it: links that are held up to 3 deg
(`APART_SIGMAS`) beside where they hang would pass. Drops of 12 s know the lower link's to 0.9 to 1.4 deg, those of 3 s
to 1.9 to 4.3 deg (docs/explanation/angles.md)."""

BEARINGS_RAD = np.radians(0.3)
"""Ordinary dry friction lets a link stop this far off hanging: no more need be said of it."""

MOVES_RAD = np.radians(0.25)
"""A link that leaves its rest by less than this, or than `MOVES_NOISE`, does not say to which side it moves."""

MOVES_NOISE = 8.0
"""The bound of `MOVES_RAD` in standard deviations of one angle at rest: none of a million is that far off by chance."""

BEYOND = 0.15
"""A motion that goes by less than this part of itself to the other side goes to one side only."""

LET_GO = 3.0
"""A link let go swings about as far beyond the vertical as it was held away from it: one that was lifted goes farther
than this many times as far."""


class Verdict(Enum):
    """The recording's verdict on a rest."""

    CONFIRMED = auto()
    """The swing goes about it."""
    UNREFUTED = auto()
    """Nothing contradicts it."""
    REFUTED = auto()
    """The swing goes about another direction."""
    ONE_SIDED = auto()
    """The motion goes to one side of it only."""
    TILTED = auto()
    """The links do not point down in the picture."""
    UNKNOWN = auto()
    """Neither a swing nor the picture tells where the links hang: a joint is not known."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A rest with what is said of it.

    ``tilt_rad`` (L,): from the picture's vertical, NaN where that is not known. ``links``: their names.
    """

    rest: Rest
    verdict: Verdict
    tilt_rad: Floats
    links: tuple[str, ...]

    @property
    def hangs(self) -> bool:
        """Whether it may be the zero."""
        return self.verdict in (Verdict.CONFIRMED, Verdict.UNREFUTED)

    def to_dict(self) -> dict[str, Any]:
        """The verdict as in the angles' ``meta``."""
        return {
            "start_s": self.rest.start_s,
            "stop_s": self.rest.stop_s,
            "hanging": self.hangs,
            "verdict": self.verdict.name.lower(),
            "from_vertical_deg": [None if np.isnan(v) else float(v) for v in np.degrees(self.tilt_rad)],
        }


def judge(
    rests: list[Rest], phi: Floats, swing: Swing | None, down: Down, upright_rad: float | None = None
) -> list[Judged]:
    """The verdict of turns ``phi`` (T, L) and the picture on each rest.

    The swing decides where it is known. Else the motion must not look like one that was let go there, and the links
    must point down within three standard deviations (`UPRIGHT_SIGMA_RAD`), which takes their joints. Where the caller
    says that they hang, they must point down within ``upright_rad``, as far as the joints are known.
    """
    sigma = np.hypot(UPRIGHT_SIGMA_RAD, down.sigma_rad)
    most = np.minimum(3 * sigma if upright_rad is None else upright_rad, HANGS_WITHIN_RAD)
    out = []
    for rest in rests:
        tilt = down.off(rest.phi_rad)
        if swing is not None:
            verdict = Verdict.REFUTED if swing.refutes(rest.phi_rad, rest.sigma_rad) else Verdict.CONFIRMED
        elif _let_go(rest, phi, tilt):
            verdict = Verdict.ONE_SIDED
        elif (np.abs(tilt) > most).any():
            verdict = Verdict.TILTED
        elif upright_rad is None and np.isnan(tilt).any():
            verdict = Verdict.UNKNOWN
        else:
            verdict = Verdict.UNREFUTED
        out.append(Judged(rest, verdict, tilt, down.links))
    return out


def _moves(rest: Rest, phi: Floats) -> Floats:
    """The least distance of a link (L,) from the rest to have left it."""
    scatter = np.nanstd(phi[rest.first : rest.last + 1], axis=0)
    return np.asarray(np.maximum(MOVES_RAD, MOVES_NOISE * scatter))


def _let_go(rest: Rest, phi: Floats, tilt: Floats) -> bool:
    """Whether a link moves to one side of the rest only, and not beyond where a link let go would swing to."""
    least = _moves(rest, phi)
    for k, held in enumerate(tilt):
        moved = phi[:, k] - rest.phi_rad[k]
        moved = moved[np.isfinite(moved)]
        side = 1.0 if moved.max() > -moved.min() else -1.0
        far, back = float((side * moved).max()), float((-side * moved).max())
        # Half of what leaving the rest takes is noise yet.
        if far < least[k] or back > BEYOND * far + least[k] / 2:
            continue
        # The vertical lies at -held, seen from the rest.
        if np.isnan(held) or far < LET_GO * -side * held:
            return True
    return False


def hanging_rests(judged: list[Judged], swing: Swing | None, label: str) -> tuple[list[Rest], list[str]]:
    """The rests that hang, and in words what contradicts the others.

    Raises :class:`AnglesError` where the links rest, but not hanging.
    """
    kept = [j for j in judged if j.hangs]
    others = [j for j in judged if not j.hangs]
    if not kept and others:
        nearest = min(others, key=lambda j: float(np.nan_to_num(np.abs(j.tilt_rad), nan=np.pi).max()))
        raise AnglesError(
            fault(
                label,
                f"{_held(nearest, swing)}{_reason(nearest, swing)}: it is no zero",
                GIVE_PIVOT if nearest.verdict is Verdict.UNKNOWN else GIVE_ZERO,
            )
        )
    return [j.rest for j in kept], _notes(kept, others, swing) if kept else []


def _notes(kept: list[Judged], others: list[Judged], swing: Swing | None) -> list[str]:
    """Notes on the rests that are the zero, and on those that could be taken for it."""
    notes = []
    zero = kept[0].rest
    near = [
        j
        for j in others
        if (np.abs(within_half_turn(j.rest.phi_rad - zero.phi_rad)) < HANGS_WITHIN_RAD).all()
    ]
    if near:
        held = max(near, key=lambda j: j.rest.stop_s - j.rest.start_s)
        off = np.abs(within_half_turn(held.rest.phi_rad - zero.phi_rad))
        notes.append(
            f"two rests disagree: held still about {_each(off)} deg from hanging in {_when(held.rest)}"
            f"{_reason(held, swing)}; the zero is the rest in {_when(zero)}"
        )
    if (np.abs(kept[0].tilt_rad) > HANGS_WITHIN_RAD).any():
        notes.append(
            f"the links hang about {_each(np.abs(kept[0].tilt_rad))} deg from the picture's vertical in {_when(zero)}: "
            "the film is rolled"
        )
    return notes


def unconfirmed(judged: list[Judged]) -> list[str]:
    """The note on a zero that rests on no swing: the recording moves too little, or by hand only."""
    kept = [j for j in judged if j.hangs]
    if any(j.verdict is Verdict.CONFIRMED for j in kept):
        return []
    return [
        f"nothing contradicts that the links hang in {_when(kept[0].rest)}, {_each(np.abs(kept[0].tilt_rad))} deg from "
        "the picture's vertical, but too little of a free swing is seen to confirm it: the zero's uncertainty says so"
    ]


def unconfirmed_sigma(zero_rad: Floats, sigma_rad: Floats, down: Down) -> Floats:
    """Standard uncertainty (L,) of a zero that no swing confirms: the links may hang as the picture's vertical says."""
    doubt = np.hypot(down.off(zero_rad), np.radians(ROLL_SIGMA_DEG))
    return np.asarray(np.hypot(sigma_rad, doubt))


def confirmed_sigma(kept: list[Rest], zero_rad: Floats, sigma_rad: Floats, swing: Swing) -> Floats:
    """Standard uncertainty (L,) of a zero that the swing goes about.

    It is at least how far they are apart where dry friction may have stopped the links: in a rest after the swing, in
    a swing with dry friction, or where they are more than `APART_SIGMAS` apart. After a swing with dry friction
    it is no less than that of the swing: where the links stop says no more.
    """
    after = all(rest.start_s > swing.start_s for rest in kept)
    apart = np.abs(swing.off(zero_rad))
    if not (after or swing.dry):
        apart = np.where(_disagree(apart, sigma_rad, swing), apart, 0.0)
    if after and swing.dry:
        apart = np.maximum(apart, swing.sigma_rad)
    return np.asarray(np.hypot(sigma_rad, apart))


def lone_sigma(kept: list[Rest], zero_rad: Floats, sigma_rad: Floats, swing: Swing, down: Down) -> Floats:
    """Standard uncertainty (L,) of a zero by rests before the swing alone: more for links that it does not confirm.

    Whether these hang there or are held, only swing and picture say. With their weighted mean off the zero by ``m``,
    and ``s`` its standard uncertainty, it is the root of ``m^2 + s^2`` at least: at such a distance they expect the
    hanging link. A picture that contradicts the swing is rolled, and is left out.
    """
    by_swing, by_picture = swing.off(zero_rad), down.off(zero_rad)
    roll = np.hypot(np.radians(ROLL_SIGMA_DEG), down.sigma_rad)
    between = np.abs(within_half_turn(by_picture - by_swing))
    upright = between <= APART_SIGMAS * np.hypot(roll, swing.sigma_rad)
    swings, pictures = swing.sigma_rad**-2, np.where(upright, roll**-2, 0.0)
    mean = (swings * by_swing + pictures * np.where(upright, by_picture, 0.0)) / (swings + pictures)
    doubt = np.hypot(mean, (swings + pictures) ** -0.5)
    return np.asarray(np.where(_alone(kept, swing), np.maximum(sigma_rad, doubt), sigma_rad))


def _alone(kept: list[Rest], swing: Swing) -> NDArray[np.bool_]:
    """Whether of each link (L,) only rests before the swing say where it hangs, as the swing hardly knows it itself."""
    before = all(rest.start_s <= swing.start_s for rest in kept)
    return np.asarray(before & (swing.sigma_rad > CONFIRMS_RAD))


def alone(kept: list[Rest], swing: Swing, down: Down) -> list[str]:
    """The note on a zero that is `_alone`."""
    unsure = _alone(kept, swing)
    if not unsure.any():
        return []
    links = " and ".join(name for name, doubt in zip(down.links, unsure, strict=True) if doubt)
    return [
        f"the zero of {links} is the rest in {_when(kept[0])} alone, and the swing after it confirms it only to "
        f"{_each(swing.sigma_rad[unsure])} deg: the zero's uncertainty says so. Let the links hang at the end too, or "
        "film more of the swing"
    ]


def _disagree(apart_rad: Floats, sigma_rad: Floats, swing: Swing) -> NDArray[np.bool_]:
    """Whether zeros of rest and swing (L,) differ by more than `APART_SIGMAS`, and than bearings explain."""
    return np.asarray(
        apart_rad > np.maximum(APART_SIGMAS * np.hypot(swing.sigma_rad, sigma_rad), BEARINGS_RAD)
    )


def off_the_swing(kept: list[Rest], zero_rad: Floats, sigma_rad: Floats, swing: Swing) -> list[str]:
    """The note where a zero and the swing that confirms it differ by more than `APART_SIGMAS`."""
    apart = np.abs(swing.off(zero_rad))
    if not _disagree(apart, sigma_rad, swing).any():
        return []
    return [
        f"the links rest {_each(apart)} deg from the direction that the swing goes about in {_when(kept[0])}, as dry "
        "friction may stop them: the zero's uncertainty says so"
    ]


def _held(j: Judged, swing: Swing | None) -> str:
    known = np.isfinite(j.tilt_rad)
    if j.verdict is Verdict.UNKNOWN:
        return f"the links are held still in {_when(j.rest)}"
    if known.all() or (known.any() and swing is None):
        off, what = np.abs(j.tilt_rad[known]), "from the picture's vertical"
    elif swing is not None:
        off, what = np.abs(swing.off(j.rest.phi_rad)), "from the direction that the swing goes about"
    else:
        return f"the links are held still in {_when(j.rest)}"
    return f"held still at about {_each(off)} deg {what} in {_when(j.rest)}"


def _reason(j: Judged, swing: Swing | None) -> str:
    if j.verdict is Verdict.REFUTED and swing is not None:
        off = np.abs(swing.off(j.rest.phi_rad))
        return f", and the swing goes about a direction {_each(off)} deg from there"
    if j.verdict is Verdict.ONE_SIDED:
        return ", and the motion goes to one side of it only"
    if j.verdict is Verdict.TILTED:
        return ", and too little of a free swing is seen to say that the links hang there"
    if j.verdict is Verdict.UNKNOWN:
        unknown = " and ".join(n for n, v in zip(j.links, j.tilt_rad, strict=True) if np.isnan(v))
        return (
            ", and nothing says that they hang there: too little of a free swing is seen, and the picture does not "
            f"tell without the joint of {unknown}"
        )
    return ""


def _each(angle_rad: Floats) -> str:
    """Degrees of each link, or once where they are alike."""
    words = [f"{v:.0f}" if v >= 9.95 else f"{v:.1f}" for v in np.degrees(angle_rad)]
    return " and ".join(dict.fromkeys(words))


def _when(rest: Rest) -> str:
    return f"{rest.start_s:.3g}-{rest.stop_s:.3g} s"
