"""The contents of a run folder, as a page. Reads files, computes nothing that a stage has not."""

from __future__ import annotations

import re
from pathlib import Path

from pydpend.citing import bibtex
from pydpend.report import damping, recording
from pydpend.report.page import Block, Code, Heading, Links, Listing, Page, Section, Table, Text
from pydpend.report.tiles import tiles
from pydpend.report.words import sentence
from pydpend.run_folder import FIT_FOLDER, README, RECORD, StoredRun, read_run


def report_page(folder: str | Path) -> Page:
    """The report of a run folder (`pydpend.analyse`)."""
    run = read_run(folder)
    fit = run.fit_folder.fit() if FIT_FOLDER in run.stages else None
    predictions = run.predictions()
    warnings = [f"{run.title(name)}: {why}" for name, why in run.not_done.items()]
    answer: list[Block] = []
    if fit is not None:
        answer = [Heading("Damping"), *damping.answer(fit, predictions, run.fit_folder.scale())]
    read: list[recording.Part] = []
    parts: list[Section] = []
    for r in run.recordings:
        part = recording.read(r)
        read.append(part)
        warnings += part.warnings
        parts += part.sections(f"r{r.index}", r.label if len(run.recordings) > 1 else "")
    if any(part.answer for part in read):
        answer += [Heading("Recordings" if len(read) > 1 else "Recording"), beside_each_other(read)]
    if fit is not None:
        warnings += damping.warnings(fit)
        parts += damping.sections(run, fit, predictions)
    if not answer:
        answer = [Text("No stage gave a result; the warnings say why.")]
    if run.does_not_apply:
        answer.append(Heading("What does not apply"))
        answer.append(Listing(tuple(f"{run.title(name)}: {why}" for name, why in run.does_not_apply.items())))
    names = ", ".join(r.label for r in run.recordings) or run.path.name
    return Page(
        title=f"Analysis of {names}",
        subtitle=f"pydpend {run.version}",
        tiles=tiles(read, fit),
        warnings=tuple(dict.fromkeys(warnings)),
        sections=(
            Section("answer", "Results", tuple(answer)),
            *parts,
            Section("reproduce", "Reproduce and cite", tuple(_reproduce(run))),
        ),
    )


def beside_each_other(parts: list[recording.Part]) -> Table:
    """The results of each recording, a column each."""
    columns = [dict(part.answer) for part in parts]
    properties = dict.fromkeys(name for column in columns for name in column)
    rows = tuple((name, *(column.get(name, "–") for column in columns)) for name in properties)
    header = ("property", *(part.label for part in parts))
    return Table(header, rows, numbers=frozenset(range(1, len(header))))


_WORD = re.compile(r"""(?:\$'(?:[^'\\]|\\.)*'|'[^']*'|"[^"]*"|\\.|[^\s'"\\])+""")
"""A word of a command line with its quotes."""


def in_lines(command: str) -> str:
    """A command line with each option on a line of its own, still to be copied as it is."""
    lines: list[list[str]] = [[]]
    for word in _WORD.findall(command):
        if word.startswith("-") and not re.match(r"-\.?\d", word):
            lines.append([])
        lines[-1].append(word)
    return " \\\n    ".join(" ".join(line) for line in lines)


def files_beside(run: StoredRun) -> list[str]:
    """The files of a run that people open, from its folder."""
    made = {name for done in run.stages.values() for name in done.files}
    return [
        README,
        RECORD,
        *sorted(name for name in made if not name.endswith((".png", ".svg", ".mp4"))),
    ]


def _reproduce(run: StoredRun) -> list[Block]:
    return [
        Text("This page was made by"),
        Code(in_lines(run.command)),
        Table(("given as", "file", "SHA-256"), run.inputs),
        Table(("program", "version"), tuple(run.versions.items())),
        Table(
            ("stage", "what came of it", "took (s)"),
            tuple(
                (run.title(name), sentence(done.message), f"{done.seconds:.1f}")
                for name, done in run.stages.items()
            ),
            numbers=frozenset({2}),
        ),
        Text(
            "Every number, table and option is in the folder beside this page; README.txt there lists them. "
            "As long as the page lies in that folder, these open:"
        ),
        Links(tuple(files_beside(run))),
        Text(
            f"Cite as: The pydpend developers, pydpend {run.version} (software), and for the method "
            "A. D. Myers, J. R. Tempelman, D. Petrushenko, F. A. Khasawneh, The Double Pendulum: An Experimental "
            "Design Report (2020). For BibTeX:"
        ),
        Code(bibtex(run.version).strip(), "BibTeX"),
        Text(
            "Angles are absolute, counter-clockwise positive, zero hanging down, unwrapped over turns. An uncertainty "
            "is one standard uncertainty."
        ),
    ]
