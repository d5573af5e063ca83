"""Films a recording beside the simulation of the pendulum that was fitted to it.

Left the film with what was found (or its angles as links, where there is no film), right the motion of the fitted
equations from the state at --start that fits the second after it best, below the angles of both. A double pendulum is
chaotic: while it tumbles the two part after a second or some, however good the fit.

  pydpend animate run/ -o beside.mp4
  pydpend animate run/ --start 1.5 --length 2 --speed 0.1 -o beside.gif
"""

from __future__ import annotations

import argparse

from pydpend.cli.writes import add_force, check_files

HELP = "film of a recording beside its simulation"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    p.add_argument("run_folder", metavar="RUN", help="a folder made by pydpend analyse, with a damping fit")
    p.add_argument("-o", "--output", required=True, metavar="FILM", help=".mp4 or .gif")
    add_force(p)
    p.add_argument("--recording", metavar="NAME", help="which recording, where there are several")
    p.add_argument(
        "--start",
        dest="start_s",
        type=float,
        metavar="S",
        help="start of the simulation, s (default: the fit's)",
    )
    p.add_argument("--length", type=float, default=4.0, metavar="S", help="its length, s (default 4)")
    p.add_argument("--speed", type=float, default=0.2, help="film time over real time (default 0.2, slowed)")
    p.add_argument(
        "--play-fps",
        dest="fps",
        type=float,
        default=25.0,
        help="pictures a second at which it plays (default 25)",
    )


def run(args: argparse.Namespace) -> int:
    """Simulates and films."""
    from dataclasses import fields

    import numpy as np

    from pydpend.angles import read_angles
    from pydpend.damping.stored import load_fit
    from pydpend.documents import read_json
    from pydpend.errors import ArgumentError, FitError, Setting, fault
    from pydpend.model import Damping
    from pydpend.plots.beside import Pictures, beside
    from pydpend.plots.folder import AGAIN, FigureError, chosen
    from pydpend.simulate import simulate

    check_files(args, args.output)
    r = chosen(args.run_folder, args.recording)
    stored = load_fit(r.run / "fit")
    model = stored.model()
    angles = read_angles(r.here / "angles.parquet", name=r.facts["label"])
    fit = read_json(r.run / "fit" / "fit.json", FitError, AGAIN)
    start = args.start_s
    if start is None:
        inputs = fit.tables("inputs")
        if r.index >= len(inputs):
            fit.refuse("inputs", f"{len(inputs)} recordings, {r.facts['name']} is the {r.index + 1}th")
        first = inputs[r.index]
        start = first.number("start_s") if "start_s" in first else float(angles.t_s[0])
    if not angles.t_s[0] <= start < angles.t_s[-1]:
        raise ArgumentError(
            fault(
                Setting("start_s"),
                f"{start:g} s is not in the recording",
                f"It goes from {angles.t_s[0]:g} to {angles.t_s[-1]:g} s",
            )
        )
    if not args.length > 0:
        raise ArgumentError(fault(Setting("length"), f"{args.length:g} s is not above 0"))
    until = min(float(angles.t_s[-1]), start + args.length)
    # One state fits a second of a motion well, and more of a chaotic one hardly.
    state = stored.state(angles, start, min(1.0, until - start))
    times = np.arange(start, until, 1e-3)
    coefficients = fit.table("coefficients")
    known = {f.name for f in fields(Damping)}
    for name in coefficients:
        if name not in known:
            coefficients.refuse(name, "there is no such coefficient")
    damping = Damping(**{name: coefficients.table(name).number("value") for name in coefficients})
    motion = simulate(model, damping, state, times)
    pictures = None
    about = r.here / "overlay.json"
    if about.exists():
        shown = read_json(about, FigureError, AGAIN)
        width, height = (int(side) for side in shown.array("size_px", 2))
        pictures = Pictures(r.here / "overlay.mp4", (width, height), shown.array("times_s", -1))
    count = beside(angles, motion, model, args.output, pictures=pictures, fps=args.fps, speed=args.speed)
    print(f"{count} pictures from {times[0]:.3f} to {times[-1]:.3f} s; written to {args.output}")
    return 0
