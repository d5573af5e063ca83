"""Recordings to nodes: what is in a file, its rig, its nodes, and the film with these drawn in.

The work is done in Rust with the GIL released; here arguments get their words and results their names.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend import _tracker
from pydpend._typing import Centroid, Decoder, Interlaced, PixelAspect, Polarity, Progress
from pydpend.errors import ArgumentError, fault
from pydpend.live import aspect_text
from pydpend.nodes import Nodes, Rig, nodes_of, read_nodes
from pydpend.output import AnyPath

Path: TypeAlias = AnyPath


def _frames(frames: tuple[int, int | None] | range | None) -> tuple[int, int | None] | None:
    if frames is None:
        return None
    if isinstance(frames, range):
        if frames.step != 1:
            raise ArgumentError(fault("frames", f"{frames} has a step", "Give a range without one"))
        frames = (frames.start, frames.stop)
    try:
        start, stop = frames
        start, stop = int(start), None if stop is None else int(stop)
    except (TypeError, ValueError):
        raise ArgumentError(
            fault("frames", f"{frames!r} is no range", "Give (first, one past the last)")
        ) from None
    if start < 0 or (stop is not None and stop <= start):
        raise ArgumentError(fault("frames", f"{frames!r} holds no frame", "Give (first, one past the last)"))
    return start, stop


def _threads(threads: int | None) -> int:
    if threads is None:
        return 0
    if not 0 < threads < 1 << 62:
        raise ArgumentError(
            fault("threads", f"{threads} is out of range", "Give 1 or more, or None for one a core")
        )
    return int(threads)


def _count(name: str, value: int) -> int:
    """A number as the compiled half takes it; it knows the limits."""
    if not isinstance(value, (int, np.integer)) or not 0 <= value < 1 << 31:
        raise ArgumentError(fault(name, f"{value!r} is out of range", "Give a whole number"))
    return int(value)


def _rig(rig: Rig | Path | None) -> str | None:
    if rig is None:
        return None
    return rig.to_json() if isinstance(rig, Rig) else _tracker.read_rig(os.fsdecode(rig))


def _files(rig: Rig | Path | None) -> list[str]:
    """Files that are read besides the recording."""
    return [] if rig is None or isinstance(rig, Rig) else [os.fsdecode(rig)]


class _Bar:
    """A bar on a terminal's standard error or in a notebook."""

    def __init__(self) -> None:
        self._stage = ""
        self._bar: Any = None

    def __call__(self, stage: str, done: int, total: int | None) -> None:
        from tqdm.auto import tqdm

        if stage != self._stage:
            self.close()
            self._stage = stage
            self._bar = tqdm(total=total, desc=stage, unit=" frames", leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def _callback(
    progress: Progress,
) -> tuple[Callable[[str, int, int | None], object] | None, Callable[[], None]]:
    """The callback to use, and what to call at the end."""
    if callable(progress):
        return progress, lambda: None
    notebook = "ipykernel" in sys.modules
    if progress is True or (progress is None and (notebook or sys.stderr.isatty())):
        bar = _Bar()
        return bar, bar.close
    return None, lambda: None


def track(
    path: Path,
    rig: Rig | Path | None = None,
    *,
    fps: float | None = None,
    frames: tuple[int, int | None] | range | None = None,
    threads: int | None = None,
    progress: Progress = None,
    output: Path | None = None,
    force: bool = False,
    resume: bool = False,
    safe_csv: bool = False,
    threshold: float | None = None,
    polarity: Polarity = "auto",
    centroid: Centroid = "weighted",
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> Nodes:
    """Follows the markers of a recording.

    Args:
        path: the recording.
        rig: nodes, bodies and joints, or a file of them; found in the recording if None.
        fps: frames a second of recorded time, instead of what the recording claims.
        frames: first frame and one past the last.
        threads: None is one a core. The result is the same for any number.
        progress: a callback ``(stage, done, total)``; None is a bar on a terminal or in a notebook, False nothing.
            An exception from it stops the run.
        output: a table to write too, Parquet or CSV by the ending.
        force: replace `output` if it is there already.
        resume: go on where an earlier run for `output` stopped.
        safe_csv: as in `Nodes.write`.
        threshold: in the recording's units; None is learned from it.
        polarity: whether markers are brighter or darker than what is around them.
        centroid: by intensity, or by OpenCV's contours as in the paper.
        decoder: what reads compressed film.
        interlaced: how film is read whose pictures hold two fields, filmed one after the other: not at all, or each
            picture as one (for cameras that filmed whole pictures and only say that they are interlaced).
        allow_protocol: open network addresses and devices too.
        pixel_aspect: width to height of a pixel, (16, 15) or "16:15", instead of what the recording says.

    Returns:
        The nodes. If the recording was damaged, `Nodes.complete` is False and `Nodes.meta` says how it ended; what
        the run warned of is in ``meta["warnings"]``.

    Raises:
        SourceError: if the recording cannot be opened or read.
        DetectError: if there are no markers, or the threshold is out of range.
        RigError: if the rig is wrong, does not fit the recording, or none can be found.
        TableError: if `output` is there already or cannot be written.
        ArgumentError: if an argument makes no sense.
        KeyboardInterrupt: on Ctrl-C, within two seconds. What was done until then is the exception's `nodes`, and with
            `output` it is kept there, to go on with `resume=True`.
    """
    existing = "resume" if resume else "replace" if force else "refuse"
    callback, close = _callback(progress)
    try:
        columns, warnings, stopped = _tracker.track(
            os.fsdecode(path),
            _rig(rig),
            _frames(frames),
            (threshold, polarity, centroid),
            (fps, decoder, interlaced, allow_protocol, _threads(threads), aspect_text(pixel_aspect)),
            None if output is None else os.fsdecode(output),
            existing,
            safe_csv,
            _files(rig),
            callback,
        )
    finally:
        close()
    nodes = nodes_of(columns)
    nodes.meta["warnings"] = [str(warning) for warning in warnings]
    if stopped is not None:
        stopped.nodes = nodes  # type: ignore[attr-defined]
        raise stopped
    return nodes


class Setup(NamedTuple):
    """What `setup` found.

    Attributes:
        rig: nodes, bodies, joints and the reference picture.
        warnings: what to know of the rig and the recording, a sentence each.
        picture: the reference picture with the rig and all other detections drawn, (H, W, 3) uint8, red, green, blue.
    """

    rig: Rig
    warnings: list[str]
    picture: NDArray[np.uint8]


def setup(
    path: Path,
    output: Path | None = None,
    *,
    picture: Path | None = None,
    force: bool = False,
    fps: float | None = None,
    frames: tuple[int, int | None] | range | None = None,
    threads: int | None = None,
    progress: Progress = None,
    threshold: float | None = None,
    polarity: Polarity = "auto",
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> Setup:
    """Finds markers, bodies and joints of a recording.

    Args:
        path: the recording; it is read through.
        output: a rig file to write, to be looked at and edited.
        picture: an image file to write, for example .png: the reference picture with all that was found.
        force: replace `output` and `picture` if they are there already.
        fps, frames, threads, progress, threshold, polarity, decoder, interlaced,
            allow_protocol, pixel_aspect: as in `track`.

    Raises:
        SourceError, DetectError, RigError, ArgumentError: as `track`.
        RigError, FilmError: also if `output` or `picture` is there already, is the recording, or cannot be written.
        KeyboardInterrupt: on Ctrl-C, within two seconds; nothing is written then.
    """
    callback, close = _callback(progress)
    try:
        text, warnings, drawn = _tracker.setup(
            os.fsdecode(path),
            _frames(frames),
            (threshold, polarity, "weighted"),
            (fps, decoder, interlaced, allow_protocol, _threads(threads), aspect_text(pixel_aspect)),
            None if output is None else os.fsdecode(output),
            None if picture is None else os.fsdecode(picture),
            force,
            callback,
        )
    finally:
        close()
    return Setup(Rig.from_json(text), [str(warning) for warning in warnings], drawn)


@dataclass(frozen=True, eq=False)
class OverlayFilm:
    """A film of K pictures with nodes drawn.

    Attributes:
        path: the file, H.264.
        frame: each picture's frame in the recording, (K,).
        t_s: each picture's time in the recording in s, (K,).
        play_fps: pictures a second at which it plays: picture k is at ``k / play_fps`` s of the film.
    """

    path: str
    frame: NDArray[np.int64]
    t_s: NDArray[np.float64]
    play_fps: int


def overlay(
    recording: Path,
    nodes: Nodes | Path,
    output: Path,
    *,
    every: int = 1,
    width: int | None = None,
    play_fps: int = 30,
    quality: int = 20,
    force: bool = False,
    progress: Progress = None,
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
) -> OverlayFilm:
    """Draws nodes, names, bodies, trails and gaps into their recording.

    Args:
        recording: the recording that the nodes come from.
        nodes: its nodes, or a table of them. Frames that they do not have are left out.
        output: the film, H.264, for example .mp4.
        every: draw each such frame only, from the first of the nodes; trails go through the frames between.
        width: of the film in px, even; the height is in proportion. None is the recording's.
        play_fps: pictures a second at which it plays.
        quality: x264's rate factor, 0 (best, largest) to 51.
        force: replace `output` if it is there already.
        progress, decoder, interlaced, allow_protocol: as in `track`.

    Returns:
        The film's file and which frames and times its pictures are of.

    Raises:
        SourceError: if the recording cannot be read.
        TableError: if the nodes are not valid or not of this recording.
        FilmError: if `output` is there already or cannot be written.
        ArgumentError: if an argument makes no sense.
        KeyboardInterrupt: on Ctrl-C, within two seconds; what was drawn is a whole film.
    """
    table = [] if isinstance(nodes, Nodes) else [os.fsdecode(nodes)]
    if not isinstance(nodes, Nodes):
        nodes = read_nodes(nodes)
    callback, close = _callback(progress)
    try:
        frame, t_s = _tracker.overlay_film(
            os.fsdecode(recording),
            nodes._columns(),
            nodes._meta_json(),
            os.fsdecode(output),
            (None, decoder, interlaced, allow_protocol, 0, None),
            _count("every", every),
            None if width is None else _count("width", width),
            _count("play_fps", play_fps),
            _count("quality", quality),
            force,
            table,
            callback,
        )
    finally:
        close()
    return OverlayFilm(os.fsdecode(output), frame, t_s, play_fps)


def info(
    path: Path,
    *,
    fps: float | None = None,
    decoder: Decoder = "auto",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> dict[str, Any]:
    """What is known of a recording before it is read through.

    Returns:
        `name`, `container`, `codec`, `width`, `height` (px), `pixel_aspect` (width to height of a pixel, "16:15"),
        `pixel_aspect_origin` ("recording", or "user" where it was given), `depth_bits`, `declared_frames`, `rate_hz`,
        `rate_origin`, `time_base` (numerator and denominator of s per tick), `size_bytes`, `sha256_first_mib`,
        `converted_from`, `warnings` and `details`; `frames` that are there by their packets, without decoding any, and
        what its times are (`time`: `kind`, `rate_hz`, `sigma_s`, `gaps`, `notes`, ...); None where unknown. Of a long
        recording only the first frames are looked at for these two.

    Raises:
        SourceError: if it cannot be opened, or its time stamps stand still.
    """
    opened = (fps, decoder, "as-frames", allow_protocol, 0, aspect_text(pixel_aspect))
    known: dict[str, Any] = json.loads(_tracker.info(os.fsdecode(path), opened))
    return known
