"""The part of the page that belongs to one recording: film, angles, identity of the markers, encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.encoder import Comparison
from pydpend.kinematics import LinkAngles
from pydpend.kinematics.camera import rms_of
from pydpend.nodes import AMBIGUOUS, MANUAL, Nodes
from pydpend.plots.encoder import calibration_figure
from pydpend.plots.style import inline_svg
from pydpend.recording_folder import StoredOverlay
from pydpend.report import motion
from pydpend.report.motion import Motion
from pydpend.report.page import (
    Block,
    Chart,
    Figure,
    Film,
    Reset,
    Section,
    Series,
    StatusMap,
    Table,
    Text,
    band,
)
from pydpend.report.words import digits, with_sigma
from pydpend.run_folder import StoredRecording

MOST_PLACES = 6
"""Curves of places in one chart."""


@dataclass(eq=False)
class Part:
    """The part of the page on one recording."""

    label: str
    nodes: Nodes | None = None
    residual_px: NDArray[np.float64] | None = None
    """(T, N): distance of each node from its place in its body's shape."""
    angles: LinkAngles | None = None
    meta: dict[str, Any] = field(default_factory=dict)
    film: StoredOverlay | None = None
    motion: Motion = field(default_factory=Motion)
    comparison: Comparison | None = None
    calibration: str | None = None
    warnings: list[str] = field(default_factory=list)
    answer: list[tuple[str, str]] = field(default_factory=list)
    """Its findings, as (property, value)."""

    def sections(self, id_: str, suffix: str) -> list[Section]:
        """The sections, titled with the recording's name where there are several."""
        end = f": {suffix}" if suffix else ""
        out: list[Section] = []
        if self.angles is not None:
            out.append(Section(f"{id_}-angles", f"Angles{end}", tuple(self._angle_blocks(id_))))
        elif self.nodes is not None:
            blocks = (*self._film_blocks(id_), *self._place_blocks(id_))
            out.append(Section(f"{id_}-places", f"Places{end}", blocks))
        moving = self.motion.blocks(id_, self.angles, self.film is not None)
        if moving:
            out.append(Section(f"{id_}-motion", f"Motion{end}", tuple(moving)))
        if self.nodes is not None:
            out.append(Section(f"{id_}-nodes", f"Markers{end}", tuple(self._node_blocks(id_))))
        if self.comparison is not None:
            out.append(Section(f"{id_}-encoder", f"Encoder{end}", tuple(self._encoder_blocks(id_))))
        return out

    def _film_blocks(self, id_: str) -> list[Block]:
        if self.film is None:
            return []
        every = self.film.every
        shown = "every frame" if every == 1 else f"one frame in {every}"
        return [
            Film(
                f"{id_}-overlay",
                id_,
                self.film.path.read_bytes(),
                self.film.times_s,
                self.film.rate_hz,
                f"{self.label} with markers and bodies drawn in; {shown}. The plots follow it.",
            )
        ]

    def _angle_blocks(self, id_: str) -> list[Block]:
        assert self.angles is not None
        a = self.angles
        degrees = np.degrees(a.phi_rad)
        sigmas = np.degrees(a.sigma_rad)
        angle = tuple(Series(f"{a.columns.stem(k)} (deg)", degrees[:, k], k) for k in range(a.links))
        blocks: list[Block] = [
            *self._film_blocks(id_),
            Chart(f"{id_}-phi", "Angles", id_, a.t_s, angle, y_label="angle (deg)", height=280),
        ]
        if np.isfinite(sigmas).any():
            sigma = tuple(
                Series(f"noise of {a.columns.stem(k)} (deg)", sigmas[:, k], k) for k in range(a.links)
            )
            part = np.degrees(a.sigma_camera_rad)
            if np.isfinite(part).any():
                sigma += tuple(
                    Series(f"camera's part of {a.columns.stem(k)} (deg)", part[:, k], k, dashed=True)
                    for k in range(a.links)
                )
            blocks.append(
                Chart(
                    f"{id_}-sigma",
                    "Standard uncertainty of each angle",
                    id_,
                    a.t_s,
                    sigma,
                    y_label="sigma (deg)",
                    height=180,
                )
            )
        blocks.append(Reset(id_, film=self.film is not None))
        return blocks

    def _place_blocks(self, id_: str) -> list[Block]:
        """The markers' places in the picture, where there are no angles."""
        assert self.nodes is not None
        n = self.nodes
        few = list(enumerate(n.rig.nodes))[:MOST_PLACES]
        blocks: list[Block] = [
            Chart(
                f"{id_}-{axis}",
                f"{axis} in the picture, {way}",
                id_,
                n.t_s,
                tuple(
                    Series(f"{node.name} (px)", n.xy_px[:, i, k], i, points=len(n) < 200) for i, node in few
                ),
                y_label=f"{axis} (px)",
            )
            for k, (axis, way) in enumerate((("x", "to the right"), ("y", "downwards")))
        ]
        if len(n.rig.nodes) > MOST_PLACES:
            blocks.append(Text(f"The first {MOST_PLACES} of {len(n.rig.nodes)} markers.", quiet=True))
        return [*blocks, Reset(id_, film=self.film is not None)]

    def _node_blocks(self, id_: str) -> list[Block]:
        assert self.nodes is not None
        n = self.nodes
        names = tuple(node.name for node in n.rig.nodes)
        residual = np.full((1, len(names)), np.nan) if self.residual_px is None else self.residual_px
        runs = tuple(_runs(n.t_s, n.status[:, i]) for i in range(len(names)))
        rows = []
        for i, node in enumerate(n.rig.nodes):
            seen = n.seen[:, i]
            lengths = _gaps(seen)
            sigma = n.sigma_px[seen, i]
            off = residual[np.isfinite(residual[:, i]), i]
            rows.append(
                (
                    node.name,
                    node.body,
                    f"{100 * seen.mean():.2f} %",
                    str(len(lengths)),
                    str(max(lengths, default=0)),
                    str(int((n.status[:, i] == AMBIGUOUS).sum())),
                    str(int((n.status[:, i] == MANUAL).sum())),
                    f"{np.nanmedian(sigma):.4f}" if sigma.size else "–",
                    f"{np.sqrt(np.mean(off**2)):.4f}" if off.size else "–",
                    f"{off.max():.3f}" if off.size else "–",
                )
            )
        known = bool(np.isfinite(residual).any())
        full = float(np.nanpercentile(residual, 99.9)) if known else 1.0
        told = (
            f"The curve in each row is the distance of the marker from its place in its body's shape; the row "
            f"is {full:.2g} px high, larger ones are cut off."
            if known
            else "No body shows two markers at once, so there is no shape to compare them with."
        )
        return [
            StatusMap(
                f"{id_}-status",
                "What was known of each marker",
                id_,
                n.t_s,
                names,
                runs,
                tuple(residual.T) if known else (),
                full,
                height=60 + 26 * len(names),
            ),
            Text(told, quiet=True),
            Table(
                (
                    "marker",
                    "body",
                    "seen",
                    "gaps",
                    "longest gap (frames)",
                    "ambiguous (frames)",
                    "by a person (frames)",
                    "median sigma (px)",
                    "RMS to shape (px)",
                    "largest (px)",
                ),
                tuple(rows),
                numbers=frozenset(range(2, 9)),
            ),
        ]

    def _encoder_blocks(self, id_: str) -> list[Block]:
        assert self.comparison is not None
        c = self.comparison
        rows = [
            ("readings compared", str(c.n)),
            ("RMS of film minus encoder (deg)", digits(math.degrees(c.rms_rad), 3)),
            ("largest (deg)", digits(math.degrees(c.largest_rad), 3)),
            ("gain", with_sigma(c.gain, c.gain_sigma)),
            (
                "zero of the encoder (deg)",
                with_sigma(math.degrees(c.offset_rad), math.degrees(c.offset_sigma_rad)),
            ),
        ]
        if c.sync.given:
            rows.append(("delay (ms)", with_sigma(1e3 * c.delay_s, 1e3 * c.delay_sigma_s)))
        else:
            rows += [
                ("clock offset (s)", with_sigma(c.sync.offset_s, c.sync.offset_sigma_s)),
                ("clock drift (ppm)", with_sigma(1e6 * c.sync.drift, 1e6 * c.sync.drift_sigma)),
            ]
        names = {
            "encoder": "encoder's noise",
            "video": "film's noise",
            "camera": "the film's camera",
            "unexplained": "none of these",
        }
        rows += [
            (f"share of the residual explained by {names[k]} (%)", f"{100 * v:.1f}")
            for k, v in c.shares.items()
        ]
        blocks: list[Block] = [Table(("quantity", "value"), tuple(rows), numbers=frozenset({1}))]
        if self.calibration is not None:
            blocks.append(
                Figure(
                    self.calibration,
                    "Calibration line of the encoder and its residuals (the paper's Fig. 10).",
                )
            )
        both = (
            Series("encoder (deg)", np.degrees(c.encoder_rad), 1),
            Series("film (deg)", np.degrees(c.video_rad), 0),
        )
        sigma = np.full(c.t_s.size, math.degrees(c.stated_sigma_rad))
        blocks += [
            Chart(f"{id_}-both", "Film and encoder, phi1", id_, c.t_s, both, y_label="phi1 (deg)"),
            Chart(
                f"{id_}-difference",
                "Film minus encoder; the band is ± the stated standard uncertainty of both",
                id_,
                c.t_s,
                (Series("difference (deg)", np.degrees(c.residual_rad), 0), *band(sigma)),
                y_label="difference (deg)",
            ),
            Reset(id_, film=self.film is not None),
        ]
        return blocks


def _runs(t_s: NDArray[np.float64], status: NDArray[np.uint8]) -> tuple[tuple[int, float, float], ...]:
    """Stretches of the same status as (code, from s, to s)."""
    edges = np.flatnonzero(np.diff(status)) + 1
    starts = np.concatenate(([0], edges))
    ends = np.concatenate((edges, [status.size]))
    step = float(np.median(np.diff(t_s))) if t_s.size > 1 else 1.0
    return tuple(
        (int(status[a]), float(t_s[a]), float(t_s[b]) if b < t_s.size else float(t_s[-1]) + step)
        for a, b in zip(starts, ends, strict=True)
    )


def _gaps(seen: NDArray[np.bool_]) -> list[int]:
    """Lengths in frames of the stretches not seen."""
    change = np.diff(np.concatenate(([True], seen, [True])).astype(np.int8))
    return [int(b - a) for a, b in zip(np.flatnonzero(change < 0), np.flatnonzero(change > 0), strict=True)]


def read(r: StoredRecording) -> Part:
    """Everything the run folder holds of one recording."""
    part = Part(r.label)
    rows: list[tuple[str, str]] = []
    if r.did("track") or r.kind == "nodes":
        nodes = r.nodes()
        part.nodes = nodes
        seen = nodes.seen
        rows += [
            ("frames", str(nodes.frame.size)),
            *_times(nodes.t_s, nodes.meta.get("time")),
            *_pixels(nodes),
            ("markers, bodies", f"{len(nodes.rig.nodes)}, {len(nodes.rig.bodies)}"),
            ("markers seen, of all frames", f"{100 * seen.mean():.1f} %"),
            *([] if nodes.edits is None else [("decided by people", nodes.edits)]),
            ("median uncertainty of a centre", f"{digits(float(np.nanmedian(nodes.sigma_px)))} px"),
        ]
        time = nodes.meta.get("time")
        if isinstance(time, dict):
            part.warnings += [f"{part.label}: {w}" for w in time.get("notes", [])]
        part.warnings += [f"{part.label}: {w}" for w in (*nodes.meta.get("warnings", []), *nodes.notes)]
        ending = nodes.meta.get("ending")
        if isinstance(ending, dict) and ending.get("kind") == "early":
            part.warnings.append(f"{part.label}: the recording ended early: {ending.get('reason')}")
        if nodes.damage is not None:
            part.warnings.append(f"{part.label}: {nodes.damage}")
    if r.did("markers") and part.nodes is not None:
        part.residual_px = r.residual_px(part.nodes)
    if r.did("angles"):
        part.angles = r.angles()
        part.meta = r.angles_about()
        if part.nodes is None:
            rows += [("samples", str(part.angles.t_s.size)), *_times(part.angles.t_s)]
        part.warnings += [f"{part.label}: {note}" for note in part.meta.get("notes", [])]
        zero = part.meta.get("zero")
        if isinstance(zero, dict) and "from" in zero:
            rows.append(("zero of the angles", zero_in_words(zero)))
        for k in range(part.angles.links):
            sigma = part.angles.sigma_rad[:, k]
            if np.isfinite(sigma).any():
                noise = f"{digits(math.degrees(np.nanmedian(sigma)))} deg noise"
                rows.append(
                    (
                        f"uncertainty of {part.angles.columns.stem(k)}",
                        noise + _camera_in_words(part.angles, k),
                    )
                )
        turns = (np.nanmax(part.angles.phi_rad, axis=0) - np.nanmin(part.angles.phi_rad, axis=0)) / (
            2 * np.pi
        )
        rows += [(f"range of {part.angles.columns.stem(k)}", f"{t:.2f} turns") for k, t in enumerate(turns)]
    part.motion = motion.read(r)
    rows += part.motion.answer()
    part.warnings += [f"{part.label}: {note}" for note in part.motion.warnings()]
    if r.did("overlay"):
        part.film = r.overlay()
    if r.did("encoder"):
        found = r.comparison()
        part.comparison = found
        line = r.calibration()
        part.calibration = None if line is None else inline_svg(calibration_figure(line))
        part.warnings += [f"{part.label}: {note}" for note in found.notes]
        rms, neither = math.degrees(found.rms_rad), found.shares.get("unexplained")
        rows.append(("film minus encoder, RMS", f"{digits(rms, 3)} deg"))
        if neither is not None and neither < 1:
            expected = f"{digits(rms * math.sqrt(1 - neither), 3)} deg"
            rows.append(("film minus encoder, expected from their noise", expected))
    part.answer = rows
    return part


def _camera_in_words(angles: LinkAngles, link: int) -> str:
    """The camera's part of an angle's uncertainty, after its noise."""
    if angles.camera_rad is None:
        return ", camera's part not stated"
    part = math.degrees(rms_of(angles.camera_rad)[link])
    return f", {digits(part)} deg camera (one error of all frames, which no number of them averages out)"


def zero_in_words(zero: dict[str, Any]) -> str:
    """The origin of the angles' zero, with its standard uncertainty."""
    sigmas = zero.get("sigma_rad")
    if not sigmas:
        return f"{zero['from']}, uncertainty not stated"
    return f"{zero['from']}, ± {' and '.join(digits(math.degrees(s)) for s in sigmas)} deg"


def _times(t_s: NDArray[np.float64], time: Any = None) -> list[tuple[str, str]]:
    """Duration and rate; ``time`` is what the node table says of its times."""
    step = float(np.median(np.diff(t_s))) if t_s.size > 1 else math.nan
    rate = f"{1 / step:.6g} per s"
    if isinstance(time, dict) and time.get("kind") == "variable":
        slowest, fastest = time["range_hz"]
        # Between clocks of cameras alone: no more than rounding shows.
        uneven = fastest - slowest > 1e-3 * fastest
        rate = rate if not uneven else f"variable, {slowest:.3g} to {fastest:.3g} per s"
    return [("duration", f"{t_s[-1] - t_s[0]:.3f} s"), ("rate", rate)]


def _pixels(nodes: Nodes) -> list[tuple[str, str]]:
    """The width of a pixel, where it is not square."""
    width, height = nodes.rig.pixel_aspect
    if width == height:
        return []
    source = nodes.meta.get("source")
    given = isinstance(source, dict) and source.get("pixel_aspect_origin") == "user"
    origin = "as given" if given else "as the recording says"
    return [("pixels", f"{width / height:.4f} wide ({width}:{height}), {origin}")]
