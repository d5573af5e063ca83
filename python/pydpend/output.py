"""Files that are written: whole under their names or not at all, and never over what is read.

Whatever a name looks like, an address, a pattern or an option, it is the name of one file on this machine: libraries
that would look into it are given a file of another name. The compiled half keeps to the same rules for what it writes.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias

from pydpend._native import check_outputs
from pydpend.errors import ArgumentError, fault

AnyPath: TypeAlias = str | bytes | os.PathLike[str] | os.PathLike[bytes]
"""A file's name in any of the forms in which Python takes one; it need not be UTF-8."""

_READ: ContextVar[frozenset[tuple[int, int]]] = ContextVar("_READ", default=frozenset())
"""Device and number of each file that the work under way reads."""


def path_of(path: AnyPath) -> Path:
    """A name as a path; bytes that are not UTF-8 become surrogates, as everywhere in Python.

    Raises ArgumentError for an empty name, which Python takes for the folder that it is in, and for one with a NUL.
    """
    name = os.fsdecode(path)
    if not name or "\0" in name:
        problem = "holds a NUL, as no name of a file does" if name else "is empty"
        raise ArgumentError(fault(repr(name), f"the name {problem}", "Give the name of a file"))
    return Path(name)


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


@contextmanager
def keeping(read: Iterable[AnyPath]) -> Iterator[None]:
    """While this lasts, none of the files ``read`` is replaced, whatever link leads to it. Of a folder all files."""
    known = set(_READ.get())
    for given in read:
        path = path_of(given)
        for file in path.rglob("*") if path.is_dir() else [path]:
            found = _identity(file)
            if found is not None and not file.is_dir():
                known.add(found)
    token = _READ.set(frozenset(known))
    try:
        yield
    finally:
        _READ.reset(token)


def check_kept(target: Path) -> None:
    """Raises ArgumentError if writing ``target`` would destroy a file that is read."""
    if _identity(target) in _READ.get():
        raise ArgumentError(
            fault(str(target), "it is read, and writing it would destroy it", "Choose another name")
        )


def check_new(paths: Iterable[AnyPath | None], *, replace: bool) -> None:
    """Whether the files ``paths`` may be written: asked before the work that gives their content begins.

    Raises
    ------
        ArgumentError: if one is read (see `keeping`), two are the same, or, unless ``replace``, one is there already.
    """
    files = [path_of(path) for path in paths if path is not None]
    for file in files:
        check_kept(file)
    check_outputs([os.fspath(file) for file in files], [], replace)


@contextmanager
def whole(path: AnyPath) -> Iterator[Path]:
    """A new empty file with the ending of ``path``; it becomes ``path`` when the block ends without an exception.

    Nothing else has its name, so no link is followed and no file is replaced before that. A pipe or a device is given
    as it is.

    Raises
    ------
        ArgumentError: if ``path`` is a file that is read, see `keeping`.
        OSError: if it cannot be made.
    """
    target = path_of(path)
    check_kept(target)
    if target.exists() and not stat.S_ISREG(target.stat().st_mode) and not target.is_dir():
        yield target
        return
    # The ending only as far as libraries know one: any other may be as long as a name.
    ending = target.suffix if len(os.fsencode(target.suffix)) <= 16 else ""
    while True:
        temporary = target.with_name(f".pydpend-{secrets.token_hex(6)}.writing{ending}")
        try:
            os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            break
        except FileExistsError:
            continue
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def check_folder(path: AnyPath) -> Path:
    """The folder that results go into. Raises ArgumentError if a file has its name or the name of one above it."""
    folder = path_of(path)
    if os.fspath(folder) == "-":
        what = "standard output is not possible: the results need a folder"
        raise ArgumentError(fault("-", what, "Give the name of a folder"))
    there = next((p for p in (folder, *folder.parents) if p.exists()), None)
    if there is not None and not there.is_dir():
        what = "it is a file, and the results need a folder"
        raise ArgumentError(fault(str(there), what, "Give the name of a folder"))
    return folder


def results_folder(path: AnyPath) -> Path:
    """The folder that results go into, made if it is not there. Raises ArgumentError if it cannot be."""
    folder = check_folder(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        what = f"the folder cannot be made ({problem.strerror})"
        raise ArgumentError(fault(str(folder), what, "Give a folder that can be written")) from problem
    return folder


def write_text(path: AnyPath, text: str) -> None:
    """Writes a text file, UTF-8; what UTF-8 cannot hold, as of a name that is not UTF-8, is written out.

    Raises
    ------
        ArgumentError: if ``path`` is a file that is read.
        OSError: if it cannot be written.
    """
    with whole(path) as temporary:
        temporary.write_bytes(text.encode("utf-8", "backslashreplace"))
