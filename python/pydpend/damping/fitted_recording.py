"""Parts of a damping fit's result on its recordings: spans, zeros and noise, angle maps, errors of predictions."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.damping.outliers import Outlier
from pydpend.documents import Table
from pydpend.json_text import plain

Floats = NDArray[np.float64]

KNOTS = 90
"""Knots of an angle map per turn: one every 4 deg."""


@dataclass(frozen=True, eq=False)
class AngleMaps:
    """Bias of each measured angle as a periodic piecewise-linear function of the angles.

    Attributes
    ----------
    knots_deg : ndarray of float, shape (2, 3, 90)
        Bias of each link's angle at the knots, deg, over phi1, phi2 and phi2 - phi1; the first knot is at 0.
    """

    knots_deg: Floats

    def to_dict(self) -> dict[str, Any]:
        """The knots as in ``fit.json``, with what they are functions of."""
        return {"arguments": ["phi1", "phi2", "phi2-phi1"], "knots_deg": self.knots_deg.tolist()}

    @classmethod
    def of_table(cls, table: Table) -> AngleMaps:
        """The inverse of `to_dict`."""
        return cls(table.array("knots_deg", 2, 3, KNOTS))


@dataclass(frozen=True)
class FittedRecording:
    """A recording of L links as it was fitted.

    Attributes
    ----------
    name : str
        Name of the recording.
    source : dict or str or None
        Where its angles come from, as they state it.
    start_s, stop_s : float
        Span that was fitted, s.
    samples : int
        Number of samples of the whole recording.
    noise_deg : tuple of float
        Noise of each link's angle as its own residuals show it, deg; NaN where gaps leave too little.
    noise_source : tuple of str
        By what each angle was weighted: ``stated`` or ``measured`` noise.
    zeros_deg, zeros_sigma_deg : tuple of float
        Zero of each given angle that was found, and its standard error, deg; NaN where the fit does not tell.
    zeros_stated_sigma_deg : tuple of float
        Standard uncertainty that the angles state of their zero, deg; NaN where they do not.
    zeros_off : tuple of bool
        Whether each given zero is wrong beyond these.
    tail_modes_hz : tuple of float or None
        Small oscillations in the last seconds, Hz (trajectory fit); empty where the links swing by more than 20 deg.
    e0_j : float or None
        Energy at the start, J (energy fit).
    camera_numbers, camera_numbers_sigma : tuple of float or None
        Its camera's five numbers as the trajectory fit found them, and their standard errors, in units of what the
        angles state; None where they state nothing.
    tail_swing_deg : tuple of float
        Half of each link's swing in these seconds, deg.
    outliers : tuple of pydpend.damping.outliers.Outlier
        Samples that were left out (docs/explanation/damping.md has the rule).
    """

    name: str
    source: dict[str, Any] | str | None
    start_s: float
    stop_s: float
    samples: int
    noise_deg: tuple[float, ...]
    noise_source: tuple[str, ...]
    zeros_deg: tuple[float, ...]
    zeros_sigma_deg: tuple[float, ...]
    zeros_stated_sigma_deg: tuple[float, ...]
    zeros_off: tuple[bool, ...]
    tail_modes_hz: tuple[float, ...] | None = None
    e0_j: float | None = None
    camera_numbers: tuple[float, ...] | None = None
    camera_numbers_sigma: tuple[float, ...] | None = None
    outliers: tuple[Outlier, ...] = ()
    tail_swing_deg: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The recording as in ``fit.json``."""
        own = {"tail_modes_hz", "e0_j", "camera_numbers", "camera_numbers_sigma"}
        return {name: v for name, v in asdict(self).items() if name not in own or v is not None}

    @classmethod
    def of_table(cls, table: Table) -> FittedRecording:
        """The inverse of `to_dict`."""
        source = table.values.get("source")
        if not isinstance(source, dict | str | None):
            table.refuse("source", "a table or a text is expected")
        return cls(
            table.text("name"),
            source,
            table.number("start_s"),
            table.number("stop_s"),
            table.whole("samples"),
            table.numbers_or_nan("noise_deg"),
            table.texts("noise_source"),
            table.numbers_or_nan("zeros_deg"),
            table.numbers_or_nan("zeros_sigma_deg"),
            table.numbers_or_nan("zeros_stated_sigma_deg"),
            table.flags("zeros_off"),
            table.numbers_or_nan("tail_modes_hz") if "tail_modes_hz" in table else None,
            table.number("e0_j") if "e0_j" in table else None,
            table.numbers_or_nan("camera_numbers") if "camera_numbers" in table else None,
            table.numbers_or_nan("camera_numbers_sigma") if "camera_numbers_sigma" in table else None,
            tuple(
                Outlier(o.number("time_s"), o.whole("link"), o.number("off_rad"))
                for o in (table.tables("outliers") if "outliers" in table else ())
            ),
            table.numbers_or_nan("tail_swing_deg") if "tail_swing_deg" in table else (),
        )


@dataclass(frozen=True)
class Window:
    """Prediction errors over all windows of one length.

    Attributes
    ----------
    rms_deg : tuple of float
        Root mean square over all samples, per link, deg.
    median_deg : tuple of float
        Median of the windows' root mean squares, per link, deg.
    n : int
        Number of windows.
    """

    rms_deg: tuple[float, ...]
    median_deg: tuple[float, ...]
    n: int

    def to_dict(self) -> dict[str, Any]:
        """The errors as in ``predict.json``."""
        out: dict[str, Any] = plain(
            {"rms_deg": list(self.rms_deg), "median_deg": list(self.median_deg), "n": self.n}
        )
        return out

    @classmethod
    def of_table(cls, table: Table) -> Window:
        """The inverse of `to_dict`."""
        rms, median = (tuple(table.array(key, -1).tolist()) for key in ("rms_deg", "median_deg"))
        return cls(rms, median, table.whole("n"))

    def by_link(self) -> dict[str, Any]:
        """The errors as in ``fit.json``: each link's under a name of their own."""
        out: dict[str, Any] = {"n": self.n}
        for j, (rms, median) in enumerate(zip(self.rms_deg, self.median_deg, strict=True), 1):
            out |= {f"phi{j}_deg": rms, f"phi{j}_median_deg": median}
        return out

    @classmethod
    def of_links(cls, table: Table) -> Window:
        """The inverse of `by_link`."""
        links = [j for j in (1, 2) if j == 1 or f"phi{j}_deg" in table]
        rms = tuple(table.number(f"phi{j}_deg") for j in links)
        median = tuple(table.number(f"phi{j}_median_deg") for j in links)
        return cls(rms, median, table.whole("n"))
