"""Calibrates the encoder: a straight line between volts and angle from recordings held at known angles.

HOLDS are one recording per angle, a folder of them, or one table with a column angle_deg. The angles are
given with --angles-deg in the files' order, or stand in the files' names (hold_-360deg.csv).

  pydpend calibrate holds/ -o encoder.json --figure calibration.png
  pydpend calibrate h0.csv h1.csv h2.csv --angles-deg=-360,0,360 -o encoder.json
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pydpend.cli.writes import add_force, check_files

HELP = "hold recordings in, the encoder's volts-to-angle line out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend calibrate``."""
    p.add_argument(
        "holds", metavar="HOLDS", nargs="+", help="hold recordings (CSV, TDMS, NumPy), or a folder"
    )
    p.add_argument("-o", "--output", required=True, metavar="OUT", help="calibration to write (.json)")
    p.add_argument("--angles-deg", metavar="A,B,...", help="angles of the holds in the files' order, degrees")
    add_signal_arguments(p)
    p.add_argument("--range-v", default="0,10", metavar="LOW,HIGH", help="rails of the output (default 0,10)")
    p.add_argument("--wraps", action="store_true", help="single-turn encoder: it jumps from rail to rail")
    p.add_argument("--figure", metavar="FILE", help="draw line and residuals (.png, .svg, .pdf)")
    add_force(p)
    p.add_argument("--json", action="store_true", help="the calibration on stdout too")


def add_signal_arguments(p: argparse.ArgumentParser) -> None:
    """Options of reading an encoder's file; shared by ``calibrate`` and ``compare``."""
    p.add_argument(
        "--column", metavar="NAME", help="column or TDMS channel of the encoder (default voltage_v)"
    )
    p.add_argument("--time-column", metavar="NAME", help="column or channel of the time (default time_s)")
    p.add_argument(
        "--rate-hz", type=float, metavar="HZ", help="samples per second where the file has no time"
    )
    p.add_argument(
        "--unit", choices=("v", "rad", "deg"), help="unit of the column (default from its name, else V)"
    )


def run(args: argparse.Namespace) -> int:
    """Runs the command."""
    import numpy as np

    from pydpend.encoder import calibrate, read_holds
    from pydpend.errors import EncoderError, Setting, fault
    from pydpend.number_words import numbers

    if Path(args.output).suffix.lower() != ".json":
        raise EncoderError(
            fault(f"-o {args.output}", "a calibration is a .json", "Give a name that ends in .json")
        )
    check_files(args, args.output, args.figure)
    rails = numbers(args.range_v, "range_v")
    if len(rails) != 2 or rails[0] >= rails[1]:
        raise EncoderError(fault(Setting("range_v"), f"{args.range_v!r} is not a range", "Give LOW,HIGH"))
    holds = read_holds(
        args.holds,
        numbers(args.angles_deg, "angles_deg") if args.angles_deg else None,
        column=args.column,
        time_column=args.time_column,
        rate_hz=args.rate_hz,
        unit=args.unit,
    )
    found = calibrate(holds, range_v=(rails[0], rails[1]), wraps=args.wraps)
    found.write(args.output)
    if args.figure:
        from pydpend.plots.encoder import calibration_figure
        from pydpend.plots.style import save

        save(calibration_figure(found), args.figure)
    if args.json:
        print(found.to_json(), end="")
    else:
        turn = 2 * np.pi
        print(
            f"{len(holds)} holds: {found.slope_v_per_rad * turn:.6f} +- {found.sigma[1] * turn:.6f} V per turn, "
            f"{found.offset_v:.5f} +- {found.sigma[0]:.5f} V at zero"
        )
        print(
            f"linearity {100 * found.linearity:.4f} % of the span; noise of a reading {1e3 * found.noise_v:.3f} mV "
            f"= {np.degrees(found.noise_rad):.3f} deg; written to {args.output}"
        )
    for name in found.noisy_holds:
        print(f"note: {name} scatters by more than the specified {1e3 * found.spec_v:g} mV", file=sys.stderr)
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    return 0
