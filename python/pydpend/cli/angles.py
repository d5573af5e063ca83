"""Angles of the links of a mechanism from a node table, with their uncertainties.

Angles are counter-clockwise positive, zero hanging down, counted over turns. The table written is Parquet
or CSV by the ending of OUT.

  pydpend angles drop.parquet -o angles.parquet --figure angles.pdf
  pydpend angles drop.parquet --zero hanging.parquet --link-length-m 0.1719 -o angles.csv
  pydpend angles four-bar.parquet --estimator linkage --zero vertical -o angles.csv
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path
from typing import Any

from pydpend.cli.writes import add_force, check_files

HELP = "node table in, link angles with uncertainties out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """The options of ``pydpend angles``."""
    p.add_argument("nodes", metavar="NODES", help="node table of `pydpend track` (.parquet or .csv)")
    p.add_argument("-o", "--output", required=True, metavar="OUT", help="angles table (.parquet or .csv)")
    p.add_argument(
        "--estimator",
        choices=("rigid", "linkage", "pairwise"),
        default="rigid",
        help="pose of each body (default), all links through their joints, or the paper's pairs",
    )
    p.add_argument(
        "--zero",
        default="rest",
        metavar="WHERE",
        help="rest (found in the recording, default), vertical (the picture's, uncertain by the camera's roll: 1 deg, "
        "or vertical=0.5), horizontal (to the right), reference_frame, the links' angles in the rig's reference "
        "picture in degrees (12.5,-3), or the node table of a recording at rest",
    )
    p.add_argument(
        "--bodies",
        metavar="A,B",
        help="names of the links from the pivot outwards (default: all bodies of the rig)",
    )
    p.add_argument(
        "--axis",
        action="append",
        metavar="LINK=A-B",
        help="the line of a link that is vertical or horizontal at 0, from marker or joint A to B (upper=pivot-elbow); "
        "again for others",
    )
    p.add_argument(
        "--pivot",
        action="append",
        metavar="[LINK=]X,Y[,SIGMA]",
        help="where a link of one marker hangs, px in the picture, and how well that is known (1 px); again for "
        "others. A link of more markers needs none, and a place that the motion contradicts is refused",
    )
    p.add_argument("--mirrored", action="store_true", help="the film is mirror-inverted or taken from behind")
    p.add_argument("--link-length-m", type=float, metavar="M", help="pivot to elbow in metres, for the scale")
    p.add_argument(
        "--gaps",
        choices=("error", "stop"),
        default="error",
        help="where a hidden link may have lost a turn: refuse (default), or leave its angles out from there on",
    )
    p.add_argument("--figure", metavar="FILE", help="draw the angles and their sigmas (.png, .svg, .pdf)")
    p.add_argument(
        "--methods-figure",
        metavar="FILE",
        help="draw methods 1 and 2 of the paper's Section 8.2.1 on the first link, with their errors",
    )
    add_force(p)
    p.add_argument("--json", action="store_true", help="what was done, as JSON on stdout")


def run(args: argparse.Namespace) -> int:
    """Runs the command; 1 if something was left out, or the swing contradicts the zero, and that was said."""
    import numpy as np

    from pydpend.errors import RecordingWarning
    from pydpend.kinematics import angles, write_angles, written_files
    from pydpend.kinematics.camera import rms_of
    from pydpend.kinematics.setting_words import axes_in_words, pivots_in_words
    from pydpend.nodes import read_nodes

    check_files(args, *written_files(args.output), args.figure, args.methods_figure)
    nodes = read_nodes(args.nodes)
    with warnings.catch_warnings():
        # It is among the notes, which are printed below.
        warnings.simplefilter("ignore", RecordingWarning)
        found = angles(
            nodes,
            args.estimator,
            zero=_zero(args.zero),
            bodies=args.bodies.split(",") if args.bodies else None,
            mirrored=args.mirrored,
            link_length_m=args.link_length_m,
            axis=axes_in_words(args.axis or ()),
            pivot=pivots_in_words(args.pivot or ()),
            gaps=args.gaps,
        )
    write_angles(found, args.output)
    if args.figure:
        from pydpend.plots.angles import angles_figure
        from pydpend.plots.style import save

        save(angles_figure(found), args.figure)
    if args.methods_figure:
        from pydpend.kinematics.markers import body_markers
        from pydpend.plots.angles import body_methods_figure
        from pydpend.plots.style import save

        first = body_markers(nodes, args.bodies.split(",") if args.bodies else None, args.mirrored)[0]
        save(body_methods_figure(first), args.methods_figure)
    seen = found.seen.sum(axis=0)
    sigma = [float(np.nanmedian(s)) if np.isfinite(s).any() else None for s in found.sigma_rad.T]
    camera = None if found.camera_rad is None else rms_of(found.camera_rad)
    if args.json:
        summary: dict[str, Any] = {
            **found.meta,
            "output": args.output,
            "frames": int(found.t_s.size),
            "frames_with_angle": seen.tolist(),
            "median_sigma_rad": sigma,
            "rms_sigma_camera_rad": None if camera is None else camera.tolist(),
        }
        print(json.dumps(summary, indent=2))
    else:
        for k in range(found.links):
            value = sigma[k]
            noise = "not known" if value is None else f"{np.degrees(value):.4f} deg noise"
            part = "" if camera is None else f" and {np.degrees(camera[k]):.4f} deg camera"
            print(
                f"{found.columns.stem(k)}: {seen[k]} of {found.t_s.size} frames, standard uncertainty {noise}{part}"
            )
        zero = found.meta["zero"]
        sure = zero.get("sigma_rad")
        known = f" (+- {' and '.join(f'{v:.2g}' for v in np.degrees(sure))} deg)" if sure else ""
        print(f"zero from {zero['from']}{known}; written to {args.output}")
    contradicted = found.meta["zero"].get("contradicted")
    for note in (*nodes.notes, *found.meta["notes"]):
        print(f"{'warning' if note == contradicted else 'note'}: {note}", file=sys.stderr)
    # Turns from the reference picture are right whatever the swing says.
    return 1 if found.left_out or (contradicted and args.zero != "reference_frame") else 0


def _zero(text: str) -> Any:
    from pydpend.errors import OptionError, Setting, fault
    from pydpend.kinematics import parse_zero
    from pydpend.nodes import read_nodes

    said = parse_zero(text)
    if said is None and not Path(text).exists():
        advice = "Give rest, vertical, reference_frame, degrees of each link (180,180) or a node table"
        raise OptionError(fault(Setting("zero"), f"{text} is no file and no degrees", advice))
    return read_nodes(text) if said is None else said
