"""Write a node table in the form of another program.

By the ending of the output: .c3d and .trc (biomechanics), .csv (DLTdv's xypts), .mat (MATLAB).

  pydpend export drop.parquet -o drop.c3d --px-per-m 930
  pydpend export drop.parquet -o drop.mat
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pydpend.cli.writes import add_force, check_files
from pydpend.errors import ArgumentError, Setting, fault

HELP = "write a node table as C3D, TRC, DLTdv CSV or MAT"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments."""
    parser.add_argument("nodes", help="a node table, Parquet or CSV")
    parser.add_argument("-o", "--output", required=True, help="the file: .c3d, .trc, .csv or .mat")
    parser.add_argument("--px-per-m", type=float, help="scale of the image; C3D and TRC are then in mm")
    add_force(parser)
    parser.add_argument("--json", action="store_true", help="print what was written as JSON")


def run(args: argparse.Namespace) -> int:
    """Writes it."""
    from pydpend.exporting import SCALED, WRITERS, export
    from pydpend.nodes import read_nodes

    check_files(args, args.output)
    ending = Path(args.output).suffix.lower()
    if args.px_per_m is not None and ending in WRITERS and ending not in SCALED:
        raise ArgumentError(
            fault(Setting("px_per_m"), f"{ending} files are in px", "Leave it out, or write .c3d or .trc")
        )
    nodes = read_nodes(args.nodes)
    export(nodes, args.output, px_per_m=args.px_per_m)
    if args.json:
        print(json.dumps({"output": args.output, "frames": len(nodes), "nodes": list(nodes.rig.names)}))
    return 0
