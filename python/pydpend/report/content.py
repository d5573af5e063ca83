"""What a run folder holds, as a page. Reads files, computes nothing that a stage has not."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

from pydpend.documents import read_json
from pydpend.errors import PydpendError
from pydpend.plots.folder import AGAIN
from pydpend.report import damping, recording
from pydpend.report.page import Block, Code, Heading, Listing, Page, Section, Table, Text
from pydpend.report.words import sentence


def _json(path: Path) -> dict[str, Any] | None:
    """A JSON object, or ``None`` where the stage that writes it was not done."""
    return read_json(path, PydpendError, AGAIN).values if path.exists() else None


def report_page(folder: str | Path) -> Page:
    """The report of a run folder (`pydpend.analyse`)."""
    path = Path(folder)
    run = _json(path / "run.json") or {"facts": {}, "stages": {}}
    facts: dict[str, Any] = run["facts"]
    stages: set[str] = set(run["stages"])
    found: list[dict[str, Any]] = facts.get("recordings", [])
    fit = _json(path / "fit" / "fit.json") if "fit" in stages else None
    prediction = _json(path / "prediction.json") if "prediction" in stages else None

    titles: dict[str, str] = facts.get("titles", {})
    warnings = [f"{titles.get(name, name)}: {why}" for name, why in facts.get("not_done", {}).items()]
    answer: list[Block] = []
    if fit is not None:
        model = _json(path / "fit" / "model.json")
        answer = [Heading("Damping"), *damping.answer(fit, prediction, model)]
    read: list[recording.Part] = []
    parts: list[Section] = []
    for i, r in enumerate(found):
        part = recording.read(path, r, stages)
        read.append(part)
        warnings += part.warnings
        parts += part.sections(f"r{i}", r["label"] if len(found) > 1 else "")
    if any(part.answer for part in read):
        answer += [Heading("Recordings" if len(read) > 1 else "Recording"), beside_each_other(read)]
    if fit is not None:
        warnings += damping.warnings(fit)
        parts += damping.sections(path, fit, prediction)
    if not answer:
        answer = [Text("No stage gave a result; the warnings say why.")]
    apart = facts.get("does_not_apply", {})
    if apart:
        answer.append(Heading("What does not apply"))
        answer.append(Listing(tuple(f"{titles.get(name, name)}: {why}" for name, why in apart.items())))
    names = ", ".join(r["label"] for r in found) or path.name
    return Page(
        title=f"Analysis of {names}",
        subtitle=f"pydpend {facts.get('version', '')}",
        warnings=tuple(dict.fromkeys(warnings)),
        sections=(
            Section("answer", "Results", tuple(answer)),
            *parts,
            Section("reproduce", "Reproduce and cite", tuple(_reproduce(facts, run["stages"]))),
        ),
    )


def beside_each_other(parts: list[recording.Part]) -> Table:
    """What was found of each recording, a column each."""
    columns = [dict(part.answer) for part in parts]
    properties = dict.fromkeys(name for column in columns for name in column)
    rows = tuple((name, *(column.get(name, "–") for column in columns)) for name in properties)
    header = ("property", *(part.label for part in parts))
    return Table(header, rows, numbers=frozenset(range(1, len(header))))


def in_lines(command: str) -> str:
    """A command line with each option on a line of its own, still to be copied as it is."""
    lines: list[list[str]] = [[]]
    for word in shlex.split(command):
        if word.startswith("-") and not re.match(r"-\.?\d", word):
            lines.append([])
        lines[-1].append(word)
    return " \\\n    ".join(shlex.join(line) for line in lines)


def _reproduce(facts: dict[str, Any], stages: dict[str, dict[str, Any]]) -> list[Block]:
    rows = tuple((i["given_as"], i["path"], i["sha256"]) for i in facts.get("inputs", ()))
    return [
        Text("This page was made by"),
        Code(in_lines(facts.get("command", ""))),
        Table(("given as", "file", "SHA-256"), rows),
        Table(("program", "version"), tuple(facts.get("versions", {}).items())),
        Table(
            ("stage", "what came of it", "took (s)"),
            tuple(
                (facts.get("titles", {}).get(name, name), sentence(done["message"]), f"{done['seconds']:.1f}")
                for name, done in stages.items()
            ),
            numbers=frozenset({2}),
        ),
        Text(
            "Every number, table and option is in the folder beside this page; README.txt there lists them."
        ),
        Text(
            f"Cite as: The pydpend developers, pydpend {facts.get('version', '')} (software), and for the method "
            "A. D. Myers, J. R. Tempelman, D. Petrushenko, F. A. Khasawneh, The Double Pendulum: An Experimental "
            "Design Report (2020)."
        ),
        Text(
            "Angles are absolute, counter-clockwise positive, zero hanging down, unwrapped over turns. An uncertainty "
            "is one standard uncertainty."
        ),
    ]
