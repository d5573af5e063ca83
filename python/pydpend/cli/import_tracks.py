"""Make a node table of the tracks of another program; whose they are is told from the content.

DLTdv, OSP Tracker, Kinovea, DeepLabCut, SLEAP, trackpy, laptrack, TrackMate, TRC, C3D, Qualisys, movement, or any
table with frame, time_s, node, x_px, y_px. What is assumed is said, and stands in the table.

  pydpend import xypts.csv --fps 500 --body upper=pt1,pt2 --body lower=pt3,pt4 -o nodes.parquet
  pydpend import walk.trc --plane xy -o nodes.parquet
"""

from __future__ import annotations

import argparse
import json
import sys

from pydpend.cli.writes import add_force, check_files
from pydpend.errors import OptionError, Setting, fault

HELP = "another program's tracks in, a node table out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend import``."""
    p.add_argument(
        "tracks", nargs="+", metavar="FILE", help="a file of tracks, or several with points of one film"
    )
    p.add_argument("-o", "--output", required=True, metavar="OUT", help="node table (.parquet or .csv)")
    p.add_argument("--fps", type=float, help="frames per s of the camera, in place of the file's times")
    p.add_argument(
        "--body",
        dest="bodies",
        action="append",
        metavar="NAME=A,B",
        help="a link and its points; once for each link, from the pivot outwards",
    )
    p.add_argument("--nodes", metavar="A,B", help="points that are taken, in this order; all by default")
    p.add_argument("--unit", help="unit of the places, where the file does not say it: px, m, cm, mm, um, in")
    p.add_argument("--y-axis", help="direction of y: down or up, where it is not as the program has it")
    p.add_argument("--plane", help="the mechanism's plane of three coordinates: xy, xz or yz")
    p.add_argument("--image-px", metavar="WxH", help="size of the pictures, where the file does not say it")
    p.add_argument("--min-confidence", type=float, help="confidence, 0 to 1, below which a place is missing")
    p.add_argument("--sigma-px", type=float, help="standard uncertainty of each coordinate, px")
    add_force(p)
    p.add_argument("--json", action="store_true", help="print what was read as JSON")


def run(args: argparse.Namespace) -> int:
    """Reads and writes."""
    import numpy as np

    from pydpend.tracks import read_tracks

    check_files(args, args.output)
    nodes = read_tracks(
        args.tracks,
        fps=args.fps,
        bodies=_bodies(args.bodies),
        nodes=args.nodes.split(",") if args.nodes else (),
        unit=args.unit,
        y_axis=args.y_axis,
        plane=args.plane,
        image_px=_size(args.image_px),
        min_confidence=args.min_confidence,
        sigma_px=args.sigma_px,
    )
    nodes.write(args.output)
    form = nodes.meta["source"]["container"]
    if args.json:
        about = {
            "output": args.output,
            "frames": len(nodes),
            "nodes": list(nodes.rig.names),
            "bodies": list(nodes.rig.bodies),
            **nodes.meta["settings"]["import"],
        }
        print(json.dumps(about, indent=2))
        return 0
    for i, node in enumerate(nodes.rig.nodes):
        print(
            f"{node.name}: {int(np.count_nonzero(nodes.seen[:, i]))} of {len(nodes)} frames, body {node.body}"
        )
    print(f"read as {form}; written to {args.output}")
    for note in nodes.notes:
        print(f"note: {note}", file=sys.stderr)
    return 0


def _bodies(given: list[str] | None) -> dict[str, list[str]] | None:
    """The nodes of each body, from ``NAME=A,B``."""
    if given is None:
        return None
    out: dict[str, list[str]] = {}
    for text in given:
        name, sign, members = text.partition("=")
        if not (name and sign and members) or name in out:
            problem = f"{text!r} is there twice" if name in out else f"{text!r} is no body"
            raise OptionError(fault(Setting("bodies"), problem, "Write NAME=A,B once for each link"))
        out[name] = members.split(",")
    return out


def _size(text: str | None) -> tuple[int, int] | None:
    """Width and height, from ``WxH``."""
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise OptionError(fault(Setting("image_px"), f"{text!r} is no size", "Write 1280x1024"))
    return int(width), int(height)
