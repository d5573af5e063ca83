"""The provenance of a run folder: its inputs, the versions and the command that made it."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pydpend.analyse.contents import about
from pydpend.analyse.folder import Digests, RunFolder
from pydpend.analyse.options import Options, all_options
from pydpend.option_fields import flag_of
from pydpend.terminal import shell_word

FILES = ("rig", "edits", "encoder", "calibration", "model", "zero")
"""Options that may name a file or a folder."""


def inputs(options: Options, digests: Digests) -> list[dict[str, str]]:
    """Every file or folder that the run reads: what it was given as, its path, its SHA-256."""
    named = [("input", name) for name in options.inputs]
    named += [(flag_of(o), str(getattr(options, o))) for o in FILES if getattr(options, o) is not None]
    return [
        {"given_as": given, "path": name, "sha256": digests.of(Path(name))}
        for given, name in named
        if Path(name).exists()
    ]


def versions() -> dict[str, str]:
    """Of pydpend, Python and the libraries that compute."""
    from pydpend import _native

    found = {"pydpend": _native.VERSION, "python": platform.python_version()}
    for name in ("numpy", "scipy", "pyarrow", "matplotlib", "npTDMS"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not known"
    return found


def command(options: Options, folder: Path) -> str:
    """The command line that does this run again."""
    words = ["pydpend", "analyse", *options.inputs, "-o", str(folder)]
    default = Options()
    for f in all_options():
        value = getattr(options, f.name)
        if f.name == "inputs" or value == getattr(default, f.name):
            continue
        flag = flag_of(f.name)
        if isinstance(value, bool):
            words.append(flag if value else flag.replace("--", "--no-", 1))
            continue
        for one in value if isinstance(value, tuple) else (value,):
            words += [f"{flag}={one}"] if str(one).startswith("-") else [flag, str(one)]
    return " ".join(map(shell_word, words))


def readme(run: RunFolder) -> str:
    """The description of the folder, for a person who opens it in ten years."""
    facts: dict[str, Any] = run.facts
    lines = [
        f"A run of pydpend {facts['version']}.",
        "",
        "Made by:",
        f"  {facts['command']}",
        "with " + ", ".join(f"{name} {number}" for name, number in facts["versions"].items()),
        "",
        "From (SHA-256):",
        *(f"  {i['sha256']}  {i['path']} ({i['given_as']})" for i in facts["inputs"]),
        "",
        "report.html  the page for people: warnings, results, film, plots; needs no network",
        "run.json     inputs with SHA-256, options, versions, and what each stage was made from",
        "",
    ]
    for name, done in run.stages.items():
        lines.append(f"{name}: {done['message']}")
        lines += [f"  {file:32} {about(file)}".rstrip() for file in done["files"]]
    lines += [f"{name}: not done: {why}" for name, why in facts.get("not_done", {}).items()]
    lines += [f"{name}: does not apply: {why}" for name, why in facts.get("does_not_apply", {}).items()]
    lines += [
        "",
        "Angles are in rad, counter-clockwise positive, zero hanging down; other units are in the names.",
        "Figures alone: pydpend plot FIGURE FOLDER -o figure.pdf",
        "",
    ]
    return "\n".join(lines)
