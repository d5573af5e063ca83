"""Tracks of other programs: `read_tracks` finds out from the content whose they are, and makes nodes of them."""

from __future__ import annotations

from pydpend.tracks.read import read_tracks

__all__ = ["read_tracks"]
