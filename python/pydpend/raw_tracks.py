"""Tracks as a file or a caller gives them, before they are a node table; and rows of a long table put into frames.

Knows nothing of files: who reads one fills a `RawTracks`, and `pydpend.node_arrays` makes what nodes hold of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import TableError, fault

Floats = NDArray[np.float64]

MOST_CELLS = 100_000_000
"""Frames times nodes of a table at most, 3 GB in memory: more are tracks of thousands of particles."""


@dataclass(frozen=True, eq=False)
class RawTracks:
    """T frames of N points in D = 2 or 3 coordinates. What is not there is NaN.

    Attributes
    ----------
    form : str
        Name of the form that they came in, for people.
    source : str
        File that they came from, for messages.
    names : tuple of str
        Names of the points.
    frame : ndarray of int64, shape (T,)
        Frame numbers from 0, increasing.
    xyz : ndarray of float, shape (T, N, D)
        Places in `unit`.
    t_s : ndarray of float, shape (T,), or None
        Times in s; None where the source has none.
    bodies : tuple of str or None
        Body of each point; None where the source has none.
    sigma : ndarray of float, shape (T, N), or None
        Standard uncertainty of each coordinate in `unit`.
    confidence : ndarray of float, shape (T, N), or None
        What the source thinks of each place, 0 to 1.
    status : ndarray of uint8, shape (T, N), or None
        States as `pydpend.marker_status` numbers them.
    area_px : ndarray of float, shape (T, N), or None
        Areas of the blobs, px.
    unit : str
        ``px``, ``m``, ``cm``, ``mm``, ``um``, another word that the source has, or "" where it has none.
    is_y_up : bool
        Whether y, the second coordinate, grows upwards.
    image_px : tuple of int or None
        Width and height of the pictures.
    least_confidence : float
        Confidence below which the source's own program takes a place for wrong.
    facts : dict
        What else stands in the source, for the table's metadata.
    notes : list of str
        What was assumed or left out, in sentences.
    """

    form: str
    source: str
    names: tuple[str, ...]
    frame: NDArray[np.int64]
    xyz: Floats
    t_s: Floats | None = None
    bodies: tuple[str, ...] | None = None
    sigma: Floats | None = None
    confidence: Floats | None = None
    status: NDArray[np.uint8] | None = None
    area_px: Floats | None = None
    unit: str = "px"
    is_y_up: bool = False
    image_px: tuple[int, int] | None = None
    least_confidence: float = 0.0
    facts: dict[str, str | float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a long table, one per frame and point (R of them), and where each stands in its file.

    Attributes
    ----------
    source : str
        The file, for messages.
    frame : ndarray of float, shape (R,)
        Frame numbers; NaN is refused.
    point : sequence of str
        Name of the point of each row (R).
    place : callable
        Where a row stands, from its number: ``line 12``.
    t_s : ndarray of float, shape (R,), or None
        Times, s.
    """

    source: str
    frame: Floats
    point: Sequence[str]
    place: Callable[[int], str]
    t_s: Floats | None = None

    def check_frames(self) -> NDArray[np.int64]:
        """The frame numbers as whole ones (R,). Raises TableError naming the row of one that is not."""
        bad = np.flatnonzero(
            ~(np.isfinite(self.frame) & (self.frame == np.round(self.frame)) & (self.frame >= 0))
        )
        if bad.size:
            row = int(bad[0])
            said = "empty" if np.isnan(self.frame[row]) else f"{self.frame[row]:g}"
            problem = f"the frame is {said}, and a whole number from 0 is expected"
            raise TableError(fault(self.source, problem, "Number the frames", place=self.place(row)))
        return self.frame.astype(np.int64)


@dataclass(frozen=True, eq=False)
class Pivoted:
    """Long rows in frames: numbers (T,), times (T,) or None, names of the N points, and where each row goes."""

    frame: NDArray[np.int64]
    t_s: Floats | None
    names: tuple[str, ...]
    at: tuple[NDArray[np.intp], NDArray[np.intp]]
    source: str
    place: Callable[[int], str]

    def spread(self, values: Floats) -> Floats:
        """Values of the rows (R, ...) in frames (T, N, ...), NaN where there is no row."""
        out = np.full((self.frame.size, len(self.names), *values.shape[1:]), np.nan)
        out[self.at] = values
        return out

    def words_of(self, words: Sequence[str]) -> tuple[str, ...]:
        """The one word that each point has in all its rows (N). Raises TableError naming a row with another."""
        found: dict[int, tuple[int, str]] = {}
        for row, (n, word) in enumerate(zip(self.at[1].tolist(), words, strict=True)):
            first, known = found.setdefault(n, (row, word))
            if word != known:
                problem = f"{self.names[n]} is of {word!r} here and of {known!r} in {self.place(first)}"
                raise TableError(fault(self.source, problem, "Give a node one body", place=self.place(row)))
        return tuple(found[n][1] for n in range(len(self.names)))


def pivot(rows: Rows) -> Pivoted:
    """Long rows put into frames; points in the order in which they come first.

    Raises
    ------
    TableError
        If a point has two rows in one frame, the times of a frame's rows differ, or there are too many points.
    """
    if not len(rows.frame):
        raise TableError(fault(rows.source, "it has no rows", "Give a file with tracks in it"))
    numbers = rows.check_frames()
    frame, at_frame = np.unique(numbers, return_inverse=True)
    order: dict[str, int] = {}
    at_point = np.array([order.setdefault(name, len(order)) for name in rows.point], dtype=np.intp)
    names = tuple(order)
    if frame.size * len(names) > MOST_CELLS:
        problem = f"{len(names)} points in {frame.size} frames are more than {MOST_CELLS} places"
        raise TableError(
            fault(rows.source, problem, "Leave out short tracks, which are no markers of a mechanism")
        )
    cell = at_frame * len(names) + at_point
    first = np.full(frame.size * len(names), -1, dtype=np.int64)
    # The last assignment wins: backwards, the first row of each cell stands in the end.
    first[cell[::-1]] = np.arange(cell.size)[::-1]
    twice = np.flatnonzero(first[cell] != np.arange(cell.size))
    if twice.size:
        row = int(twice[0])
        before = rows.place(int(first[cell[row]]))
        problem = f"{rows.point[row]} has a second place in frame {numbers[row]}, the first is in {before}"
        raise TableError(fault(rows.source, problem, "Leave one of them", place=rows.place(row)))
    return Pivoted(frame, _frame_times(rows, numbers, at_frame, frame.size), names, (at_frame, at_point), rows.source,
                   rows.place)  # fmt: skip


def _frame_times(rows: Rows, numbers: NDArray[np.int64], at: NDArray[np.intp], frames: int) -> Floats | None:
    """The time of each frame (T,). Raises TableError for rows of one frame with different times."""
    if rows.t_s is None:
        return None
    out = np.full(frames, np.nan)
    given = np.isfinite(rows.t_s)
    out[at[given][::-1]] = rows.t_s[given][::-1]
    other = np.flatnonzero(given & (rows.t_s != out[at]))
    if other.size:
        row = int(other[0])
        problem = (
            f"{rows.point[row]} is at {float(rows.t_s[row])!r} s in frame {numbers[row]}, and others of this frame at "
            f"{float(out[at[row]])!r} s"
        )
        raise TableError(
            fault(rows.source, problem, "Give all points of a frame one time", place=rows.place(row))
        )
    return out
