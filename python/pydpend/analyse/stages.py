"""What each stage of a run does: calls the public functions and writes what they give into the run folder.

Nothing is computed here. Every function returns one sentence for ``run.json``.
"""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydpend.analyse.folder import RunFolder, file_digest, write_whole
from pydpend.analyse.options import Options
from pydpend.errors import PydpendError, fault

if TYPE_CHECKING:
    from pydpend.analyse.recordings import Recording
    from pydpend.angles import LinkAngles
    from pydpend.model import Model
    from pydpend.nodes import Nodes


def version() -> str:
    """The program's version."""
    from pydpend import _tracker

    return _tracker.VERSION


def file_key(name: str | None) -> str | None:
    """What stands for an option that may be a file: its bytes if it is one, else its words."""
    if name is None:
        return None
    path = Path(name)
    return file_digest(path) if path.exists() else name


def command(options: Options, folder: Path) -> str:
    """The command line that does this run again."""
    words = ["pydpend", "analyse", *options.inputs, "-o", str(folder)]
    default = Options()
    for f in fields(Options):
        value = getattr(options, f.name)
        if f.name == "inputs" or value == getattr(default, f.name):
            continue
        flag = "--" + f.name.removesuffix("_s").removesuffix("_deg").replace("_", "-")
        if isinstance(value, bool):
            words.append(flag if value else flag.replace("--", "--no-", 1))
        else:
            words += [flag, str(value)]
    return shlex.join(words)


def _write_json(path: Path, value: Any) -> None:
    write_whole(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def track(r: Recording, options: Options, here: Path) -> str:
    """Film to ``nodes.parquet``. An interrupted one is gone on with."""
    from pydpend.tracking import track as track_film

    here.mkdir(parents=True, exist_ok=True)
    nodes = track_film(
        r.path,
        options.rig,
        fps=options.fps,
        threads=options.threads,
        output=here / "nodes.parquet",
        resume=True,
        force=True,
    )
    return f"{nodes.frame.size} frames, {len(nodes.rig.nodes)} nodes"


def _nodes(here: Path, r: Recording) -> Nodes:
    from pydpend.nodes import read_nodes

    return read_nodes(here / "nodes.parquet" if r.kind == "film" else r.path)


def _hanging(options: Options, here: Path) -> Any:
    """The ``zero`` of `angles.angles`, tracking a reference film if one is named."""
    from pydpend.analyse.recordings import kind_of
    from pydpend.nodes import read_nodes

    zero = options.zero
    if zero in ("rest", "reference_frame"):
        return zero
    path = Path(zero)
    if path.exists():
        if kind_of(path) == "nodes":
            return read_nodes(path)
        from pydpend.tracking import track as track_film

        # The same rig, so that the markers have the same names.
        rig = here / "zero_rig.toml"
        rig.write_text(read_nodes(here / "nodes.parquet").rig.to_toml(), encoding="utf-8")
        return track_film(path, rig, fps=options.fps, output=here / "zero.parquet", force=True)
    try:
        return [math.radians(float(word)) for word in zero.split(",")]
    except ValueError:
        raise PydpendError(
            fault(
                "zero", f"{zero!r} is no file and no degrees", "Give rest, reference_frame, 180,180 or a film"
            )
        ) from None


def angles(r: Recording, options: Options, here: Path) -> str:
    """Nodes, or anyone's angles, to ``angles.parquet``."""
    from pydpend.angles import angles as estimate
    from pydpend.angles import read_angles, write_angles

    here.mkdir(parents=True, exist_ok=True)
    if r.kind == "angles":
        columns = None
        if options.columns is not None:
            pairs = [word.partition("=") for word in options.columns.split(",")]
            columns = {ours.strip(): theirs.strip() for ours, _, theirs in pairs}
        found = read_angles(
            r.path, columns=columns, hanging_rad=math.radians(options.hanging_deg), name=r.name
        )
    else:
        method: Any = options.estimator
        found = estimate(
            _nodes(here, r),
            method,
            zero=_hanging(options, here),
            link_length_m=options.link_length_m,
            gaps="stop",
            name=r.name,
        )
    write_angles(found, here / "angles.parquet")
    _write_json(here / "angles.json", _plain(found.meta))
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
    from pydpend.angles import read_angles

    return [
        read_angles(folder / r.name / "angles.parquet", name=r.name)
        for r in found
        if (folder / r.name / "angles.parquet").exists()
    ]


def _model(options: Options) -> Model:
    from pydpend.model import Model, derived, published

    if options.model == "derived":
        return derived("A")
    if options.model == "published":
        return published()
    return Model.from_toml(options.model)


def encoder(r: Recording, options: Options, here: Path) -> str:
    """Calibrates the encoder and compares the film's phi1 with it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pydpend.angles import read_angles
    from pydpend.encoder import calibrate, compare, encoder_angles, read_calibration, read_encoder, read_holds
    from pydpend.plots.encoder import calibration_figure, comparison_figure
    from pydpend.plots.style import inline_svg, save

    film = read_angles(here / "angles.parquet", name=r.name)
    signal = read_encoder(str(r.encoder), column=options.encoder_column)
    line = None
    if options.calibration is not None:
        path = Path(options.calibration)
        line = calibrate(read_holds([path])) if path.is_dir() else read_calibration(path)
        line.write(here / "encoder.json")
        write_whole(here / "calibration.svg", inline_svg(calibration_figure(line)))
    found = compare(film, encoder_angles(signal, line))
    write_whole(here / "comparison.json", found.to_json())
    pq.write_table(pa.table(found.to_columns()), here / "comparison.parquet")
    save(comparison_figure(found), here / "comparison.png")
    return f"RMS difference {math.degrees(found.rms_rad):.4f} deg"


def fit(found: tuple[Recording, ...], options: Options, folder: Path) -> str:
    """Damping of all recordings together, and of each if there are several."""
    import warnings

    from pydpend.damping import fit_damping
    from pydpend.damping.stored import write_fit
    from pydpend.plots.damping import save_figures
    from pydpend.trials import summary

    recordings = _angles(folder, found)
    with warnings.catch_warnings():
        # What is wrong with published constants is said by the fit itself, with numbers.
        warnings.simplefilter("ignore")
        model = _model(options)
    settings: dict[str, Any] = {
        "method": options.method,
        "laws": options.laws,
        "start_s": options.start_s,
        "stop_s": options.stop_s,
        "angle_maps": options.angle_maps,
    }
    fitted = fit_damping(recordings, model, predict=False, **settings)
    into = folder / "fit"
    into.mkdir(exist_ok=True)
    trials = None
    if len(recordings) > 1:
        trials = summary([fit_damping(a, model, **settings) for a in recordings], fitted)
        _write_json(into / "trials.json", trials.to_json())
    write_fit(fitted, into)
    save_figures(fitted, trials, into)
    return fitted.message


def prediction(found: tuple[Recording, ...], options: Options, folder: Path) -> str:
    """Each recording predicted from a fit of the others."""
    from pydpend.damping import fit_damping
    from pydpend.damping.stored import StoredFit

    recordings = _angles(folder, found)
    model = _model(options)
    out = {}
    for i, one in enumerate(recordings):
        others = recordings[:i] + recordings[i + 1 :]
        fitted = fit_damping(
            others,
            model,
            laws=options.laws,
            start_s=options.start_s,
            stop_s=options.stop_s,
            angle_maps=options.angle_maps,
        )
        stored = StoredFit.of(fitted)
        out[one.name] = stored.predict(one, start_s=options.start_s, stop_s=options.stop_s).to_json()
    _write_json(folder / "prediction.json", out)
    return f"{len(out)} recordings predicted"


def report(folder: Path) -> None:
    """``report.html``."""
    from pydpend.report import write_report

    write_report(folder)


def readme(run: RunFolder) -> str:
    """What lies in the folder, for a person who opens it in ten years."""
    lines = [
        f"A run of pydpend {run.facts['version']}.",
        "",
        "Made by:",
        f"  {run.facts['command']}",
        "",
        "report.html     the page for people: warnings, results, film, plots",
        "run.json        inputs with SHA-256, options, and what each stage was made from",
        "",
        "Stages:",
    ]
    for name, done in run.stages.items():
        lines.append(f"  {name}: {done['message']}")
        lines += [f"      {file}" for file in done["files"]]
    lines += [f"  {name}: not done: {why}" for name, why in run.facts.get("not_done", {}).items()]
    lines += [
        "",
        "Angles are in rad, counter-clockwise positive, zero hanging down; other units are in the names.",
        "",
    ]
    return "\n".join(lines)
