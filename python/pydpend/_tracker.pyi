"""The compiled half of pydpend; private. Everything here is wrapped by a public name.

Shapes: T frames, N nodes. Images are (H, W), uint8 or uint16. What is not seen is NaN.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self, final

import numpy as np
from numpy.typing import NDArray

from pydpend.crossing import (
    Callback,
    Columns,
    DetectArguments,
    Found,
    Frames,
    HeldColumns,
    OpenArguments,
    Row,
)
from pydpend.errors import Message
from pydpend.kinds import Kind

__all__ = [
    "VERSION",
    "Film",
    "LiveTracker",
    "arrow_reader",
    "check_outputs",
    "check_table",
    "damage_words",
    "detect",
    "fingerprint",
    "follow_motion",
    "info",
    "kind_of",
    "learn_noise",
    "misplaced",
    "overlay_film",
    "poincare_section",
    "read_meta",
    "read_rig",
    "read_table",
    "recording_files",
    "rig_toml",
    "score_places",
    "setup",
    "shooting_fit",
    "shooting_segments",
    "shooting_trace",
    "simulate_ensemble",
    "simulate_motion",
    "smooth_angles",
    "tangent_growth",
    "term_names",
    "track",
    "unit_powers",
    "write_rig",
    "write_table",
]

VERSION: str

def track(
    input: str,
    rig: str | None,
    frames: Frames,
    detect: DetectArguments,
    open: OpenArguments,
    output: str | None,
    existing: str,
    safe_csv: bool,
    reads: list[str],
    progress: Callback,
) -> tuple[Columns, list[Message], BaseException | None]:
    """Columns, warnings, and the exception that stopped the run, if one did. `rig` is JSON."""

def setup(
    input: str,
    frames: Frames,
    detect: DetectArguments,
    open: OpenArguments,
    output: str | None,
    picture: str | None,
    replace: bool,
    progress: Callback,
) -> tuple[str, list[Message], NDArray[np.uint8]]:
    """The rig as JSON, warnings, and the reference picture with the rig drawn, (H, W, 3), red, green, blue."""

def overlay_film(
    input: str,
    held: HeldColumns,
    meta: str,
    output: str,
    open: OpenArguments,
    every: int,
    width: int | None,
    play_fps: int,
    quality: int,
    replace: bool,
    reads: list[str],
    progress: Callback,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Of each of the film's K pictures the frame, (K,), and its time in the recording in s, (K,). `width` is in px."""

def recording_files(input: str | Path) -> list[Path]:
    """The files that a recording is read from; none for what is read once only."""

def fingerprint(files: list[Path]) -> str:
    """What tells the contents of some files from others without reading all of them, in hexadecimal."""

def check_outputs(outputs: list[str], inputs: list[str], replace: bool) -> None:
    """Refuses outputs that would replace an input, one another or, unless `replace`, what is there already."""

def info(input: str, open: OpenArguments) -> str:
    """What is known of a recording before it is read through, as JSON."""

def detect(
    image: NDArray[Any],
    settings: DetectArguments,
    area_px: tuple[float | None, float | None],
    depth_bits: int | None,
    aspect: str | None,
) -> Found:
    """Centres (D, 2) in px; sigma in px, area in px, peak, elongation (D, 4); flags (D,)."""

@final
class LiveTracker:
    """Follows the markers of a rig, image by image."""

    def __new__(cls, rig_text: str, settings: DetectArguments, depth_bits: int | None) -> Self: ...
    def learn(self, images: list[NDArray[Any]]) -> None:
        """Learns thresholds and noise from images of the scene."""

    def step(self, image: NDArray[Any], index: int) -> Row:
        """Places (N, 2) in px, sigma in px, area in px and status (N,) in the next image."""

    def detections(self) -> Found:
        """What was detected in the last image."""

def read_table(path: str) -> Columns:
    """Frame (T,), time in s (T,), centres in px (T, N, 2), sigma in px, area in px and status (T, N), JSON."""

def damage_words(damage: str) -> str | None: ...
def read_meta(path: str) -> str:
    """The metadata of a node table as JSON."""

def write_table(path: str, held: HeldColumns, meta: str, safe_csv: bool) -> None:
    """Writes a node table, Parquet or CSV by the ending."""

def check_table(held: HeldColumns, meta: str) -> None:
    """Checks the invariants of a node table."""

def arrow_reader(held: HeldColumns, rig: str) -> Any:
    """The rows as an Arrow stream; `rig` is JSON."""

def kind_of(path: str) -> Kind: ...
def misplaced(path: str, wanted: list[str]) -> Message | None: ...
def read_rig(path: str) -> str:
    """A rig file as JSON."""

def write_rig(path: str, rig: str) -> None:
    """Writes a rig, given as JSON, as TOML."""

def rig_toml(rig: str) -> str:
    """A rig's TOML from its JSON."""

@final
class Film:
    """A scene ready to be filmed: H x W pixels, T frames, N markers, L links."""

    @staticmethod
    def read(path: str, motion: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None) -> Film:
        """The film of a scene file; `motion` is times in s (T,) and angles in rad (T, L)."""

    @staticmethod
    def from_json(scene: str, motion: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None) -> Film:
        """The film of a scene as JSON; `motion` as in `read`."""

    @staticmethod
    def preset(name: str, seed: int) -> Film:
        """The film of one of the program's own scenes."""

    def scene(self) -> str:
        """The scene as JSON."""

    def rig_toml(self, frame: int) -> str:
        """The rig as it stands in a frame, TOML; places in px."""

    def image(self, frame: int) -> NDArray[Any]:
        """Recorded levels (H, W), uint8 or uint16."""

    def expected(self, frame: int) -> NDArray[np.float32]:
        """Expected levels (H, W)."""

    def truth(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Times (T,), centres (T, N, 2), visible part (T, N), angles (T, L)."""

    def write(
        self,
        output: str,
        truth: str | None,
        codec: str | None,
        quality: int | None,
        x264_preset: str | None,
        gray_only: bool,
        bits: int | None,
        safe_csv: bool,
        replace: bool,
        reads: list[str],
    ) -> None:
        """Writes the film, and its truth if a file is named; `bits` are those of a sample."""

def score_places(
    nodes: list[str],
    frame: NDArray[np.int64],
    xy_px: NDArray[np.float64],
    sigma_px: NDArray[np.float32],
    truth: Film | str,
    limit_px: float,
) -> str:
    """A table's places against the truth, as JSON: frames (T,), places in px (T, N, 2), sigmas in px (T, N)."""

def simulate_motion(
    model: dict[str, float],
    state: list[float],
    times_s: NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> dict[str, Any]:
    """The motion from `state` (phi1, phi2 in rad, w1, w2 in rad/s), sampled at `times_s` (T,).

    `state` (T, 4), `a` (T, 2) in rad/s2, `normal` (T, 2) in N, `dry` (T, 2) in N m, `energy` (T,) in J, `works`
    (T, terms) in J, `events` (E, 4): time in s, joint, contact before and after; `at_rest`, `end_s`, `steps`.
    """

def simulate_ensemble(
    models: list[dict[str, float]],
    states: NDArray[np.float64],
    times_s: NDArray[np.float64],
    *,
    tolerance: float,
    width_rad_s: float | None = None,
    pinned: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Motions of K `states` (K, 4) on all cores, one model for all or one each.

    States (K T, 4) in rad and rad/s, energies (K T,) in J, which came to rest (K,).
    """

def poincare_section(
    model: dict[str, float],
    state: list[float],
    duration_s: float,
    *,
    link: int,
    angle_rad: float,
    direction: float,
    tolerance: float,
    pinned: bool = False,
) -> NDArray[np.float64]:
    """Passages of link 0 or 1 through an angle: rows of time in s and state in rad and rad/s, (K, 5)."""

def tangent_growth(
    model: dict[str, float],
    state: list[float],
    interval_s: float,
    skipped: int,
    counted: int,
    tolerance: float,
) -> NDArray[np.float64]:
    """Rates of growth of a tangent vector in 1/s, one per counted interval, (counted,)."""

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Angles = tuple[_Floats, _Floats, _Floats]

def shooting_segments(
    recordings: Sequence[_Angles], spans: Sequence[tuple[float, float]], length_s: float, chained: bool
) -> tuple[_Ints, _Floats, _Floats]:
    """Segments of about `length_s` over the spans, s, of each recording.

    A recording is times in s (T,), angles and their sigmas in rad (T, 2).
    Rows (K, 4): recording, first sample, one past the last, chained; start and end in s (K, 2); states (K, 4).
    """

def shooting_fit(
    recordings: Sequence[_Angles],
    segment_rows: _Ints,
    segment_times: _Floats,
    segment_states: _Floats,
    model: dict[str, float],
    zeros: Sequence[tuple[float, float]],
    *,
    free: Sequence[str],
    bounded: Sequence[str],
    clock: bool,
    free_zeros: bool,
    slack: Sequence[float],
    learned: bool,
    huber: float,
    max_iterations: int,
    clock_scale: float = 1.0,
    progress: Callable[[int, int, float], object] | None = None,
) -> dict[str, Any]:
    """The multiple-shooting fit; `pydpend.damping.shooting` names the shapes and units of each argument and result."""

def shooting_trace(
    recordings: Sequence[_Angles],
    segment_rows: _Ints,
    segment_times: _Floats,
    segment_states: _Floats,
    model: dict[str, float],
    clock_scale: float,
) -> tuple[_Ints, _Floats, _Floats]:
    """The motion of every segment at its R samples.

    Rows of recording, sample, segment (R, 3); states in rad and rad/s (R, 4); the power of each term in W for a
    coefficient of one, (R, terms).
    """

def follow_motion(
    model: dict[str, float], state: tuple[float, float, float, float], start_s: float, times_s: _Floats
) -> _Floats:
    """States at `times_s` (T,), ascending, from `state` at `start_s`: (T, 4) in rad and rad/s."""

def term_names() -> list[tuple[str, str]]:
    """Name and unit of each term's coefficient, in the order of the powers."""

def unit_powers(model: dict[str, float], state: _Floats, accelerations: _Floats) -> _Floats:
    """Powers (T, terms) for a coefficient of one along states (T, 4) and accelerations (T, 2) in rad/s2."""

def learn_noise(
    t_s: NDArray[np.float64],
    phi_rad: NDArray[np.float64],
    sigma_rad: NDArray[np.float64],
    order: int,
    scale: bool,
    stretch_s: float,
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """The likeliest noise of one link's angles (T,).

    Factor on the sigmas, knots in s (K,), logarithms of the intensity (K,);
    `order` is the number of components carried, 3 or 4.
    """

def smooth_angles(
    t_s: NDArray[np.float64],
    phi_rad: NDArray[np.float64],
    sigma_rad: NDArray[np.float64],
    order: int,
    factor: float,
    knots_s: NDArray[np.float64],
    log_q: NDArray[np.float64],
    white: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, list[float]]:
    """Angle, rate and acceleration of one link, (T, 3) in rad, rad/s, rad/s2, and their covariances, (T, 3, 3).

    Then the logarithm of the likelihood and the three factors of the calibration by `white`, T unit normals.
    """
