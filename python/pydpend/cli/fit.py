"""Damping of each joint from the angles of one or several free decays.

Writes fit.json, coefficients.csv, and per recording a table of energies, one of residuals and
figures into DIR; with several recordings also trials.json and its figure. docs/explanation/damping.md says
what is estimated and how to read it.

  pydpend fit trial1.parquet trial2.parquet trial3.parquet -o damping/
  pydpend fit angles.csv --columns time_s=t,phi1_rad=theta1,phi2_rad=theta2 --model pendulum.toml -o damping/
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from pydpend.cli.flags import add_fields, given
from pydpend.cli.writes import add_force, check_files
from pydpend.terminal import below

if TYPE_CHECKING:
    from pydpend.damping import DampingFit, Estimate, RatioCheck
    from pydpend.kinematics import LinkAngles

HELP = "damping of each joint from angles of free decays"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    from pydpend.fit_options import FitOptions

    add_angles_arguments(p, many=True)
    p.add_argument(
        "--model",
        default="derived",
        help="derived (default), published, a pendulum's TOML file, or ratios (no masses are known: all is over psi)",
    )
    add_fields(p, FitOptions, fields(FitOptions))
    p.add_argument("--no-figures", action="store_true", help="write no figures")
    add_output_arguments(p)


def add_angles_arguments(p: argparse.ArgumentParser, *, many: bool) -> None:
    """Arguments that say which angles, and how they are to be understood."""
    p.add_argument(
        "angles",
        metavar="ANGLES",
        nargs="+" if many else None,
        help="angles table (Parquet, CSV) or a folder of the paper's authors' form (DPmean_data_RB0.npy ...)",
    )
    add_table_arguments(p)


def add_table_arguments(p: argparse.ArgumentParser) -> None:
    """Options of reading an angles table; of every command that reads one."""
    p.add_argument(
        "--columns",
        default="",
        metavar="OURS=THEIRS,...",
        help="the angles table's columns: time_s=t,phi1_rad=theta1",
    )
    p.add_argument(
        "--hanging",
        dest="hanging_deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="angle in degrees that the angles table has when the links hang straight down (default 0)",
    )
    p.add_argument("--clockwise", action="store_true", help="the angles table counts clockwise positive")
    p.add_argument(
        "--unwrap",
        action="store_true",
        help="the angles table keeps its angles within one turn; rows are taken to be less than half a turn apart",
    )


def add_output_arguments(p: argparse.ArgumentParser) -> None:
    """Options of the results' folder and of how much is said."""
    p.add_argument("-o", "--output", required=True, metavar="DIR", type=Path, help="folder for the results")
    add_force(p)
    p.add_argument("--json", action="store_true", help="the result as JSON on stdout")
    p.add_argument("--quiet", action="store_true", help="no progress")


def read(path: str, args: argparse.Namespace) -> LinkAngles:
    """Angles as the arguments say."""
    from pydpend.errors import OptionError, Setting, fault
    from pydpend.kinematics import read_angles

    pairs = [item.split("=", 1) for item in args.columns.split(",") if item]
    if any(len(pair) != 2 for pair in pairs):
        raise OptionError(
            fault(Setting("columns"), f"{args.columns!r} is not OURS=THEIRS,...", "Write time_s=t,...")
        )
    return read_angles(
        path,
        columns=dict(pairs) or None,
        hanging_rad=math.radians(args.hanging_deg),
        clockwise=args.clockwise,
        unwrap=args.unwrap,
    )


def progress(label: str, quiet: bool) -> Callable[[int, int, float], None] | None:
    """Iteration, chi-square and time left on stderr, when it is a terminal."""
    if quiet or not sys.stderr.isatty():
        return None
    begun = time.monotonic()

    def report(step: int, most: int, chi2: float) -> None:
        left = (time.monotonic() - begun) / step * (most - step)
        print(
            f"\r{label}: step {step}, chi-square {chi2:.4g}, at most {left:.0f} s left ",
            end="",
            file=below(sys.stderr),
        )

    return report


def run(args: argparse.Namespace) -> int:
    """Fits and writes. 1 when the fit did not converge."""
    from pydpend.damping import fit_damping
    from pydpend.fit_folder import FitFolder
    from pydpend.fit_options import FitOptions
    from pydpend.fit_status import FitStatus
    from pydpend.model import model_called
    from pydpend.output import check_folder, results_folder
    from pydpend.trials import fit_trials

    options = FitOptions(**given(args, fields(FitOptions)))
    options.check_own_prediction()
    check_folder(args.output)
    folder = FitFolder(args.output)
    check_files(args, *folder.files(len(args.angles), figures=not args.no_figures, maps=options.angle_maps))
    recordings = [read(path, args) for path in args.angles]
    model = model_called(args.model)
    chosen = options.as_programs_do()
    report = progress("fit", args.quiet)
    trials = None
    if len(recordings) > 1:
        trials = fit_trials(recordings, model, chosen, progress=report)
        fit = trials.joint
    else:
        fit = fit_damping(recordings, model, options=chosen, progress=report)
    if report is not None:
        print(file=sys.stderr)
    results_folder(args.output)
    folder.write(fit, trials)
    if not args.no_figures:
        from pydpend.plots.damping import save_figures

        save_figures(fit, trials, folder)
    if args.json:
        print(fit.to_json(), end="")
    else:
        for line in describe(fit):
            print(line)
    return 0 if fit.status is FitStatus.CONVERGED else 1


def describe(fit: DampingFit) -> list[str]:
    """The result in lines for a reader."""
    from pydpend.damping.prediction import slashed

    warned = [note for note in fit.notes if note.startswith("warning: ")]
    lines = [fit.message, *warned]
    for name, e in fit.coefficients.items():
        lines.append(f"{name:12s} {e.value: .4e} +- {e.sigma:.1e} {e.unit}")
    for name, e in ({} if fit.ten is None else fit.ten.values).items():
        lines.append(f"of ten: {name:8s} {e.value: .4e} +- {e.sigma:.1e} {e.unit}")
    for name, e in fit.ratios.items():
        beside = "" if fit.consistency is None else _beside(fit.consistency.ratios[name])
        lines.append(f"{name + '/psi':12s} {e.value: .6g} +- {e.sigma:.1e} {e.unit}{beside}")
    lines += [interval.sentence(name) for name, interval in fit.intervals.items()]
    swings = ", ".join(f"{f:.4f}" for f in fit.modes_hz)
    lines.append(f"small oscillations of the fitted pendulum: {swings} Hz")
    for recording in fit.inputs:
        if recording.tail_modes_hz:
            seen = ", ".join(f"{f:.4f}" for f in recording.tail_modes_hz)
            swing = " and ".join(f"{d:.2g}" for d in recording.tail_swing_deg)
            lines.append(
                f"measured in the last seconds of {recording.name}, swinging by up to {swing} deg: {seen} Hz"
            )
    for group in ("law", "joint"):
        parts = ", ".join(_share(k, e) for k, e in fit.shares[group].items())
        lines.append(f"energy by {group}: {parts}")
    for window, p in fit.prediction.items():
        lines.append(f"prediction, {window} s windows: {slashed(p.rms_deg)} deg RMS")
    rest = [note for note in fit.notes if note not in warned]
    return [*lines, *(t.sentence for t in fit.terms), *fit.identifiability.sentences, *rest]


def _share(name: str, share: Estimate) -> str:
    """A share of the energy lost, in words where it is not determined."""
    if not math.isfinite(share.value):
        return f"{name} none (no energy was lost to these laws)"
    if not share.sigma < 1.0:
        return f"{name} not determined"
    return f"{name} {100 * share.value:.1f} +- {100 * share.sigma:.1f} %"


def _beside(ratio: RatioCheck) -> str:
    """Words on a ratio by the model's parts."""
    parts = ratio.parts
    said = f"{parts.value:.6g} +- {parts.sigma:.1e}" if parts.sigma > 0 else f"{parts.value:.6g}"
    return f" (the parts: {said}, {ratio.sigmas:+.1f} sigma)"
