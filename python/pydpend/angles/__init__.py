"""Angles of the links: the table every later stage starts from, and the ways from nodes to it."""

from __future__ import annotations

from pydpend.angles.files import read_angles, write_angles
from pydpend.angles.table import LinkAngles

__all__ = ["LinkAngles", "read_angles", "write_angles"]
