"""Draws one figure of a run folder alone, as PNG, SVG or PDF.

It is drawn from the files of the folder; the report's page is not needed.

  pydpend plot energy run/ -o energy.pdf
  pydpend plot neighbours run/ --frame 812 -o neighbours.svg
  pydpend plot angles both/ --recording trial1 -o angles.svg
"""

from __future__ import annotations

import argparse

from pydpend.cli.writes import add_force, check_files

HELP = "one figure of a run folder as PNG, SVG or PDF"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    p.add_argument("figure", type=_figure, choices=FIGURES, metavar="FIGURE", help=", ".join(FIGURES))
    p.add_argument("run_folder", metavar="RUN", help="a folder made by pydpend analyse")
    p.add_argument("-o", "--output", required=True, metavar="FILE", help=".png, .svg or .pdf")
    p.add_argument("--recording", metavar="NAME", help="which recording, where there are several")
    p.add_argument(
        "--frame",
        type=int,
        metavar="N",
        help="which frame, of neighbours and web; one with a gap if not given",
    )
    add_force(p)


FIGURES = (
    "nodes",
    "neighbours",
    "web",
    "angles",
    "phase",
    "amplitudes",
    "calibration",
    "comparison",
    "residuals",
    "energy",
    "coefficients",
    "ten",
    "shares",
    "prediction",
    "maps",
)


def _figure(word: str) -> str:
    """A figure's name; a file in its place is named as what it is."""
    from pydpend.kinds import kind_of, misplaced

    if word in FIGURES:
        return word
    said = misplaced(word, () if kind_of(word) == "run" else ("run",))
    if said is not None:
        raise argparse.ArgumentTypeError(str(said))
    return word


def run(args: argparse.Namespace) -> int:
    """Draws it."""
    from pydpend.errors import ArgumentError, fault
    from pydpend.plots.folder import figure_of
    from pydpend.plots.style import save

    check_files(args, args.output)
    figure = figure_of(args.figure, args.run_folder, args.recording, args.frame)
    try:
        save(figure, args.output)
    except OSError as error:
        raise ArgumentError(fault(f"-o {args.output}", f"cannot be written ({error.strerror})")) from None
    return 0
