"""The film maker: films of markers on links with known truth, to try a layout, a light and a frame rate.

A scene is a TOML file or the same as a dictionary; ``pydpend film --preset clean --print-scene`` prints one with every
part. The tracker knows no physics: a pendulum's motion comes as times and angles, for example from
:func:`pydpend.simulate`.

A frame's time is the middle of its exposure. Recorded levels are
``clip(round(mu + z * sqrt(read_noise**2 + shot_gain * max(mu - black, 0))), 0, top)`` with ``mu`` the expected level
(:meth:`Film.expected`) and ``z`` independent standard normal numbers, from the seed and the frame's index alone.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray
from pyarrow import csv, parquet

from pydpend import _native
from pydpend.columns import PARQUET_FAULTS
from pydpend.errors import FILM_TRUTH, FilmError, fault
from pydpend.output import AnyPath
from pydpend.tabular import TableResult
from pydpend.typed import typed, typed_class

StrPath: TypeAlias = AnyPath
Codec: TypeAlias = Literal["h264", "ffv1", "mjpeg", "raw"]

PRESETS = (
    *("clean", "noisy", "dim", "glints", "late", "dropout", "occluded", "fast"),
    *("triple", "pairs", "symmetric"),
)
"""The scenes that come with the program, by which tracking is judged."""


@dataclass(frozen=True, eq=False)
class Truth(TableResult):
    """The truth of a film of T frames, N markers and L links.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Middle of each exposure, s.
    xy_px : ndarray of float, shape (T, N, 2)
        Centres in px, x right, y down; given also where nothing can be seen.
    visible : ndarray of float, shape (T, N)
        Part of a marker's area that is seen, 0 to 1.
    phi_rad : ndarray of float, shape (T, L)
        Angles, rad, counter-clockwise positive, 0 hanging down.
    nodes, bodies : tuple of str
        Name of each marker and of its link.
    """

    t_s: NDArray[np.float64]
    xy_px: NDArray[np.float64]
    visible: NDArray[np.float64]
    phi_rad: NDArray[np.float64]
    nodes: tuple[str, ...]
    bodies: tuple[str, ...]

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The truth as columns of a table, as `Film.write` writes it.

        Returns
        -------
        dict of str to ndarray, each of shape (T N,)
            ``frame``, ``time_s``, ``node``, ``body``, ``x_px``, ``y_px``, ``visible`` and the angles ``phi1_rad``, ...,
            a row for each frame and marker.
        """
        frames, markers = self.visible.shape
        out: dict[str, NDArray[Any]] = {
            "frame": np.repeat(np.arange(frames), markers),
            "time_s": np.repeat(self.t_s, markers),
            "node": np.tile(np.array(self.nodes, dtype=object), frames),
            "body": np.tile(np.array(self.bodies, dtype=object), frames),
            "x_px": self.xy_px[:, :, 0].ravel(),
            "y_px": self.xy_px[:, :, 1].ravel(),
            "visible": self.visible.ravel(),
        }
        return out | {
            f"phi{k + 1}_rad": np.repeat(self.phi_rad[:, k], markers) for k in range(self.phi_rad.shape[1])
        }


@typed_class()
class Film:
    """A scene ready to be filmed; nothing in it changes.

    Parameters
    ----------
    scene : path-like or dict
        A TOML file's path, a dictionary of the same form, or the name of a preset.
    motion : tuple of ndarray, or object with ``t_s`` and ``phi_rad``, optional
        Times (T,) in s and angles (T, L) in rad of the links in the scene's order, counter-clockwise positive, 0
        hanging down (a simulation, link angles); the first time is frame 0.
    seed, frames : int, optional
        Seed of the noise and number of frames, in place of the scene's.
    rate_hz : float, optional
        Frames per s, in place of the scene's.

    Raises
    ------
    FilmError
        For a scene that makes no sense, naming line or key, or a motion too short.
    """

    def __init__(
        self,
        scene: StrPath | Mapping[str, Any],
        *,
        motion: Any = None,
        seed: int | None = None,
        frames: int | None = None,
        rate_hz: float | None = None,
    ) -> None:
        moving = _motion(motion)
        self._reads: list[str] = []
        changes = {
            key: value
            for key, value in (("seed", seed), ("frames", frames), ("rate_hz", rate_hz))
            if value is not None
        }
        if isinstance(scene, Mapping):
            self._film = _native.Film.from_json(json.dumps({**scene, **changes}), moving)
            return
        if scene in PRESETS:
            self._film = _native.Film.preset(str(scene), seed or 0)
        else:
            self._reads = [os.fsdecode(scene)]
            # A motion that is given here may stand for a scene that is not complete without one.
            self._film = _native.Film.read(os.fsdecode(scene), moving)
        if changes or (moving is not None and scene in PRESETS):
            self._film = _native.Film.from_json(json.dumps({**self.scene, **changes}), moving)

    @property
    def scene(self) -> dict[str, Any]:
        """The scene, with all that was left out filled in."""
        scene: dict[str, Any] = _without_none(json.loads(self._film.scene()))
        return scene

    @typed()
    def image(self, frame: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """The recorded levels of a frame.

        Parameters
        ----------
        frame : int
            Index of the frame, from 0.

        Returns
        -------
        ndarray of uint8 or uint16, shape (H, W)
            Levels; uint8 up to 8 bits, else uint16.

        Raises
        ------
        FilmError
            If the film has no such frame.
        """
        image: NDArray[np.uint8] | NDArray[np.uint16] = self._film.image(frame)
        return image

    @typed()
    def expected(self, frame: int) -> NDArray[np.float32]:
        """The expected levels of a frame: no noise, no rounding, no saturation.

        Parameters
        ----------
        frame : int
            Index of the frame, from 0.

        Returns
        -------
        ndarray of float32, shape (H, W)
            Levels.

        Raises
        ------
        FilmError
            If the film has no such frame.
        """
        return self._film.expected(frame)

    def truth(self) -> Truth:
        """The truth of every frame.

        Returns
        -------
        Truth
            Places, visibility and angles.
        """
        time, xy, visible, phi = self._film.truth()
        markers = self.scene.get("marker", [])
        return Truth(
            time,
            xy,
            visible,
            phi,
            nodes=tuple(m["name"] for m in markers),
            bodies=tuple(m["link"] for m in markers),
        )

    @typed()
    def rig_toml(self, frame: int = 0) -> str:
        """The rig file as a perfect ``pydpend setup`` would write it.

        Parameters
        ----------
        frame : int
            Index of the reference picture, from 0.

        Returns
        -------
        str
            TOML that `Rig.read` reads.
        """
        return self._film.rig_toml(frame)

    @typed()
    def write(
        self,
        output: StrPath,
        truth: StrPath | None = None,
        *,
        codec: Codec | None = None,
        quality: int | None = None,
        x264_preset: str | None = None,
        gray_only: bool = False,
        bits: int | None = None,
        safe_csv: bool = False,
        force: bool = False,
    ) -> None:
        """Writes the film and, if wanted, its truth. Each file takes its name when it is whole.

        Parameters
        ----------
        output : path-like
            The film; its ending decides the form: .mp4 .mov .mkv .avi, .mraw (with its .cih), .tif (pages), .y4m, or
            numbered images as in ``frames/%05d.png``.
        truth : path-like, optional
            The truth, .parquet or .csv, a row per frame and marker.
        codec : {"h264", "ffv1", "mjpeg", "raw"}, optional
            How pictures are coded; by the form if not given.
        quality : int, optional
            Rate factor of H.264, 0 to 51, or of MJPEG, 1 to 31; small is good.
        x264_preset : str, optional
            Preset of H.264, ultrafast to placebo.
        gray_only : bool
            Whether the film has no colour planes.
        bits : int, optional
            Bits per sample of a .mraw: 8, 10, 12 or 16.
        safe_csv : bool
            Whether names in the truth are marked for spreadsheets, see `Nodes.write`.
        force : bool
            Whether to replace files that are there already.

        Raises
        ------
        FilmError
            If the form cannot hold the film, a file is there already or is the scene's, or the film cannot be written.
        """
        encoding = _native.EncodeSettings(
            truth=None if truth is None else os.fsdecode(truth),
            codec=codec,
            quality=quality,
            x264_preset=x264_preset,
            gray_only=gray_only,
            bits=bits,
        )
        existing = "replace" if force else "refuse"
        written = _native.OutputSettings(
            os.fsdecode(output), existing=existing, safe_csv=safe_csv, reads=self._reads
        )
        self._film.write(encoding, written)


@typed()
def film(
    scene: StrPath | Mapping[str, Any],
    output: StrPath,
    truth: StrPath | None = None,
    motion: Any = None,
    *,
    seed: int | None = None,
    frames: int | None = None,
    rate_hz: float | None = None,
    codec: Codec | None = None,
    quality: int | None = None,
    x264_preset: str | None = None,
    gray_only: bool = False,
    bits: int | None = None,
    safe_csv: bool = False,
    force: bool = False,
) -> Film:
    """A scene filmed into a file.

    Parameters
    ----------
    scene : path-like or dict
        A TOML file's path, a dictionary of the same form, or the name of a preset.
    output : path-like
        The film; its ending decides the form, as in `Film.write`.
    truth : path-like, optional
        The truth, .parquet or .csv, a row per frame and marker.
    motion, seed, frames, rate_hz : optional
        As in `Film`.
    codec, quality, x264_preset, gray_only, bits, safe_csv, force : optional
        As in `Film.write`.

    Returns
    -------
    Film
        The film, which knows its truth.

    Raises
    ------
    FilmError
        As `Film` and `Film.write`.
    """
    made = Film(scene, motion=motion, seed=seed, frames=frames, rate_hz=rate_hz)
    made.write(
        output,
        truth,
        codec=codec,
        quality=quality,
        x264_preset=x264_preset,
        gray_only=gray_only,
        bits=bits,
        safe_csv=safe_csv,
        force=force,
    )
    return made


def read_truth(path: StrPath) -> Truth:
    """Reads the truth that was written beside a film, .parquet or .csv; angles are those of all its links.

    Raises :class:`pydpend.FilmError` for a file that is not one, naming the column.
    """
    name = os.fsdecode(path)
    try:
        # A file, because pyarrow looks for addresses in names.
        with open(name, "rb") as file:
            table = (
                csv.read_csv(file)
                if name.endswith(".csv")
                else parquet.read_table(file, page_checksum_verification=True)
            )
    except PARQUET_FAULTS as problem:
        said = " ".join(str(problem).split())
        raise FilmError(fault(name, f"the truth cannot be read ({said})")) from None
    wanted = ["frame", "time_s", "node", "body", "x_px", "y_px", "visible", "phi1_rad"]
    missing = [column for column in wanted if column not in table.column_names]
    if missing:
        advice = "Give the table that " + FILM_TRUTH + " wrote"
        raise FilmError(fault(name, f"there is no column {missing[0]}", advice, place=missing[0]))

    def numbers(key: str, kind: pa.DataType) -> NDArray[Any]:
        if table.column_names.count(key) > 1:
            raise FilmError(fault(name, "the column is there twice", "Rename one", place=f"column {key}"))
        try:
            return np.asarray(table[key].cast(kind).to_numpy())
        except pa.ArrowException:
            problem = f"it holds {table[key].type}, not {kind}"
            raise FilmError(fault(name, problem, "Give the whole table", place=f"column {key}")) from None

    frame = numbers("frame", pa.int64())
    count = int(np.count_nonzero(frame == frame[0])) if len(frame) else 0
    if count == 0 or len(frame) % count or np.any(frame.reshape(-1, count) != frame[::count, None]):
        raise FilmError(fault(name, "it has not all markers in each frame", "Give the whole table"))

    def column(key: str) -> NDArray[np.float64]:
        return numbers(key, pa.float64()).reshape(-1, count)

    def names(key: str) -> tuple[str, ...]:
        words = [str(word) for word in table[key].slice(0, count).to_pylist()]
        # A CSV marks names that a spreadsheet would take for formulas.
        marked = re.compile("'+[=+@\t\r-]")
        return tuple(w[1:] if name.endswith(".csv") and marked.match(w) else w for w in words)

    links = [f"phi{k}_rad" for k in range(1, len(table.column_names)) if f"phi{k}_rad" in table.column_names]
    return Truth(
        t_s=column("time_s")[:, 0],
        xy_px=np.stack([column("x_px"), column("y_px")], axis=-1),
        visible=column("visible"),
        phi_rad=np.stack([column(key)[:, 0] for key in links], axis=-1),
        nodes=names("node"),
        bodies=names("body"),
    )


def _motion(motion: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Times (T,) and angles (T, L) of whatever moves."""
    if motion is None:
        return None
    pair: tuple[ArrayLike, ArrayLike]
    if hasattr(motion, "t_s") and hasattr(motion, "phi_rad"):
        pair = (motion.t_s, motion.phi_rad)
    else:
        try:
            first, second = motion
        except (TypeError, ValueError):
            raise FilmError(
                fault("motion", "it is not times and angles", "Give (t_s, phi_rad) or a simulation")
            ) from None
        pair = (first, second)
    t_s = np.ascontiguousarray(pair[0], dtype=np.float64)
    phi_rad = np.ascontiguousarray(pair[1], dtype=np.float64)
    if t_s.ndim != 1 or phi_rad.ndim != 2 or len(t_s) != len(phi_rad):
        raise FilmError(
            fault(
                "motion",
                f"times of shape {t_s.shape} and angles of shape {phi_rad.shape} do not go together",
                "Give t_s (T,) and phi_rad (T, L)",
            )
        )
    return t_s, phi_rad


def _without_none(value: Any) -> Any:
    """Leaves out keys without a value, as TOML does."""
    if isinstance(value, dict):
        return {key: _without_none(v) for key, v in value.items() if v is not None}
    if isinstance(value, list):
        return [_without_none(v) for v in value]
    return value
