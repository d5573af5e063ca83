"""Datasets of xarray: nodes with the dimensions that movement has, tables along their time.

xarray is no dependency of the package: who asks for a dataset has it, or is told how to get it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import TableError, fault

if TYPE_CHECKING:
    import xarray as xr

UNITS: tuple[tuple[str, str], ...] = (
    ("_rad_s2", "rad/s^2"),
    ("_rad_s", "rad/s"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_px", "px"),
    ("_m", "m"),
    ("_v", "V"),
    ("_j", "J"),
    ("_s", "s"),
)
"""Units by the ends of columns' names, longer ends first."""


def xarray() -> Any:
    """The library. Raises TableError with the command that installs it."""
    try:
        import xarray as library
    except ImportError:
        problem = "datasets are xarray's, which is not installed"
        raise TableError(fault("to_xarray", problem, "pip install 'pydpend[tracks]'")) from None
    return library


def table_dataset(columns: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    """A variable for each column but ``time_s``, the coordinate ``time``; without it they are along ``row``."""
    library = xarray()
    along = "time" if "time_s" in columns else "row"
    coordinates = {"time": ("time", columns["time_s"], {"units": "s"})} if along == "time" else {}
    variables = {}
    for name, values in columns.items():
        if name != "time_s":
            unit = next((unit for end, unit in UNITS if name.endswith(end)), None)
            variables[name] = (along, values, {} if unit is None else {"units": unit})
    dataset: xr.Dataset = library.Dataset(variables, coordinates)
    return dataset


def poses_dataset(
    columns: tuple[NDArray[Any], ...], nodes: Sequence[str], bodies: Sequence[str], about: Mapping[str, Any]
) -> xr.Dataset:
    """Nodes as movement has poses: ``position`` by time, space, keypoints and one individual.

    ``columns``: frames, times, places, uncertainties, areas and states of `pydpend.Nodes`; ``about``: the attributes.
    """
    library = xarray()
    frame, t_s, xy_px, sigma_px, area_px, status = columns
    each = ("time", "keypoints", "individuals")
    position = np.asarray(xy_px).transpose(0, 2, 1)[..., None]
    # movement has NaN for a confidence that is not known: an uncertainty is none.
    confidence = np.full((*status.shape, 1), np.nan)
    dataset: xr.Dataset = library.Dataset(
        {
            "position": (("time", "space", "keypoints", "individuals"), position, {"units": "px"}),
            "confidence": (each, confidence),
            "sigma_px": (each, sigma_px[..., None], {"units": "px"}),
            "area_px": (each, area_px[..., None], {"units": "px^2"}),
            "status": (each, status[..., None]),
        },
        {
            "time": ("time", t_s, {"units": "s"}),
            "space": ["x", "y"],
            "keypoints": list(nodes),
            "individuals": ["rig"],
            "frame": ("time", frame),
            "body": ("keypoints", list(bodies)),
        },
        {"source_software": "pydpend", "ds_type": "poses", "time_unit": "seconds", **about},
    )
    return dataset
