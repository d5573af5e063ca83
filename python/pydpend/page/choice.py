"""A person's choice of how a film is read and what is followed in it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from pydpend.errors import ArgumentError, fault


@dataclass(frozen=True)
class Choice:
    """A person's choice of how the film is read and what is followed in it.

    Parameters
    ----------
    fps : float, optional
        Frames a second of recorded time.
    frames : str, optional
        Frames ``A..B``, from A up to but not B.
    region : str, optional
        ``X0,Y0,X1,Y1``, px.
    polarity : str
        ``auto``, ``bright`` or ``dark``.
    threshold : float, optional
        Level in the film's units.
    marker : tuple of tuple
        Places (x, y, frame) of what is to be followed.
    markers : int, optional
        How many markers there are.
    """

    fps: float | None = None
    frames: str | None = None
    region: str | None = None
    polarity: str = "auto"
    threshold: float | None = None
    marker: tuple[tuple[float, float, int], ...] = ()
    markers: int | None = None

    def words(self) -> list[str]:
        """The options of ``pydpend track`` for it."""
        out: list[str] = []
        for name in ("fps", "frames", "region", "threshold", "markers"):
            value = getattr(self, name)
            if value is not None:
                out += [f"--{name}", f"{value:g}" if isinstance(value, float) else str(value)]
        if self.polarity != "auto":
            out += ["--polarity", self.polarity]
        for x, y, frame in self.marker:
            out += ["--marker", f"{x:g},{y:g}@{frame}"]
        return out

    def reading(self) -> dict[str, Any]:
        """The keywords of `track` for it."""
        said = asdict(self)
        if not self.marker:
            del said["marker"]
        return said


def chosen(before: Choice, said: dict[str, Any]) -> Choice:
    """The choice with what was said now. Raises ArgumentError for what makes no sense."""
    known = set(asdict(before))
    wrong = said.keys() - known
    if wrong:
        raise ArgumentError(
            fault(sorted(wrong)[0], "it is no setting", f"Known are {', '.join(sorted(known))}")
        )
    values = dict(said)
    try:
        if "marker" in values:
            values["marker"] = tuple((float(x), float(y), int(f)) for x, y, f in values["marker"])
        for name in ("fps", "threshold"):
            if values.get(name) is not None:
                values[name] = float(values[name])
        if values.get("markers") is not None:
            values["markers"] = int(values["markers"])
        choice = replace(before, **values)
    except (TypeError, ValueError) as problem:
        raise ArgumentError(fault("choice", f"it cannot be ({problem})", "Give numbers")) from None
    if choice.fps is not None and not choice.fps > 0:
        raise ArgumentError(fault("fps", f"{choice.fps:g} is not above 0", "Give the frames of one second"))
    return choice
