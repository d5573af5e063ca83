"""The angles of the links over time: :class:`LinkAngles`, and what makes one valid.

Its file forms are in ``files``; how angles come from nodes is in the other files beside this one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.errors import AnglesError, Setting, Text, fault
from pydpend.instants import times_given
from pydpend.kinematics.names import NUMBERED, ColumnNames, LinkJoint, numbered_names
from pydpend.tabular import TableResult, html_table
from pydpend.typed import typed, typed_class

Floats = NDArray[np.float64]

CAMERA_NUMBERS = 5
"""Numbers of a camera that angles depend on."""

PER_LINK = ("sigma_rad", "reference_frame_rad", "lines")
"""Entries of ``meta["zero"]`` that have a value for each link."""


@typed_class("t_s")
@dataclass(frozen=True, eq=False, repr=False)
class LinkAngles(TableResult):
    """Angles of L links at T instants.

    Parameters
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s, finite, strictly increasing; dates become seconds from the first.
    phi_rad : ndarray of float, shape (T, L)
        Absolute angle of each link to the downward vertical, rad: **counter-clockwise positive, zero hanging down**,
        unwrapped over turns, NaN where the link was not seen.
    sigma_rad : ndarray of float, shape (T, L)
        Standard uncertainty of each by its own noise, rad, NaN where not seen or not known: the white part, which
        differs from frame to frame.
    frame : ndarray of int64, shape (T,), optional
        Index in the recording.
    meta : dict
        How the angles were had, as plain values.
    name : str
        Name of the recording, for messages and legends.
    camera_rad : ndarray of float, shape (T, L, 5), optional
        What the camera adds to the angles, rad, for one standard deviation of each of five independent numbers that are
        the same in all frames: with noise e, ``phi = true + e + camera_rad @ n``, n of unit variance. NaN where not
        seen. None where nothing is stated.
    link_names : tuple of str
        Names of the L links; ``link1``, ``link2``, ... if not given.
    joints : tuple of pydpend.kinematics.LinkJoint
        The joints between links of these, each with the angle `theta_rad`.
    covariance_rad2 : ndarray of float, shape (T, L, L), optional
        Covariance of the links' noise, rad^2, where the angles are of one fit; its diagonal is `sigma_rad` squared.
        None where each link was seen by itself.

    Raises
    ------
    AnglesError
        If the shapes, times or uncertainties cannot be right.
    """

    t_s: Floats
    phi_rad: Floats
    sigma_rad: Floats
    frame: NDArray[np.int64] | None = None
    meta: dict[str, Any] = field(default_factory=dict)
    name: str = "angles"
    camera_rad: Floats | None = None
    link_names: tuple[str, ...] = ()
    joints: tuple[LinkJoint, ...] = ()
    covariance_rad2: Floats | None = None

    def __post_init__(self) -> None:
        t = times_given(self.t_s, AnglesError)
        phi = np.ascontiguousarray(self.phi_rad, dtype=np.float64)
        sigma = np.ascontiguousarray(self.sigma_rad, dtype=np.float64)
        if t.ndim != 1 or t.size == 0:
            raise AnglesError(
                fault(self.name, f"times of shape {t.shape}, not (T,) with T > 0", "Give one time a row")
            )
        if phi.ndim != 2 or phi.shape[0] != t.size or not phi.shape[1] or sigma.shape != phi.shape:
            raise AnglesError(
                fault(
                    self.name,
                    f"angles of shape {phi.shape} and sigmas of shape {sigma.shape} for {t.size} times",
                    "Both must be (T, L), a column for each link",
                )
            )
        if self.frame is not None:
            frame = np.ascontiguousarray(self.frame, dtype=np.int64)
            if frame.shape != t.shape:
                raise AnglesError(
                    fault(self.name, f"{frame.size} frames for {t.size} times", "Give one frame a row")
                )
            object.__setattr__(self, "frame", frame)
        sigma = np.where(np.isnan(phi), np.nan, sigma)
        for key, value in (("t_s", t), ("phi_rad", phi), ("sigma_rad", sigma)):
            object.__setattr__(self, key, value)
        self._check_names()
        if self.camera_rad is not None:
            object.__setattr__(self, "camera_rad", self._checked_camera(self.camera_rad))
        if self.covariance_rad2 is not None:
            object.__setattr__(self, "covariance_rad2", self._checked_covariance(self.covariance_rad2))
        check_table(
            self.name,
            (t, phi, sigma, self.frame),
            self.columns,
            lambda row, column: f"row {row}, column {column}",
        )

    def _check_names(self) -> None:
        """Each link has a name of its own, and the joints are between them."""
        names = tuple(self.link_names) or numbered_names(self.links)
        if len(names) != self.links or len(set(names)) != self.links or not all(names):
            raise AnglesError(
                fault(
                    self.name,
                    f"the names {', '.join(map(repr, names))} for {self.links} link(s)",
                    "Give each link a name of its own, in the order of the columns",
                )
            )
        for joint in self.joints:
            unknown = [link for link in joint.links if link not in names]
            if unknown:
                raise AnglesError(
                    fault(
                        self.name,
                        f"the joint {joint.name} is of a link {unknown[0]!r} that is not there",
                        f"The links are {', '.join(names)}",
                    )
                )
        object.__setattr__(self, "link_names", names)

    def _checked_camera(self, columns: Floats) -> Floats:
        """The camera's columns, NaN where there is no angle."""
        camera = np.ascontiguousarray(columns, dtype=np.float64)
        if camera.shape != (*self.phi_rad.shape, CAMERA_NUMBERS):
            raise AnglesError(
                fault(
                    self.name,
                    f"the camera's part has the shape {camera.shape} for angles of shape {self.phi_rad.shape}",
                    f"It must be (T, L, {CAMERA_NUMBERS})",
                )
            )
        bad = np.argwhere(~np.isfinite(camera) & self.seen[..., None])
        if bad.size:
            row, link, number = (int(v) for v in bad[0])
            raise AnglesError(
                fault(
                    self.name,
                    f"it is {camera[row, link, number]} where there is an angle",
                    "Give the camera's part of every angle, or none at all",
                    place=f"row {row}, column {self.columns.camera(number, link)}",
                )
            )
        return np.where(self.seen[..., None], camera, np.nan)

    def _checked_covariance(self, given: Floats) -> Floats:
        """The covariance, NaN where there is no angle."""
        covariance = np.ascontiguousarray(given, dtype=np.float64)
        if covariance.shape != (*self.phi_rad.shape, self.links):
            problem = f"a covariance of shape {covariance.shape} for angles of shape {self.phi_rad.shape}"
            raise AnglesError(fault(self.name, problem, "It must be (T, L, L)"))
        both = self.seen[:, :, None] & self.seen[:, None, :]
        return np.where(both, covariance, np.nan)

    @property
    def sigma_camera_rad(self) -> Floats:
        """Standard uncertainty (T, L) of each angle by the camera, rad; NaN where not seen or not stated.

        It is one error of all frames in which a link stands alike: no mean over frames makes it smaller.
        """
        if self.camera_rad is None:
            return np.full_like(self.phi_rad, np.nan)
        return np.asarray(np.sqrt((self.camera_rad**2).sum(axis=2)))

    @property
    def sigma_total_rad(self) -> Floats:
        """Both parts (T, L), rad; the noise alone where nothing is stated of the camera."""
        return np.asarray(np.hypot(self.sigma_rad, np.nan_to_num(self.sigma_camera_rad)))

    @property
    def links(self) -> int:
        """Number of links."""
        return int(self.phi_rad.shape[1])

    @property
    def columns(self) -> ColumnNames:
        """The names of the links' columns."""
        return ColumnNames(self.link_names)

    @property
    def theta_rad(self) -> Floats:
        """Angle at each of the `joints`, its second link's less its first's, (T, J), rad; NaN where not seen."""
        return self._between(self.phi_rad)

    @property
    def sigma_theta_rad(self) -> Floats:
        """Standard uncertainty (T, J) of `theta_rad` by the links' noise, rad, which differs from frame to frame."""
        first, second = self._ends()
        variance = self.sigma_rad[:, second] ** 2 + self.sigma_rad[:, first] ** 2
        if self.covariance_rad2 is not None:
            variance = variance - 2 * self.covariance_rad2[:, first, second]
        return np.asarray(np.sqrt(variance))

    @property
    def sigma_camera_theta_rad(self) -> Floats:
        """Standard uncertainty (T, J) of `theta_rad` by the camera, rad; NaN where not seen or not stated.

        The camera turns the two links of a joint together in part, so it is less than both parts' squares' sum.
        """
        if self.camera_rad is None:
            return np.full(self.theta_rad.shape, np.nan)
        return np.asarray(np.sqrt((self._between(self.camera_rad) ** 2).sum(axis=2)))

    def _ends(self) -> list[list[int]]:
        """Indices of the joints' first links, and of their second ones."""
        return [[self.link_names.index(joint.links[k]) for joint in self.joints] for k in (0, 1)]

    def _between(self, values: Floats) -> Floats:
        """Differences (T, J, ...) over the joints of the links' values (T, L, ...)."""
        first, second = self._ends()
        return np.asarray(values[:, second] - values[:, first])

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each link has an angle, (T, L)."""
        return np.isfinite(self.phi_rad)

    @property
    def step_s(self) -> float:
        """Median time between rows, s; NaN for a single row."""
        return float(np.median(np.diff(self.t_s))) if self.t_s.size > 1 else math.nan

    @property
    def left_out(self) -> int:
        """The number of angles or readings left out on the way here; ``meta["notes"]`` says which and why."""
        return int(self.meta.get("left_out", 0))

    @typed()
    def select(self, *links: str) -> LinkAngles:
        """The angles of some of the links.

        Parameters
        ----------
        *links : str
            Their names, in the order that is wanted.

        Returns
        -------
        LinkAngles
            These, with the joints between them.

        Raises
        ------
        AnglesError
            For a link that is not there.
        """
        for name in links:
            if name not in self.link_names:
                advice = f"The links are {', '.join(self.link_names)}"
                raise AnglesError(fault(self.name, f"there is no link {name!r}", advice))
        index = [self.link_names.index(name) for name in links]
        meta = dict(self.meta)
        zero = meta.get("zero")
        if isinstance(zero, dict):
            # What the zero says of each link goes with the links.
            meta["zero"] = zero | {k: [zero[k][i] for i in index] for k in PER_LINK if k in zero}
        if isinstance(meta.get("bodies"), list):
            meta["bodies"] = [body for body in meta["bodies"] if body.get("name") in links]
        camera = meta.get("camera")
        if isinstance(camera, dict) and "rms_rad" in camera:
            meta["camera"] = camera | {"rms_rad": [camera["rms_rad"][i] for i in index]}
        return replace(
            self,
            phi_rad=self.phi_rad[:, index],
            sigma_rad=self.sigma_rad[:, index],
            meta=meta,
            camera_rad=None if self.camera_rad is None else self.camera_rad[:, index],
            covariance_rad2=None
            if self.covariance_rad2 is None
            else self.covariance_rad2[:, index][:, :, index],
            link_names=tuple(links),
            joints=tuple(j for j in self.joints if set(j.links) <= set(links)),
        )

    @typed()
    def between(self, start_s: float | None = None, stop_s: float | None = None) -> LinkAngles:
        """The rows with ``start_s <= t <= stop_s``.

        Parameters
        ----------
        start_s, stop_s : float, optional
            First and last time, s; the recording's if not given.

        Returns
        -------
        LinkAngles
            These rows, with the same name and meta.

        Raises
        ------
        AnglesError
            If there are none.
        """
        keep = np.ones(self.t_s.size, dtype=bool)
        if start_s is not None:
            keep &= self.t_s >= start_s
        if stop_s is not None:
            keep &= self.t_s <= stop_s
        if not keep.any():
            raise AnglesError(
                fault(
                    self.name,
                    f"there is nothing between {start_s} s and {stop_s} s",
                    f"The recording is from {self.t_s[0]:.6g} s to {self.t_s[-1]:.6g} s",
                )
            )
        return replace(
            self,
            t_s=self.t_s[keep],
            phi_rad=self.phi_rad[keep],
            sigma_rad=self.sigma_rad[keep],
            frame=None if self.frame is None else self.frame[keep],
            camera_rad=None if self.camera_rad is None else self.camera_rad[keep],
            covariance_rad2=None if self.covariance_rad2 is None else self.covariance_rad2[keep],
        )

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The table's columns, in the order of the file.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``frame`` if there is one, ``time_s``, and of each link ``phi1_rad``, ``sigma1_rad`` (the noise) and, where
            the camera's part is stated, ``sigma_camera1_rad`` and ``camera1_phi1_rad`` to ``camera5_phi1_rad``. Of more
            than two links their names stand in place of the numbers: ``phi_crank_rad``, ``sigma_phi_crank_rad``,
            ``sigma_camera_phi_crank_rad``, ``camera1_phi_crank_rad``. Where the noise of the links is not independent,
            ``covariance_phi1_phi2_rad2`` of each two. Last of each joint ``theta_elbow_rad``,
            ``sigma_theta_elbow_rad`` and ``sigma_camera_theta_elbow_rad``.
        """
        names = self.columns
        out: dict[str, NDArray[Any]] = {}
        if self.frame is not None:
            out["frame"] = self.frame
        out["time_s"] = self.t_s
        for k in range(self.links):
            out[names.phi(k)] = self.phi_rad[:, k]
        for k in range(self.links):
            out[names.sigma(k)] = self.sigma_rad[:, k]
        if self.camera_rad is not None:
            for k in range(self.links):
                out[names.sigma_camera(k)] = self.sigma_camera_rad[:, k]
            for k in range(self.links):
                for number in range(CAMERA_NUMBERS):
                    out[names.camera(number, k)] = self.camera_rad[:, k, number]
        if self.covariance_rad2 is not None:
            for a, b in itertools.combinations(range(self.links), 2):
                out[names.covariance(a, b)] = self.covariance_rad2[:, a, b]
        parts = [("theta", self.theta_rad), ("sigma_theta", self.sigma_theta_rad)]
        if self.camera_rad is not None:
            parts.append(("sigma_camera_theta", self.sigma_camera_theta_rad))
        for part, values in parts:
            out |= {f"{part}_{j.name}_rad": values[:, k] for k, j in enumerate(self.joints)}
        return out

    def __repr__(self) -> str:
        """A line for people."""
        parts = [f"{100 * part:.1f} %" for part in self.seen.mean(axis=0)]
        # Of many links one line has room for the least and the most.
        seen = " and ".join(parts if self.links <= NUMBERED else dict.fromkeys((min(parts), max(parts))))
        span = f"{self.t_s[0]:g} to {self.t_s[-1]:g} s"
        links = f"{self.links} link{'s'[: self.links > 1]}"
        return f"<LinkAngles {self.name}: {self.t_s.size} times x {links}, {span}, {seen} seen>"

    def _repr_html_(self) -> str:
        """The angles' summary of each link, for a notebook."""
        rows = []
        for k in range(self.links):
            seen = self.seen[:, k]
            turns = float(np.ptp(self.phi_rad[seen, k])) / (2 * math.pi) if seen.any() else math.nan
            sigma = self.sigma_rad[np.isfinite(self.sigma_rad[:, k]), k]
            error = f"{math.degrees(float(np.median(sigma))):.4f} deg" if sigma.size else "not stated"
            camera = self.sigma_camera_rad[seen, k]
            of_camera = f"{math.degrees(float(np.sqrt(np.mean(camera**2)))):.4f} deg"
            if not np.isfinite(camera).any():
                of_camera = "not stated"
            rows.append(
                (self.columns.stem(k), f"{100 * seen.mean():.1f} %", f"{turns:.2f} turns", error, of_camera)
            )
        return html_table(
            repr(self)[1:-1], ("angle", "seen", "range", "median noise", "camera's part (RMS)"), rows
        )


def check_table(
    name: str,
    table: tuple[Floats, Floats, Floats, NDArray[np.int64] | None],
    columns: ColumnNames,
    place: Callable[[int, str], str],
) -> None:
    """Times finite and rising, angles not infinite, sigmas not negative, no wrap between neighbours.

    ``table``: times, angles, sigmas and frames.
    """
    t, phi, sigma, frame = table

    def refuse_first(bad: NDArray[np.bool_], column: str, say: Callable[[int], str], advice: Text) -> None:
        """The error for the first row that is ``bad``, if there is one."""
        rows = np.flatnonzero(bad)
        if rows.size:
            row = int(rows[0])
            raise AnglesError(fault(name, say(row), advice, place=place(row, column)))

    def falls(values: NDArray[Any]) -> NDArray[np.bool_]:
        """The rows that do not come after the one before."""
        return np.concatenate([[False], np.diff(values) <= 0])

    refuse_first(
        ~np.isfinite(t), "time_s", lambda i: f"the time {t[i]} is not a number", "Give every row a time"
    )
    refuse_first(
        falls(t),
        "time_s",
        lambda i: f"the time {t[i]:.9g} s does not come after {t[i - 1]:.9g} s",
        "Sort the rows by time and remove repeats",
    )
    if frame is not None:
        refuse_first(
            falls(frame),
            "frame",
            lambda i: f"frame {frame[i]} does not come after frame {frame[i - 1]}",
            "Sort the rows by frame and remove repeats",
        )
    # Over a gap a link may turn by more than half a turn; between neighbouring rows that is a wrap.
    step = np.diff(t)
    neighbours = (
        np.concatenate([[False], step <= 1.5 * np.median(step)]) if t.size > 1 else np.zeros(1, dtype=bool)
    )

    def check_link(k: int, angle: Floats, error: Floats) -> None:
        """Checks the angles and sigmas of link ``k``, from 0, at the T times."""
        refuse_first(
            np.isinf(angle),
            columns.phi(k),
            lambda i: "the angle is infinite",
            "Leave the field empty where the link was not seen",
        )
        refuse_first(
            (error < 0) | np.isinf(error),
            columns.sigma(k),
            lambda i: f"the standard uncertainty {error[i]:.6g} rad cannot be",
            "Give a finite one that is not negative, or none",
        )
        jump = np.abs(np.diff(angle, prepend=np.nan))
        refuse_first(
            (jump > math.pi) & neighbours,
            columns.phi(k),
            lambda i: f"the angle jumps by {jump[i]:.4g} rad from one row to the next: it is not unwrapped",
            "Read it with " + Setting("unwrap", True),
        )

    for k in range(phi.shape[1]):
        check_link(k, phi[:, k], sigma[:, k])
