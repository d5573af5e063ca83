"""Whether recordings of one rig agree: mean and spread of each quantity, and which recordings stand apart.

Unlike `pydpend.trials`, which fits all recordings together, this combines the fits of each: it takes any number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from pydpend.batching.row import State
from pydpend.coefficients import FULL, RATIOS, unit
from pydpend.fit_folder import FitFile
from pydpend.fit_status import FitStatus
from pydpend.json_text import write_json
from pydpend.trials import combine

TRIALS = str(FitFile.TRIALS)

APART = 0.01
"""Probability with which one of all recordings that agree would be called apart (Bonferroni: shared out over them)."""

FEWEST = 2
"""Recordings that can agree or not."""


def agreement(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The common values of recordings of one rig: ``message``, ``recordings``, ``coefficients``, ``apart``.

    Takes the rows whose fit converged.
    """
    fitted = [row for row in rows if row.get("fit_status") == FitStatus.CONVERGED]
    spreads: dict[str, Any] = {}
    apart: dict[str, list[str]] = {}
    for name, column, its_unit in _quantities():
        have = [
            row for row in fitted if (row.get(f"{column}_sigma") or 0.0) > 0 and row.get(column) is not None
        ]
        if len(have) < FEWEST:
            continue
        values = np.array([row[column] for row in have])
        sigmas = np.array([row[f"{column}_sigma"] for row in have])
        found = combine(values, sigmas, its_unit)
        spreads[name] = {"recordings": [row["name"] for row in have]} | found.to_dict()
        off = np.abs(values - found.mean) / np.hypot(sigmas, found.spread)
        most = norm.isf(APART / (2 * len(have)))
        for row, z in zip(have, off.tolist(), strict=True):
            if z > most:
                apart.setdefault(row["name"], []).append(name)
    return {
        "message": _message(len(fitted), spreads, apart),
        "recordings": [row["name"] for row in fitted],
        "coefficients": spreads,
        "apart": apart,
    }


def _quantities() -> list[tuple[str, str, str]]:
    """Name, column and unit of what is compared."""
    own = [(name, name, unit(name)) for name in FULL]
    over = [(f"{name}/psi", f"{name}_over_psi", f"{unit(name)}, over psi") for name in FULL]
    return [*own, *over, *((f"{name}/psi", f"ratio_{name}", unit(name)) for name in RATIOS)]


def _message(count: int, spreads: Mapping[str, Any], apart: Mapping[str, Any]) -> str:
    if not spreads:
        return f"{count} recordings were fitted: too few to be compared"
    differ = [n for n, s in spreads.items() if s["p_value"] is not None and s["p_value"] < APART]
    said = f"{count} recordings: "
    if differ:
        said += f"they differ beyond their errors in {', '.join(differ)}: use the spread between them"
    else:
        said += "they agree within their errors"
    if apart:
        names = list(apart)
        more = f" and {len(names) - 5} more" if len(names) > 5 else ""
        said += f". {', '.join(names[:5])}{more} stand{'s' if len(names) == 1 else ''} apart from the others"
    return said


def write_agreement(results: Path, rows: Iterable[Mapping[str, Any]]) -> dict[str, Any] | None:
    """Writes ``trials.json`` where recordings share a rig file; what it says, None where there is none."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["state"] != State.FAILED and row.get("rig_file"):
            groups.setdefault(str(row["rig_file"]), []).append(row)
    found = {rig: agreement(group) for rig, group in groups.items() if len(group) >= FEWEST}
    target = results / TRIALS
    if not found:
        target.unlink(missing_ok=True)
        return None
    value = {"rigs": [{"rig": rig, **said} for rig, said in found.items()]}
    write_json(target, value)
    return value
