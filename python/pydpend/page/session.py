"""One film on the page: what a person has chosen, what tracking found with it, and what was decided since."""

from __future__ import annotations

import math
import os
import re
import tempfile
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pydpend import _native
from pydpend.errors import ArgumentError, PydpendError, fault, speaking
from pydpend.live import detect
from pydpend.nodes import Nodes, nodes_of, read_nodes
from pydpend.output import AnyPath
from pydpend.page.choice import Choice, chosen
from pydpend.page.doubts import described, doubts, runs
from pydpend.page.edits_file import EditsFile
from pydpend.page.frames import Frames
from pydpend.page.said import arranged, checkable, decision_of
from pydpend.page.words import PageWords
from pydpend.reading_options import OpenOptions
from pydpend.recording_folder import RunFile
from pydpend.tracking import info, setup, track

MOST_ROWS = 400
"""Frames of rows in one answer: some 100 kB of nine markers."""

MOST_DETECTIONS = 300
"""Detections of a frame that are sent: a page with more shows no one anything."""


class Cancelled(Exception):
    """A run that the person does not want any more."""


@dataclass
class Work:
    """A run in the background, and how it ended."""

    busy: bool = False
    stage: str = ""
    done: int = 0
    total: int | None = None
    problem: str | None = None
    warnings: list[str] = field(default_factory=list)
    candidates: list[dict[str, Any]] = field(default_factory=list)
    wanted: threading.Event = field(default_factory=threading.Event)


class Session:
    """The film and everything that is known of it. Methods may be called from several threads.

    Parameters
    ----------
    film : Path
        The film.
    folder : Path
        Where edits, rig and table are kept.
    rig : Path, optional
        A rig to begin with.
    """

    def __init__(self, film: Path, folder: Path, rig: Path | None = None) -> None:
        self.film, self.folder = film, folder
        self.facts = info(film)
        options = OpenOptions(interlaced="as-frames")
        # Small pictures are of frames all over the film; what reads them must not take the other one's place away.
        self._frames, self._thumbs = Frames(film, options), Frames(film, options)
        self.edits = EditsFile(self.file("edits.toml"), film.name, self.facts.get("sha256_ends"))
        self.edits.entries()
        self.choice = Choice()
        self.work = Work()
        self.nodes: Nodes | None = None
        self.saved = False
        self._lock = threading.RLock()
        self._thread: threading.Thread | None = None
        self._version = 0
        # What the page polls for is summed up once for each table and each set of decisions.
        self._summed: tuple[tuple[int, str], dict[str, Any]] = ((-1, ""), {})
        self._rig = rig if rig is not None else self.file("rig.toml")
        self._uses_rig = self._rig.exists()
        self.start()

    def file(self, ending: str) -> Path:
        """A file of this film in the folder: ``drop.edits.toml`` of drop.mp4."""
        return self.folder / f"{self.film.stem}.{ending}"

    # What is shown.

    def state(self) -> dict[str, Any]:
        """All that the page shows besides pictures and rows, as JSON has it."""
        with self._lock:
            nodes, entries = self.nodes, self.edits.entries()
            out: dict[str, Any] = {
                "film": self._facts(),
                "choice": asdict(self.choice),
                "work": {k: v for k, v in vars(self.work).items() if k != "wanted"},
                "edits": [_plain(entry) for entry in entries],
                "files": {
                    "edits": str(self.edits.path),
                    "table": str(self.file(RunFile.NODES)),
                    "rig": str(self.file("rig.toml")),
                },
                "saved": self.saved,
                "table": None,
                "version": self._version,
                "command": self.command(),
            }
            if nodes is not None:
                known = (self._version, self.edits.text)
                if self._summed[0] != known:
                    self._summed = (known, _summary(nodes, entries))
                out["table"] = self._summed[1]
            return out

    def _facts(self) -> dict[str, Any]:
        names = ("name", "container", "codec", "width", "height", "depth_bits", "rate_hz", "rate_origin")
        time = self.facts.get("time") or {}
        count = self.facts.get("frames") or self.facts.get("declared_frames")
        told = [*self.facts.get("warnings", []), *time.get("notes", [])]
        return {name: self.facts.get(name) for name in names} | {"frames": count, "notes": told}

    def command(self) -> str:
        """The command line that makes the same table again."""
        words = ["pydpend", "track", self.film.name]
        if self._uses_rig:
            words += ["--rig", self._rig.name]
        words += self.choice.words()
        if self.edits.entries():
            words += ["--edits", self.edits.path.name]
        return " ".join([*words, "-o", self.file(RunFile.NODES).name])

    def rows(self, first: int, last: int) -> dict[str, Any]:
        """Rows of some frames: of each frame, for each node, x, y, sigma (px) and status."""
        with self._lock:
            nodes = self.nodes
        if nodes is None:
            return {"frame": [], "rows": []}
        a, b = np.searchsorted(nodes.frame, (first, min(last, first + MOST_ROWS)))
        values = np.concatenate(
            (nodes.xy_px[a:b], nodes.sigma_px[a:b, :, None], nodes.status[a:b, :, None]), axis=2
        )
        found = [[[_finite(v) for v in node] for node in row] for row in values.tolist()]
        return {"frame": nodes.frame[a:b].tolist(), "rows": found}

    def curve(self, node: str) -> dict[str, Any]:
        """The places of a node over the frames, for a plot."""
        with self._lock:
            nodes = self.nodes
        if nodes is None or node not in nodes.rig.names:
            raise ArgumentError(fault("node", f"{node} is no node", "Choose one of the list"))
        xy = nodes.xy_px[:, nodes.rig.names.index(node)]
        return {
            "frame": nodes.frame.tolist(),
            "x": [_finite(v) for v in xy[:, 0].tolist()],
            "y": [_finite(v) for v in xy[:, 1].tolist()],
        }

    def jpeg(self, index: int, low: float | None, high: float | None, width: int | None) -> bytes:
        """The picture of a frame, see `Frames.jpeg`."""
        return (self._frames if width is None else self._thumbs).jpeg(index, low, high, width)

    def detections(self, index: int, threshold: float | None, node: str | None) -> dict[str, Any]:
        """Spots of a frame: x, y, sigma and area (px) of each, and where ``node`` should be.

        The largest come first, or those that are nearest to where the node should be.
        """
        expected = None if node is None else self._expected(index, node)
        samples, bits = self._frames.samples(index)
        if samples is None:
            return {"found": [], "all": 0, "expected": None, "problem": "the frame could not be decoded"}
        image = samples.astype(np.uint8) if bits == 8 else samples
        chosen = self.choice
        try:
            found = detect(
                image,
                threshold=threshold,
                polarity=chosen.polarity,  # type: ignore[arg-type]
                region=chosen.region,
                depth_bits=bits,
            )
        except PydpendError as problem:
            with speaking(PageWords()):
                return {"found": [], "all": 0, "expected": expected, "problem": str(problem)}
        rows = [[float(d[k]) for k in ("x_px", "y_px", "sigma_px", "area_px")] for d in found]
        if expected is None:
            rows.sort(key=lambda row: -row[3])
        else:
            x, y = expected
            rows.sort(key=lambda row: math.hypot(row[0] - x, row[1] - y))
        return {"found": rows[:MOST_DETECTIONS], "all": len(rows), "expected": expected, "problem": None}

    def _expected(self, index: int, node: str) -> tuple[float, float] | None:
        """Where a node should be in a frame: on the line between the nearest frames that show it."""
        with self._lock:
            nodes = self.nodes
        if nodes is None or node not in nodes.rig.names:
            return None
        n = nodes.rig.names.index(node)
        seen = nodes.seen[:, n]
        if not seen.any():
            return None
        x, y = (np.interp(index, nodes.frame[seen], nodes.xy_px[seen, n, k]) for k in (0, 1))
        return float(x), float(y)

    # What changes.

    def choose(self, said: dict[str, Any]) -> None:
        """Takes a person's choice and tracks the film with it. Raises ArgumentError for what makes no sense."""
        choice = chosen(self.choice, said)
        with self._lock:
            self.choice = choice
            # Another choice finds a rig of its own; only a rate leaves names and bodies as they are.
            if said.keys() - {"fps"}:
                self._uses_rig = False
        self.start()

    def arrange(self, said: dict[str, Any]) -> None:
        """Gives nodes other names or bodies, and tracks with that rig. Raises RigError for what makes no sense."""
        with self._lock:
            if self.nodes is None:
                raise ArgumentError(fault("rig", "there is none yet", "Find the markers first"))
            rig = arranged(self.nodes.rig, said)
            rig.write(self.file("rig.toml"))
            self._rig, self._uses_rig = self.file("rig.toml"), True
        self.start()

    def decide(self, said: dict[str, Any]) -> None:
        """Writes a decision, makes it on the rows at once, and tracks the whole film with it in the background.

        Raises ArgumentError for a decision that cannot be, which is not written.
        """
        with self._lock:
            if self.nodes is None:
                raise ArgumentError(fault("edits", "there are no markers yet", "Find the markers first"))
            decision = decision_of(said, int(self.nodes.frame[0]), int(self.nodes.frame[-1]))
            text = self.edits.head() + "\n" + self.edits.entry(decision)
            # A name is followed through detections, which only a run has; all others are made on the rows.
            if decision["what"] != "name":
                columns = _native.edited_table(
                    self.nodes._columns(), self.nodes._meta_json(), text, str(self.edits.path)
                )
                changed = nodes_of(columns)
            else:
                _native.edited_table(self.nodes._columns(), self.nodes._meta_json(), checkable(text), "edits")
                changed = self.nodes
            self.edits.append(decision)
            self._show(changed)
        self.start()

    def undo(self) -> bool:
        """Takes the last decision back; whether there was one."""
        with self._lock:
            undone = self.edits.undo()
        if undone:
            self.start()
        return undone

    # What runs.

    def start(self) -> None:
        """Tracks the film with what is chosen and decided now; a run that goes on is given up."""
        with self._lock:
            self.work.wanted.set()
            before = self._thread
            self.saved = False
            self.work = Work(busy=True, stage="opening")
            self._thread = threading.Thread(target=self._run, args=(self.work, before), daemon=True)
            self._thread.start()

    def wait(self, seconds: float) -> None:
        """Waits for the run."""
        if self._thread is not None:
            self._thread.join(seconds)

    def close(self) -> None:
        """Gives up what runs."""
        self.work.wanted.set()
        self.wait(5)

    def _run(self, work: Work, before: threading.Thread | None) -> None:
        if before is not None:
            before.join()

        def told(stage: str, done: int, total: int | None) -> None:
            if work.wanted.is_set():
                raise Cancelled
            work.stage, work.done, work.total = stage, done, total

        with speaking(PageWords()):
            try:
                self._track(work, told)
            except Cancelled:
                return
            except (PydpendError, OSError) as problem:
                if not work.wanted.is_set():
                    work.problem = str(problem)
            finally:
                work.busy = False

    def _track(self, work: Work, told: Callable[[str, int, int | None], None]) -> None:
        with self._lock:
            choice, entries = self.choice, self.edits.entries()
            rig = self._rig if self._uses_rig else None
        reading = choice.reading()
        edits = self.edits.path if entries else None
        try:
            # In a folder of its own, so that another page of this film may track it at the same time.
            with tempfile.TemporaryDirectory(prefix=".page-", dir=self.folder) as own:
                table = Path(own) / RunFile.NODES
                nodes = track(self.film, rig, **reading, edits=edits, output=table, progress=told)
                with self._lock:
                    if work.wanted.is_set():
                        return
                    os.replace(table, self.file(RunFile.NODES))
        except PydpendError:
            if not choice.marker and rig is None:
                work.candidates = self._candidates(reading, told)
            with self._lock:
                self._show(None)
            raise
        with self._lock:
            if work.wanted.is_set():
                return
            if rig is None:
                nodes.rig.write(self.file("rig.toml"))
            work.warnings = list(nodes.meta.get("warnings", []))
            self._show(read_nodes(self.file(RunFile.NODES)))
            self.saved = True

    def _show(self, nodes: Nodes | None) -> None:
        self.nodes = nodes
        self._version += 1

    def _candidates(
        self, reading: dict[str, Any], told: Callable[[str, int, int | None], None]
    ) -> list[dict[str, Any]]:
        """Candidates where it is not clear what is meant, each with its number, place, frame and look."""
        try:
            setup(self.film, **reading, progress=told)
        except PydpendError as unclear:
            lines = getattr(unclear, "candidates", [])
            found = [_CANDIDATE.match(line) for line in lines]
            return [
                {"number": int(m[1]), "x": float(m[2]), "y": float(m[3]), "frame": int(m[4]), "words": m[5]}
                for m in found
                if m is not None
            ]
        return []


def _summary(nodes: Nodes, entries: list[dict[str, Any]]) -> dict[str, Any]:
    """The table as the page shows it, without its rows."""
    return {
        "nodes": [asdict(node) for node in nodes.rig.nodes],
        "bodies": list(nodes.rig.bodies),
        "joints": [asdict(joint) for joint in nodes.rig.joints],
        "first": int(nodes.frame[0]),
        "last": int(nodes.frame[-1]),
        "frames": int(nodes.frame.size),
        "seen": [float(v) for v in nodes.seen.mean(axis=0)],
        "runs": [runs(nodes.status[:, n], nodes.frame) for n in range(len(nodes.rig.nodes))],
        "doubts": described(doubts(nodes, entries)),
        "decided": nodes.edits,
        "moving": "moving" in nodes.meta.get("settings", {}),
    }


_CANDIDATE = re.compile(r"(\d+), at ([-\d.]+),([-\d.]+)@(\d+): (.*)", re.DOTALL)


def _finite(value: float) -> float | None:
    return round(value, 4) if np.isfinite(value) else None


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    return {
        key: value if isinstance(value, (int, float, list)) else str(value) for key, value in entry.items()
    }


def checked_film(film: AnyPath) -> Path:
    """The film's path. Raises ArgumentError for what is no file that can be read again."""
    path = Path(os.fsdecode(film))
    if not path.exists():
        raise ArgumentError(
            fault(str(path), "there is no such file", "Check the name and the folder you are in")
        )
    return path
