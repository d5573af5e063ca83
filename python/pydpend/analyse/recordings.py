"""What the inputs of a run are: films, node tables or angles."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydpend.analyse.folder import UNFINISHED, Digests
from pydpend.analyse.options import Options
from pydpend.columns import column_names
from pydpend.errors import PydpendError, fault


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
        """As plain values, for ``run.json``."""
        return asdict(self)


def recordings(options: Options, digests: Digests) -> tuple[Recording, ...]:
    """Each input with its kind, found from what is in it."""
    if not options.inputs:
        raise PydpendError(
            fault("INPUTS", "there is nothing to analyse", "Name a film, a node table or angles")
        )
    names: set[str] = set()
    out = []
    for i, given in enumerate(options.inputs):
        path = Path(given)
        if not path.exists():
            raise PydpendError(fault(given, "there is no such file", "Check the name"))
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", path.stem or path.name).strip("._") or "recording"
        name = stem
        count = 1
        while name in names or name in ("fit", UNFINISHED):
            count += 1
            name = f"{stem}_{count}"
        names.add(name)
        out.append(
            Recording(
                name=name,
                label=path.name,
                path=str(path),
                kind=kind_of(path),
                digest=digests.of(path),
                encoder=options.encoder if i == 0 else None,
            )
        )
    return tuple(out)


def kind_of(path: Path) -> str:
    """``film``, ``nodes`` or ``angles``, from what the file says of itself."""
    if path.is_dir():
        return "angles" if any(path.glob("DPmean_data_RB*.npy")) else "film"
    ending = path.suffix.lower()
    if ending not in (".parquet", ".csv", ".txt"):
        return "film"
    columns = column_names(path, PydpendError)
    return "nodes" if {"node", "x_px"} <= set(columns) else "angles"
