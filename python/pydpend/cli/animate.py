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
    import numpy as np

    from pydpend.damping.stored import StoredFit
    from pydpend.errors import ArgumentError, FitError, Setting, fault
    from pydpend.model import Damping
    from pydpend.plots.beside import Pictures, beside
    from pydpend.plots.folder import chosen
    from pydpend.run_folder import read_run
    from pydpend.simulation import simulate

    check_files(args, args.output)
    run = read_run(args.run_folder)
    r = chosen(run, args.recording)
    fit = run.fit_folder.fit()
    stored = StoredFit.of(fit)
    model, angles = stored.model(), r.angles()
    start = args.start_s
    if start is None:
        if r.index >= len(fit.inputs):
            advice = f"It has {len(fit.inputs)} recordings, {r.name} is the {r.index + 1}th"
            raise FitError(fault(str(run.path), "the fit is of other recordings", advice))
        start = fit.inputs[r.index].start_s
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
    damping = Damping(**{name: e.value for name, e in fit.coefficients.items()})
    motion = simulate(model, damping, state, times)
    shown = r.overlay()
    pictures = None if shown is None else Pictures(shown.path, shown.size_px, shown.times_s)
    count = beside(angles, motion, model, args.output, pictures=pictures, fps=args.fps, speed=args.speed)
    print(f"{count} pictures from {times[0]:.3f} to {times[-1]:.3f} s; written to {args.output}")
    return 0
