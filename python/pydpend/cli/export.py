"""Write a node table or an angles table in the form of another program.

By the ending of the output. Nodes: .c3d and .trc (biomechanics), .csv (DLTdv's xypts), .mat (MATLAB), .nc (NetCDF, as
movement has poses), .xlsx. Angles, with --states their rates and accelerations, and tables of `pydpend states`: .csv,
.mat, .nc, .xlsx, .parquet, and .mot or .sto (OpenSim).

  pydpend export drop.parquet -o drop.c3d --px-per-m 930
  pydpend export angles.parquet --states -o states.mot
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pydpend.cli.writes import add_force, check_files
from pydpend.errors import ArgumentError, OptionError, Setting, TableError, fault

HELP = "write nodes, angles or states for another program: C3D, TRC, MAT, NetCDF, Excel, OpenSim"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments."""
    parser.add_argument("table", help="a node table, or a table of angles, states or points, Parquet or CSV")
    parser.add_argument("-o", "--output", required=True, help="the file; its ending says the form")
    parser.add_argument(
        "--states", action="store_true", help="of angles: with rates and accelerations, smoothed"
    )
    parser.add_argument("--px-per-m", type=float, help="scale of the image; C3D and TRC are then in mm")
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print what was written as JSON")


def run(args: argparse.Namespace) -> int:
    """Writes it."""
    from pydpend.exporting import SCALED, WRITERS, export
    from pydpend.kinds import expect, kind_of
    from pydpend.kinematics import read_angles
    from pydpend.link_states import states
    from pydpend.nodes import Nodes, read_nodes
    from pydpend.table_exports import StoredTable
    from pydpend.tabular import TableResult

    check_files(args, args.output)
    ending = Path(args.output).suffix.lower()
    if args.px_per_m is not None and ending in WRITERS and ending not in SCALED:
        raise ArgumentError(
            fault(Setting("px_per_m"), f"{ending} files are in px", "Leave it out, or write .c3d or .trc")
        )
    expect(args.table, ("nodes", "angles"), TableError)
    kind = kind_of(args.table)
    if args.states and kind != "angles":
        problem = f"{args.table} is no angles table"
        raise OptionError(fault(Setting("states"), problem, "Leave it out, or give angles"))
    # Tables of points have no mark but their times.
    is_table = kind == "angles" or (kind == "unknown" and "time_s" in _names(args.table))
    if is_table and args.px_per_m is not None:
        raise OptionError(fault(Setting("px_per_m"), "a table has no scale", "Leave it out"))
    result: Nodes | TableResult
    if args.states:
        result = states(read_angles(args.table))
    elif is_table:
        # The paper's authors publish angles as a folder.
        folder = Path(args.table).is_dir()
        result = read_angles(args.table) if folder else StoredTable(Path(args.table))
    else:
        result = read_nodes(args.table)
    export(result, args.output, px_per_m=args.px_per_m)
    if args.json:
        rows = len(result) if isinstance(result, Nodes) else len(result.to_columns()["time_s"])
        about = {"output": args.output, "frames": rows}
        print(json.dumps(about | ({"nodes": list(result.rig.names)} if isinstance(result, Nodes) else {})))
    return 0


def _names(table: str) -> list[str]:
    """The columns of a file; none where there is no such file."""
    from pydpend.columns import column_names

    path = Path(table)
    return column_names(path, TableError) if path.is_file() else []
