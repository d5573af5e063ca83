"""The inputs of a run: films, node tables or angles."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydpend.analyse.folder import UNFINISHED, Digests
from pydpend.analyse.options import Options
from pydpend.columns import column_names
from pydpend.errors import OptionError, PydpendError, Setting, fault, listed
from pydpend.kinds import expect, kind_of
from pydpend.kinematics import parse_zero
from pydpend.run_folder import FIT_FOLDER

TABLES = (".parquet", ".csv", ".txt")
"""Endings of tables."""


@dataclass(frozen=True)
class Recording:
    """One input. ``name`` is its folder in the run, ``label`` what people read."""

    name: str
    label: str
    path: str
    kind: str
    """``film``, ``nodes`` or ``angles``."""
    digest: str
    encoder: str | None = None

    def facts(self) -> dict[str, Any]:
        """The recording as plain values, for ``run.json``."""
        return asdict(self)


def recordings(options: Options, digests: Digests) -> tuple[Recording, ...]:
    """Each input with its kind, found from what is in it."""
    if not options.inputs:
        raise PydpendError(
            fault("INPUTS", "there is nothing to analyse", "Name a film, a node table or angles")
        )
    names: set[str] = set()
    contents: dict[str, str] = {}
    out = []
    for i, given in enumerate(options.inputs):
        path = Path(given)
        if not path.exists():
            raise PydpendError(fault(given, "there is no such file", "Check the name"))
        content = digests.of(path)
        if content in contents:
            other = contents[content]
            also = "" if other == given else f" (as {other} too)"
            raise PydpendError(
                fault(given, f"the recording is given twice{also}", "Give each recording once")
            )
        contents[content] = given
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", path.stem or path.name).strip("._") or "recording"
        name = stem
        count = 1
        while name in names or name in (FIT_FOLDER, UNFINISHED):
            count += 1
            name = f"{stem}_{count}"
        names.add(name)
        out.append(
            Recording(
                name=name,
                label=path.name,
                path=str(path),
                kind=recording_kind(path),
                digest=content,
                encoder=options.encoder if i == 0 else None,
            )
        )
    return tuple(out)


APPLIES: Mapping[str, tuple[str, ...]] = {
    "rig": ("film",),
    "edits": ("film",),
    "marker": ("film",),
    "markers": ("film",),
    "also": ("film",),
    "same": ("film",),
    "zero": ("film", "nodes"),
    "estimator": ("film", "nodes"),
    "bodies": ("film", "nodes"),
    "mirrored": ("film", "nodes"),
    "link_length_m": ("film", "nodes"),
    **dict.fromkeys(("axis", "pivot", "scale", "origin", "points"), ("film", "nodes")),
    "columns": ("angles",),
    "hanging_deg": ("angles",),
    "clockwise": ("angles",),
    "unwrap": ("angles",),
    **dict.fromkeys(Options().reading_key(), ("film",)),
}
"""Options and the kinds of input that they are of. Others are of all, or change no result."""

NOUNS = {"film": "a film", "nodes": "a node table", "angles": "an angles table"}


def check_options(options: Options, found: tuple[Recording, ...]) -> None:
    """Raises OptionError for an option that does nothing with these inputs."""
    kinds = {r.kind for r in found}
    if parse_zero(options.zero) is None:
        kinds.add(recording_kind(Path(options.zero)))
    plain = Options()
    for option, of in APPLIES.items():
        if getattr(options, option) != getattr(plain, option) and not kinds & set(of):
            raise OptionError(
                fault(
                    Setting(option),
                    f"is of {listed(NOUNS[kind] for kind in of)}, and no input is one",
                    "Leave it out",
                )
            )


def recording_kind(path: Path) -> str:
    """``film``, ``nodes`` or ``angles``, by what is in the file. Raises PydpendError for what is another thing."""
    expect(path, ("film", "pictures", "nodes", "angles"), PydpendError)
    kind = kind_of(path)
    if kind in ("nodes", "angles"):
        return kind
    if kind in ("film", "pictures") or path.suffix.lower() not in TABLES:
        return "film"
    # Columns under names of its own are an angles table's, if there are columns.
    column_names(path, PydpendError)
    return "angles"
