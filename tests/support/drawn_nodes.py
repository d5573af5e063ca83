"""Nodes drawn at random, with a rig and the metadata of a table: what tests of node tables begin with."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydpend.nodes import AMBIGUOUS, MISSING, REACQUIRED, SEEN, UNDECODED, Joint, Node, Nodes, Rig

RIG = Rig(
    image_px=(640, 480),
    nodes=(
        Node("n0", "upper", 10.1, 20.0),
        Node("n1", "upper", 1 / 3, 21.0),
        Node("n2", "lower", 40.0, 22.0),
    ),
    bodies=("upper", "lower"),
    joints=(Joint("pivot", ("upper",), 5.0, 5.0), Joint("elbow", ("upper", "lower"), 30.0, 22.0)),
    reference_frame=0,
)
META: dict[str, Any] = {
    "schema_version": 1,
    "tool": "tracker test",
    "source": {
        "name": "drop.mp4",
        "container": "mp4",
        "codec": "h264",
        "width": 640,
        "height": 480,
        "depth_bits": 8,
        "rate_origin": "user",
        "time_base": [1, 500],
        "warnings": [],
    },
    "settings": {},
    "ending": {"kind": "complete"},
}


def some_nodes(frames: int = 50, seed: int = 3) -> Nodes:
    rng = np.random.default_rng(seed)
    status = rng.choice([SEEN, SEEN, SEEN, REACQUIRED, MISSING, AMBIGUOUS], (frames, 3)).astype(np.uint8)
    # Frames that could not be decoded.
    status[frames // 2 : frames // 2 + 2] = UNDECODED
    seen = (status == SEEN) | (status == REACQUIRED)
    return Nodes(
        frame=np.arange(10, 10 + frames, dtype=np.int64),
        t_s=np.arange(10, 10 + frames) / 500,
        xy_px=np.where(seen[:, :, None], rng.uniform(0, 480, (frames, 3, 2)), np.nan),
        sigma_px=np.where(seen, rng.uniform(0.01, 0.1, (frames, 3)), np.nan).astype(np.float32),
        area_px=np.where(seen, rng.uniform(20, 80, (frames, 3)), np.nan).astype(np.float32),
        status=status,
        rig=RIG,
        meta=META,
    )
