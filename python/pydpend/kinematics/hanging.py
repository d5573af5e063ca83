"""The zero by what the caller says: a rest that hangs, the picture, another recording, or given angles."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pydpend.errors import AnglesError, RecordingWarning, Setting, fault
from pydpend.kinematics.linkage_frames import LinkageAngles, turns_by
from pydpend.kinematics.markers import BodyMarkers, body_markers
from pydpend.kinematics.pose import solve
from pydpend.kinematics.rests import (
    HANGS_WITHIN_RAD,
    alone,
    confirmed_sigma,
    hanging_rests,
    judge,
    lone_sigma,
    off_the_swing,
    unconfirmed,
    unconfirmed_sigma,
)
from pydpend.kinematics.shape import Shape
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.swing import Swing, find_swing
from pydpend.kinematics.table import Floats, LinkAngles
from pydpend.kinematics.unwrap import unwrap
from pydpend.kinematics.vertical import ROLL_SIGMA_DEG, Down, picture_down, vertical_zero
from pydpend.kinematics.zero import find_rest, zero_of
from pydpend.nodes import Nodes
from pydpend.number_words import numbers
from pydpend.series import highpass_noise

VERTICAL = "vertical"
"""The word for the picture's vertical, alone or with the roll's standard uncertainty in degrees: ``vertical=0.5``."""

HORIZONTAL = "horizontal"
"""The word for the picture's direction to the right, which is written alike."""


def is_direction(zero: str) -> bool:
    """Whether a word for the zero is a direction of the picture."""
    return zero.partition("=")[0] in (VERTICAL, HORIZONTAL)


@dataclass(frozen=True, eq=False)
class Raw:
    """Turns from the rig's reference picture before unwrapping, (T, L), and what they came from.

    ``structure``: what hangs on what. ``linked``: the linkage, where angles of some links are by it;
    ``covariance_rad2`` (T, L, L): of all angles' noise, where it is. ``down``: directions of the links, where those of
    the picture are the zero.
    """

    theta: Floats
    sigma: Floats
    templates: list[Floats]
    shape: Shape | None
    meta: dict[str, Any]
    structure: Structure
    linked: LinkageAngles | None = None
    covariance_rad2: Floats | None = None
    down: Down | None = None


def parse_zero(text: str) -> str | list[float] | None:
    """The zero that a text states; ``None`` if it can only be a file.

    A word that `angles` knows, or angles in degrees (``12.5,-3``) as rad.

    Raises OptionError for degrees that may be read in two ways.
    """
    if text in ("rest", "reference_frame") or is_direction(text):
        return text
    if not re.fullmatch(r"[-+.,\deE]*\d[-+.,\deE]*", text):
        return None
    return [float(np.radians(degrees)) for degrees in numbers(text, "zero")]


def roll_sigma(zero: str) -> float:
    """Standard uncertainty of the camera's roll, rad, in ``vertical`` or ``vertical=DEGREES``.

    Raises :class:`AnglesError` if it is no number of degrees above zero.
    """
    text = zero.partition("=")[2] if "=" in zero else str(ROLL_SIGMA_DEG)
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not 0 < value <= 45:
        raise AnglesError(
            fault(
                Setting("zero"),
                f"{zero!r}: the camera's roll is uncertain by {text!r}, which is no number of degrees from 0 to 45",
                f"Write {VERTICAL} for {ROLL_SIGMA_DEG:g} deg, or {VERTICAL}=0.5",
            )
        )
    return float(np.radians(value))


def zero_for(
    nodes: Nodes,
    phi: Floats,
    raw: Raw,
    markers: list[BodyMarkers],
    zero: str | Sequence[float] | float | Nodes,
    bodies: Sequence[str] | None,
    mirrored: bool,
    label: str,
) -> tuple[Floats, dict[str, Any], list[str]]:
    """The zero to take off the turns ``phi`` (T, L) to have angles, (L,), its origin, and what is doubtful.

    Warns with RecordingWarning of a zero that the swing contradicts.
    """
    links = phi.shape[1]
    given = _given(zero, links)
    if isinstance(zero, str) and zero not in ("rest", "reference_frame") and not is_direction(zero):
        raise AnglesError(
            fault(
                Setting("zero"),
                f"{zero!r} is not known",
                f"Give rest, {VERTICAL}, {HORIZONTAL}, reference_frame or the links' angles",
            )
        )
    down = raw.down or picture_down(raw.shape, nodes, markers, mirrored)
    swing = None
    if raw.structure.is_chain:
        swing = find_swing(nodes.t_s, phi, _noise(phi, raw.sigma), down.turn_rad)
    notes: list[str] = []
    if isinstance(zero, str) and zero == "rest":
        rests = find_rest(LinkAngles(nodes.t_s, phi, raw.sigma, name=label))
        judged = judge(rests, phi, swing, down)
        kept, notes = hanging_rests(judged, swing, label)
        value, sigma = zero_of(kept, label)
        if swing is None:
            notes += unconfirmed(judged)
            sigma = unconfirmed_sigma(value, sigma, down)
        else:
            notes += off_the_swing(kept, value, sigma, swing) + alone(kept, swing, down)
            sigma = lone_sigma(kept, value, confirmed_sigma(kept, value, sigma, swing), swing, down)
        meta = {"from": "rest", "sigma_rad": sigma.tolist(), "rests": [j.to_dict() for j in judged]}
        return value, meta | _told(swing, value), notes
    if isinstance(zero, str) and zero == "reference_frame":
        value, meta = np.zeros(links), {"from": "reference picture"}
    elif isinstance(zero, str):
        value, sigma = vertical_zero(down, roll_sigma(zero), label)
        meta = {
            "from": "the picture's vertical",
            "sigma_rad": sigma.tolist(),
            "roll_sigma_rad": roll_sigma(zero),
            "lines": list(down.lines),
        }
        if zero.startswith(HORIZONTAL):
            # A quarter turn on from pointing down; links that swing do so about the vertical.
            value, swing, meta["from"] = value + np.pi / 2, None, "the picture's horizontal"
    elif given is not None:
        value, meta = -given, {"from": "given", "reference_frame_rad": given.tolist()}
    else:
        assert isinstance(zero, Nodes)
        value, meta, notes = _zero_from_reference(zero, raw, markers, bodies, mirrored)
    stated = np.array(meta.get("sigma_rad", 0.0))
    if swing is not None and swing.refutes(value, stated):
        apart = np.abs(swing.off(value))
        off = " and ".join(f"{v:.1f}" for v in np.degrees(apart))
        notes.append(
            f"the swing goes about a direction about {off} deg from the zero ({meta['from']}): the angles may be "
            "off by that"
        )
        # A link that seems to swing about a direction a quarter turn away has turned over, which refutes no zero.
        # Turns from the reference picture are what they are, wherever the links hang.
        is_swing = bool((apart < np.pi / 2).all())
        if is_swing and not (isinstance(zero, str) and zero == "reference_frame"):
            notes[-1] += ", and the zero's uncertainty says so"
            meta["sigma_rad"] = np.hypot(stated, apart).tolist()
            # Past `angles` and the check of its arguments, to its caller's line.
            warnings.warn(f"{label}: {notes[-1]}", RecordingWarning, stacklevel=4)
        meta["contradicted"] = notes[-1]
    return value, meta | _told(swing, value), notes


def _given(zero: object, links: int) -> Floats | None:
    """The links' angles (L,) in the reference picture that a caller gives, rad; ``None`` for a word or a recording.

    Raises :class:`AnglesError` if it is none of these, or not one finite angle per link.
    """
    if isinstance(zero, (str, Nodes)):
        return None
    angles: Floats | None = None
    if isinstance(zero, (int, float, np.number, Sequence, np.ndarray)) and not isinstance(
        zero, (bool, bytes)
    ):
        try:
            angles = np.atleast_1d(np.asarray(zero, dtype=np.float64))
        except (TypeError, ValueError):
            angles = None
    if angles is None:
        what = repr(zero) if zero is None or isinstance(zero, (bool, bytes)) else f"a {type(zero).__name__}"
        raise AnglesError(
            fault(
                Setting("zero"),
                f"{what} is no zero",
                f"Give rest, {VERTICAL}, reference_frame, one angle in rad per link, or the Nodes of a recording in "
                "which the links hang at rest",
            )
        )
    if angles.shape != (links,) or not np.isfinite(angles).all():
        # The command line takes degrees, Python rad.
        deg = ", ".join(f"{v:.6g}" for v in np.degrees(angles).ravel())
        rad = ", ".join(f"{v:.6g}" for v in angles.ravel())
        raise AnglesError(
            fault(
                Setting("zero"),
                f"{angles.size} angle(s) for {links} link(s): {deg} deg ({rad} rad)",
                "Give one finite angle per link",
            )
        )
    return angles


def _noise(phi: Floats, sigma: Floats) -> float:
    """Standard deviation of one angle, rad: the largest link's median, or measured where none is stated."""
    stated = [float(np.median(s[np.isfinite(s)])) for s in sigma.T if np.isfinite(s).any()]
    measured = [v for v in (highpass_noise(c) for c in phi.T) if np.isfinite(v)]
    return max([v for v in stated if v > 0] or measured or [1e-3])


def _told(swing: Swing | None, zero: Floats) -> dict[str, Any]:
    """The swing's evidence on a zero, for the meta."""
    if swing is None:
        return {"swing": None}
    return {"swing": {"off_rad": swing.off(zero).tolist(), "sigma_rad": swing.sigma_rad.tolist()}}


def _zero_from_reference(
    reference: Nodes, raw: Raw, markers: list[BodyMarkers], bodies: Sequence[str] | None, mirrored: bool
) -> tuple[Floats, dict[str, Any], list[str]]:
    """The zero from another recording: its rest, with this recording's templates."""
    others = body_markers(reference, bodies, mirrored)
    if [m.nodes for m in others] != [m.nodes for m in markers]:
        raise AnglesError(
            fault(
                "reference recording", "its nodes are not those of this recording", "Track both with one rig"
            )
        )
    poses = [solve(m.xy_px, m.weight, p) for m, p in zip(others, raw.templates, strict=True)]
    theta = np.stack([p.theta for p in poses], axis=1)
    sigma = np.stack([p.information for p in poses], axis=1) ** -0.5
    for k, other in enumerate(others):
        if len(other.nodes) == 1 and raw.linked is not None:
            theta[:, k], sigma[:, k] = turns_by(raw.linked.linkage, others, other.name)
    turns = np.stack([unwrap(reference.t_s, column)[0] for column in theta.T], axis=1)
    rests = find_rest(LinkAngles(reference.t_s, turns, sigma, name="reference recording"))
    down = picture_down(raw.shape, reference, markers, mirrored)
    swing = None
    if raw.structure.is_chain:
        swing = find_swing(reference.t_s, turns, _noise(turns, sigma), down.turn_rad)
    # Whoever names it says that it hangs; only upside down cannot be.
    judged = judge(rests, turns, swing, down, HANGS_WITHIN_RAD)
    kept, notes = hanging_rests(judged, swing, "reference recording")
    value, error = zero_of(kept, "reference recording")
    if swing is not None:
        notes += off_the_swing(kept, value, error, swing)
        error = confirmed_sigma(kept, value, error, swing)
    return value, {"from": "reference recording", "sigma_rad": error.tolist()}, notes
