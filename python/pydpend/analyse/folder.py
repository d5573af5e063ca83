"""A run folder: which stages are done, from what, and whether they still hold.

A stage holds if the hash of what it was made from (inputs, options, the program's version, the stages before it)
is the same and the files that it wrote are there unchanged in size. ``run.json`` is written whole and renamed.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydpend.errors import PydpendError, fault

RUN_SCHEMA = 1


class RunFolderError(PydpendError):
    """A folder that is not a run of pydpend, or cannot be written."""


def digest(value: Any) -> str:
    """A hash of a JSON-like value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, or of the names and digests of the files in a folder."""
    if path.is_dir():
        return digest(
            {p.relative_to(path).as_posix(): file_digest(p) for p in sorted(path.rglob("*")) if p.is_file()}
        )
    with path.open("rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()


def write_whole(path: Path, text: str) -> None:
    """Writes a file so that it is there whole or not at all."""
    temporary = path.with_name(path.name + ".new")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)


@dataclass
class RunFolder:
    """A run folder and what ``run.json`` says of it."""

    path: Path
    stages: dict[str, dict[str, Any]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def open(cls, path: Path) -> RunFolder:
        """The folder, made if it is not there. One that holds other things is refused."""
        record = path / "run.json"
        if not record.exists():
            if path.exists() and (not path.is_dir() or any(path.iterdir())):
                raise RunFolderError(
                    fault(str(path), "is not empty and not a run of pydpend", "Give a new folder with -o")
                )
            try:
                path.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise RunFolderError(fault(str(path), f"cannot be made ({error.strerror})")) from None
            return cls(path)
        try:
            raw = json.loads(record.read_text("utf-8"))
            if raw["schema"] != RUN_SCHEMA:
                raise RunFolderError(
                    fault(str(record), f"schema {raw['schema']} is not known", "Use a new folder")
                )
            return cls(path, stages=dict(raw["stages"]), facts=dict(raw["facts"]))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RunFolderError(
                fault(
                    str(record),
                    f"cannot be read ({error})",
                    "Use a new folder, or remove the file to do all again",
                )
            ) from None

    def save(self) -> None:
        """Writes ``run.json``."""
        text = json.dumps({"schema": RUN_SCHEMA, "facts": self.facts, "stages": self.stages}, indent=1)
        try:
            write_whole(self.path / "run.json", text + "\n")
        except OSError as error:
            raise RunFolderError(fault(str(self.path), f"cannot be written ({error.strerror})")) from None

    def holds(self, stage: str, key: str) -> bool:
        """Whether the stage was done from exactly this and its files are there."""
        done = self.stages.get(stage)
        if done is None or done["key"] != key:
            return False
        return all(
            (self.path / name).is_file() and (self.path / name).stat().st_size == size
            for name, size in done["files"].items()
        )

    def done(self, stage: str, key: str, files: list[str], message: str) -> None:
        """Records a stage and saves."""
        sizes = {name: (self.path / name).stat().st_size for name in files}
        self.stages[stage] = {"key": key, "files": sizes, "message": message}
        self.save()

    def forget(self, wanted: set[str]) -> None:
        """Drops stages that are no longer part of the run, so that no page shows them."""
        for stage in [s for s in self.stages if s not in wanted]:
            del self.stages[stage]
