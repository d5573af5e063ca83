"""A run folder: which stages are done, from what, and whether they still hold.

A stage holds if the hash of what it was made from (inputs, options, the program's version, the stages before it)
is the same and the files that it wrote are there unchanged, by their SHA-256. ``run.json`` is written whole and
renamed. A folder may come from anyone: what ``run.json`` names is deleted only if it is a file that the stage makes.
A stage writes into `UNFINISHED`; what it made is moved to its place when it is whole.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydpend._native import fingerprint, recording_files
from pydpend.analyse.contents import made_by
from pydpend.documents import Table, read_json
from pydpend.errors import PydpendError, fault
from pydpend.output import check_kept, results_folder, write_text
from pydpend.run_folder import RECORD

RUN_SCHEMA = 5
"""A folder of an older schema is done again, one of a newer is refused."""

UNFINISHED = "unfinished"
"""Folder in the run folder where a stage writes until it is done."""


class RunFolderError(PydpendError):
    """A folder that is not a run of pydpend, or cannot be written."""


def digest(value: Any) -> str:
    """A hash of a JSON-like value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


@dataclass
class Digests:
    """SHA-256 of input files. One whose size and time of change are known already is not read again."""

    known: dict[str, list[Any]] = field(default_factory=dict)
    """Absolute path: size in bytes, time of change in ns and its fingerprint, SHA-256."""

    def of(self, path: Path) -> str:
        """SHA-256 of a file, or of the names and digests of the files in a folder.

        Of a film that is two files, of both.
        """
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.is_file())
            return digest({p.relative_to(path).as_posix(): self.of(p) for p in inside})
        others = [p for p in recording_files(path) if not p.samefile(path)]
        if others:
            return digest([self._of_file(path), *(self._of_file(p) for p in others)])
        return self._of_file(path)

    def _of_file(self, path: Path) -> str:
        name, state = str(path.absolute()), path.stat()
        known = self.known.get(name)
        now = f"{state.st_mtime_ns} {fingerprint([path])}"
        if known is None or known[:2] != [state.st_size, now]:
            known = [state.st_size, now, _sha256(path)]
            self.known[name] = known
        return str(known[2])

    def option(self, name: str | None) -> str | None:
        """The key of an option that may be a file: its digest if it is one, else its words."""
        if name is None:
            return None
        path = Path(name)
        return self.of(path) if path.exists() else name


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _stages(table: Table) -> dict[str, dict[str, Any]]:
    """The records of each stage in ``run.json``, checked: files are later taken away by these names."""
    out = {}
    for stage in table:
        done = table.table(stage)
        files = done.table("files")
        for name in files:
            if not made_by(stage, name):
                files.refuse(name, f"{name!r} is no file that this stage makes")
        out[stage] = {
            "key": done.text("key"),
            "files": {name: files.text(name) for name in files},
            "message": done.text("message"),
            "seconds": done.number("seconds"),
        }
    return out


@dataclass
class RunFolder:
    """A run folder and what ``run.json`` says of it."""

    path: Path
    stages: dict[str, dict[str, Any]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    begun: dict[str, str] = field(default_factory=dict)
    """Keys of stages that write in place and were begun: only with the same key can they be gone on with."""

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """The folder, made if it is not there. One that holds other things is refused."""
        record = path / RECORD
        if not record.exists():
            if path.exists() and (not path.is_dir() or any(path.iterdir())):
                raise RunFolderError(
                    fault(str(path), "is not empty and not a run of pydpend", "Give a new folder with -o")
                )
            return cls(results_folder(path))
        raw = read_json(record, RunFolderError, "Use a new folder")
        schema = raw.whole("schema")
        if schema > RUN_SCHEMA:
            raw.refuse("schema", f"schema {schema} is not known")
        for inside in path.iterdir():
            # What a stage writes or deletes through it would be elsewhere.
            if inside.is_symlink() and inside.is_dir():
                raise RunFolderError(
                    fault(str(inside), "a folder of a run is a link to another place", "Use a new folder")
                )
        if schema < RUN_SCHEMA:
            return cls(path)
        begun = raw.table("begun")
        return cls(
            path,
            stages=_stages(raw.table("stages")),
            facts=raw.table("facts").values,
            begun={stage: begun.text(stage) for stage in begun},
        )

    def digests(self) -> Digests:
        """The digests of inputs that are known from the run before."""
        facts = Table(self.facts, str(self.path / RECORD), RunFolderError, "facts", "Use a new folder")
        if "digests" not in facts:
            return Digests()
        table = facts.table("digests")
        known: dict[str, list[Any]] = {}
        for name in table:
            entry = table.items(name)
            kinds = (int, str, str)
            if len(entry) != 3 or not all(isinstance(e, k) for e, k in zip(entry, kinds, strict=True)):
                table.refuse(name, "size, time of change and SHA-256 are expected")
            known[name] = entry
        return Digests(known)

    def save(self) -> None:
        """Writes ``run.json``."""
        content = {
            "schema": RUN_SCHEMA,
            "facts": self.facts,
            "stages": self.stages,
            "begun": self.begun,
        }
        text = json.dumps(content, indent=1)
        try:
            write_text(self.path / RECORD, text + "\n")
        except OSError as error:
            raise RunFolderError(fault(str(self.path), f"cannot be written ({error.strerror})")) from None

    def holds(self, stage: str, key: str) -> bool:
        """Whether the stage was done from exactly this and its files are there."""
        done = self.stages.get(stage)
        if done is None or done["key"] != key:
            return False
        return all(
            (self.path / name).is_file() and _sha256(self.path / name) == known
            for name, known in done["files"].items()
        )

    def begin(self, stage: str, key: str) -> bool:
        """Records that a stage writes in place from now on; whether what an earlier run left can be gone on with."""
        same = self.begun.get(stage) == key
        self.stages.pop(stage, None)
        self.begun[stage] = key
        self.save()
        return same

    def take(self, stage: str, unfinished: Path, into: Path) -> list[str]:
        """Moves what a stage made to its place and returns the names. From here on the former result is gone."""
        former = self.stages.pop(stage, {"files": {}})["files"]
        self.save()
        names = []
        for source in sorted(p for p in unfinished.rglob("*") if p.is_file()):
            target = into / source.relative_to(unfinished)
            check_kept(target)
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(source, target)
            names.append(target.relative_to(self.path).as_posix())
        for name in set(former) - set(names):
            (self.path / name).unlink(missing_ok=True)
        return names

    def done(self, stage: str, key: str, files: list[str], message: str, seconds: float) -> None:
        """Records a stage and saves."""
        self.stages[stage] = {
            "key": key,
            "files": {name: _sha256(self.path / name) for name in files},
            "message": message,
            "seconds": round(seconds, 2),
        }
        self.save()

    def forget(self, wanted: set[str]) -> None:
        """Drops stages that are no longer part of the run, so that no page shows them."""
        for stage in [s for s in self.stages if s not in wanted]:
            del self.stages[stage]
