"""The score of a node table, measured against the truth of a film."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, ClassVar

from pydpend import _native
from pydpend.documents import Table
from pydpend.errors import TableError
from pydpend.filming import Film, StrPath
from pydpend.json_text import JsonResult
from pydpend.nodes import Nodes, read_nodes
from pydpend.typed import typed


@dataclass(frozen=True)
class Score(JsonResult):
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
        Everything, as ``pydpend score --json`` prints it.
    """

    _error: ClassVar = TableError
    _source: ClassVar = "the score"

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
        return self.details

    @classmethod
    def of_table(cls, table: Table) -> Score:
        """The score from what ``pydpend score --json`` printed, read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Score
            The score.

        Raises
        ------
        TableError
            Naming the key that is missing or not what it must be.
        """
        return cls(
            table.whole("frames"),
            table.whole("frames_missing"),
            table.number_or_nan("coverage"),
            table.whole("wrong"),
            table.whole("switches"),
            table.whole("false_positives"),
            rms_px=(table.number_or_nan("rms_x_px"), table.number_or_nan("rms_y_px")),
            error_over_sigma=table.number("error_over_sigma") if "error_over_sigma" in table else None,
            angle_rms_deg={a.text("body"): a.number_or_nan("rms_deg") for a in table.tables("angles")},
            matches={
                m.text("node"): m.text("truth") if "truth" in m else None for m in table.tables("matches")
            },
            details=table.values,
        )


@typed()
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
        _native.score_places(
            [node.name for node in table.rig.nodes],
            table.frame,
            table.xy_px,
            table.sigma_px,
            truth._film if isinstance(truth, Film) else os.fsdecode(truth),
            limit_px,
        )
    )
    return Score.of_table(Table(found, "the score", TableError))
