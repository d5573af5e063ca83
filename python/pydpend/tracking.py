"""Recordings to nodes: what is in a file, its rig, its nodes, and the film with these drawn in.

The work is done in Rust with the GIL released; here arguments get their words and results their names.
"""

from __future__ import annotations

import json
import os
import warnings as warnings_of_python
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend._typing import (
    Centroid,
    Decoder,
    Frames,
    Interlaced,
    PixelAspect,
    Polarity,
    Progress,
    Region,
)
from pydpend.errors import ArgumentError, RecordingWarning, fault
from pydpend.nodes import Nodes, Rig, nodes_of, read_nodes
from pydpend.output import AnyPath
from pydpend.progress import callback
from pydpend.reading_options import OpenOptions, ReadingOptions, given
from pydpend.tabular import TableResult
from pydpend.terminal import shown
from pydpend.typed import typed
from pydpend.wanted import Numbers, Pairs, Places, wanted

Path: TypeAlias = AnyPath


def _count(name: str, value: int) -> int:
    """A number as the compiled half takes it; it knows the limits."""
    if not isinstance(value, (int, np.integer)) or not 0 <= value < 1 << 31:
        raise ArgumentError(fault(name, f"{value!r} is out of range", "Give a whole number"))
    return int(value)


def _rig(rig: Rig | Path | None) -> str | None:
    if rig is None:
        return None
    return rig.to_json() if isinstance(rig, Rig) else _native.read_rig(os.fsdecode(rig))


def _files(rig: Rig | Path | None) -> list[str]:
    """Files that are read besides the recording."""
    return [] if rig is None or isinstance(rig, Rig) else [os.fsdecode(rig)]


def _loss(nodes: Nodes) -> str | None:
    """Loss of a recording, in a sentence; None if nothing is lost."""
    ending = nodes.meta.get("ending", {})
    early = None
    if ending.get("kind") == "early":
        early = f"the recording ended early, after {ending['frames']} frames ({ending['reason']})"
    return "; ".join(said for said in (nodes.damage, early) if said is not None) or None


@typed()
def track(
    path: Path,
    rig: Rig | Path | None = None,
    *,
    fps: float | None = None,
    frames: Frames | None = None,
    threads: int | None = None,
    progress: Progress = None,
    output: Path | None = None,
    force: bool = False,
    resume: bool = False,
    safe_csv: bool = False,
    marker: Places | None = None,
    markers: int | None = None,
    also: Numbers = (),
    same: Pairs = (),
    region: Region | None = None,
    threshold: float | None = None,
    polarity: Polarity = "auto",
    centroid: Centroid = "disc",
    min_area_px: float | None = None,
    max_area_px: float | None = None,
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
    edits: Path | None = None,
) -> Nodes:
    """Nodes of a recording: its markers followed from frame to frame.

    Parameters
    ----------
    path : path-like
        The recording: a film of any container, a folder of numbered images, or a camera's raw file.
    rig : Rig or path-like, optional
        Nodes, bodies and joints, or a file of them; found in the recording if not given.
    fps : float, optional
        Frames a second of recorded time, Hz, instead of what the recording claims.
    frames : tuple of int, range or str, optional
        First frame and one past the last, counted from 0; None for the latter is the end. ``(0, 500)`` or ``"0..500"``.
    threads : int, optional
        At least 1; one a core if not given. The result is the same for any number.
    progress : callable or bool, optional
        Called with (stage, frames done, frames in all or None). None is a bar on a terminal or in a notebook, False
        nothing. An exception from it stops the run.
    output : path-like, optional
        A table to write too, Parquet or CSV by the ending.
    force : bool
        Whether to replace `output` if it is there already.
    resume : bool
        Whether to go on where an earlier run for `output` stopped.
    safe_csv : bool
        Whether names in a CSV are marked for spreadsheets, see `Nodes.write`.
    marker : tuple, str or sequence of these, optional
        Places of what is to be followed: (x, y) or (x, y, frame), px and from 0, or ``"x,y@frame"``; a node for each,
        in that order. Without a frame it is the first.
    markers : int, optional
        How many markers there are.
    also : int or sequence of int
        Numbers of the picture of `setup` that are to be followed too.
    same : tuple of str or sequence of these
        Pairs of nodes that are one marker, which keeps the first name.
    region : sequence of float or str, optional
        Part of the image in which markers are looked for: first column and row and last column and row in px,
        ``(0, 0, 319, 239)`` or ``"0,0,319,239"``; the rig's if not given.
    threshold : float, optional
        Level that parts markers from what is around them, in the recording's units; learned from it if not given.
    polarity : {"auto", "bright", "dark"}
        Whether markers are brighter or darker than what is around them.
    centroid : {"disc", "weighted", "contour"}
        Centre by the disc that fits best, by intensity above the background, or by OpenCV's contours as in the paper
        (Section 4).
    min_area_px, max_area_px : float, optional
        Limits of a marker's area, px; learned from the recording if not given.
    decoder : {"auto", "ffmpeg", "opencv"}
        What reads compressed film.
    interlaced : {"refuse", "as-frames"}
        How film is read whose pictures hold two fields, filmed one after the other: not at all, or each picture as
        one (for cameras that filmed whole pictures and only say that they are interlaced).
    allow_protocol : bool
        Whether network addresses and devices are opened too.
    pixel_aspect : tuple of int or str, optional
        Width to height of a pixel, ``(16, 15)`` or ``"16:15"``, instead of what the recording says.
    edits : path-like, optional
        A file of people's decisions (docs/reference/edits.md), made on the rows before they are given or written.

    Returns
    -------
    Nodes
        The nodes of T frames. If the recording was damaged, `Nodes.complete` is False, `Nodes.damage` says what is
        lost and ``meta["ending"]`` how it ended; what the run warned of is in ``meta["warnings"]``.

    Raises
    ------
    SourceError
        If the recording cannot be opened or read.
    DetectError
        If there are no markers, or the threshold is out of range.
    RigError
        If the rig is wrong, does not fit the recording, or none can be found.
    TableError
        If `output` is there already or cannot be written.
    ArgumentError
        If an argument makes no sense, or edits are of another film or name a node, a frame or a detection that is not
        there; with their line.
    KeyboardInterrupt
        On Ctrl-C, within two seconds. What was done until then is the exception's ``nodes``, and with `output` it is
        kept there, to go on with ``resume=True``.

    Warns
    -----
    RecordingWarning
        If the recording is damaged or ended early.
    """
    reading = given(ReadingOptions, locals())
    existing = "resume" if resume else "replace" if force else "refuse"
    target = None if output is None else os.fsdecode(output)
    reads = [*_files(rig), *([] if edits is None else [os.fsdecode(edits)])]
    written = _native.OutputSettings(target, existing=existing, safe_csv=safe_csv, reads=reads)
    told, close = callback(progress)
    try:
        columns, warnings, stopped = _native.track(
            os.fsdecode(path),
            _rig(rig),
            reading.span(),
            reading.detected(),
            reading.opened(),
            wanted(marker, markers, also, same),
            None if edits is None else os.fsdecode(edits),
            written,
            told,
        )
    finally:
        close()
    nodes = nodes_of(columns)
    nodes.meta["warnings"] = [str(warning) for warning in warnings]
    if stopped is not None:
        stopped.nodes = nodes  # type: ignore[attr-defined]
        raise stopped
    lost = _loss(nodes)
    if lost is not None:
        warnings_of_python.warn(f"{shown(os.fsdecode(path))}: {lost}", RecordingWarning, stacklevel=3)
    return nodes


class Setup(NamedTuple):
    """The rig that `setup` found, and how far it can be believed.

    Attributes
    ----------
    rig : Rig
        Nodes, bodies, joints and the reference picture; places in px, x right, y down.
    warnings : list of str
        What to know of the rig and the recording, a sentence each.
    picture : ndarray of uint8, shape (H, W, 3)
        The reference picture with the rig and all other detections drawn; red, green, blue.
    """

    rig: Rig
    warnings: list[str]
    picture: NDArray[np.uint8]


@typed()
def setup(
    path: Path,
    output: Path | None = None,
    *,
    picture: Path | None = None,
    force: bool = False,
    fps: float | None = None,
    frames: Frames | None = None,
    threads: int | None = None,
    progress: Progress = None,
    marker: Places | None = None,
    markers: int | None = None,
    also: Numbers = (),
    same: Pairs = (),
    region: Region | None = None,
    threshold: float | None = None,
    polarity: Polarity = "auto",
    centroid: Centroid = "disc",
    min_area_px: float | None = None,
    max_area_px: float | None = None,
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> Setup:
    """The markers, bodies and joints of a recording, found by how they move.

    Parameters
    ----------
    path : path-like
        The recording; it is read through.
    output : path-like, optional
        A rig file to write, to be looked at and edited.
    picture : path-like, optional
        An image file to write, for example .png: the reference picture with all that was found.
    force : bool
        Whether to replace `output` and `picture` if they are there already.
    fps, frames, threads, progress, marker, markers, also, same : optional
        As in `track`; the rig keeps what was said of what to follow.
    region, threshold, polarity, centroid, min_area_px, max_area_px : optional
        As in `track`.
    decoder, interlaced, allow_protocol, pixel_aspect : optional
        As in `track`.

    Returns
    -------
    Setup
        Rig, warnings and picture.

    Raises
    ------
    SourceError, DetectError, ArgumentError
        As `track`.
    RigError
        If no rig can be found, or `output` is there already, is the recording, or cannot be written.
    FilmError
        If `picture` is there already, is the recording, or cannot be written.
    KeyboardInterrupt
        On Ctrl-C, within two seconds; nothing is written then.

    Notes
    -----
    Where it is not clear what is to be followed, the exception's ``picture`` shows what was found, each with its number
    and its path, and its ``candidates`` say a line of each; the file `picture` is then that picture.
    """
    reading = given(ReadingOptions, locals())
    target = None if output is None else os.fsdecode(output)
    written = _native.OutputSettings(target, existing="replace" if force else "refuse")
    told, close = callback(progress)
    try:
        text, warnings, drawn = _native.setup(
            os.fsdecode(path),
            reading.span(),
            reading.detected(),
            reading.opened(),
            wanted(marker, markers, also, same),
            written,
            None if picture is None else os.fsdecode(picture),
            told,
        )
    finally:
        close()
    return Setup(Rig.from_json(text), [str(warning) for warning in warnings], drawn)


@dataclass(frozen=True, eq=False)
class OverlayFilm(TableResult):
    """A film of K pictures with nodes drawn into their recording.

    Attributes
    ----------
    path : str
        The file, H.264.
    frame : ndarray of int64, shape (K,)
        Each picture's frame in the recording, from 0.
    t_s : ndarray of float, shape (K,)
        Each picture's time in the recording, s.
    play_fps : int
        Pictures a second at which it plays: picture k is at ``k / play_fps`` s of the film.
    """

    path: str
    frame: NDArray[np.int64]
    t_s: NDArray[np.float64]
    play_fps: int

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The pictures as columns of a table, a row each.

        Returns
        -------
        dict of str to ndarray, each of shape (K,)
            ``frame`` and ``time_s``.
        """
        return {"frame": self.frame, "time_s": self.t_s}


@typed()
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
    fps: float | None = None,
    threads: int | None = None,
    decoder: Decoder = "auto",
    interlaced: Interlaced = "refuse",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> OverlayFilm:
    """A film of a recording with its nodes, names, bodies, trails and gaps drawn in.

    Parameters
    ----------
    recording : path-like
        The recording that the nodes come from.
    nodes : Nodes or path-like
        Its nodes, or a table of them. Frames that they do not have are left out.
    output : path-like
        The film, H.264, for example .mp4.
    every : int
        Each such frame only is drawn, from the first of the nodes; trails go through the frames between.
    width : int, optional
        Width of the film in px, even; the height is in proportion. The recording's if not given.
    play_fps : int
        Pictures a second at which it plays.
    quality : int
        Rate factor of x264, 0 (best, largest) to 51.
    force : bool
        Whether to replace `output` if it is there already.
    progress, fps, threads, decoder, interlaced, allow_protocol, pixel_aspect : optional
        As in `track`.

    Returns
    -------
    OverlayFilm
        The film's file and which frames and times its pictures are of.

    Raises
    ------
    SourceError
        If the recording cannot be read.
    TableError
        If the nodes are not valid or not of this recording.
    FilmError
        If `output` is there already or cannot be written.
    ArgumentError
        If an argument makes no sense.
    KeyboardInterrupt
        On Ctrl-C, within two seconds; what was drawn is a whole film, and there is none where nothing was.
    """
    opening = given(OpenOptions, locals())
    table = [] if isinstance(nodes, Nodes) else [os.fsdecode(nodes)]
    if not isinstance(nodes, Nodes):
        nodes = read_nodes(nodes)
    drawing = _native.OverlaySettings(
        every=_count("every", every),
        width=None if width is None else _count("width", width),
        play_fps=_count("play_fps", play_fps),
        quality=_count("quality", quality),
    )
    film = _native.OutputSettings(os.fsdecode(output), existing="replace" if force else "refuse", reads=table)
    told, close = callback(progress)
    try:
        frame, t_s = _native.overlay_film(
            os.fsdecode(recording),
            nodes._columns(),
            nodes._meta_json(),
            opening.opened(),
            drawing,
            film,
            told,
        )
    finally:
        close()
    return OverlayFilm(os.fsdecode(output), frame, t_s, play_fps)


@typed()
def info(
    path: Path,
    *,
    fps: float | None = None,
    threads: int | None = None,
    decoder: Decoder = "auto",
    interlaced: Interlaced = "as-frames",
    allow_protocol: bool = False,
    pixel_aspect: PixelAspect | None = None,
) -> dict[str, Any]:
    """The facts of a recording before it is read through.

    Parameters
    ----------
    path : path-like
        The recording.
    fps, threads, decoder : optional
        As in `track`.
    interlaced : {"as-frames", "refuse"}
        As in `track`, but what interlaced film is, is told by default.
    allow_protocol, pixel_aspect : optional
        As in `track`.

    Returns
    -------
    dict
        ``name``, ``container``, ``codec``, ``width``, ``height`` (px), ``pixel_aspect`` (width to height of a pixel,
        "16:15"), ``pixel_aspect_origin`` ("recording", or "user" where it was given), ``depth_bits``,
        ``pixel_damage`` (whether damage to pixels is "noticed", "partly", "unnoticed" or "unknown"),
        ``declared_frames``, ``rate_hz``, ``rate_origin``, ``time_base`` (numerator and denominator of s per tick),
        ``size_bytes``, ``sha256_first_mib``, ``converted_from``, ``warnings`` and ``details``; ``frames`` that are
        there by their packets, without decoding any, and what its times are (``time``: ``kind``, ``rate_hz``,
        ``sigma_s``, ``gaps``, ``notes``, ...); None where unknown. Of a long recording only the first frames are
        looked at for these two.

    Raises
    ------
    SourceError
        If it cannot be opened, or its time stamps stand still.
    ArgumentError
        If an argument makes no sense.
    """
    opening = given(OpenOptions, locals())
    known: dict[str, Any] = json.loads(_native.info(os.fsdecode(path), opening.opened()))
    return known
