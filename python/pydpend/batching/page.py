"""``index.html``: a row a recording, sorted and chosen in the page itself.

Everything from files (names, reasons) is text: the template escapes it, and the script sets it as text.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2

from pydpend.batching.row import Light, State
from pydpend.coefficients import FULL, WORDS, unit
from pydpend.output import write_text
from pydpend.report.words import with_sigma, with_squares

INDEX = "index.html"

MOST_KINDS = 60
"""Kinds of warning that can be chosen, the most frequent."""

LONGEST_KIND = 90
"""Characters of a kind of warning in the list to choose from."""

_NUMBER = re.compile(r"[-+−]?\d[\d.]*(e[-+]?\d+)?")


def write_index(
    results: Path, rows: Sequence[Mapping[str, Any]], of: int, trials: Mapping[str, Any] | None
) -> None:
    """Writes the page of the recordings that have ended, ``of`` so many."""
    columns = _columns(rows)
    texts: dict[str, int] = {}
    kinds, of_row = _kinds(rows)
    data = {
        "words": {str(light): light.words for light in Light},
        "rows": [_row(row, columns, texts, mine) for row, mine in zip(rows, of_row, strict=True)],
        "texts": list(texts),
    }
    # Inside <script> only "</" and "<!--" are special; without any "<" neither can occur.
    written = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    here, report = files("pydpend.batching") / "assets", files("pydpend.report") / "assets"
    css = "\n".join(
        (at / name).read_text("utf-8") for at, name in ((report, "report.css"), (here, "index.css"))
    )
    counts = Counter(str(row["light"]) for row in rows)
    missing = of - len(rows)
    version = next((str(row["version"]) for row in rows if row.get("version")), "")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string((here / "index.html.j2").read_text("utf-8")).render(
        title=f"{results.name}: {of} recordings",
        subtitle=f"pydpend {version}" + (f"; {missing} recordings have not ended yet" if missing else ""),
        css=css,
        js=(here / "index.js").read_text("utf-8"),
        data=written,
        lights=[{"value": str(one), "words": one.words, "count": counts[str(one)]} for one in Light],
        kinds=kinds,
        columns=[*_FIXED, *({"name": c[0], "full": c[1], "number": True, "sort": True} for c in columns)],
        agreements=[_agreement(one) for one in trials["rigs"]] if trials else [],
    )
    write_text(results / INDEX, page)


_FIXED = (
    {"name": "recording", "full": "", "number": False, "sort": True},
    {"name": "result", "full": "", "number": False, "sort": True},
    {"name": "picture", "full": "", "number": False, "sort": False},
    {"name": "angles", "full": "", "number": False, "sort": False},
    {"name": "reason", "full": "", "number": False, "sort": True},
)
"""Columns that every page has; the script knows their places."""

_Column = tuple[str, str, str, str]
"""A column of numbers: its head, its words, and the row's columns of value and uncertainty."""


def _columns(rows: Sequence[Mapping[str, Any]]) -> list[_Column]:
    """The columns of numbers: those of which any row has one."""
    known: list[_Column] = [
        ("length (s)", "duration of the recording", "duration_s", ""),
        ("seen (%)", "markers seen, of all in all frames", "seen", ""),
        ("noise of φ1 (deg)", "median standard uncertainty of the angle", "noise1_deg", ""),
        ("encoder (deg)", "RMS difference of film and encoder", "encoder_rms_deg", ""),
        ("chi-square", "of the damping fit; 1 for a model that is right", "chi2", ""),
    ]
    known += [(f"{n} ({with_squares(unit(n))})", WORDS.get(n, ""), n, f"{n}_sigma") for n in FULL]
    known += [
        (f"{n}/psi", f"{WORDS.get(n, '')}, over psi", f"{n}_over_psi", f"{n}_over_psi_sigma") for n in FULL
    ]
    known.append(("took (s)", "time of the analysis", "seconds", ""))
    return [column for column in known if any(row.get(column[2]) is not None for row in rows)]


def _row(
    row: Mapping[str, Any], columns: Sequence[_Column], texts: dict[str, int], kinds: Sequence[int]
) -> dict[str, Any]:
    reason = row.get("reason") or ""
    values = [row.get(value) for _, _, value, _ in columns]
    return {
        "name": row["name"],
        "light": row["light"],
        "report": _address(row.get("report")) if row["state"] != State.FAILED else None,
        "film": _address(row.get("overlay")),
        "sketch": row.get("sketch"),
        "curve": row.get("curve"),
        "why": texts.setdefault(reason, len(texts)) if reason else None,
        "kinds": kinds,
        "values": values,
        "shown": [
            _shown(v, row.get(c[3]) if c[3] else None, c[2]) for v, c in zip(values, columns, strict=True)
        ],
    }


def _address(name: str | None) -> str | None:
    return quote(name) if name else None


def _shown(value: float | None, sigma: float | None, column: str) -> str:
    if value is None:
        return ""
    if sigma is not None:
        return with_sigma(value, sigma)
    return f"{100 * value:.1f}" if column == "seen" else f"{value:.3g}"


def kind_of_warning(text: str, name: str) -> str:
    """A warning without what is of one recording alone: its name and numbers."""
    bare = re.sub(rf"\b{re.escape(name)}(\.\w+)?\b(: )?", "", text)
    kind = _NUMBER.sub("#", bare)
    return kind if len(kind) <= LONGEST_KIND else kind[: LONGEST_KIND - 1].rstrip() + "…"


def _kinds(rows: Sequence[Mapping[str, Any]]) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """The kinds of warning with how many recordings have each, and each row's."""
    own = []
    for row in rows:
        stem = Path(str(row["path"])).stem
        said = row["warnings"] or ([row["reason"]] if row.get("reason") else [])
        own.append({kind_of_warning(text, stem) for text in said})
    counts = Counter(kind for kinds in own for kind in kinds)
    chosen = [kind for kind, _ in counts.most_common(MOST_KINDS)]
    place = {kind: i for i, kind in enumerate(chosen)}
    listed = [{"words": kind, "count": counts[kind]} for kind in chosen]
    return listed, [sorted(place[kind] for kind in kinds if kind in place) for kinds in own]


def _agreement(found: Mapping[str, Any]) -> dict[str, Any]:
    rows = []
    for name, s in found["coefficients"].items():
        chance = "–" if s["p_value"] is None else f"{s['p_value']:.2g}"
        mean = with_sigma(s["mean"], s["sigma"])
        unit_ = "" if s["unit"] == "1" else with_squares(s["unit"])
        rows.append((name, mean, f"{s['spread']:.2g}", str(len(s["recordings"])), chance, unit_))
    return {"message": found["message"], "rig": found["rig"], "rows": rows}
