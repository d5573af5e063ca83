"""Compares a link's video angle with the encoder's.

Finds the offset and drift of the two clocks (or takes them as one), then gain, zero, residuals and whose
noise explains them. DIR gets compare.json, residuals.parquet and the figures.

  pydpend compare angles.parquet drop.csv --calibration encoder.json -o compared/
  pydpend compare angles.parquet drop.tdms --calibration holds/ --clocks given -o compared/
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pydpend.cli.calibrate import add_signal_arguments
from pydpend.cli.fit import add_table_arguments, read
from pydpend.cli.writes import add_force, check_files

HELP = "link angles and encoder in, their comparison out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend compare``."""
    p.add_argument(
        "angles", metavar="ANGLES", help="angles table (.parquet, .csv) or the authors' folder of .npy"
    )
    p.add_argument("encoder", metavar="ENCODER", help="the encoder's recording (CSV, TDMS, NumPy)")
    p.add_argument(
        "--calibration", metavar="CAL", help="encoder.json of `pydpend calibrate`, or a folder of holds"
    )
    p.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for the results")
    p.add_argument(
        "--link", type=int, choices=(1, 2), default=1, help="the link the encoder sits on (default 1)"
    )
    p.add_argument(
        "--clocks",
        choices=("estimate", "given"),
        default="estimate",
        help="estimate offset and drift (default), or take the recorder's synchronisation as given",
    )
    p.add_argument(
        "--label", metavar="TEXT", help="what to call the encoder in figures, e.g. 'encoder (made)'"
    )
    p.add_argument("--format", choices=("png", "svg", "pdf"), default="png", help="of the figures")
    add_signal_arguments(p)
    add_table_arguments(p)
    add_force(p)
    p.add_argument("--json", action="store_true", help="compare.json on stdout too")


def part(share: float, digits: int) -> str:
    """A part of the residual's variance in percent; in words where the noise that is stated is far too large."""
    return (
        f"{100 * share:.{digits}f} %" if not share > 2 else "more than whole: less noise is there than stated"
    )


def run(args: argparse.Namespace) -> int:
    """Runs the command; 1 if readings were left out and said."""
    import numpy as np
    import pyarrow as pa
    import pyarrow.parquet as pq

    from pydpend.encoder import calibrate, compare, encoder_angles, read_calibration, read_encoder, read_holds
    from pydpend.errors import EncoderError, fault
    from pydpend.output import check_folder, results_folder, whole, write_text
    from pydpend.plots.angles import angles_figure
    from pydpend.plots.encoder import calibration_figure, comparison_figure
    from pydpend.plots.style import save

    folder = check_folder(args.output)
    drawn = ("compare", "angles", "calibration") if args.calibration else ("compare", "angles")
    names = ("compare.json", "residuals.parquet", *(f"{figure}.{args.format}" for figure in drawn))
    check_files(args, *(folder / name for name in names))
    video = read(args.angles, args)
    signal = read_encoder(
        args.encoder, column=args.column, time_column=args.time_column, rate_hz=args.rate_hz, unit=args.unit
    )
    line = None
    if args.calibration:
        path = Path(args.calibration)
        line = calibrate(read_holds([path])) if path.is_dir() else read_calibration(path)
    found = compare(video, encoder_angles(signal, line), args.link - 1, clocks=args.clocks)
    results_folder(folder)
    try:
        write_text(folder / "compare.json", found.to_json())
        with whole(folder / "residuals.parquet") as new, new.open("wb") as file:
            pq.write_table(pa.table(found.to_columns()), file, write_page_checksum=True)
        save(comparison_figure(found, label=args.label), folder / f"compare.{args.format}")
        save(angles_figure(video), folder / f"angles.{args.format}")
        if line is not None:
            save(calibration_figure(line), folder / f"calibration.{args.format}")
    except OSError as problem:
        raise EncoderError(
            fault(str(folder), f"the results cannot be written ({problem.strerror})", "Check the folder")
        ) from problem
    if args.json:
        print(found.to_json(), end="")
    else:
        s = found.sync
        if s.given:
            print(
                f"clocks taken as one; delay {1e3 * found.delay_s:.4f} +- {1e3 * found.delay_sigma_s:.4f} ms"
            )
        else:
            print(
                f"video time = encoder time {s.offset_s:+.6f} +- {s.offset_sigma_s:.6f} s, "
                f"drift {1e6 * s.drift:.2f} +- {1e6 * s.drift_sigma:.2f} ppm"
            )
        print(
            f"gain {found.gain:.6f} +- {found.gain_sigma:.6f}, "
            f"zero {np.degrees(found.offset_rad):.4f} +- {np.degrees(found.offset_sigma_rad):.4f} deg"
        )
        print(
            f"residual RMS {np.degrees(found.rms_rad):.4f} deg, largest {np.degrees(found.largest_rad):.4f} deg; "
            f"explained by the encoder's noise {part(found.share_encoder, 1)}, "
            f"by the video's {part(found.share_video, 2)}, by the camera {part(found.share_camera, 1)}"
        )
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    return 1 if found.left_out else 0
