"""Damages every kind of file that pydpend reads and looks what comes of it.

Usage: python -m tests.validation.mutate [FORMAT ...] [--mutants 300] [--seed 1] [--keep FOLDER]

Each mutant goes through the program ``tracker`` and the commands of ``pydpend``, each call with a time and a memory
limit. What may come of it: the file is read (``ok``; damage to samples or numbers that carry no checksum cannot be
noticed), it is read in part and said so (``status 1``), or it is refused in one line (``refused``). What may not: see
`BAD`.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.mutants import mutant

TRACKER = Path(__file__).parent.parent.parent / "target" / "release" / "tracker"
LIMIT_S = 20
"""Of processor time: a call takes a second or two."""
WAIT_S = 180.0
"""Of any time: what waits for nothing ends here, also where many share the machine."""
LIMIT_BYTES = 3 << 30
"""Of address space: libraries and threads alone reserve one."""

BAD = ("panic", "hang", "traceback", "signal", "memory", "many lines", "frames lost")
"""What no damage may lead to. ``frames lost``: status 0 with another number of frames than the whole file's."""


@dataclass(frozen=True)
class Call:
    """A command on a mutant: words of ``tracker`` or ``pydpend``, in which ``OUT`` is a new path without an ending.

    ``table``: the ending of the node table that it writes, whose frames are counted.
    """

    words: tuple[str, ...]
    table: str = ""


@dataclass(frozen=True)
class Format:
    """A kind of input: files that ``make`` writes into a folder, of which ``damaged`` is one, and what reads it."""

    make: Callable[[Path], None]
    damaged: str
    text: bool
    calls: tuple[Call, ...]


@dataclass
class Outcome:
    """What came of one call."""

    kind: str
    said: str = ""


def _limits() -> None:
    # A fork begins with what its parent has: the limit is for what comes on top.
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + LIMIT_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # A runaway output must not fill the disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))


def _judged(status: int, said: str) -> Outcome:
    """From an exit status (minus a signal's number) and what was written to stderr."""
    lines = [line for line in said.splitlines() if line.strip()]
    if "panicked at" in said or status == 101:
        return Outcome("panic", said)
    if "Traceback (most recent call last)" in said:
        return Outcome("memory" if "MemoryError" in said else "traceback", said)
    if "memory allocation of" in said:
        return Outcome("memory", said)
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return Outcome("hang", f"more than {LIMIT_S} s of processor time: {said}")
    if status < 0:
        return Outcome("signal", f"{signal.Signals(-status).name}: {said}")
    if status == 2:
        errors = [line for line in lines if not line.startswith(("warning", "tracker: warning"))]
        return Outcome("refused" if len(errors) == 1 else "many lines", said)
    return Outcome({0: "ok", 1: "status 1"}.get(status, "signal"), said)


def _binary(words: list[str]) -> Outcome:
    try:
        done = subprocess.run(
            [str(TRACKER), *words[1:]], capture_output=True, timeout=WAIT_S, preexec_fn=_limits, check=False
        )
    except subprocess.TimeoutExpired:
        return Outcome("hang", f"more than {WAIT_S:g} s")
    return _judged(done.returncode, done.stderr.decode("utf-8", "replace"))


def _python(words: list[str]) -> Outcome:
    """``pydpend`` in a fork of this process, which has it imported: a start of Python takes longer than the call."""
    from pydpend.cli import main

    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            status = 70
            try:
                _limits()
                os.dup2(said.fileno(), 2)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False))
                sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False))
                # Warnings of libraries are lines that nobody asked for: they count as errors.
                warnings.simplefilter("error")
                try:
                    status = main(words[1:])
                except SystemExit as ended:
                    status = ended.code if isinstance(ended.code, int) else 2
                except BaseException:
                    traceback.print_exc()
                    status = 3
                sys.stderr.flush()
            finally:
                os._exit(status)
        end = time.monotonic() + WAIT_S
        while True:
            found, status = os.waitpid(child, os.WNOHANG)
            if found:
                break
            if time.monotonic() > end:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return Outcome("hang", f"more than {WAIT_S:g} s")
            time.sleep(0.002)
        said.seek(0)
        return _judged(os.waitstatus_to_exitcode(status), said.read().decode("utf-8", "replace"))


def _imported(call: Call, folder: Path) -> None:
    """Runs a command here, so that what it imports is there for every fork."""
    from pydpend.cli import main

    words = [word.replace("OUT", str(folder / "warm")).replace("HERE", str(folder)) for word in call.words]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(words[1:])
    for left in folder.glob("warm*"):
        shutil.rmtree(left) if left.is_dir() else left.unlink()


def _frames(table: Path) -> int:
    """Frames of a node table that was just written, from its first and last column alone."""
    import pyarrow.parquet as pq

    with table.open("rb") as file:
        return len(set(pq.read_table(file, columns=["frame"]).column("frame").to_pylist()))


def _called(call: Call, folder: Path, number: int) -> tuple[Outcome, int]:
    """What came of a call in a folder, and the frames of its table."""
    out = folder / f"out{number}"
    words = [word.replace("OUT", str(out)).replace("HERE", str(folder)) for word in call.words]
    outcome = _binary(words) if words[0] == "tracker" else _python(words)
    table = out.with_name(out.name + call.table)
    frames = _frames(table) if call.table and table.exists() and outcome.kind in ("ok", "status 1") else -1
    for left in folder.glob(f"{out.name}*"):
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    return outcome, frames


@dataclass
class Found:
    """What came of a format's mutants."""

    counts: Counter[str] = field(default_factory=Counter)
    bad: list[str] = field(default_factory=list)


def tried(name: str, known: Format, mutants: int, seed: int, folder: Path, keep: Path | None) -> Found:
    """Makes the files, sees that the commands take them whole, then damages one of them again and again."""
    known.make(folder)
    target = folder / known.damaged
    whole = target.read_bytes()
    clean: dict[str, int] = {}
    for i, call in enumerate(known.calls):
        if call.words[0] == "pydpend":
            _imported(call, folder)
        outcome, frames = _called(call, folder, i)
        if outcome.kind not in ("ok", "status 1"):
            raise RuntimeError(f"{name}: {' '.join(call.words)} does not take the whole file: {outcome.said}")
        clean[" ".join(call.words)] = frames
    out = Found()
    for k in range(mutants):
        rng = random.Random(f"{seed} {name} {k}")
        damaged, how = mutant(whole, known.text, rng)
        target.write_bytes(damaged)
        kinds = []
        for i, call in enumerate(known.calls):
            outcome, frames = _called(call, folder, i)
            if outcome.kind == "ok" and frames != clean[" ".join(call.words)]:
                outcome = Outcome(
                    "frames lost", f"{frames} frames of {clean[' '.join(call.words)]}: {outcome.said}"
                )
            kinds.append(outcome.kind)
            if outcome.kind in BAD:
                last = outcome.said.strip().splitlines()[-1:] or [""]
                place = ""
                if keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    saved = keep / f"{name.replace(' ', '_')}-{seed}-{k}-{Path(known.damaged).name}"
                    saved.write_bytes(damaged)
                    place = f" ({saved})"
                out.bad.append(
                    f"{name}, mutant {k} of seed {seed}, {how}: {' '.join(call.words)}: "
                    f"{outcome.kind}: {last[0][:300]}{place}"
                )
        # The worst of its calls stands for a mutant.
        order = (*BAD, "status 1", "refused", "ok")
        out.counts[min(kinds, key=order.index)] += 1
    target.write_bytes(whole)
    return out


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def main() -> int:
    """The command line: a line for each format, every bad case, status 1 if there is one."""
    from tests.support.mutated_formats import FORMATS

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument("--mutants", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the mutants that lead to something bad")
    args = parser.parse_args()
    unknown = set(args.formats) - set(FORMATS)
    if unknown:
        parser.error(f"no format is called {', '.join(unknown)}")
    columns = ("ok", "status 1", "refused", *BAD)
    print("| format | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    bad = 0
    for name in args.formats or FORMATS:
        with _folder() as folder:
            found = tried(name, FORMATS[name], args.mutants, args.seed, folder, args.keep)
        print(f"| {name} | " + " | ".join(str(found.counts[c]) for c in columns) + " |", flush=True)
        bad += len(found.bad)
        for line in found.bad:
            print(line, file=sys.stderr, flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
