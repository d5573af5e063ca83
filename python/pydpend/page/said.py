"""Decisions and arrangements as the browser sends them, checked before anything is written."""

from __future__ import annotations

import json
import re
from typing import Any

from pydpend.errors import ArgumentError, fault
from pydpend.rig import Rig


def decision_of(said: dict[str, Any], first: int, last: int) -> dict[str, Any]:
    """A decision about frames ``first`` to ``last``. Raises ArgumentError for what is none."""
    allowed = {"what", "node", "with", "frame", "frames", "at_px", "sigma_px"}
    wrong = said.keys() - allowed
    if wrong or not isinstance(said.get("what"), str) or not isinstance(said.get("node"), str):
        raise ArgumentError(
            fault("edit", f"it has {sorted(said)}", f"Give what, node and of {sorted(allowed)}")
        )
    out = dict(said)
    try:
        if out.get("at_px") is not None:
            x, y = out["at_px"]
            out["at_px"] = [round(float(x), 3), round(float(y), 3)]
        if out.get("sigma_px") is not None:
            out["sigma_px"] = round(float(out["sigma_px"]), 4)
        if out.get("frame") is not None:
            out["frame"] = int(out["frame"])
    except (TypeError, ValueError) as problem:
        raise ArgumentError(fault("edit", f"it cannot be ({problem})", "Give numbers")) from None
    _there(out, first, last)
    return out


def _there(decision: dict[str, Any], first: int, last: int) -> None:
    """Refuses a decision about frames that the table does not have, before it is in the file."""
    span = str(decision.get("frames", "")).split("..")
    try:
        told = [decision.get("frame"), int(span[0]) if span[0] else None]
        told += [int(span[1]) - 1 if len(span) > 1 and span[1] else None]
    except ValueError:
        raise ArgumentError(fault("frames", f"{decision['frames']!r} cannot be", "Give A..B")) from None
    beyond = next((frame for frame in told if frame is not None and not first <= frame <= last), None)
    if beyond is not None:
        problem = f"there are frames {first} to {last}, and no frame {beyond}"
        raise ArgumentError(fault("edit", problem, "Choose frames that are there"))


def checkable(text: str) -> str:
    """The text of a decision without what only a run can check: that there is something where it points."""
    return re.sub(r'what = "name"', 'what = "no_marker"', re.sub(r"(?m)^(frame|at_px) = .*\n", "", text))


def arranged(rig: Rig, said: dict[str, Any]) -> Rig:
    """The rig with other names and bodies of nodes: ``{"nodes": [[old name, new name, body], ...]}``."""
    told = {str(old): (str(name), str(body)) for old, name, body in said.get("nodes", [])}
    whole = json.loads(rig.to_json())
    for node in whole["node"]:
        node["name"], node["body"] = told.get(node["name"], (node["name"], node["body"]))
    bodies = list(dict.fromkeys(node["body"] for node in whole["node"]))
    moved = any(told.get(n.name, (n.name, n.body))[1] != n.body for n in rig.nodes)
    whole["body"] = [{"name": name} for name in bodies]
    if moved:
        # A joint is where two bodies of before met; with others it is found anew by the angles.
        whole["joint"] = []
    return Rig.from_json(json.dumps(whole))
