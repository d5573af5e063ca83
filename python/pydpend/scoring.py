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

    Attributes
    ----------
    frames : int
        Frames of the truth.
    frames_missing : int
        Frames of the truth that the table does not have.
    coverage : float
        Of all rows in which a marker is at least half visible, the part in which its node agrees, 0 to 1.
    wrong : int
        Rows whose place agrees with another marker and not with the node's own.
    switches : int
        Changes of the marker that a node agrees with.
    false_positives : int
        Rows at the place of no visible marker.
    rms_px : tuple of float
        Root mean square error of fully visible markers along x and y, px.
    error_over_sigma : float or None
        Ratio of that error to the stated uncertainty; None if none is stated.
    angle_rms_deg : dict of str to float
        Root mean square error of each body's direction, deg.
    matches : dict of str to str or None
        Which marker each node stands for; None for none.
    details : dict
        Everything, as ``tracker score --json`` prints it.
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
        """The score as plain values.

        Returns
        -------
        dict
            `details`: numbers, texts, lists and tables; None for what is not known.
        """
        value: dict[str, Any] = json.loads(self.to_json())
        return value

    def to_json(self) -> str:
        """The score as JSON.

        Returns
        -------
        str
            `to_dict` as text.
        """
        return json.dumps(self.details, indent=2)


def score(nodes: Nodes | StrPath, truth: Film | StrPath, limit_px: float = 2.0) -> Score:
    """The score of a node table against the truth: a table that :func:`pydpend.film` wrote, or the film itself.

    Names need not agree: each node stands for the marker at whose place it is most often.

    Parameters
    ----------
    nodes : Nodes or path-like
        The nodes, or a table of them.
    truth : Film or path-like
        The film, or the truth that was written beside it.
    limit_px : float
        Farthest that a place may be from a marker to agree with it, px.

    Returns
    -------
    Score
        Coverage, mistakes and errors.

    Raises
    ------
    ArgumentError
        If the two have no frame in common.
    FilmError
        For a truth that cannot be read.
    TableError
        For a node table that cannot be read.
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
