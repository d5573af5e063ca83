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
    Found,
    Frames,
    HeldColumns,
    Row,
    SegmentArrays,
    StartNumbers,
)
from pydpend.errors import Message
from pydpend.kinds import Kind

__all__ = [
    "CAMERA_BY_EYE",
    "VERSION",
    "DetectSettings",
    "EncodeSettings",
    "Film",
    "FrameReader",
    "IntegratorSettings",
    "Law",
    "LiveTracker",
    "OpenOptions",
    "OutputSettings",
    "OverlaySettings",
    "Ratio",
    "ShootingFit",
    "ShootingSettings",
    "SimulatedMotion",
    "Wanted",
    "arrow_reader",
    "check_outputs",
    "check_table",
    "command",
    "commands",
    "damage_words",
    "detect",
    "edited_table",
    "fingerprint",
    "follow_motion",
    "frame_range",
    "info",
    "kind_of",
    "laws",
    "learn_noise",
    "misplaced",
    "overlay_film",
    "plane_places",
    "plane_slopes",
    "poincare_section",
    "ratios",
    "read_meta",
    "read_rig",
    "read_table",
    "recorded_places",
    "recording_files",
    "rig_toml",
    "score_places",
    "setting_words",
    "setup",
    "shooting_fit",
    "shooting_segments",
    "shooting_trace",
    "simulate_ensemble",
    "simulate_motion",
    "smooth_angles",
    "tangent_growth",
    "track",
    "unit_powers",
    "write_rig",
    "write_table",
]

VERSION: str
CAMERA_BY_EYE: list[float]

def command(arguments: list[str]) -> int:
    """Runs a command of the tracker as ``pydpend`` does, and gives the exit status. Signals are its own then."""

def commands() -> str:
    """The commands of the tracker and their arguments, as JSON."""

def setting_words() -> dict[str, list[str]]:
    """The words of each setting that has words, the default first."""

def frame_range(text: str) -> tuple[int, int | None]:
    """The frames of ``A..B``, of which B may be left out."""

@final
class OpenOptions:
    """How a recording is opened; `pydpend.reading_options.OpenOptions` names each."""

    def __new__(
        cls,
        *,
        fps: float | None = None,
        decoder: str = "auto",
        interlaced: str = "refuse",
        allow_protocol: bool = False,
        threads: int = 0,
        pixel_aspect: str | None = None,
    ) -> Self: ...

@final
class DetectSettings:
    """Settings of detection; `pydpend.reading_options.DetectOptions` names each."""

    def __new__(
        cls,
        *,
        threshold: float | None = None,
        polarity: str = "auto",
        centroid: str = "disc",
        region: str | None = None,
        min_area_px: float | None = None,
        max_area_px: float | None = None,
    ) -> Self: ...

@final
class Wanted:
    """Markers to follow: places ``X,Y[@FRAME]``, a count, numbers of the picture, pairs of nodes that are one."""

    def __new__(
        cls,
        *,
        marker: Sequence[str] = ...,
        markers: int | None = None,
        also: Sequence[int] = ...,
        same: Sequence[tuple[str, str]] = ...,
    ) -> Self: ...

@final
class OutputSettings:
    """Where the result of a run goes: `existing` is ``refuse``, ``replace`` or ``resume``."""

    def __new__(
        cls,
        path: str | None,
        *,
        existing: str = "refuse",
        safe_csv: bool = False,
        reads: Sequence[str] = ...,
    ) -> Self: ...

@final
class FrameReader:
    """Frames of a film by their index; raises ArgumentError for one that is not there."""

    def __new__(cls, input: str, open: OpenOptions) -> Self: ...
    def frame(
        self, index: int
    ) -> tuple[NDArray[np.uint16] | None, int, tuple[NDArray[np.uint8], NDArray[np.uint8]] | None]:
        """Samples (H, W), None where not decoded, bits of a sample, blue and red differences, a byte each, flat."""

@final
class OverlaySettings:
    """How a film with what was found is drawn; `width` is in px."""

    def __new__(cls, *, every: int, width: int | None, play_fps: int, quality: int) -> Self: ...

@final
class EncodeSettings:
    """How a film is encoded, and where its truth goes; `bits` are those of a sample."""

    def __new__(
        cls,
        *,
        truth: str | None,
        codec: str | None,
        quality: int | None,
        x264_preset: str | None,
        gray_only: bool,
        bits: int | None,
    ) -> Self: ...

def edited_table(held: HeldColumns, meta: str, edits: str, name: str) -> Columns:
    """Columns with decisions made on them; `name` is for messages."""

def track(
    input: str,
    rig: str | None,
    frames: Frames,
    detect: DetectSettings,
    open: OpenOptions,
    wanted: Wanted,
    edits: str | None,
    output: OutputSettings,
    progress: Callback,
) -> tuple[Columns, list[Message], BaseException | None]:
    """Columns, warnings, and the exception that stopped the run, if one did. `rig` is JSON."""

def setup(
    input: str,
    frames: Frames,
    detect: DetectSettings,
    open: OpenOptions,
    wanted: Wanted,
    output: OutputSettings,
    picture: str | None,
    progress: Callback,
) -> tuple[str, list[Message], NDArray[np.uint8]]:
    """The rig as JSON, warnings, and the reference picture with the rig drawn, (H, W, 3), red, green, blue."""

def overlay_film(
    input: str,
    held: HeldColumns,
    meta: str,
    open: OpenOptions,
    film: OverlaySettings,
    output: OutputSettings,
    progress: Callback,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Of each of the film's K pictures the frame, (K,), and its time in the recording in s, (K,)."""

def recording_files(input: str | Path) -> list[Path]:
    """The files that a recording is read from; none for what is read once only."""

def fingerprint(files: list[Path]) -> str:
    """Hash that tells the contents of some files from others without reading all of them, in hexadecimal."""

def check_outputs(outputs: list[str], inputs: list[str], replace: bool) -> None:
    """Refuses outputs that would replace an input, one another or, unless `replace`, what is there already."""

def info(input: str, open: OpenOptions) -> str:
    """Description of a recording before it is read through, as JSON."""

def detect(
    image: NDArray[Any],
    settings: DetectSettings,
    depth_bits: int | None,
    aspect: str | None,
) -> Found:
    """Centres (D, 2) in px; sigma in px, area in px, peak, elongation (D, 4); flags (D,)."""

@final
class LiveTracker:
    """Follows the markers of a rig, image by image."""

    def __new__(cls, rig_text: str, settings: DetectSettings, depth_bits: int | None) -> Self: ...
    def learn(self, images: list[NDArray[Any]]) -> None:
        """Learns thresholds and noise from images of the scene."""

    def step(self, image: NDArray[Any], index: int) -> Row:
        """Places (N, 2) in px, sigma in px, area in px and status (N,) in the next image."""

    def detections(self) -> Found:
        """Detections in the last image."""

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

def plane_places(rig: str, recorded_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Recorded places (n, 2) in the plane of the bodies, px, and the most that lengths are stretched there, (n, 3)."""

def plane_slopes(rig: str, recorded_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes of places (n, 2) in the plane of the bodies by a, b, v1, v2 and k1 of the camera, px, (n, 2, 5)."""

def recorded_places(rig: str, plane_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (n, 2) of the plane in recorded pixels."""

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

    def write(self, encoding: EncodeSettings, output: OutputSettings) -> None:
        """Writes the film, and its truth if a file is named."""

def score_places(
    nodes: list[str],
    frame: NDArray[np.int64],
    xy_px: NDArray[np.float64],
    sigma_px: NDArray[np.float32],
    truth: Film | str,
    limit_px: float,
) -> str:
    """A table's places against the truth, as JSON: frames (T,), places in px (T, N, 2), sigmas in px (T, N)."""

@final
class Law:
    """A law of damping or driving and its coefficient: a row of the compiled half's table."""

    @property
    def name(self) -> str:
        """The coefficient's name."""

    @property
    def unit(self) -> str:
        """The coefficient's unit, SI."""

    @property
    def law(self) -> str:
        """``viscous``, ``quadratic``, ``load``, ``constant``, ``strip``, ``added mass``, ``tilt`` or ``offset``."""

    @property
    def share(self) -> str | None:
        """Share of the dissipated energy in which it counts, ``viscous``, ``drag`` or ``dry``; None: no loss."""

    @property
    def joint(self) -> str:
        """Joint and link in whose share it counts: ``upper``, ``lower`` or ``both``."""

    @property
    def words(self) -> str:
        """Words that people read for the coefficient."""

    @property
    def source(self) -> str:
        """Where in the paper it stands, or what it is for."""

    @property
    def is_of_the_paper(self) -> bool:
        """Whether it is one of Table 5 corrected."""

    @property
    def is_force(self) -> bool:
        """Whether it has a power and a work; else it changes inertia or gravity."""

    @property
    def is_signed(self) -> bool:
        """Whether the coefficient may be below zero."""

@final
class Ratio:
    """A constant of the model whose ratio to psi a fit may free."""

    @property
    def name(self) -> str:
        """The constant's name."""

    @property
    def unit(self) -> str:
        """The ratio's unit, SI."""

    @property
    def words(self) -> str:
        """Words that people read for it."""

    @property
    def is_of_one_link(self) -> bool:
        """Whether a pendulum of one link has it."""

def laws() -> list[Law]:
    """The laws, in the order of powers and works."""

def ratios() -> list[Ratio]:
    """The ratios, in the order of fits."""

@final
class IntegratorSettings:
    """How a motion is integrated."""

    def __new__(cls, *, tolerance: float, width_rad_s: float | None = None, pinned: bool = False) -> Self: ...

@final
class SimulatedMotion:
    """A motion at T samples, with E events."""

    @property
    def state(self) -> NDArray[np.float64]:
        """Angles in rad and rates in rad/s, (T, 4)."""

    @property
    def a(self) -> NDArray[np.float64]:
        """Accelerations in rad/s2, (T, 2)."""

    @property
    def normal(self) -> NDArray[np.float64]:
        """Normal forces in the joints in N, (T, 2)."""

    @property
    def dry(self) -> NDArray[np.float64]:
        """Dry torques in the joints in N m, (T, 2)."""

    @property
    def energy(self) -> NDArray[np.float64]:
        """In J, (T,)."""

    @property
    def works(self) -> NDArray[np.float64]:
        """Energy taken out by each of `laws` in J, (T, laws)."""

    @property
    def events(self) -> NDArray[np.float64]:
        """Time in s, joint (0 or 1), contact before and after: the sign of sliding, 0 stuck, NaN smooth; (E, 4)."""

    @property
    def at_rest(self) -> bool:
        """Whether both joints stuck for good."""

    @property
    def end_s(self) -> float:
        """When the motion ended."""

def simulate_motion(
    model: dict[str, float], state: list[float], times_s: NDArray[np.float64], settings: IntegratorSettings
) -> SimulatedMotion:
    """The motion from `state` (phi1, phi2 in rad, w1, w2 in rad/s), sampled at `times_s` (T,)."""

def simulate_ensemble(
    models: list[dict[str, float]],
    states: NDArray[np.float64],
    times_s: NDArray[np.float64],
    settings: IntegratorSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Motions of K `states` (K, 4) on all cores, one model for all or one each.

    States (K T, 4) in rad and rad/s, energies (K T,) in J, which came to rest (K,).
    """

def poincare_section(
    model: dict[str, float],
    state: list[float],
    duration_s: float,
    settings: IntegratorSettings,
    *,
    link: int,
    angle_rad: float,
    direction: float,
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

@final
class ShootingSettings:
    """Settings of a fit; `pydpend.damping.shooting.solve` names each."""

    def __new__(
        cls,
        *,
        free: list[str],
        bounded: list[str],
        clock: bool,
        zeros: bool,
        slack: Sequence[float],
        learned: bool,
        huber: float,
        max_iterations: int,
    ) -> Self: ...

@final
class ShootingFit:
    """A fit of K segments of R recordings with G shared parameters."""

    @property
    def parameters(self) -> dict[str, float]:
        """The model's and the laws' numbers, SI."""

    @property
    def clock_scale(self) -> float:
        """The motion's seconds to a second of the recording."""

    @property
    def camera_numbers(self) -> _Floats:
        """Numbers of each of C cameras, in units of their prior standard deviations, (C, 5)."""

    @property
    def zeros_rad(self) -> _Floats:
        """Zeros of the angles, (R, 2)."""

    @property
    def states(self) -> _Floats:
        """Angles in rad and rates in rad/s at the segments' starts, (K, 4)."""

    @property
    def information(self) -> _Floats:
        """Second derivatives of half chi-square, (G, G)."""

    @property
    def angle_information(self) -> _Floats:
        """Part of the information from the angles, (G, G)."""

    @property
    def jump_information(self) -> _Floats:
        """Part of the information from the jumps, (G, G)."""

    @property
    def jumps_shown(self) -> _Floats:
        """Variance that the jumps show over the slack's square, (4,)."""

    @property
    def gradient(self) -> _Floats:
        """Gradient of half chi-square, (G,)."""

    @property
    def scores(self) -> _Floats:
        """Each segment's part of the gradient, (K, G)."""

    @property
    def slack(self) -> _Floats:
        """Standard deviations allowed to the jumps, (4,)."""

    @property
    def own_sigma(self) -> _Floats:
        """Median standard deviations of a segment's state from its own samples, (4,)."""

    @property
    def jump_chi2(self) -> _Floats:
        """Mean squared jump over slack squared, (4,)."""

    @property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood but for a constant."""

    @property
    def cost(self) -> float:
        """Half the robust sum of squares."""

    @property
    def squares(self) -> _Floats:
        """Sum of weighted squared residuals of each link, (2,)."""

    @property
    def counts(self) -> _Ints:
        """Residuals of each link, (2,)."""

    @property
    def state_freedom(self) -> float:
        """Degrees of freedom that the states take up."""

    @property
    def state_covariance(self) -> _Floats:
        """Of each segment's state, (K, 4, 4)."""

    @property
    def transfer(self) -> _Floats:
        """Derivatives of each segment's end with respect to its start, (K, 4, 4)."""

    @property
    def stuck(self) -> int:
        """Segments in which a joint stuck."""

    @property
    def iterations(self) -> int:
        """Steps taken."""

    @property
    def status(self) -> str:
        """A value of `pydpend.fit_status.FitStatus`."""

def shooting_fit(
    recordings: Sequence[_Angles],
    segments: SegmentArrays,
    model: dict[str, float],
    start: StartNumbers,
    settings: ShootingSettings,
    *,
    cameras: Sequence[tuple[_Floats, int] | None],
    progress: Callable[[int, int, float], object] | None,
) -> ShootingFit:
    """The multiple-shooting fit, from `model`, `start` and the segments' states.

    `cameras`: of each recording what its camera does to the angles, (T, L, 5), rad, and which camera it is, from 0;
    or None.
    """

def shooting_trace(
    recordings: Sequence[_Angles], segments: SegmentArrays, model: dict[str, float], clock_scale: float
) -> tuple[_Ints, _Floats, _Floats]:
    """The motion of every segment at its R samples.

    Rows of recording, sample, segment (R, 3); states in rad and rad/s (R, 4); the power of each term in W for a
    coefficient of one, (R, laws).
    """

def follow_motion(
    model: dict[str, float], state: tuple[float, float, float, float], start_s: float, times_s: _Floats
) -> _Floats:
    """States at `times_s` (T,), ascending, from `state` at `start_s`: (T, 4) in rad and rad/s."""

def unit_powers(model: dict[str, float], state: _Floats, accelerations: _Floats) -> _Floats:
    """Powers (T, laws) for a coefficient of one along states (T, 4) and accelerations (T, 2) in rad/s2."""

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
