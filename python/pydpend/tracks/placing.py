"""Tracks as files have them put into pixels with y down: points chosen, times, units, planes, axes, confidence.

Owns: what a caller may say of tracks, and what is assumed where nobody says it. 1 px of a length stands for 1 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pydpend.errors import ArgumentError, Message, OptionError, Setting, TableError, fault, listed, one_of
from pydpend.raw_tracks import Floats, RawTracks

MM: dict[str, float] = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "um": 1e-3, "in": 25.4}
"""Millimetres in each unit of length that is known."""

SPELLINGS: dict[str, str] = {
    **dict.fromkeys(("px", "pixel", "pixels", "pix"), "px"),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("um", "µm", "\u03bcm", "micron", "microns", "micrometer", "micrometers"), "um"),
    **dict.fromkeys(("in", "inch", "inches"), "in"),
}
"""Units of length as files spell them, in small letters."""

UNITS = ("px", *MM)
PLANES = ("xy", "xz", "yz")
Y_AXES = ("down", "up")

MOST_DEPTH = 0.1
"""The third coordinate of a plane mechanism spreads by this part of the second widest at most, or is told."""

CLEAR_PLANE = 0.5
"""Two coordinates are the plane's if the third spreads by less than this part of the second widest."""


@dataclass(frozen=True)
class Wishes:
    """Settings of a caller for tracks; None is what the file says, or what is assumed and noted."""

    fps: float | None = None
    nodes: tuple[str, ...] = ()
    unit: str | None = None
    y_axis: str | None = None
    plane: str | None = None
    image_px: tuple[int, int] | None = None
    min_confidence: float | None = None
    sigma_px: float | None = None

    def __post_init__(self) -> None:
        """Raises OptionError or ArgumentError for what makes no sense in itself."""
        for name, known in (("unit", UNITS), ("y_axis", Y_AXES), ("plane", PLANES)):
            value = getattr(self, name)
            if value is not None and value not in known:
                raise OptionError(one_of(name, value, known))
        for name, what in (("fps", "frames per s"), ("sigma_px", "pixels")):
            value = getattr(self, name)
            if value is not None and not (
                isinstance(value, (int, float, np.number)) and np.isfinite(value) and value > 0
            ):
                raise ArgumentError(
                    fault(Setting(name), f"{value} is no number of {what}", "Give one above 0")
                )
        least = self.min_confidence
        if least is not None and not (0 <= least <= 1):
            raise ArgumentError(fault(Setting("min_confidence"), f"{least} is no confidence", "Give 0 to 1"))
        size = self.image_px
        if size is not None and not (len(size) == 2 and min(size) >= 1):
            raise ArgumentError(fault(Setting("image_px"), f"{size} is no size", "Give width and height, px"))


@dataclass
class _Told:
    """Notes and facts that gather on the way."""

    notes: list[str]
    facts: dict[str, str | float] = field(default_factory=dict)


def placed(raw: RawTracks, wishes: Wishes) -> RawTracks:
    """The tracks in pixels, y down, with times.

    Raises
    ------
    TableError
        If times or the unit of length are not known, or it is open which coordinates are the plane's.
    OptionError
        For a wish that these tracks have no use for, or points that are not there.
    """
    if not raw.xyz.size:
        raise TableError(fault(raw.source, "it has no places", "Give a file with tracks in it"))
    odd = np.argwhere(np.isinf(raw.xyz))
    if odd.size:
        t, n, _ = odd[0]
        problem = f"the place of {raw.names[n]} is not finite"
        raise TableError(fault(raw.source, problem, "Leave it empty", place=f"frame {raw.frame[t]}"))
    told = _Told(list(raw.notes), dict(raw.facts))
    chosen = _chosen(raw, wishes.nodes)
    t_s = _times(chosen, wishes.fps, told)
    sure = _confident(chosen, wishes.min_confidence, told)
    factor = _factor(sure, wishes.unit, told)
    xy = _in_plane(sure, wishes.plane, told)
    sigma = None if sure.sigma is None else sure.sigma * factor
    if wishes.sigma_px is not None:
        sigma = np.full(xy.shape[:2], wishes.sigma_px)
    image = wishes.image_px if wishes.image_px is not None else sure.image_px
    is_up = sure.is_y_up or raw.xyz.shape[2] == 3 if wishes.y_axis is None else wishes.y_axis == "up"
    xy, image = _turned(xy * factor, is_up, image, told)
    _check_reach(raw, xy, wishes, image)
    return replace(sure, xyz=xy, t_s=t_s, sigma=sigma, unit="px", is_y_up=False, image_px=image, notes=told.notes,
                   facts=told.facts)  # fmt: skip


def _chosen(raw: RawTracks, wanted: Sequence[str]) -> RawTracks:
    if not wanted:
        return raw
    for name in wanted:
        if name not in raw.names:
            known = ", ".join(raw.names[:50])
            raise OptionError(
                fault(Setting("nodes"), f"there is no point {name!r} in {raw.source}", f"It has {known}")
            )
    at = [raw.names.index(name) for name in wanted]
    parts: dict[str, Any] = {
        name: None if getattr(raw, name) is None else getattr(raw, name)[:, at]
        for name in ("sigma", "confidence", "status", "area_px")
    }
    bodies = None if raw.bodies is None else tuple(raw.bodies[i] for i in at)
    return replace(raw, names=tuple(wanted), xyz=raw.xyz[:, at], bodies=bodies, **parts)


def _times(raw: RawTracks, fps: float | None, told: _Told) -> Floats:
    if fps is not None:
        if raw.t_s is not None:
            told.notes.append(f"times are frames over {fps:g} per s, and those of the file are left out")
        told.facts["fps"] = fps
        return np.asarray(raw.frame / fps)
    if raw.t_s is None:
        problem = f"it has no times and no rate: {raw.form} counts frames alone"
        raise TableError(fault(raw.source, problem, "Give the camera's frames per s with " + Setting("fps")))
    return raw.t_s


def _confident(raw: RawTracks, least: float | None, told: _Told) -> RawTracks:
    """The tracks without places that are less sure than ``least``."""
    if raw.confidence is None:
        if least is not None:
            problem = f"{raw.source} has no confidences"
            raise OptionError(fault(Setting("min_confidence"), problem, "Leave it out"))
        return raw
    limit = raw.least_confidence if least is None else least
    out = np.isfinite(raw.xyz).all(axis=2) & (raw.confidence < limit)
    if limit > 0:
        told.notes.append(
            f"{int(out.sum())} places with a confidence below {limit:g} are missing; confidence says nothing of "
            "uncertainty in px"
        )
    return replace(raw, xyz=np.where(out[..., None], np.nan, raw.xyz))


def _factor(raw: RawTracks, unit: str | None, told: _Told) -> float:
    """Pixels in the tracks' unit: 1 for px, else millimetres."""
    said = SPELLINGS.get(raw.unit.strip().lower())
    if unit is None and said is None:
        problem = (
            f"its unit of length {raw.unit!r} is not known"
            if raw.unit
            else f"{raw.form} does not say its unit of length"
        )
        raise TableError(fault(raw.source, problem, f"Give {listed(UNITS)} with " + Setting("unit")))
    if unit is not None and said is not None and unit != said:
        told.notes.append(f"the unit is taken to be {unit}, and the file says {raw.unit}")
    used = unit or said
    assert used is not None
    if used == "px":
        return 1.0
    told.notes.append(f"places are in {used} and not in pixels: 1 px stands for 1 mm")
    told.facts["px_per_m"] = 1000.0
    return MM[used]


def _in_plane(raw: RawTracks, plane: str | None, told: _Told) -> Floats:
    """Two of the coordinates (T, N, 2): those asked for, or of three those that spread most."""
    axes = raw.xyz.shape[2]
    if axes == 2:
        if plane is not None:
            raise OptionError(fault(Setting("plane"), f"{raw.source} has two coordinates", "Leave it out"))
        return raw.xyz
    # A mechanism's markers move, so that the widest motion of any of them counts, and no distance between them.
    with np.errstate(invalid="ignore"):
        spread = np.array([np.nanmax(_ranges(raw.xyz[..., a])) for a in range(3)])
    order = np.argsort(spread)
    if plane is None and spread[order[0]] > CLEAR_PLANE * spread[order[1]]:
        ranges = ", ".join(f"{a} by {s:.4g} {raw.unit}" for a, s in zip("xyz", spread, strict=True))
        problem = f"points move along all three axes ({ranges}), and it is open in which plane"
        raise TableError(fault(raw.source, problem, f"Give {listed(PLANES)} with " + Setting("plane")))
    used = "".join(sorted("xyz"[i] for i in order[1:])) if plane is None else plane
    left = next(i for i in range(3) if "xyz"[i] not in used)
    second = sorted(spread["xyz".index(a)] for a in used)[0]
    if plane is None:
        told.notes.append(f"the plane is {used}: {used[0]} is to the right, {used[1]} is up")
    if spread[left] > MOST_DEPTH * second:
        told.notes.append(
            f"points move along {'xyz'[left]} too, by {spread[left]:.4g} {raw.unit}: that is left out"
        )
    told.facts["plane"] = used
    return raw.xyz[..., ["xyz".index(a) for a in used]]


def _check_reach(raw: RawTracks, xy: Floats, wishes: Wishes, image: tuple[int, int] | None) -> None:
    """Refuses places (T, N, 2) in px so far outside the pictures that their size or the unit must be wrong."""
    if image is None:
        return
    size = np.array(image, dtype=np.float64)
    outside = np.maximum(np.maximum(-0.5 - xy, xy - (size - 0.5)), 0.0)
    far = np.hypot(outside[..., 0], outside[..., 1]) > np.hypot(*size)
    seen = np.isfinite(xy).all(axis=2)
    # A single wild place is a tracker's error and no wrong unit.
    wrong = np.flatnonzero(2 * far.sum(axis=0) > seen.sum(axis=0))
    if not wrong.size:
        return
    n = int(wrong[0])
    t = int(np.flatnonzero(far[:, n])[0])
    x, y = xy[t, n]
    unit = wishes.unit or SPELLINGS.get(raw.unit.strip().lower(), raw.unit)
    scaled = "" if unit == "px" else f"in {unit}, at 1 px for 1 mm, "
    setting = (
        Setting("image_px") if wishes.image_px is not None else Message.of("the file's size of the pictures")
    )
    advice = (
        Message.of("Give the right unit with ")
        + Setting("unit")
        + ", the right size with "
        + Setting("image_px")
    )
    problem = f"{scaled}{raw.names[n]} is at ({x:.6g}, {y:.6g}) px, far outside pictures of {image[0]} x {image[1]} px"
    raise OptionError(fault(setting, problem, advice + ", or no size", place=f"frame {raw.frame[t]}"))


def _ranges(values: Floats) -> Floats:
    """The widest motion of each point (N,), 0 where it is never seen."""
    seen = np.isfinite(values)
    high, low = np.where(seen, values, -np.inf).max(axis=0), np.where(seen, values, np.inf).min(axis=0)
    return np.where(seen.any(axis=0), high - low, 0.0)


def _turned(
    xy: Floats, is_up: bool, image: tuple[int, int] | None, told: _Told
) -> tuple[Floats, tuple[int, int] | None]:
    """Places with y down, and the pictures' size where places had to be moved into them."""
    if not is_up:
        return xy, image
    if not np.isfinite(xy).any():
        return xy, image
    right = 0
    if image is None:
        low, high = np.nanmin(xy, axis=(0, 1)), np.nanmax(xy, axis=(0, 1))
        right = max(0, int(np.ceil(-low[0])))
        height = int(np.ceil(max(high[1], 0.0))) + 1
        down = max(0, int(np.ceil(-low[1])))
        image = (int(np.ceil(high[0])) + right + 1, height + down)
        top = height - 1
        told.notes.append(f"y is up and the pictures' height is not known: 0 is put at ({right}, {top}) px")
    else:
        top = image[1] - 1
        told.notes.append(f"y is up: 0 is the middle of the lowest of {image[1]} rows of pixels")
    told.facts |= {"x_px_of_0": float(right), "y_px_of_0": float(top)}
    return np.stack([xy[..., 0] + right, top - xy[..., 1]], axis=-1), (max(image[0], 1), max(image[1], 1))
