"""The recordings of a batch: which there are, what each is called, its options, and what its result is made from."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from pydpend._native import fingerprint, recording_files
from pydpend.analyse.folder import digest
from pydpend.analyse.options import Options, check_files
from pydpend.analyse.provenance import FILES, command
from pydpend.analyse.stages import version
from pydpend.batching.options import BatchOptions
from pydpend.batching.sheet import SheetRow, read_sheet
from pydpend.errors import OptionError, PydpendError, Setting, fault
from pydpend.kinds import kind_of
from pydpend.output import AnyPath, path_of

RUNS = "runs"
"""Folder of the run folders."""

ROW_FORM = 1
"""Form of a recording's row; rows of another are made again."""


@dataclass(frozen=True)
class Job:
    """One recording to be analysed, as plain values that go to any process."""

    name: str
    path: str
    """Absolute."""
    options: dict[str, Any]
    """Options of `pydpend.analyse.Options` that are not the defaults; without the recording."""
    results: str
    """Folder of the batch, absolute."""
    kept: dict[str, str] = field(default_factory=dict)
    """Columns of the sheet that are no options."""
    key: str = ""
    """The hash of all that the result is made from; empty where the recording is not there."""
    token: str = ""
    """The call of `batch` that this is of."""
    version: str = ""
    common_rig: str = ""
    """Rig of the batch, to be used where it fits; empty for none."""
    threads: int = 1
    """Threads of the recording where its options name none."""
    front_end: str = ""
    """The function that makes the form in which messages name settings, ``module:function``; Python's own if empty."""

    @property
    def run(self) -> Path:
        """Its run folder."""
        return Path(self.results) / RUNS / self.name

    def analyse_options(self) -> Options:
        """The options of its analysis."""
        given: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in self.options.items()}
        return Options(inputs=(self.path,), **{"threads": self.threads, **given})

    def command(self) -> str:
        """The command line that does this recording alone."""
        options = self.analyse_options()
        return command(options if "threads" in self.options else replace(options, threads=None), self.run)

    def to_dict(self) -> dict[str, Any]:
        """The job as plain values."""
        return asdict(self)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Job:
        """The inverse of `to_dict`."""
        return cls(**{f.name: values[f.name] for f in fields(cls)})


@dataclass(frozen=True)
class Found:
    """A recording and its options, before it has a name."""

    path: Path
    options: Options
    kept: Mapping[str, str] = field(default_factory=dict)


def stamp(path: Path) -> list[Any]:
    """The sizes and times that tell a file or folder from one that replaced it. Raises OSError."""
    if not path.is_dir() and path.exists() and not path.is_file():
        raise OSError(f"{path} can be read once only, or never ends")
    if path.is_dir():
        inside = sorted(p for p in path.rglob("*") if p.is_file())
        return [[p.relative_to(path).as_posix(), *_sizes(p)] for p in inside]
    return [[*map(_sizes, _files(path))], fingerprint(_files(path))]


def _files(path: Path) -> list[Path]:
    try:
        return recording_files(path) or [path]
    except PydpendError:
        return [path]  # what is wrong with it is said when it is analysed


def _sizes(path: Path) -> list[int]:
    state = path.stat()
    return [state.st_size, state.st_mtime_ns]


def key_of(path: Path, options: Options, common_rig: str = "") -> str:
    """The key of a recording's row: its stamp, its options with the files that they name, the version.

    Raises OSError if the recording or a file is not there.
    """
    plain = told(options)
    for name in ("threads", "inputs"):
        plain.pop(name, None)
    named = {n: stamp(Path(plain[n])) for n in FILES if n in plain and Path(plain[n]).exists()}
    rig = stamp(Path(common_rig)) if common_rig else None
    return digest([ROW_FORM, version(), stamp(path), plain, named, rig])


def told(options: Options) -> dict[str, Any]:
    """The options that are not the defaults."""
    plain = Options()
    values = ((f.name, getattr(options, f.name)) for f in fields(Options))
    return {name: value for name, value in values if value != getattr(plain, name)}


def find_recordings(
    inputs: Sequence[AnyPath], base: Options, how: BatchOptions, note: Callable[[str], object]
) -> list[Found]:
    """The recordings of a batch in order, each with its options.

    Raises OptionError or PydpendError for what cannot be meant; a film of a sheet that is not there is left to be
    listed. ``note`` is told what the sheet and the names do not have in common.
    """
    if base.inputs:
        raise OptionError(
            fault(Setting("inputs"), "recordings are named apart", "Leave it out of the options")
        )
    base = _absolute(base)
    rows = [] if how.sheet is None else read_sheet(how.sheet, how.kept_columns)
    given = list(dict.fromkeys(path for word in inputs for path in _matching(word)))
    if not given and not rows:
        raise PydpendError(
            fault("RECORDINGS", "there is nothing to analyse", "Name films, or give " + Setting("sheet"))
        )
    by_path = {_normal(row.path): row for row in rows}
    out = []
    checked: set[str] = set()
    for path in given or [_normal(row.path) for row in rows]:
        row = by_path.pop(path, None)
        options = base if row is None else _of_row(base, row, str(how.sheet))
        # Each choice of files is looked at once, before anything is done.
        choice = repr([getattr(options, name) for name in FILES])
        if choice not in checked:
            checked.add(choice)
            _checked(options, row, str(how.sheet))
        out.append(Found(path, options, {} if row is None else row.kept))
    if given and rows:
        if by_path:
            lines = ", ".join(str(row.line) for row in list(by_path.values())[:5])
            note(
                f"{len(by_path)} of {len(rows)} rows of {how.sheet} are of no recording given (line {lines})"
            )
        bare = len(out) - (len(rows) - len(by_path))
        if bare:
            note(f"{bare} of {len(out)} recordings have no row in {how.sheet}")
    return out


def _normal(path: Path) -> Path:
    return Path(os.path.abspath(path))


def _matching(word: AnyPath) -> list[Path]:
    """The recordings that a name or a pattern means."""
    path = path_of(word)
    if not path.exists():
        found = sorted(glob.glob(os.fspath(path), recursive=True))
        if not found:
            is_pattern = glob.has_magic(os.fspath(path))
            problem = "no file has such a name" if is_pattern else "there is no such file"
            raise PydpendError(fault(str(path), problem, "Check the name"))
        return [_normal(Path(name)) for name in found]
    if path.is_dir() and kind_of(path) != "pictures":
        expected = "a folder is no recording unless it holds the pictures of one"
        raise PydpendError(fault(str(path), expected, f"Name the films in it: '{path}/*'"))
    return [_normal(path)]


def _absolute(options: Options) -> Options:
    """The options with the files that they name by their whole names, because workers run elsewhere."""
    named = {n: getattr(options, n) for n in FILES}
    there: dict[str, Any] = {
        n: str(_normal(Path(v))) for n, v in named.items() if v is not None and Path(v).exists()
    }
    return replace(options, **there)


def _of_row(base: Options, row: SheetRow, sheet: str) -> Options:
    try:
        return replace(base, **row.options)
    except PydpendError as problem:
        raise OptionError(_in_line(sheet, row, problem)) from problem


def _checked(options: Options, row: SheetRow | None, sheet: str) -> None:
    try:
        check_files(options)
    except PydpendError as problem:
        if row is None:
            raise
        raise OptionError(_in_line(sheet, row, problem)) from problem


def _in_line(sheet: str, row: SheetRow, problem: PydpendError) -> Any:
    return f"{sheet}, line {row.line}: " + problem.message


def named(found: Iterable[Found], known: Mapping[str, str]) -> list[tuple[str, Found]]:
    """Each recording with its name: the one it had (``known``, by path), else its file's, or folder and file."""
    taken = {name.casefold() for name in known.values()}
    out = []
    for one in found:
        name = known.get(str(one.path))
        if name is None:
            stem, folder = _plain(one.path.stem or one.path.name), _plain(one.path.parent.name)
            name, count = stem, 1
            if name.casefold() in taken and folder:
                stem = name = f"{folder}_{stem}"
            while name.casefold() in taken:
                count += 1
                name = f"{stem}_{count}"
            taken.add(name.casefold())
        out.append((name, one))
    return out


def _plain(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")[:100] or "recording"
