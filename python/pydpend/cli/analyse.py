"""From recordings to a report: tracks films, finds angles, compares an encoder, fits the damping.

Finished stages are kept: call it again after a change and only what depends on the change is done again.

  pydpend analyse drop.mp4 --encoder drop.csv --calibration holds/ -o run/
  pydpend analyse trial1.parquet trial2.parquet -o both/
  pydpend analyse --config run.toml -o run/
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import Field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydpend.cli.flags import add_fields, given
from pydpend.option_fields import meanings
from pydpend.terminal import below, shown

if TYPE_CHECKING:
    from pydpend.analyse.state import Event, Progress

HELP = "film, nodes or angles in, a run folder with a report out"


def add_arguments(p: argparse.ArgumentParser) -> None:
    """One flag for each field of `Options`, and how to run."""
    from pydpend.analyse.options import Options

    docs = meanings(Options)
    p.add_argument("inputs", nargs="*", metavar="RECORDING|NODES|ANGLES", help=docs["inputs"])
    p.add_argument("-o", "--output", metavar="DIR", help="run folder, made or gone on with")
    p.add_argument("--config", metavar="TOML", help="options from a file; flags given besides replace them")
    p.add_argument("--write-config", action="store_true", help="print the options as TOML and stop")
    p.add_argument("--dry-run", action="store_true", help="say what would be done and stop")
    p.add_argument("--json", action="store_true", help="print what was done as JSON")
    p.add_argument("--quiet", action="store_true", help="no progress")
    add_fields(p, Options, _flagged())


def _flagged() -> list[Field[Any]]:
    from pydpend.analyse.options import all_options

    return [f for f in all_options() if f.name != "inputs"]


def run(args: argparse.Namespace) -> int:
    """Runs the stages."""
    from pydpend.analyse import Options, RunState, analyse, plan, read_config, write_config
    from pydpend.analyse.folder import RunFolder
    from pydpend.analyse.state import StageState
    from pydpend.errors import PydpendError, fault
    from pydpend.run_folder import PAGE, RECORD

    options = read_config(args.config) if args.config else Options()
    told = given(args, _flagged())
    if args.inputs:
        told["inputs"] = tuple(args.inputs)
    options = replace(options, **told)
    if args.write_config:
        print(write_config(options))
        return 0
    if args.output is None:
        raise PydpendError(fault("-o", "the run folder is not named", "Give -o DIR"))
    folder = Path(args.output)
    if args.dry_run:
        todo = plan(options, folder)
        run_folder = RunFolder.open(folder) if (folder / RECORD).exists() else RunFolder(folder)
        states = {s.name: "kept" if run_folder.holds(s.name, s.key) else "to do" for s in todo}
        if args.json:
            print(json.dumps(states, indent=1))
        else:
            for s in todo:
                print(f"{states[s.name]:6} {s.title}")
        return 0

    outcome = analyse(options, folder, None if args.quiet else teller())
    if args.json:
        print(outcome.to_json(), end="")
    else:
        print(f"{outcome.message}; report: {outcome.folder / PAGE}")
    if args.quiet and not args.json:
        # With progress each stage said so as it ended.
        for name, state in outcome.stages.items():
            if state is StageState.NOT_DONE:
                print(f"{name}: not done: {outcome.reasons[name]}", file=sys.stderr)
    return 0 if outcome.status is RunState.DONE else 1


def teller() -> Progress:
    """Progress on stderr: on a terminal one line that moves, else a line as each stage starts and ends."""
    from pydpend.analyse.state import Going, Note, StageState, Started

    out = below(sys.stderr)
    moving = out.isatty()
    begun = time.monotonic()

    def tell(number: int, of: int, title: str, event: Event) -> None:
        nonlocal begun
        head = f"[{number}/{of}] {shown(title)}"
        wipe = "\x1b[K" if moving else ""
        if isinstance(event, Started):
            begun = time.monotonic()
            print(f"{head} ...", end="\r" if moving else "\n", file=out, flush=True)
        elif isinstance(event, Note):
            print(f"{wipe}{head}: note: {shown(event.text)}", file=out, flush=True)
        elif isinstance(event, Going):
            if moving:
                left = _left(event.share, begun)
                print(f"{wipe}{head}: {shown(str(event))}{left}", end="\r", file=out, flush=True)
        else:
            took = f" ({time.monotonic() - begun:.1f} s)" if event.state is StageState.DONE else ""
            print(f"{wipe}{head}: {shown(str(event))}{took}", file=out, flush=True)

    return tell


def _left(share: float | None, begun: float) -> str:
    """Remaining time, where the part that is done is known."""
    if not share:
        return ""
    return f", {(time.monotonic() - begun) * (1 - share) / share:.0f} s left"
