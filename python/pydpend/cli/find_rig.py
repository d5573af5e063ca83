"""Find the bodies and joints of tracks that say nothing of either, as those of other programs.

Nodes that keep their distances are one body; points that two bodies share, or that stay in place, are joints. The table
written has them, so that `pydpend angles` works on it.

  pydpend import poses.csv --fps 250 -o nodes.parquet
  pydpend find-rig nodes.parquet -o rigged.parquet
"""

from __future__ import annotations

import argparse
import json
import sys

from pydpend.cli.writes import add_force, check_files

HELP = "tracks without bodies in, a node table with bodies and joints out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend find-rig``."""
    p.add_argument("nodes", metavar="NODES", help="node table, as of `pydpend import` (.parquet or .csv)")
    p.add_argument("-o", "--output", required=True, metavar="OUT", help="node table (.parquet or .csv)")
    add_force(p)
    p.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(args: argparse.Namespace) -> int:
    """Runs the command."""
    from pydpend.kinematics import find_rig
    from pydpend.nodes import read_nodes

    check_files(args, args.output)
    found = find_rig(read_nodes(args.nodes))
    found.write(args.output)
    rig = found.rig
    if args.json:
        print(json.dumps({"rig": rig.to_dict(), "notes": list(found.notes), "output": args.output}, indent=2))
        return 0
    for body in rig.bodies:
        print(f"{body}: {', '.join(n.name for n in rig.nodes if n.body == body)}")
    for joint in rig.joints:
        where = f"at ({joint.x_px:.2f}, {joint.y_px:.2f}) px"
        if len(joint.bodies) == 1:
            print(f"{joint.name}: {joint.bodies[0]} on the ground, {where}")
        else:
            moment = "" if rig.reference_frame is None else f" in frame {rig.reference_frame}"
            print(f"{joint.name}: {' and '.join(joint.bodies)}, {where}{moment}")
    print(f"written to {args.output}")
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    return 0
