"""The stages of a run: each calls public functions and writes their results into a folder.

Nothing is computed here. ``here`` is the recording's folder with what earlier stages made, ``into`` the folder to
write to. Every function returns one sentence for ``run.json``.
"""

from __future__ import annotations

import importlib
import math
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydpend.analyse.motion import no_pendulum
from pydpend.analyse.options import Options
from pydpend.analyse.state import DoesNotApply, Going, Note, Tell
from pydpend.errors import RecordingWarning
from pydpend.fit_folder import FitFolder
from pydpend.fit_status import FitStatus
from pydpend.recording_folder import RecordingFolder, RunFile, StoredOverlay
from pydpend.run_folder import fit_folder, write_predictions

if TYPE_CHECKING:
    from pydpend.analyse.recordings import Recording
    from pydpend.kinematics import LinkAngles
    from pydpend.nodes import Nodes


def version() -> str:
    """The program's version."""
    from pydpend import _native

    return _native.VERSION


def _share(tell: Tell) -> Callable[[str, int, int | None], None]:
    """The tracker's progress, told."""

    def progress(stage: str, done: int, total: int | None) -> None:
        tell(Going(stage, done / total) if total else Going(f"{stage}, {done} frames"))

    return progress


def _import_ahead() -> None:
    for name in ("scipy.special", "scipy.optimize", "matplotlib.figure"):
        importlib.import_module(name)


def track(r: Recording, options: Options, into: Path, tell: Tell, resume: bool) -> str:
    """Film to ``nodes.parquet``; ``resume``: go on with what an interrupted run of the same left."""
    from pydpend.tracking import track as track_film

    # Tracking is busy outside Python; what the stages after it compute with is imported meanwhile.
    threading.Thread(target=_import_ahead).start()
    with warnings.catch_warnings(record=True) as losses:
        warnings.simplefilter("always", RecordingWarning)
        nodes = track_film(
            r.path,
            options.rig,
            **options.reading(),
            **options.of_markers(),
            edits=options.edits,
            output=RecordingFolder(into).file(RunFile.NODES),
            resume=resume,
            force=True,
            progress=_share(tell),
        )
    for note in (*nodes.meta.get("warnings", []), *(loss.message for loss in losses)):
        tell(Note(str(note)))
    count = len(nodes.rig.nodes)
    return f"{nodes.frame.size} frames, {count} node{'s' if count > 1 else ''}"


def markers(r: Recording, here: Path, into: Path) -> str:
    """The sight of each node and its fit to its body: ``residuals.parquet``, ``markers.json``."""
    import numpy as np

    from pydpend.kinematics import misfits

    nodes = nodes_of(here, r)
    off = misfits(nodes)
    folder = RecordingFolder(into)
    folder.write_residuals(nodes.t_s, off)
    folder.write_markers(nodes, off)
    if not np.isfinite(off).any():
        return "no body shows two nodes at once, so none can be compared with its shape"
    return f"RMS distance of a marker from its body's shape {math.sqrt(np.nanmean(off**2)):.4f} px"


def nodes_of(here: Path, r: Recording) -> Nodes:
    """The nodes of a recording, tracked here or given."""
    from pydpend.nodes import read_nodes

    return RecordingFolder(here).nodes() if r.kind == "film" else read_nodes(r.path)


def _hanging(r: Recording, options: Options, here: Path, into: Path) -> Any:
    """The ``zero`` of `angles.angles`, tracking a reference film if one is named."""
    from pydpend.analyse.recordings import recording_kind
    from pydpend.kinematics import parse_zero
    from pydpend.nodes import read_nodes

    said = parse_zero(options.zero)
    if said is not None:
        return said
    path = Path(options.zero)
    if recording_kind(path) == "nodes":
        return read_nodes(path)
    from pydpend.tracking import track as track_film

    # The same rig, so that the markers have the same names.
    folder = RecordingFolder(into)
    rig = folder.file(RunFile.ZERO_RIG)
    nodes_of(here, r).rig.write(rig)
    # The frames are those of the recording that moves.
    reading = options.reading() | {"frames": None}
    return track_film(path, rig, **reading, output=folder.file(RunFile.ZERO), progress=False)


def angles(r: Recording, options: Options, here: Path, into: Path) -> str:
    """Nodes, or anyone's angles, to ``angles.parquet``."""
    from pydpend.kinematics import angles as estimate
    from pydpend.kinematics import read_angles
    from pydpend.kinematics.setting_words import axes_in_words, pivots_in_words

    if r.kind == "angles":
        columns = None
        if options.columns is not None:
            pairs = [word.partition("=") for word in options.columns.split(",")]
            columns = {ours.strip(): theirs.strip() for ours, _, theirs in pairs}
        found = read_angles(
            r.path,
            columns=columns,
            hanging_rad=math.radians(options.hanging_deg),
            clockwise=options.clockwise,
            unwrap=options.unwrap,
            name=r.name,
        )
    else:
        estimator: Any = options.estimator
        nodes = nodes_of(here, r)
        single = all(nodes.rig.indices(body).size < 2 for body in nodes.rig.bodies)
        if single and not nodes.rig.joints and not options.pivot:
            raise DoesNotApply("no body has two markers or a joint, so there is no link and no angle")
        zero = _hanging(r, options, here, into)
        with warnings.catch_warnings():
            # It is among the notes of the angles, which the report shows.
            warnings.simplefilter("ignore", RecordingWarning)
            found = estimate(
                nodes,
                estimator,
                zero=zero,
                bodies=options.bodies.split(",") if options.bodies else None,
                mirrored=options.mirrored,
                link_length_m=options.link_length_m,
                axis=axes_in_words(options.axis),
                pivot=pivots_in_words(options.pivot),
                gaps="stop",
                name=r.name,
            )
    RecordingFolder(into).write_angles(found)
    return f"{found.links} link{'s' if found.links > 1 else ''}, {found.t_s.size} instants"


def _angles(folder: Path, found: tuple[Recording, ...]) -> list[LinkAngles]:
    folders = [(r.name, RecordingFolder(folder / r.name)) for r in found]
    return [here.angles(name) for name, here in folders if here.file(RunFile.ANGLES).exists()]


def _check_pendulum(
    angles: list[LinkAngles], found: tuple[Recording, ...], options: Options, folder: Path
) -> None:
    """Raises DoesNotApply where the recordings are of another mechanism than a fit has equations for."""
    by_name = {r.name: r for r in found}
    made_of = [by_name[a.name] for a in angles]
    rigs = [None if r.kind == "angles" else nodes_of(folder / r.name, r).rig for r in made_of]
    why = no_pendulum(angles, rigs, options)
    if why is not None:
        raise DoesNotApply(why)


def encoder(r: Recording, options: Options, here: Path, into: Path) -> str:
    """Calibrates the encoder and compares the film's phi1 with it."""
    from pydpend.encoder import calibrate, compare, encoder_angles, read_calibration, read_encoder, read_holds
    from pydpend.plots.encoder import calibration_figure, comparison_figure
    from pydpend.plots.style import save

    film, folder = RecordingFolder(here).angles(r.name), RecordingFolder(into)
    unit: Any = options.unit
    signal = read_encoder(
        str(r.encoder),
        column=options.column,
        time_column=options.time_column,
        rate_hz=options.rate_hz,
        unit=unit,
    )
    line = None
    if options.calibration is not None:
        path = Path(options.calibration)
        line = calibrate(read_holds([path])) if path.is_dir() else read_calibration(path)
        line.write(folder.file(RunFile.ENCODER))
        save(calibration_figure(line), folder.file(RunFile.CALIBRATION_FIGURE))
    found = compare(film, encoder_angles(signal, line))
    folder.write_comparison(found)
    save(comparison_figure(found), folder.file(RunFile.COMPARISON_FIGURE))
    return f"RMS difference {math.degrees(found.rms_rad):.4f} deg"


def fit(found: tuple[Recording, ...], options: Options, folder: Path, into: Path, tell: Tell) -> str:
    """Damping of all recordings together, and of each if there are several."""
    from pydpend.damping import fit_damping
    from pydpend.model import model_called
    from pydpend.plots.damping import save_figures
    from pydpend.trials import fit_trials

    recordings, model = _angles(folder, found), model_called(options.model)
    _check_pendulum(recordings, found, options, folder)
    chosen = options.joint_fit(len(found) > 1)
    trials = None
    if len(recordings) > 1:
        trials = fit_trials(
            recordings,
            model,
            chosen,
            progress=_steps(tell),
            before_each=lambda k: tell(Going(f"recording {k + 1} alone")),
        )
        fitted = trials.joint
    else:
        fitted = fit_damping(recordings, model, options=chosen, progress=_steps(tell))
    files = FitFolder(into)
    files.write(fitted, trials)
    if not options.pinned:
        files.write_model(model)
    save_figures(fitted, trials, files)
    return fitted.message


def converged(folder: Path) -> bool:
    """Whether the fit of a run came to its end."""
    return fit_folder(folder).fit().status is FitStatus.CONVERGED


def _steps(tell: Tell) -> Callable[[int, int, float], None]:
    return lambda step, most, chi2: tell(Going(f"step {step}, chi-square {chi2:.4g}"))


def prediction(found: tuple[Recording, ...], options: Options, folder: Path, into: Path, tell: Tell) -> str:
    """Each recording predicted from a fit of the others."""
    from pydpend.damping import Prediction, fit_damping
    from pydpend.damping.single import reduced
    from pydpend.damping.stored import StoredFit
    from pydpend.model import model_called

    recordings, model = _angles(folder, found), model_called(options.model)
    _check_pendulum(recordings, found, options, folder)
    if options.pinned:
        recordings, model = reduced(recordings, model, True)
    out: dict[str, Prediction] = {}
    for i, one in enumerate(recordings):
        tell(Going(f"{i + 1} of {len(recordings)}"))
        others = recordings[:i] + recordings[i + 1 :]
        fitted = fit_damping(others, model, options=options.fit.bare())
        stored = StoredFit.of(fitted)
        out[one.name] = stored.predict(one, start_s=options.start_s, stop_s=options.stop_s)
    write_predictions(into, out)
    return f"{len(out)} recordings predicted"


MOST_PICTURES = 2000
"""The overlay film has at most this many pictures: 67 s at 30 a second, a page below 25 MB for any recording."""

PAGE_WIDTH_PX = 640
"""Its width, unless the recording is narrower."""

OVERLAY_QUALITY = 24
"""x264's rate factor."""


def overlay(r: Recording, here: Path, into: Path, tell: Tell) -> str:
    """The film with what was found drawn in, for the page: ``overlay.mp4`` and the times of its pictures."""
    from pydpend.tracking import info
    from pydpend.tracking import overlay as draw

    nodes, folder = nodes_of(here, r), RecordingFolder(into)
    every = max(1, -(-nodes.frame.size // MOST_PICTURES))
    width = min(PAGE_WIDTH_PX, nodes.rig.image_px[0])
    drawn = draw(
        r.path,
        nodes,
        folder.file(RunFile.OVERLAY),
        every=every,
        width=width - width % 2,
        quality=OVERLAY_QUALITY,
        progress=_share(tell),
    )
    film = info(folder.file(RunFile.OVERLAY))
    size = (int(film["width"]), int(film["height"]))
    folder.write_overlay(StoredOverlay(folder.file(RunFile.OVERLAY), drawn.t_s, drawn.play_fps, size, every))
    return f"{drawn.t_s.size} pictures, {'every frame' if every == 1 else f'one frame in {every}'}"


def report(folder: Path) -> tuple[str, ...]:
    """``report.html``; its warnings."""
    from pydpend.report import write_report

    return write_report(folder).warnings
