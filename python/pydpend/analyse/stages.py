"""What each stage of a run does: calls the public functions and writes what they give into a folder.

Nothing is computed here. ``here`` is the recording's folder with what earlier stages made, ``into`` the folder to
write to. Every function returns one sentence for ``run.json``.
"""

from __future__ import annotations

import importlib
import json
import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydpend.analyse.folder import write_whole
from pydpend.analyse.options import Options
from pydpend.analyse.state import Going, Note, Tell
from pydpend.documents import read_json
from pydpend.errors import PydpendError
from pydpend.fit_status import FitStatus
from pydpend.output import whole
from pydpend.run_folder import FIT_FOLDER, RunFile

if TYPE_CHECKING:
    from pydpend.analyse.recordings import Recording
    from pydpend.kinematics import LinkAngles
    from pydpend.nodes import Nodes


class DoesNotApply(PydpendError):
    """A stage that has no meaning for these recordings; nothing is wrong with them."""


def version() -> str:
    """The program's version."""
    from pydpend import _tracker

    return _tracker.VERSION


def _write_json(path: Path, value: Any) -> None:
    write_whole(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def _write_parquet(path: Path, columns: dict[str, Any]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    # A file, because pyarrow looks for addresses in names.
    with whole(path) as new, new.open("wb") as file:
        pq.write_table(pa.table(columns), file, use_dictionary=False)


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
    nodes = track_film(
        r.path,
        options.rig,
        fps=options.fps,
        pixel_aspect=options.pixel_aspect,
        threads=options.threads,
        output=into / RunFile.NODES,
        resume=resume,
        force=True,
        progress=_share(tell),
    )
    for note in nodes.meta.get("warnings", []):
        tell(Note(str(note)))
    count = len(nodes.rig.nodes)
    return f"{nodes.frame.size} frames, {count} node{'s' if count > 1 else ''}"


def markers(r: Recording, here: Path, into: Path) -> str:
    """How well each node was seen and how well it fits its body: ``residuals.parquet``, ``markers.json``."""
    import numpy as np

    from pydpend.kinematics import misfits

    nodes = _nodes(here, r)
    off = misfits(nodes)
    # Columns are numbered, because a node may be called anything; their names are in markers.json.
    columns = {"time_s": nodes.t_s} | {f"node{i}_px": off[:, i] for i in range(off.shape[1])}
    _write_parquet(into / RunFile.RESIDUALS, columns)
    known = np.isfinite(off)
    rows = [
        {
            "node": node.name,
            "body": node.body,
            "seen": float(nodes.seen[:, i].mean()),
            "residual_rms_px": float(np.sqrt(np.mean(off[known[:, i], i] ** 2)))
            if known[:, i].any()
            else None,
            "residual_largest_px": float(off[known[:, i], i].max()) if known[:, i].any() else None,
        }
        for i, node in enumerate(nodes.rig.nodes)
    ]
    _write_json(into / RunFile.MARKERS, {"nodes": rows})
    if not known.any():
        return "no body shows two nodes at once, so none can be compared with its shape"
    return f"RMS distance of a marker from its body's shape {math.sqrt(np.nanmean(off**2)):.4f} px"


def _nodes(here: Path, r: Recording) -> Nodes:
    from pydpend.nodes import read_nodes

    return read_nodes(here / RunFile.NODES if r.kind == "film" else r.path)


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
    rig = into / RunFile.ZERO_RIG
    _nodes(here, r).rig.write(rig)
    return track_film(
        path,
        rig,
        fps=options.fps,
        pixel_aspect=options.pixel_aspect,
        output=into / RunFile.ZERO,
        progress=False,
    )


def angles(r: Recording, options: Options, here: Path, into: Path) -> str:
    """Nodes, or anyone's angles, to ``angles.parquet``."""
    from pydpend.kinematics import angles as estimate
    from pydpend.kinematics import read_angles, write_angles

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
        nodes = _nodes(here, r)
        if all(nodes.rig.indices(body).size < 2 for body in nodes.rig.bodies):
            raise DoesNotApply("no body has two markers, so there is no link and no angle")
        found = estimate(
            nodes,
            estimator,
            zero=_hanging(r, options, here, into),
            bodies=options.bodies.split(",") if options.bodies else None,
            mirrored=options.mirrored,
            link_length_m=options.link_length_m,
            gaps="stop",
            name=r.name,
        )
    write_angles(found, into / RunFile.ANGLES)
    _write_json(into / RunFile.ANGLES_ABOUT, _plain(found.meta))
    return f"{found.links} link{'s' if found.links > 1 else ''}, {found.t_s.size} instants"


def _plain(value: Any) -> Any:
    """JSON-like with null for what is not a number."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _angles(folder: Path, found: tuple[Recording, ...]) -> list[LinkAngles]:
    from pydpend.kinematics import read_angles

    return [
        read_angles(folder / r.name / RunFile.ANGLES, name=r.name)
        for r in found
        if (folder / r.name / RunFile.ANGLES).exists()
    ]


def encoder(r: Recording, options: Options, here: Path, into: Path) -> str:
    """Calibrates the encoder and compares the film's phi1 with it."""
    from pydpend.encoder import calibrate, compare, encoder_angles, read_calibration, read_encoder, read_holds
    from pydpend.kinematics import read_angles
    from pydpend.plots.encoder import calibration_figure, comparison_figure
    from pydpend.plots.style import save

    film = read_angles(here / RunFile.ANGLES, name=r.name)
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
        line.write(into / RunFile.ENCODER)
        save(calibration_figure(line), into / RunFile.CALIBRATION_FIGURE)
    found = compare(film, encoder_angles(signal, line))
    write_whole(into / RunFile.COMPARISON, found.to_json())
    _write_parquet(into / RunFile.COMPARED, found.to_columns())
    save(comparison_figure(found), into / RunFile.COMPARISON_FIGURE)
    return f"RMS difference {math.degrees(found.rms_rad):.4f} deg"


def fit(found: tuple[Recording, ...], options: Options, folder: Path, into: Path, tell: Tell) -> str:
    """Damping of all recordings together, and of each if there are several."""
    from pydpend.damping import fit_damping
    from pydpend.damping.stored import write_fit
    from pydpend.model import CONSTANTS, model_called
    from pydpend.plots.damping import save_figures
    from pydpend.trials import fit_trials

    recordings, model = _angles(folder, found), model_called(options.model)
    chosen = options.joint_fit(len(found) > 1)
    trials = None
    if len(recordings) > 1:
        trials = fit_trials(
            recordings,
            model,
            chosen,
            progress=_steps(tell),
            alone=lambda k: tell(Going(f"recording {k + 1} alone")),
        )
        fitted = trials.joint
        write_whole(into / RunFile.TRIALS, trials.to_json())
    else:
        fitted = fit_damping(recordings, model, options=chosen, progress=_steps(tell))
    write_fit(fitted, into)
    if not options.pinned:
        sigmas = model.sigmas()
        constants = {
            n: {"value": v, "sigma": sigmas[n]}
            for n, v in zip(CONSTANTS, model.constants().tolist(), strict=True)
        }
        _write_json(into / RunFile.MODEL, {"name": model.name, "constants": constants})
    save_figures(fitted, trials, into)
    return fitted.message


def converged(folder: Path) -> bool:
    """Whether the fit of a run came to its end."""
    return read_json(folder / FIT_FOLDER / RunFile.FIT, PydpendError).text("status") == FitStatus.CONVERGED


def _steps(tell: Tell) -> Callable[[int, int, float], None]:
    return lambda step, most, chi2: tell(Going(f"step {step}, chi-square {chi2:.4g}"))


def prediction(found: tuple[Recording, ...], options: Options, folder: Path, into: Path, tell: Tell) -> str:
    """Each recording predicted from a fit of the others."""
    import numpy as np

    from pydpend.damping import fit_damping
    from pydpend.damping.single import reduced
    from pydpend.damping.stored import StoredFit
    from pydpend.model import model_called
    from pydpend.plots.damping import windows_columns

    recordings, model = _angles(folder, found), model_called(options.model)
    if options.pinned:
        recordings, model = reduced(recordings, model, True)
    out = {}
    for i, one in enumerate(recordings):
        tell(Going(f"{i + 1} of {len(recordings)}"))
        others = recordings[:i] + recordings[i + 1 :]
        fitted = fit_damping(others, model, options=options.fit.bare())
        stored = StoredFit.of(fitted)
        predicted = stored.predict(one, start_s=options.start_s, stop_s=options.stop_s)
        out[one.name] = predicted.to_dict()
        windows = windows_columns(predicted)
        (into / one.name).mkdir()
        np.savetxt(
            into / one.name / RunFile.WINDOWS,
            np.column_stack(list(windows.values())),
            fmt="%.9g",
            delimiter=",",
            header=",".join(windows),
            comments="",
        )
    _write_json(into / RunFile.PREDICTION, out)
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

    nodes = _nodes(here, r)
    every = max(1, -(-nodes.frame.size // MOST_PICTURES))
    width = min(PAGE_WIDTH_PX, nodes.rig.image_px[0])
    drawn = draw(
        r.path,
        nodes,
        into / RunFile.OVERLAY,
        every=every,
        width=width - width % 2,
        quality=OVERLAY_QUALITY,
        progress=_share(tell),
    )
    film = info(into / RunFile.OVERLAY)
    _write_json(
        into / RunFile.OVERLAY_ABOUT,
        {
            "rate_hz": drawn.play_fps,
            "every": every,
            "size_px": [film["width"], film["height"]],
            "times_s": drawn.t_s.tolist(),
        },
    )
    return f"{drawn.t_s.size} pictures, {'every frame' if every == 1 else f'one frame in {every}'}"


def report(folder: Path) -> None:
    """``report.html``."""
    from pydpend.report import write_report

    write_report(folder)
