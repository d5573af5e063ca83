"""The four tiles at the top of the page: the film, its angles, where the energy goes, and how the measures were had."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pydpend.damping import DampingFit
from pydpend.kinematics.camera import rms_of
from pydpend.nodes import Nodes
from pydpend.report.damping import SHARE
from pydpend.report.page import Bar, Light, Tile
from pydpend.report.recording import Part, zero_in_words
from pydpend.report.words import digits, with_sigma

FEW_FRAMES, MOST_FRAMES = 0.90, 0.99
"""Part of the frames with all angles: fewer than the first are a sign of lost links, fewer than the second are told."""
LOOSE_ZERO_DEG, UNKNOWN_ZERO_DEG = 0.5, 2.0
"""Uncertainty of a zero, deg: a camera set up by eye is rolled by 1; what is beyond twice that is no zero."""

CAMERA = {
    "found": "found in the recording",
    "given": "given with the rig",
    "by_eye": "taken as aimed by eye",
}


def tiles(parts: Sequence[Part], fit: DampingFit | None) -> tuple[Tile, ...]:
    """The tiles of a run; those of which the run knows nothing say so."""
    return (_film(parts), _angles(parts), _energy(fit), _measures(parts))


def _first(parts: Sequence[Part]) -> Part | None:
    return next((part for part in parts if part.nodes is not None or part.angles is not None), None)


def _film(parts: Sequence[Part]) -> Tile:
    part = next((part for part in parts if part.nodes is not None), None)
    if part is None or part.nodes is None:
        return Tile("film", "Film", note="Angles were given, no film.")
    n = part.nodes
    seen = np.isin(n.status, (1, 2)).mean()
    told = f"{part.label}: {n.frame.size} frames, {len(n.rig.nodes)} markers, seen in {100 * seen:.1f} %"
    # A film in the page gives its first picture; else what was found is drawn.
    film = None if part.film is None else f"r{parts.index(part)}-overlay"
    return Tile("film", "Film", note=told, svg=_sketch(n), film=film)


def _sketch(n: Nodes) -> str:
    """The markers where most of them are seen, coloured by link, as SVG."""
    frame = int(np.isfinite(n.xy_px[:, :, 0]).sum(axis=1).argmax())
    width, height = n.rig.image_px
    bodies = list(n.rig.bodies)
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{width / 80:.1f}" fill="var(--s{bodies.index(node.body) % 6})"/>'
        for (x, y), node in zip(n.xy_px[frame], n.rig.nodes, strict=True)
        if math.isfinite(x) and node.body in bodies
    )
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="Markers in frame {n.frame[frame]}">{dots}</svg>'


def _angles(parts: Sequence[Part]) -> Tile:
    judged = [(*_judged(part), part) for part in parts if part.angles is not None]
    if not judged:
        return Tile("angles", "Angles", note="No angles: the warnings or “What does not apply” say why.")
    light, reason, part = max(judged, key=lambda j: list(Light).index(j[0]))
    assert part.angles is not None
    rows = []
    for k in range(part.angles.links):
        sigma = part.angles.sigma_rad[:, k]
        if np.isfinite(sigma).any():
            rows.append(
                (part.angles.columns.stem(k), f"± {digits(math.degrees(np.nanmedian(sigma)))} deg noise")
            )
    named = f"{part.label}: {reason}." if len(judged) > 1 else f"{reason[0].upper()}{reason[1:]}."
    return Tile("angles", "Angles", light=light, note=named, rows=tuple(rows))


def _judged(part: Part) -> tuple[Light, str]:
    """How far the angles are to be trusted, and the weightiest reason."""
    assert part.angles is not None
    whole = float(np.isfinite(part.angles.phi_rad).all(axis=1).mean())
    zero = part.meta.get("zero")
    known = zero.get("sigma_rad") if isinstance(zero, dict) else None
    off_deg = max(map(math.degrees, known)) if known else math.nan
    notes = part.meta.get("notes", [])
    if whole < FEW_FRAMES:
        return Light.BAD, f"only {100 * whole:.0f} % of the frames have all angles"
    if off_deg > UNKNOWN_ZERO_DEG:
        return Light.BAD, f"the zero is known to {digits(off_deg)} deg only"
    if off_deg > LOOSE_ZERO_DEG:
        return (
            Light.LOOK,
            f"the zero is known to {digits(off_deg)} deg only: a film hanging still tells it better",
        )
    if whole < MOST_FRAMES:
        return Light.LOOK, f"{100 * (1 - whole):.1f} % of the frames lack an angle"
    if notes:
        return Light.LOOK, "a warning is about them"
    if math.isnan(off_deg):
        return Light.LOOK, "how well their zero is known is not stated"
    return (
        Light.GOOD,
        f"{100 * whole:.1f} % of the frames have all angles, and the zero is known to {digits(off_deg)} deg",
    )


def _energy(fit: DampingFit | None) -> Tile:
    if fit is None:
        return Tile("energy", "Energy lost", note="No damping was fitted.")
    bars = []
    for group in ("law", "joint"):
        found = fit.shares.get(group, {})
        if len(found) < 2 or not all(math.isfinite(c.value) and c.sigma < 1.0 for c in found.values()):
            continue
        bars.append(
            tuple(
                Bar(
                    SHARE[name],
                    f"{with_sigma(100 * c.value, 100 * c.sigma)} %",
                    100 * min(1.0, max(0.0, c.value)),
                )
                for name, c in found.items()
            )
        )
    note = "" if bars else "The recording does not tell how the energy is shared out."
    return Tile("energy", "Energy lost", note=note, bars=tuple(bars))


def _measures(parts: Sequence[Part]) -> Tile:
    part = _first(parts)
    if part is None:
        return Tile("measures", "How it was measured", note="No recording was read.")
    rows = [("zero", _zero(part)), ("scale", _scale(part)), ("rate", _rate(part)), ("camera", _camera(part))]
    note = f"{part.label}; the other recordings below." if len(parts) > 1 else ""
    return Tile("measures", "How it was measured", note=note, rows=tuple(rows))


def _zero(part: Part) -> str:
    zero = part.meta.get("zero")
    return zero_in_words(zero) if isinstance(zero, dict) and "from" in zero else "none"


def _scale(part: Part) -> str:
    linkage = part.meta.get("linkage")
    metres = linkage.get("scale_m_per_px") if isinstance(linkage, dict) else None
    if not metres:
        return "none given (a length between two points gives it)"
    sigma = linkage.get("scale_sigma_m_per_px") if isinstance(linkage, dict) else None
    return f"{with_sigma(1 / metres, (sigma or 0.0) / metres**2)} px per m, from the link's length"


RATES = {"given": "as given", "container": "as the film says", "camera": "by the camera's own tag"}


def _rate(part: Part) -> str:
    time = part.nodes.meta.get("time") if part.nodes is not None else None
    if not isinstance(time, dict) or not time.get("rate_hz"):
        return "the table's times"
    sigma = time.get("rate_sigma_hz")
    much = with_sigma(time["rate_hz"], sigma) if sigma else f"{time['rate_hz']:.6g}"
    whence = RATES.get(str(time.get("rate_origin")), "")
    return f"{much} per s, {whence}" if whence else f"{much} per s"


def _camera(part: Part) -> str:
    if part.angles is None or part.angles.camera_rad is None:
        return "not stated"
    origin = part.meta.get("camera", {}).get("origin")
    worst = math.degrees(float(np.max(rms_of(part.angles.camera_rad))))
    return f"{CAMERA.get(str(origin), 'as the table states it')}, ± {digits(worst)} deg in an angle"
