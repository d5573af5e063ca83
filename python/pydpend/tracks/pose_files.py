"""Pose estimation in HDF5: SLEAP, and movement's NetCDF."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pydpend.errors import TableError, fault
from pydpend.raw_tracks import Floats, RawTracks
from pydpend.tracks.cells import DAMAGE, EXTRA, damaged, library
from pydpend.tracks.wide_text import PCUTOFF, names_of


def sleap_h5(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """SLEAP's analysis HDF5: ``tracks`` by track, axis, node and frame, or as ``dims`` says, with ``point_scores``."""
    h5py = library("h5py", str(path), "HDF5 of SLEAP", EXTRA)
    try:
        with h5py.File(path, "r") as file:
            places = _ordered(
                file["tracks"], ("frame", "track", "node", "xy"), ("track", "xy", "node", "frame")
            )
            nodes = [_word(v) for v in file["node_names"][()]]
            tracks = [_word(v) for v in file["track_names"][()]] or ["track"]
            score = None
            if "point_scores" in file:
                score = _ordered(file["point_scores"], ("frame", "track", "node"), ("track", "node", "frame"))
            shape = _video_shape(file)
    except DAMAGE as problem:
        raise damaged(path, problem) from problem
    count = places.shape[0]
    called = names_of(tracks[: places.shape[1]], nodes)
    xy = places.reshape(count, -1, 2)
    confidence = None if score is None else score.reshape(count, -1)
    return RawTracks("SLEAP", str(path), called, np.arange(count, dtype=np.int64), xy, confidence=confidence,
                     image_px=shape)  # fmt: skip


def _ordered(dataset: Any, wanted: Sequence[str], usual: Sequence[str]) -> Floats:
    """A dataset with its axes in the wanted order: they are as its ``dims`` says, else as SLEAP always wrote them."""
    said = dataset.attrs.get("dims")
    dims = list(usual) if said is None else json.loads(_word(said))
    return np.asarray(dataset[()], dtype=np.float64).transpose([dims.index(d) for d in wanted])


def _video_shape(file: Any) -> tuple[int, int] | None:
    """Width and height of the film, if sleap-io wrote them."""
    try:
        _, height, width, _ = json.loads(_word(file.attrs["video_backend_metadata"]))["shape"]
        return int(width), int(height)
    except (KeyError, TypeError, ValueError):
        return None


def _word(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def sleap_slp(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """SLEAP's project, which sleap-io reads: the places of its first film, people's before the network's."""
    sleap_io = library("sleap_io", str(path), "a project of SLEAP", "sleap")
    try:
        labels = sleap_io.load_slp(str(path), open_videos=False)
        video = labels.videos[0] if labels.videos else None
        values = np.asarray(labels.numpy(video=video, untracked=not labels.tracks, return_confidence=True))
        nodes = [str(n) for n in labels.skeletons[0].node_names]
        shape = None if video is None else video.shape
    except DAMAGE as problem:
        raise damaged(path, problem) from problem
    groups = [t.name for t in labels.tracks] or [f"animal{i + 1}" for i in range(values.shape[1])]
    notes = [] if len(labels.videos) < 2 else [f"of {len(labels.videos)} films the first alone is read"]
    count = values.shape[0]
    flat = values.reshape(count, -1, 3)
    return RawTracks(
        "SLEAP",
        str(path),
        names_of(groups[: values.shape[1]], nodes),
        np.arange(count, dtype=np.int64),
        flat[..., :2],
        confidence=flat[..., 2],
        image_px=None if shape is None else (int(shape[2]), int(shape[1])),
        notes=notes,
    )


def movement(path: Path, names: Sequence[str] = ()) -> RawTracks:
    """A dataset of movement's poses in NetCDF, which xarray reads."""
    return of_dataset(opened(path), str(path))


def opened(path: Path) -> Any:
    """The dataset in a NetCDF file. Raises TableError if it is damaged or a library is not installed."""
    xarray = library("xarray", str(path), "NetCDF", EXTRA)
    with path.open("rb") as file:
        engine = "scipy" if file.read(3) == b"CDF" else "h5netcdf"
    if engine == "h5netcdf":
        library(engine, str(path), "NetCDF", EXTRA)
    try:
        with xarray.open_dataset(path, engine=engine) as dataset:
            return dataset.load()
    except DAMAGE as problem:
        raise damaged(path, problem) from problem


def of_dataset(dataset: Any, source: str) -> RawTracks:
    """A dataset of movement: ``position`` by time, space, keypoints and individuals, and ``confidence``."""
    position = dataset["position"]
    groups = [d for d in ("keypoints", "individuals") if d in position.dims]
    order = ("time", *reversed(groups), "space")
    if set(position.dims) != set(order):
        problem = f"position has the dimensions {', '.join(map(str, position.dims))}"
        raise TableError(
            fault(source, problem, "Give poses as movement has them: time, space, keypoints, individuals")
        )
    axes = (
        [str(v) for v in dataset["space"].values]
        if "space" in dataset.coords
        else list("xyz")[: position.sizes["space"]]
    )
    xyz = np.asarray(position.transpose(*order).values, dtype=np.float64)
    xyz = xyz[..., [axes.index(a) for a in "xyz"[: len(axes)]]].reshape(xyz.shape[0], -1, len(axes))
    points = [str(v) for v in dataset["keypoints"].values] if "keypoints" in groups else ["point"]
    people = [str(v) for v in dataset["individuals"].values] if "individuals" in groups else [""]
    confidence = None
    if "confidence" in dataset:
        confidence = np.asarray(dataset["confidence"].transpose(*order[:-1]).values, dtype=np.float64)
        confidence = confidence.reshape(xyz.shape[0], -1)
        confidence = None if np.isnan(confidence).all() else confidence
    time = np.asarray(dataset["time"].values, dtype=np.float64)
    seconds = dataset.attrs.get("time_unit") == "seconds"
    rate = dataset.attrs.get("fps")
    frame = np.arange(time.size, dtype=np.int64)
    if not seconds:
        frame = time.astype(np.int64)
    elif rate is not None and np.allclose(
        np.round(time * float(np.ravel(rate)[0])), time * float(np.ravel(rate)[0]), atol=1e-3
    ):
        frame = np.round(time * float(np.ravel(rate)[0])).astype(np.int64)
    return RawTracks(
        "movement",
        source,
        names_of(people, points),
        frame,
        xyz,
        time if seconds else None,
        confidence=confidence,
        unit=str(dataset.attrs.get("space_unit", "px" if len(axes) == 2 else "")),
        least_confidence=PCUTOFF,
        facts={"source_software": str(dataset.attrs.get("source_software"))},
    )
