"""The status of a damping fit and the verdict on a term: decisions as data, with their words."""

from __future__ import annotations

from pydpend.worded import Words


class FitStatus(Words):
    """The states in which a fit can end."""

    CONVERGED = "converged", "converged"
    """Its numbers are the solution."""
    ITERATION_LIMIT = "iteration_limit", "stopped at the limit of its steps"
    """Its numbers are where it stopped."""
    STALLED = "stalled", "stalled"
    """No step brought it nearer; its numbers are where it stopped."""


class Verdict(Words):
    """The verdicts of the data on one term."""

    ASKED_FOR = "asked_for", "asked for"
    """Without it the fitted data are worse described, and others no better predicted."""
    REJECTED = "rejected", "rejected"
    """Without it nothing changes."""
    INSEPARABLE = "inseparable", "cannot be told apart"
    """Another term does the same (`Term.partner`)."""
    UNDECIDED = "undecided", "not decided"
    """None of these is clear."""
