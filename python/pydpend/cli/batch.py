"""Many recordings, each analysed into a run folder of its own, on this machine or on a cluster.

Done recordings are kept: call it again after a change or an interruption and only what is missing is done.

  pydpend batch 'trials/*.mraw' --fps 2000 -o results/
  pydpend batch --sheet trials.csv --one-rig -o results/
  pydpend batch 'trials/*.mraw' --scheduler tcp://host:8786 -o results/
  pydpend batch --status results/
"""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import Field, replace
from typing import TYPE_CHECKING, Any

from pydpend.cli.flags import add_fields, given
from pydpend.terminal import below, shown

if TYPE_CHECKING:
    from pydpend.batching.run import Advance, Event, Tell

HELP = "many recordings in, a run folder of each and a table of all out"

MOST_LISTED = 20
"""Failed recordings that are listed with their reasons; the table has all."""


def add_arguments(p: argparse.ArgumentParser) -> None:
    """One flag for each field of `BatchOptions` and of `Options`."""
    from pydpend.analyse.options import Options
    from pydpend.batching.options import BATCH_FIELDS, BatchOptions

    p.add_argument(
        "recordings",
        nargs="*",
        metavar="RECORDING",
        help="films, node tables or angles, or patterns in quotes",
    )
    p.add_argument("-o", "--output", metavar="DIR", help="folder of the results, made or gone on with")
    p.add_argument("--status", metavar="DIR", help="say how far the batch in a folder is, and stop")
    p.add_argument("--config", metavar="TOML", help="options of the analysis from a file")
    p.add_argument("--json", action="store_true", help="print what was done as JSON")
    p.add_argument("--quiet", action="store_true", help="no progress")
    add_fields(p.add_argument_group("the batch"), BatchOptions, BATCH_FIELDS)
    add_fields(p.add_argument_group("each recording, as in `pydpend analyse`"), Options, _flagged())


def _flagged() -> list[Field[Any]]:
    from pydpend.analyse.options import all_options

    return [f for f in all_options() if f.name != "inputs"]


def run(args: argparse.Namespace) -> int:
    """Does the batch, or says how far it is."""
    from pydpend.analyse import Options, read_config
    from pydpend.batching.options import BATCH_FIELDS
    from pydpend.batching.run import batch
    from pydpend.errors import OptionError, PydpendError, fault

    if args.status is not None:
        return _status(args)
    options = read_config(args.config) if args.config else Options()
    if options.inputs:
        raise OptionError(
            fault(
                args.config, "it names inputs, and a batch is told its recordings apart", "Take the key out"
            )
        )
    if args.output is None:
        raise PydpendError(fault("-o", "the folder of the results is not named", "Give -o DIR"))
    options = replace(options, **given(args, _flagged()))
    tell: Tell | None = None if args.quiet else teller()
    with _ended_as_by_ctrl_c():
        found = batch(args.recordings, args.output, options, progress=tell, **given(args, BATCH_FIELDS))
    if args.json:
        print(found.to_json(), end="")
        return 0 if found.is_whole else 1
    print(f"{found.message}; page: {found.folder / 'index.html'}")
    if found.trials:
        print(found.trials)
    for name, why in list(found.reasons.items())[:MOST_LISTED]:
        print(f"failed: {name}: {why}\n  again: {found.commands[name]}")
    if len(found.reasons) > MOST_LISTED:
        print(f"and {len(found.reasons) - MOST_LISTED} more, in batch.parquet and on the page")
    return 0 if found.is_whole else 1


def _status(args: argparse.Namespace) -> int:
    from pydpend.batching.status import status

    found = status(args.status)
    if args.json:
        print(found.to_json(), end="")
        return 0
    print(found.message + ("" if found.left_s is None else f"; about {in_time(found.left_s)} left"))
    if found.works:
        print(f"works at it: {found.works}")
    for name, who in found.running.items():
        print(f"running: {name}: {who}")
    for name, why in list(found.failed.items())[:MOST_LISTED]:
        print(f"failed: {name}: {why}")
    if len(found.failed) > MOST_LISTED:
        print(f"and {len(found.failed) - MOST_LISTED} more failed")
    return 0


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """While this lasts, SIGTERM, by which schedulers of clusters end a job, is as Ctrl-C: what is done is kept."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def in_time(seconds: float) -> str:
    """A duration for people: ``40 s``, ``12 min``, ``3.5 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def teller() -> Tell:
    """Progress on stderr: on a terminal one line that moves below the failures, else a line a recording."""
    out = below(sys.stderr)
    moving = out.isatty()
    begun = time.monotonic()
    first: list[int] = []

    def left(step: Advance) -> str:
        # What earlier calls did ends at once and tells nothing of the time.
        done = step.done - first[0]
        if not done or step.done == step.of:
            return ""
        return f", {in_time((time.monotonic() - begun) * (step.of - step.done) / done)} left"

    def tell(event: Event) -> None:
        wipe = "\x1b[K" if moving else ""
        if isinstance(event, str):
            print(f"{wipe}note: {shown(event)}", file=out, flush=True)
            return
        row = event.ended.row
        if event.ended.kept:
            first[:] = [event.done]
            return
        if not first:
            first.append(0)
        head = f"[{event.done}/{event.of}]"
        if event.again:
            print(
                f"{wipe}{head} {shown(row['name'])}: {shown(row['reason'])}; tried again",
                file=out,
                flush=True,
            )
            return
        bad = row["state"] == "failed"
        if bad or not moving:
            took = f" ({row['seconds']:.1f} s)" if row.get("seconds") else ""
            why = f": {shown(row['reason'])}" if row["reason"] else ""
            print(f"{wipe}{head} {shown(row['name'])}: {row['state']}{took}{why}", file=out, flush=True)
        if moving:
            failures = f", {event.failed} failed" if event.failed else ""
            end = "\n" if event.done == event.of else "\r"
            print(f"{wipe}{head}{failures}{left(event)}", end=end, file=out, flush=True)

    return tell
