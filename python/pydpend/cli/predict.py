"""Predicts a recording with a fit: only the initial state of each window and the angle zeros are fitted.

Writes predict.json, windows.csv and a figure into DIR.

  pydpend predict trial3.parquet --fit damping/ -o predicted/
  pydpend predict trial3.parquet --fit damping/ --windows 0.25,1 --json -o predicted/
"""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path

from pydpend.cli.fit import add_angles_arguments, add_output_arguments, read
from pydpend.cli.flags import add_fields
from pydpend.cli.writes import check_files

HELP = "predict a recording from a fit to others"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    from pydpend.fit_options import FitOptions

    add_angles_arguments(p, many=False)
    add_fields(p, FitOptions, [f for f in fields(FitOptions) if f.name in ("start_s", "stop_s")])
    p.add_argument(
        "--fit", required=True, type=Path, metavar="DIR", help="folder (or fit.json) of pydpend fit"
    )
    p.add_argument("--windows", default="0.5,1,2", help="window lengths, s (default 0.5,1,2)")
    add_output_arguments(p)


def run(args: argparse.Namespace) -> int:
    """Predicts and writes."""
    from pydpend.damping.prediction import slashed
    from pydpend.errors import OptionError, Setting, fault
    from pydpend.fit_folder import load_fit
    from pydpend.number_words import numbers
    from pydpend.output import check_folder, results_folder, write_text
    from pydpend.tabular import write_csv

    check_folder(args.output)
    check_files(args, *(args.output / name for name in ("predict.json", "windows.csv", "windows.png")))
    windows = numbers(args.windows, "windows", is_pair=False)
    if min(windows) <= 0:
        advice = "Give lengths above 0, decimals with a point: 0.5,1,2"
        raise OptionError(fault(Setting("windows"), f"{min(windows):g} s is no length of a window", advice))
    stored = load_fit(args.fit)
    result = stored.predict(read(args.angles, args), windows, start_s=args.start_s, stop_s=args.stop_s)
    results_folder(args.output)
    write_text(args.output / "predict.json", result.to_json())
    write_csv(args.output / "windows.csv", result.to_columns())
    from pydpend.plots.damping import windows_figure
    from pydpend.plots.style import save

    save(windows_figure(result), args.output / "windows.png")
    if args.json:
        print(result.to_json(), end="")
    else:
        print(result.message)
        for title, group in (("in window", result.in_window), ("forecast", result.forecast)):
            for window, w in group.items():
                print(
                    f"{title} {window} s: RMS {slashed(w.rms_deg)} deg, "
                    f"median {slashed(w.median_deg)} deg, {w.n} windows"
                )
    return 0
