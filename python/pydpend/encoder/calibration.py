"""From holds at known angles to a straight line between volts and angle (Section 5.1, Fig. 10).

The angles of the holds count as exact, their mean voltages as measured: ``V = offset + slope phi``. How
well the line is known is taken from the scatter of the holds about it (Student's t with n - 2 degrees of
freedom), which also holds what the noise within a hold does not show: hands that do not hang the link at
exactly the same place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.documents import Table, read_json
from pydpend.encoder.holds import Hold
from pydpend.errors import CALIBRATE, EncoderError, fault
from pydpend.json_text import JsonResult
from pydpend.kinds import expect
from pydpend.output import AnyPath, path_of, write_text
from pydpend.tabular import TableResult
from pydpend.typed import typed, typed_class

Floats = NDArray[np.float64]

SPEC_V = 2.5e-3
"""The encoder maker's uncertainty of a reading, V (Section 5.1)."""

RANGE_V = (0.0, 10.0)
"""Least and greatest output of the encoder, V (Section 5)."""

CHANCE = 1e-3
"""Probability by noise alone below which a deviation is not noise."""

MOST_OFF = 0.01
"""Holds further off the line than this part of the span, and further than their noise explains, are refused: a slope
with a hold of another angle in it is of no use with any uncertainty. Hands that hold the link 10 deg wrong in four
turns stay below it: their scatter goes into the uncertainty."""

LEAST_DOF = 3
"""With fewer degrees of freedom the holds' own noise says how well the line is known, not their scatter."""


@typed_class()
@dataclass(frozen=True, eq=False, repr=False)
class Calibration(JsonResult, TableResult):
    """The line between an encoder's volts and its angle, ``V = offset_v + slope_v_per_rad * phi`` (Fig. 10).

    Attributes
    ----------
    offset_v : float
        Voltage at angle zero (the link hangs), V.
    slope_v_per_rad : float
        Voltage per angle, V per rad; below zero for an encoder that counts clockwise.
    covariance : ndarray of float, shape (2, 2)
        Of (offset, slope), in V and rad.
    dof : int
        Its degrees of freedom.
    holds : tuple of pydpend.encoder.Hold
        The n holds that the line goes through.
    residual_v : ndarray of float, shape (n,)
        Hold minus line, V.
    linearity : float
        Largest residual over the calibrated span.
    noise_v : float
        Standard deviation of a reading, pooled over the holds, V.
    spec_v : float
        The maker's uncertainty of a reading, V.
    noisy_holds : tuple of str
        Holds whose standard deviation is above `spec_v` by more than chance explains.
    range_v : tuple of float
        Rails of the output, V.
    wraps : bool
        Whether the output jumps from one rail to the other (a single-turn encoder) or stays there.
    notes : tuple of str
        What should be known of the line.
    """

    _error: ClassVar = EncoderError
    _source: ClassVar = "encoder.json"
    _advice: ClassVar = "Make one with " + CALIBRATE

    offset_v: float
    slope_v_per_rad: float
    covariance: Floats
    dof: int
    holds: tuple[Hold, ...]
    residual_v: Floats
    linearity: float
    noise_v: float
    spec_v: float = SPEC_V
    noisy_holds: tuple[str, ...] = ()
    range_v: tuple[float, float] = RANGE_V
    wraps: bool = False
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """A line for people."""
        turn = self.slope_v_per_rad * 2 * np.pi
        return (
            f"<Calibration: {len(self.holds)} holds, {turn:.6g} V per turn, linearity {self.linearity:.1e}>"
        )

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard uncertainties of offset (V) and slope (V per rad)."""
        a, b = np.sqrt(np.diag(self.covariance))
        return float(a), float(b)

    @property
    def from_scatter(self) -> bool:
        """Whether the uncertainties are from the scatter of the holds about the line, not from the noise in them."""
        return self.dof >= LEAST_DOF or _contradicted(self.holds, self.residual_v, self.spec_v)

    @property
    def interval_95(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """95 % intervals of offset (V) and slope (V per rad)."""
        factor = float(scipy.special.stdtrit(self.dof, 0.975)) if self.from_scatter else 1.959964
        a, b = self.sigma
        return (
            (self.offset_v - factor * a, self.offset_v + factor * a),
            (self.slope_v_per_rad - factor * b, self.slope_v_per_rad + factor * b),
        )

    @typed()
    def angle_rad(self, volts: Floats) -> Floats:
        """Angle of a reading; no wrap is undone.

        Parameters
        ----------
        volts : ndarray of float
            Readings of any shape, V.

        Returns
        -------
        ndarray of float
            Angles of the same shape, rad, zero hanging down.
        """
        return np.asarray((np.asarray(volts) - self.offset_v) / self.slope_v_per_rad)

    @typed()
    def systematic_rad(self, volts: Floats) -> Floats:
        """Standard uncertainty of an angle from the line alone: common to all readings, not noise.

        Parameters
        ----------
        volts : ndarray of float
            Readings of any shape, V.

        Returns
        -------
        ndarray of float
            Standard uncertainties of the same shape, rad.
        """
        phi = self.angle_rad(volts)
        c = self.covariance
        variance = c[0, 0] + 2 * phi * c[0, 1] + phi**2 * c[1, 1]
        return np.asarray(np.sqrt(variance) / abs(self.slope_v_per_rad))

    @property
    def noise_rad(self) -> float:
        """Standard uncertainty of one reading's angle from its noise, rad."""
        return self.noise_v / abs(self.slope_v_per_rad)

    def to_dict(self) -> dict[str, Any]:
        """The calibration as plain values, as ``pydpend calibrate`` writes it.

        Returns
        -------
        dict
            All fields, and what follows from them: standard uncertainties, 95 % intervals, volts per turn.
        """
        low, high = self.interval_95
        return {
            "schema": 1,
            "offset_v": self.offset_v,
            "slope_v_per_rad": self.slope_v_per_rad,
            "offset_sigma_v": self.sigma[0],
            "slope_sigma_v_per_rad": self.sigma[1],
            "offset_interval_95_v": list(low),
            "slope_interval_95_v_per_rad": list(high),
            "volts_per_turn": self.slope_v_per_rad * 2 * np.pi,
            "covariance": self.covariance.tolist(),
            "dof": self.dof,
            "holds": [
                {**asdict(h), "residual_v": float(r), "within_spec": h.name not in self.noisy_holds}
                for h, r in zip(self.holds, self.residual_v, strict=True)
            ],
            "linearity": self.linearity,
            "noise_v": self.noise_v,
            "noise_rad": self.noise_rad,
            "spec_v": self.spec_v,
            "noisy_holds": list(self.noisy_holds),
            "range_v": list(self.range_v),
            "wraps": self.wraps,
            "notes": list(self.notes),
        }

    @classmethod
    def of_table(cls, table: Table) -> Calibration:
        """The calibration from an ``encoder.json`` that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Calibration
            The line.

        Raises
        ------
        EncoderError
            Naming the key that is missing or not what it must be.
        """
        holds = table.tables("holds")
        low, high = table.array("range_v", 2)
        covariance = table.array("covariance", 2, 2)
        slope = table.number("slope_v_per_rad")
        noise, spec = table.number("noise_v"), table.number("spec_v")
        for key, bad in (
            ("slope_v_per_rad", slope == 0),
            ("covariance", not (np.diag(covariance) >= 0).all()),
            ("noise_v", not noise > 0),
            ("range_v", not low < high),
        ):
            if bad:
                table.refuse(key, "no calibration has this value")
        return cls(
            table.number("offset_v"),
            slope,
            covariance,
            table.whole("dof"),
            tuple(
                Hold(
                    h.number("angle_rad"),
                    h.number("mean_v"),
                    h.number("std_v"),
                    h.whole("n"),
                    h.number("sigma_v"),
                    h.text("name"),
                )
                for h in holds
            ),
            np.array([h.number("residual_v") for h in holds], dtype=np.float64),
            table.number("linearity"),
            noise,
            spec,
            table.texts("noisy_holds"),
            (float(low), float(high)),
            table.flag("wraps"),
            table.texts("notes"),
        )

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The holds as columns of a table, a row each.

        Returns
        -------
        dict of str to ndarray, each of shape (n,)
            ``name``, ``angle_rad``, ``mean_v``, ``std_v``, ``n``, ``sigma_v`` and ``residual_v``.
        """
        out: dict[str, NDArray[Any]] = {"name": np.array([h.name for h in self.holds], dtype=object)}
        for key in ("angle_rad", "mean_v", "std_v", "n", "sigma_v"):
            out[key] = np.array([getattr(h, key) for h in self.holds])
        return out | {"residual_v": self.residual_v}

    @typed()
    def write(self, path: AnyPath) -> None:
        """Writes the JSON; a file that is there is replaced.

        Parameters
        ----------
        path : path-like
            The file.

        Raises
        ------
        EncoderError
            If the file cannot be written.
        """
        try:
            write_text(path, self.to_json())
        except OSError as problem:
            raise EncoderError(
                fault(str(path), f"the file cannot be written ({problem.strerror})", "Check the folder")
            ) from problem


@typed()
def read_calibration(path: AnyPath) -> Calibration:
    """A calibration as :meth:`Calibration.write` wrote it.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Calibration
        The line.

    Raises
    ------
    EncoderError
        Naming the file, and the key that is missing or not what it must be.
    """
    expect(path_of(path), ("calibration",), EncoderError)
    return Calibration.of_table(read_json(path_of(path), EncoderError, Calibration._advice))


@typed()
def calibrate(
    holds: Sequence[Hold],
    *,
    range_v: tuple[float, float] = RANGE_V,
    wraps: bool = False,
    spec_v: float = SPEC_V,
) -> Calibration:
    """Weighted straight line through holds at known angles (Section 5.1, Fig. 10).

    Parameters
    ----------
    holds : sequence of pydpend.encoder.Hold
        At least two, at two angles; `read_holds` reads them.
    range_v : tuple of float
        Rails of the output, V.
    wraps : bool
        Whether the output jumps from one rail to the other (a single-turn encoder).
    spec_v : float
        The maker's uncertainty of a reading, V.

    Returns
    -------
    Calibration
        The line with its uncertainties.

    Raises
    ------
    EncoderError
        For fewer than two holds, holds all at one angle or far off a line, a voltage that does not change with the
        angle, and holds outside the range or at its rails.
    """
    if len(holds) < 2:
        raise EncoderError(
            fault(
                "calibration",
                f"{len(holds)} hold ({_names(holds)}) is not enough for a line",
                "Give at least two, at two angles",
            )
        )
    phi = np.array([h.angle_rad for h in holds])
    volts = np.array([h.mean_v for h in holds])
    if not (np.isfinite(phi).all() and np.isfinite(volts).all()):
        raise EncoderError(fault("calibration", "an angle or a voltage of a hold is not a number"))
    if np.ptp(phi) < 1e-6:
        raise EncoderError(
            fault(
                "calibration",
                f"all {len(holds)} holds ({_names(holds)}) are at one angle, {np.degrees(phi[0]):.6g} deg",
                "Give recordings of at least two angles",
            )
        )
    margin = 4 * spec_v
    for hold in holds:
        low, high = range_v[0] + (0 if wraps else margin), range_v[1] - (0 if wraps else margin)
        if not low <= hold.mean_v <= high:
            raise EncoderError(
                fault(
                    hold.name,
                    f"its mean, {hold.mean_v:.4f} V, is at a rail ({range_v[0]:g}, {range_v[1]:g} V)",
                    "Turn the encoder's zero towards the middle, or give the right range",
                )
            )
    std = np.array([h.std_v for h in holds])
    n = np.array([h.n for h in holds])
    sigma = _sigmas(holds, spec_v)
    if wraps:
        volts = _unwrapped_holds(phi, volts, sigma, range_v[1] - range_v[0])
    weight = 1 / sigma**2
    design = np.stack([np.ones_like(phi), phi], axis=1)
    normal = design.T @ (design * weight[:, None])
    covariance: Floats = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    offset, slope = covariance @ (design.T @ (weight * volts))
    residual = volts - offset - slope * phi
    dof = len(holds) - 2
    notes: list[str] = []
    chi2 = float((weight * residual**2).sum())
    contradicted = _contradicted(holds, residual, spec_v)
    if dof >= LEAST_DOF or contradicted:
        covariance = np.asarray(covariance * (chi2 / dof), dtype=np.float64)
        if contradicted:
            notes.append(
                f"the holds scatter about the line {np.sqrt(chi2 / dof):.1f} times more than their noise: "
                "the angles of the holds are not exact, or the encoder is not linear"
            )
    else:
        notes.append(
            f"{len(holds)} holds: the uncertainties are from the noise within them, not their scatter"
        )
    linearity = float(np.abs(residual).max() / (abs(slope) * np.ptp(phi)))
    if abs(slope) * np.ptp(phi) < 10 * float(np.sqrt((sigma**2).mean())):
        raise EncoderError(
            fault(
                "calibration", "the voltage does not change with the angle", "Check the wiring and the angles"
            )
        )
    if contradicted and linearity > MOST_OFF:
        worst = int(np.abs(residual).argmax())
        raise EncoderError(
            fault(
                "calibration",
                f"the holds do not lie on a line: {holds[worst].name} is {residual[worst]:+.4f} V off it, "
                f"{100 * linearity:.2f} % of the span and {abs(residual[worst]) / sigma[worst]:.0f} times its noise"
                + _culprit(holds, phi, volts, sigma),
                "Check the angles of the holds, and that each file is of its own hold",
            )
        )
    weights = np.maximum(n - 1, 0)
    noise = float(np.sqrt((weights * std**2).sum() / weights.sum())) if weights.sum() else spec_v
    return Calibration(
        float(offset),
        float(slope),
        covariance,
        dof,
        tuple(holds),
        residual,
        linearity,
        noise if noise > 0 else spec_v,
        spec_v,
        tuple(h.name for h in holds if _too_noisy(h, spec_v)),
        range_v,
        wraps,
        tuple(notes),
    )


def _names(holds: Sequence[Hold]) -> str:
    return ", ".join(h.name for h in holds) or "none"


def _sigmas(holds: Sequence[Hold], spec_v: float) -> Floats:
    """Standard errors of the holds' means, V. ``spec_v`` where none of them tells its noise."""
    sigma = np.array([h.sigma_v for h in holds], dtype=np.float64)
    # A hold that reads one converter step all the time has no scatter; it is not exact for that.
    usual = float(np.median(sigma[sigma > 0])) if (sigma > 0).any() else 10 * spec_v
    return np.asarray(np.maximum(sigma, 0.1 * usual))


def _contradicted(holds: Sequence[Hold], residual_v: Floats, spec_v: float) -> bool:
    """Whether the holds are off the line by more than one in a thousand would by their noise, however few they are."""
    chi2 = float(((residual_v / _sigmas(holds, spec_v)) ** 2).sum())
    return len(holds) > 2 and bool(scipy.special.chdtrc(len(holds) - 2, chi2) < CHANCE)


def _culprit(holds: Sequence[Hold], phi: Floats, volts: Floats, sigma: Floats) -> str:
    """Words for the one hold without which the others lie on a line; empty if there is not just one such."""
    alone = []
    for i in range(len(holds) if len(holds) > 3 else 0):
        rest = np.arange(len(holds)) != i
        if np.ptp(phi[rest]) < 1e-6:
            continue
        slope, offset = np.polyfit(phi[rest], volts[rest], 1, w=1 / sigma[rest])
        off = np.abs(volts[rest] - offset - slope * phi[rest]).max()
        if off <= MOST_OFF * abs(slope) * np.ptp(phi[rest]):
            alone.append(holds[i].name)
    return f"; without {alone[0]} the others lie on one" if len(alone) == 1 else ""


def _too_noisy(hold: Hold, spec_v: float) -> bool:
    """Whether the hold scatters by more than specified, and by more than one in a thousand would by chance."""
    if hold.std_v <= spec_v or hold.n < 2:
        return False
    # Readings that hang together count as fewer.
    free = max((hold.std_v / hold.sigma_v) ** 2 - 1, 1.0)
    return bool((hold.std_v / spec_v) ** 2 > scipy.special.chdtri(free, CHANCE) / free)


def _unwrapped_holds(phi: Floats, volts: Floats, sigma: Floats, span: float) -> Floats:
    """Voltages of a single-turn encoder put on one line: whole spans are added, for either sense of turning."""
    best, least = volts, np.inf
    for sense in (1.0, -1.0):
        line = volts[0] + sense * span / (2 * np.pi) * (phi - phi[0])
        there = volts + span * np.rint((line - volts) / span)
        chi2 = float((((there - line - (there - line).mean()) / sigma) ** 2).sum())
        if chi2 < least:
            best, least = there, chi2
    return best
