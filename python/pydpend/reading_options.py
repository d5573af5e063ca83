"""The options of reading a film and of detecting markers in it, in one class for every command that reads a film."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

from pydpend import _native
from pydpend._typing import Frames, PixelAspect, Region
from pydpend.errors import ArgumentError, Setting, fault
from pydpend.option_fields import option

WORDS = _native.setting_words()
"""The words of each setting that has words, the default first."""


@dataclass(frozen=True, kw_only=True)
class OpenOptions:
    """The options of opening a film.

    Parameters
    ----------
    fps : float, optional
        Frames per second of recorded time, Hz, instead of what the film claims.
    decoder : str
        What reads compressed film: ``auto``, ``ffmpeg`` or ``opencv``.
    interlaced : str
        How film is read whose pictures hold two fields: not at all (``refuse``), or each picture as one
        (``as-frames``).
    pixel_aspect : str, optional
        Width to height of a film's pixels, e.g. ``16:15``, instead of what the film says.
    allow_protocol : bool
        Open network addresses and devices too.
    threads : int, optional
        Threads for tracking; all cores if not given. Changes no result.
    """

    fps: float | None = None
    decoder: str = option(WORDS["decoder"][0], choices=tuple(WORDS["decoder"]))
    interlaced: str = option(WORDS["interlaced"][0], choices=tuple(WORDS["interlaced"]))
    pixel_aspect: PixelAspect | None = None
    allow_protocol: bool = False
    threads: int | None = None

    def opened(self) -> _native.OpenOptions:
        """The options as the compiled half takes them. Raises ArgumentError naming the one that makes no sense."""
        threads = self.threads
        if threads is not None and not 0 < threads < 1 << 62:
            problem = f"{threads} is out of range"
            raise ArgumentError(
                fault(Setting("threads"), problem, "Give 1 or more, or nothing for one a core")
            )
        return _native.OpenOptions(
            fps=self.fps,
            decoder=self.decoder,
            interlaced=self.interlaced,
            pixel_aspect=aspect_text(self.pixel_aspect),
            allow_protocol=self.allow_protocol,
            threads=0 if threads is None else int(threads),
        )


@dataclass(frozen=True, kw_only=True)
class DetectOptions:
    """The options of detecting markers, and the frames in which they are followed.

    Parameters
    ----------
    frames : str, optional
        Frames of films to follow, ``A..B``: from A up to but not B; either may be left out.
    threshold : float, optional
        Level that parts markers from what is around them, in the film's units; learned from it if not given.
    polarity : str
        Whether markers are brighter or darker than what is around them: ``auto``, ``bright`` or ``dark``.
    centroid : str
        Centre by the disc that fits (``disc``), by intensity (``weighted``), or by OpenCV's contours as in the paper
        (``contour``).
    region : str, optional
        Part of the image in which markers are looked for, ``X0,Y0,X1,Y1``: first and last column and row, px.
    min_area_px : float, optional
        Least area of a marker, px; learned if not given.
    max_area_px : float, optional
        Greatest area of a marker, px; learned if not given.
    """

    frames: Frames | None = None
    threshold: float | None = None
    polarity: str = option(WORDS["polarity"][0], choices=tuple(WORDS["polarity"]))
    centroid: str = option(WORDS["centroid"][0], choices=tuple(WORDS["centroid"]))
    region: Region | None = None
    min_area_px: float | None = None
    max_area_px: float | None = None

    def detected(self) -> _native.DetectSettings:
        """The options as the compiled half takes them. Raises ArgumentError naming the one that makes no sense."""
        return _native.DetectSettings(
            threshold=self.threshold,
            polarity=self.polarity,
            centroid=self.centroid,
            region=region_text(self.region),
            min_area_px=self.min_area_px,
            max_area_px=self.max_area_px,
        )

    def span(self) -> tuple[int, int | None] | None:
        """First frame and one past the last. Raises ArgumentError for no range."""
        return frame_span(self.frames)


@dataclass(frozen=True, kw_only=True)
class ReadingOptions(DetectOptions, OpenOptions):
    """Both: what every command that looks for markers in a film can be told."""

    def reading(self) -> dict[str, Any]:
        """Options of reading alone, of a class that has more, as keywords of `track` and `setup`."""
        return {field.name: getattr(self, field.name) for field in fields(ReadingOptions)}

    def reading_key(self) -> dict[str, Any]:
        """The key of the nodes of a film: all that they depend on besides the film and its rig."""
        return {name: value for name, value in self.reading().items() if name != "threads"}


T = TypeVar("T", OpenOptions, ReadingOptions)


def given(options: type[T], arguments: Mapping[str, Any]) -> T:
    """The options among the arguments of a function, which has all of them by their names: ``given(T, locals())``."""
    return options(**{field.name: arguments[field.name] for field in fields(options)})


def aspect_text(aspect: PixelAspect | None) -> str | None:
    """The setting as the compiled half takes it, which knows what makes sense."""
    if aspect is None or isinstance(aspect, str):
        return aspect
    try:
        width, height = aspect
    except (TypeError, ValueError):
        raise ArgumentError(
            fault("pixel_aspect", f"{aspect!r} is no width and height", "Give (16, 15) or '16:15'")
        ) from None
    return f"{width}:{height}"


def region_text(region: Region | None) -> str | None:
    """The setting as the compiled half takes it, which knows what makes sense."""
    if region is None or isinstance(region, str):
        return region
    try:
        return ",".join(repr(float(v)) for v in region)
    except (TypeError, ValueError):
        raise ArgumentError(fault("region", f"{region!r} is no rectangle", "Give (x0, y0, x1, y1)")) from None


def frame_span(frames: Frames | None) -> tuple[int, int | None] | None:
    """First frame and one past the last. Raises ArgumentError for no range."""
    if frames is None:
        return None
    if isinstance(frames, str):
        frames = _native.frame_range(frames)
    if isinstance(frames, range):
        if frames.step != 1:
            raise ArgumentError(fault("frames", f"{frames} has a step", "Give a range without one"))
        frames = (frames.start, frames.stop)
    try:
        start, stop = frames
        start, stop = int(start), None if stop is None else int(stop)
    except (TypeError, ValueError):
        raise ArgumentError(
            fault("frames", f"{frames!r} is no range", "Give (first, one past the last)")
        ) from None
    if start < 0 or (stop is not None and stop <= start):
        raise ArgumentError(fault("frames", f"{frames!r} holds no frame", "Give (first, one past the last)"))
    return start, stop
