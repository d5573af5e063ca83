"""Single images to detections, and a camera's live images to nodes.

The work is done in Rust with the GIL released; here arguments get their words and results their names.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend import _native
from pydpend._typing import Centroid, PixelAspect, Polarity, Region
from pydpend.crossing import Found
from pydpend.errors import ArgumentError, fault
from pydpend.nodes import Rig
from pydpend.output import AnyPath
from pydpend.reading_options import DetectOptions, aspect_text
from pydpend.typed import typed, typed_class

DETECTION = np.dtype(
    [
        ("x_px", np.float64),
        ("y_px", np.float64),
        ("sigma_px", np.float32),
        ("area_px", np.float32),
        ("peak", np.float32),
        ("elongation", np.float32),
        ("flags", np.uint8),
    ]
)
"""One detection: centre (x right, y down), standard uncertainty of each coordinate, area, height above the
background in the image's units, longer over shorter axis, and flags: 1 saturated, 2 at the border, 4 merged, 8 partial.
"""


def _detections(found: Found) -> NDArray[np.void]:
    xy_px, rest, flags = found
    out = np.empty(len(flags), dtype=DETECTION)
    out["x_px"], out["y_px"] = xy_px.T
    for i, name in enumerate(("sigma_px", "area_px", "peak", "elongation")):
        out[name] = rest[:, i]
    out["flags"] = flags
    return out


@typed()
def detect(
    image: NDArray[Any],
    *,
    threshold: float | None = None,
    polarity: Polarity = "auto",
    centroid: Centroid = "disc",
    region: Region | None = None,
    min_area_px: float | None = None,
    max_area_px: float | None = None,
    depth_bits: int | None = None,
    pixel_aspect: PixelAspect | None = None,
) -> NDArray[np.void]:
    """The markers of one image.

    Parameters
    ----------
    image : ndarray of uint8 or uint16, shape (H, W)
        The image, of any strides.
    threshold : float, optional
        Level in the image's units; learned from the image if not given.
    polarity : {"auto", "bright", "dark"}
        Whether markers are brighter or darker than what is around them.
    centroid : {"disc", "weighted", "contour"}
        As in `track`.
    region : sequence of float or str, optional
        As in `track`.
    min_area_px, max_area_px : float, optional
        Limits of a marker's area, px; learned if not given.
    depth_bits : int, optional
        Significant bits of a sample, for example 12 in a uint16; all if not given.
    pixel_aspect : tuple of int or str, optional
        Width to height of a pixel, ``(16, 15)`` or ``"16:15"``: discs are as much narrower; square if not given.

    Returns
    -------
    ndarray, shape (D,)
        One entry per detection, of dtype ``pydpend.live.DETECTION``, ordered by y, then x: centre in px (x right,
        y down) with its standard uncertainty, area, peak, elongation and flags.

    Raises
    ------
    ArgumentError
        If the image has the wrong type or shape, or an argument makes no sense.
    DetectError
        If no threshold can be learned.
    """
    options = DetectOptions(
        threshold=threshold,
        polarity=polarity,
        centroid=centroid,
        region=region,
        min_area_px=min_area_px,
        max_area_px=max_area_px,
    )
    return _detections(_native.detect(image, options.detected(), depth_bits, aspect_text(pixel_aspect)))


@dataclass(frozen=True, eq=False)
class NodeRow:
    """N nodes in one image; what is not seen is NaN.

    Attributes
    ----------
    frame : int
        Number of the image.
    xy_px : ndarray of float, shape (N, 2)
        Centres in px; x right, y down.
    sigma_px : ndarray of float32, shape (N,)
        Standard uncertainty of each coordinate in square px, as `Nodes.sigma_px`.
    area_px : ndarray of float32, shape (N,)
        Area of each blob, px.
    status : ndarray of uint8, shape (N,)
        What became of each node, as `Nodes.status`.
    """

    frame: int
    xy_px: NDArray[np.float64]
    sigma_px: NDArray[np.float32]
    area_px: NDArray[np.float32]
    status: NDArray[np.uint8]


@typed_class()
class Tracker:
    """The markers of a known rig followed image by image, for a camera's live loop.

    The tracker does not look ahead: what a whole recording would settle later stays ambiguous.

    Parameters
    ----------
    rig : Rig or path-like
        Nodes, bodies and joints, or a file of them.
    threshold, polarity, centroid : optional
        As in `track`.
    depth_bits : int, optional
        Significant bits of a sample; all if not given.

    Attributes
    ----------
    rig : Rig
        The rig that is followed.

    Raises
    ------
    RigError
        If the rig is wrong.
    ArgumentError
        If an argument makes no sense.
    """

    def __init__(
        self,
        rig: Rig | AnyPath,
        *,
        threshold: float | None = None,
        polarity: Polarity = "auto",
        centroid: Centroid = "disc",
        depth_bits: int | None = None,
    ) -> None:
        self.rig = rig if isinstance(rig, Rig) else Rig.read(rig)
        self._next = 0
        options = DetectOptions(threshold=threshold, polarity=polarity, centroid=centroid)
        self._live = _native.LiveTracker(self.rig.to_json(), options.detected(), depth_bits)

    @typed()
    def learn(self, images: Iterable[NDArray[Any]]) -> None:
        """Learns thresholds and noise from some images of the scene; else the first image tracked is all there is.

        Parameters
        ----------
        images : iterable of ndarray of uint8 or uint16, each of shape (H, W)
            Images of the scene.

        Raises
        ------
        ArgumentError
            If an image has the wrong type, shape or size, or there is none.
        DetectError
            If no threshold can be learned.
        """
        self._live.learn(list(images))

    @typed()
    def step(self, image: NDArray[Any], frame: int | None = None) -> NodeRow:
        """The nodes in the next image.

        Parameters
        ----------
        image : ndarray of uint8 or uint16, shape (H, W)
            The image, of any strides and of the rig's size.
        frame : int, optional
            Its number, larger than that of the one before it; the next if not given. Leave numbers out where the camera
            lost images.

        Returns
        -------
        NodeRow
            The N nodes of the rig.

        Raises
        ------
        ArgumentError
            If the image has the wrong type, shape or size, or `frame` does not grow.
        """
        number = self._next if frame is None else int(frame)
        if number < 0:
            raise ArgumentError(fault("frame", f"{number} is below 0", "Count frames from 0"))
        xy_px, sigma_px, area_px, status = self._live.step(image, number)
        self._next = number + 1
        return NodeRow(number, xy_px, sigma_px, area_px, status)

    @property
    def detections(self) -> NDArray[np.void]:
        """The detections of the last image, of dtype `DETECTION`."""
        return _detections(self._live.detections())
