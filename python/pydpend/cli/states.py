"""Rates and accelerations of links or points, with standard uncertainties, by a Kalman smoother.

Of an angles table: angle, rate and acceleration of each link, and of a single pendulum that swings freely its period,
what damps it, logarithmic decrement and Q. Of a node table: place, velocity, acceleration and speed of markers and
joints, in metres where a distance is known.

  pydpend states angles.parquet -o states.parquet
  pydpend states drop.parquet --scale n0-n3=0.1719 --points n3,n8 -o points.csv
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from pydpend.cli.writes import add_force, check_files
from pydpend.errors import AnglesError, Setting, fault

HELP = "angles or node table in, rates and accelerations (and a pendulum's period and Q) out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend states``."""
    p.add_argument("table", metavar="TABLE", help="angles table or node table (.parquet or .csv)")
    p.add_argument("-o", "--output", required=True, metavar="OUT", help="table of states (.parquet or .csv)")
    p.add_argument(
        "--link", metavar="NAME", help="the link whose period and Q are told, where there are several"
    )
    p.add_argument(
        "--start-s", type=float, metavar="S", help="start of the free swing whose period is told, s"
    )
    p.add_argument("--stop-s", type=float, metavar="S", help="its end, s")
    p.add_argument("--points", metavar="A,B", help="markers and joints (default: all that are known)")
    p.add_argument(
        "--scale",
        action="append",
        metavar="A-B=M[,SIGMA]",
        help="a distance that is known, m, between markers or joints of one link or of the ground, or places in the "
        "picture (10,20-410,22=0.5); again for others: they are averaged and compared",
    )
    p.add_argument(
        "--origin", metavar="WHERE", help="a joint of the ground or a place X,Y in px (default: the pivot)"
    )
    p.add_argument(
        "--pivot",
        action="append",
        metavar="[LINK=]X,Y[,SIGMA]",
        help="where a link of one marker hangs, px in the picture, as of `pydpend angles`; again for others",
    )
    p.add_argument("--mirrored", action="store_true", help="the film is mirror-inverted or taken from behind")
    add_force(p)
    p.add_argument("--json", action="store_true", help="what was found, as JSON on stdout")


def run(args: argparse.Namespace) -> int:
    """Runs the command."""
    from pydpend.kinds import kind_of
    from pydpend.tabular import write_csv, write_parquet

    check_files(args, args.output)
    path = Path(args.output)
    writers = {".parquet": write_parquet, ".csv": write_csv}
    if path.suffix not in writers:
        raise AnglesError(
            fault(args.output, f"the ending {path.suffix!r} is not known", "Use .parquet or .csv")
        )
    columns, about, notes = _of_points(args) if kind_of(args.table) == "nodes" else _of_angles(args)
    writers[path.suffix](path, columns)
    if args.json:
        print(json.dumps({**about, "notes": notes, "output": args.output}, indent=2))
    else:
        for line in about.pop("said"):
            print(line)
        print(f"{len(columns)} columns, {len(next(iter(columns.values())))} rows; written to {args.output}")
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    return 0


def _of_angles(args: argparse.Namespace) -> tuple[Any, dict[str, Any], list[str]]:
    from pydpend.free_swing import ring_down
    from pydpend.json_text import plain
    from pydpend.kinematics import read_angles
    from pydpend.link_states import states

    for flag in ("points", "scale", "origin", "pivot"):
        if getattr(args, flag) is not None:
            problem = f"{args.table} is an angles table, which has no places"
            raise AnglesError(fault(Setting(flag), problem, "Give the node table"))
    angles = read_angles(args.table)
    found = states(angles)
    about: dict[str, Any] = {
        "links": list(angles.link_names),
        "sigma_factor": plain(found.sigma_factor),
        "said": [],
    }
    if angles.links > 1 and args.link is None:
        return found.to_columns(), about, []
    try:
        swing = ring_down(angles, args.link, start_s=args.start_s, stop_s=args.stop_s)
    except AnglesError as problem:
        return found.to_columns(), about, [f"no period is told: {problem}"]
    about["swing"] = swing.to_dict()
    rates = [
        f"{law} {rate:.4g} +- {sigma:.2g} {unit}"
        for law, rate, sigma in zip(swing.laws, swing.rates, swing.rates_sigma, strict=True)
        for unit in [{"viscous": "1/s", "quadratic": "1/(rad s)", "dry": "rad/s"}[law]]
    ]
    about["said"] = [
        f"{swing.link}: {swing.swings} swings; period of small ones {swing.period_s:.6g} +- "
        f"{swing.period_sigma_s:.2g} s",
        f"damping of the amplitude: {' and '.join(rates)}",
        f"at {swing.at_amplitude_rad:.3g} rad: Q {swing.q:.4g}, logarithmic decrement {swing.decrement:.4g} +- "
        f"{swing.decrement_sigma:.2g}",
    ]
    return found.to_columns(), about, []


def _of_points(args: argparse.Namespace) -> tuple[Any, dict[str, Any], list[str]]:
    from pydpend.kinematics import places
    from pydpend.kinematics.setting_words import pivots_in_words, scales_in_words
    from pydpend.link_states import point_states
    from pydpend.nodes import read_nodes

    if args.link is not None:
        problem = f"{args.table} is a node table, which has no angles"
        raise AnglesError(fault(Setting("link"), problem, "Give the table of `pydpend angles`"))
    found = places(
        read_nodes(args.table),
        args.points.split(",") if args.points else None,
        scale=scales_in_words(args.scale or ()),
        origin=args.origin,
        pivot=pivots_in_words(args.pivot or ()),
        mirrored=args.mirrored,
    )
    moving = point_states(found)
    about: dict[str, Any] = {**found.meta, "points": list(found.names), "unit": found.unit, "said": []}
    notes = about.pop("notes")
    scale = found.meta.get("scale")
    if scale is not None:
        value, sigma = 1e3 * scale["m_per_px"], 1e3 * scale["sigma_m_per_px"]
        about["said"] = [f"scale {value:.6g} +- {sigma:.2g} mm a px, one error of all places"]
    return moving.to_columns(), about, notes
