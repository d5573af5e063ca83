"""How good a node table is, measured against the truth of a film."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

from pydpend import _tracker
from pydpend.filming import Film, StrPath
from pydpend.nodes import Nodes, read_nodes


@dataclass(frozen=True)
class Score:
    """A node table against the truth. A place agrees with a marker when it is within the limit of it.

    ``coverage``: of all rows in which a marker is at least half visible, the part in which its node agrees.
    ``wrong``: rows whose place agrees with another marker and not with the node's own. ``switches``: changes of the
    marker that a node agrees with. ``false_positives``: rows at the place of no visible marker. ``rms_px``: error of
    fully visible markers along x and y. ``error_over_sigma``: its ratio to the stated uncertainty, None if none is
    stated. ``angle_rms_deg``: by body. ``matches``: which marker each node stands for, None for none. ``details``:
    everything, as ``tracker score --json`` prints it.
    """

    frames: int
    frames_missing: int
    coverage: float
    wrong: int
    switches: int
    false_positives: int
    rms_px: tuple[float, float]
    error_over_sigma: float | None
    angle_rms_deg: dict[str, float]
    matches: dict[str, str | None]
    details: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """`to_json` as plain values."""
        value: dict[str, Any] = json.loads(self.to_json())
        return value

    def to_json(self) -> str:
        """All of it."""
        return json.dumps(self.details, indent=2)


def score(nodes: Nodes | StrPath, truth: Film | StrPath, limit_px: float = 2.0) -> Score:
    """Compares a node table with the truth: a table that :func:`pydpend.film` wrote, or the film itself.

    Names need not agree: each node stands for the marker at whose place it is most often.

    Raises :class:`pydpend.ArgumentError` if the two have no frame in common, :class:`pydpend.FilmError` for a truth
    that cannot be read.
    """
    table = nodes if isinstance(nodes, Nodes) else read_nodes(nodes)
    found: dict[str, Any] = json.loads(
        _tracker.score_places(
            [node.name for node in table.rig.nodes],
            table.frame,
            table.xy_px,
            table.sigma_px,
            truth._film if isinstance(truth, Film) else os.fsdecode(truth),
            limit_px,
        )
    )
    return Score(
        frames=found["frames"],
        frames_missing=found["frames_missing"],
        coverage=found["coverage"],
        wrong=found["wrong"],
        switches=found["switches"],
        false_positives=found["false_positives"],
        rms_px=(_number(found["rms_x_px"]), _number(found["rms_y_px"])),
        error_over_sigma=found["error_over_sigma"],
        angle_rms_deg={a["body"]: _number(a["rms_deg"]) for a in found["angles"]},
        matches={m["node"]: m["truth"] for m in found["matches"]},
        details=found,
    )


def _number(value: float | None) -> float:
    """JSON has no NaN; what is not known comes as null."""
    return float("nan") if value is None else value
