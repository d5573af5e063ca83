"""Stretches of frames in which it is not known where a marker is, in the order to go through them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.nodes import AMBIGUOUS, MISSING, Nodes

WHY = {AMBIGUOUS: "something may be it, and another name is possible", MISSING: "it is not seen"}


@dataclass(frozen=True)
class Doubt:
    """A stretch of frames in which it is not known where a node is.

    Attributes
    ----------
    node : str
        Its name.
    first, last : int
        Frames of the recording, both included.
    why : str
        A sentence.
    """

    node: str
    first: int
    last: int
    why: str


def runs(status: NDArray[np.uint8], frame: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Stretches of one status as (status, first frame, last frame)."""
    edges = np.flatnonzero((np.diff(status) != 0) | (np.diff(frame) != 1)) + 1
    starts = np.concatenate(([0], edges)).astype(int)
    ends = np.concatenate((edges, [status.size])).astype(int)
    return [(int(status[a]), int(frame[a]), int(frame[b - 1])) for a, b in zip(starts, ends, strict=True)]


def doubts(nodes: Nodes, decided: list[dict[str, Any]]) -> list[Doubt]:
    """Every stretch in which a node is ambiguous or missing and nobody has said that it is not to be seen."""
    out = []
    for n, node in enumerate(nodes.rig.nodes):
        status = nodes.status[:, n].copy()
        settled = np.zeros(status.size, dtype=bool)
        for entry in decided:
            if entry.get("what") == "no_marker" and entry.get("node") == node.name:
                first, _, last = str(entry.get("frames", "")).partition("..")
                until = int(last) if last else np.iinfo(np.int64).max
                settled |= (nodes.frame >= int(first or 0)) & (nodes.frame < until)
        # A number that is none of the states parts what is settled from what is not.
        status[settled] = 255
        out += [
            Doubt(node.name, first, last, WHY[code])
            for code, first, last in runs(status, nodes.frame)
            if code in WHY
        ]
    # What is ambiguous is decided by a look; so it comes first where both begin in one frame.
    return sorted(out, key=lambda d: (d.first, d.why != WHY[AMBIGUOUS], d.node))


def described(found: list[Doubt]) -> list[dict[str, Any]]:
    """The doubts as JSON has them."""
    return [asdict(doubt) for doubt in found]
