"""Tracks of several files, of one film each, as one: programs that export one track a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pydpend.errors import TableError, fault
from pydpend.raw_tracks import Floats, RawTracks

NEAR = 0.1
"""Times of two files that are nearer than this part of a step are of one frame, and must be the same."""


def merged(parts: Sequence[RawTracks]) -> RawTracks:
    """One set of tracks of several, by their times where all have them, else by their frame numbers.

    Raises TableError for units, axes or times that contradict, and for names that are there twice.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    for other in parts[1:]:
        for what, mine, its in (
            ("unit", first.unit, other.unit),
            ("direction of y", first.is_y_up, other.is_y_up),
            ("number of coordinates", first.xyz.shape[2], other.xyz.shape[2]),
            ("picture size", first.image_px, other.image_px),
            ("form", first.form, other.form),
        ):
            if mine != its:
                problem = f"its {what} is {its}, and that of {first.source} is {mine}"
                raise TableError(
                    fault(other.source, problem, "Give files that one program wrote of one film")
                )
        twice = sorted({n for p in parts if p is not other for n in p.names} & set(other.names))
        if twice:
            problem = f"{', '.join(twice)} is in another of the files too"
            raise TableError(fault(other.source, problem, "Give each point a name of its own"))
    by_time = all(p.t_s is not None for p in parts)
    keys: list[Floats] = [
        p.t_s if by_time and p.t_s is not None else p.frame.astype(np.float64) for p in parts
    ]
    key = np.unique(np.concatenate(keys))
    if by_time:
        _check_near(parts, keys, key)
    at = [np.searchsorted(key, k) for k in keys]
    frame = np.arange(key.size, dtype=np.int64) if by_time else key.astype(np.int64)
    notes = list(dict.fromkeys(note for p in parts for note in p.notes))
    return replace(
        first,
        source=", ".join(p.source for p in parts),
        names=tuple(n for p in parts for n in p.names),
        frame=frame,
        t_s=key if by_time else None,
        xyz=_spread([p.xyz for p in parts], at, key.size),
        sigma=_all([p.sigma for p in parts], at, key.size),
        confidence=_all([p.confidence for p in parts], at, key.size),
        bodies=None,
        status=None,
        area_px=None,
        notes=notes,
    )


def _check_near(parts: Sequence[RawTracks], keys: Sequence[Floats], key: Floats) -> None:
    """Refuses times that differ by so little that they are of one frame."""
    steps = [np.diff(k) for k in keys if k.size > 1]
    if not steps:
        return
    near = np.flatnonzero(np.diff(key) < NEAR * float(np.median(np.concatenate(steps))))
    if near.size:
        one, other = float(key[near[0]]), float(key[near[0] + 1])
        a = next(p.source for p, k in zip(parts, keys, strict=True) if one in k)
        b = next(p.source for p, k in zip(parts, keys, strict=True) if other in k)
        problem = f"its time {other!r} s is not that of {a}, which has {one!r} s"
        raise TableError(fault(b, problem, "Export the points with the same times, with all digits"))


def _spread(
    values: Sequence[Floats], at: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.intp]]], frames: int
) -> Floats:
    parts = []
    for v, rows in zip(values, at, strict=True):
        part = np.full((frames, *v.shape[1:]), np.nan)
        part[rows] = v
        parts.append(part)
    return np.concatenate(parts, axis=1)


def _all(
    values: Sequence[Floats | None], at: Sequence[np.ndarray[tuple[int, ...], np.dtype[np.intp]]], frames: int
) -> Floats | None:
    given = [v for v in values if v is not None]
    return _spread(given, at, frames) if len(given) == len(values) else None
