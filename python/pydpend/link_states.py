"""Angles, rates and accelerations of the links from noisy angles (docs/reference/physics.md section 9).

`states` is a Kalman smoother (compiled, ``crates/dynamics``), the accurate way, with covariances;
`savitzky_golay` the simple one. Plain differences are no way: at 500 frames a second and 0.1 degrees the
second difference has 1070 rad/s2 of noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pydpend import _native
from pydpend.argument_types import of_type
from pydpend.errors import AnglesError, Setting, fault
from pydpend.kinematics import LinkAngles, Places
from pydpend.kinematics.names import NUMBERED
from pydpend.tabular import TableResult, by_link, html_rows
from pydpend.typed import typed, typed_class

Array = npt.NDArray[np.float64]

STRETCH_S = 0.25
"""Length of the stretches of a recording that have a process noise of their own, s: short against the
change from tumbling to swinging, long against the 30 or so samples that the smoother looks at."""

LEAST_SAMPLES = 50
"""Samples that the smoother takes, at least."""

_LEAST_SHARE = 0.2
"""A sigma below this share of the median is raised to it: a scatter of marker pairs is near zero by
chance."""


_LIKE_ANGLES = ("t_s", "phi_rad", "sigma_rad")
"""Attributes of `Angles`."""


class Angles(Protocol):
    """The part of `pydpend.kinematics.LinkAngles` that is needed here."""

    @property
    def t_s(self) -> Array:
        """Times (T,), s."""
        ...

    @property
    def phi_rad(self) -> Array:
        """Angles (T, L), rad."""
        ...

    @property
    def sigma_rad(self) -> Array:
        """Standard uncertainties (T, L), rad."""
        ...


@typed_class()
@dataclass(frozen=True, eq=False, repr=False)
class LinkStates(TableResult):
    """Angles, rates and accelerations of L links at T times. Counter-clockwise positive, zero hanging; SI.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    phi_rad : ndarray of float, shape (T, L)
        Angles, rad.
    w_rad_s : ndarray of float, shape (T, L)
        Rates, rad/s.
    a_rad_s2 : ndarray of float, shape (T, L)
        Accelerations, rad/s2.
    covariance : ndarray of float, shape (T, L, 3, 3)
        Of (phi, w, a) of each link, SI; the links' errors are independent.
    sigma_factor : ndarray of float, shape (L,)
        By what the given sigmas were multiplied to agree with the angles' own scatter.
    method : str
        ``smoother``, or ``savitzky-golay`` with its window and degree.
    status : str
        ``done`` or ``failed``.
    message : str
        Why it failed, in words.
    link_names : tuple of str
        Names of the links, where the angles have them.
    """

    t_s: Array
    phi_rad: Array
    w_rad_s: Array
    a_rad_s2: Array
    covariance: Array
    sigma_factor: Array
    method: str
    status: str = "done"
    message: str = ""
    link_names: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """A line for people."""
        links = self.phi_rad.shape[1]
        return f"<LinkStates: {self.t_s.size} times x {links} link{'s'[: links > 1]}, {self.method}, {self.status}>"

    def _repr_html_(self) -> str:
        """The first rows, for a notebook."""
        return html_rows(repr(self)[1:-1], self.to_columns())

    def to_columns(self) -> dict[str, Array]:
        """The states as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, and of each link angle, rate and acceleration with their standard errors (``phi1_rad``,
            ``sigma_phi1_rad``, ...), SI; of more than two links by their names (``phi_crank_rad``, ``w_crank_rad_s``).
        """
        names = ("phi#_rad", "w#_rad_s", "a#_rad_s2")
        values = (self.phi_rad, self.w_rad_s, self.a_rad_s2)
        sigmas = np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=2, axis2=3), 0.0))
        columns = {"time_s": self.t_s} | dict(zip(names, values, strict=True))
        columns |= {f"sigma_{name}": sigmas[:, :, k] for k, name in enumerate(names)}
        return by_link(columns, self.link_names if len(self.link_names) > NUMBERED else ())


@typed()
def states(
    angles: Angles,
    *,
    stretch_s: float = STRETCH_S,
    scale_sigma: bool = True,
    white_jerk: bool = False,
    seed: int = 0,
) -> LinkStates:
    """Smoothed states at every time, also where a link was not seen, by a Kalman smoother.

    The equations are in docs/reference/physics.md section 9. The covariances are calibrated by passing noise through
    the smoother; between and beyond the samples of a long gap they are those of the process.

    Parameters
    ----------
    angles : LinkAngles
        Angles, rad, at T times; anything with ``t_s``, ``phi_rad`` and ``sigma_rad``.
    stretch_s : float
        Length of the stretches in each of which the process's intensity is the most likely one, s; inf is one for all.
    scale_sigma : bool
        Whether the sigmas are multiplied by the factor that the angles themselves call for. Where no sigma is given,
        all are taken equal and found.
    white_jerk : bool
        Whether each link's jerk is white noise; a random walk if not.
    seed : int
        Of the noise that calibrates the covariances.

    Returns
    -------
    LinkStates
        Angles, rates and accelerations with covariances.

    Raises
    ------
    AnglesError
        For times that do not increase, a link with fewer than 50 angles, a sigma that is negative.
    """
    if not stretch_s > 0:
        raise AnglesError(fault("stretch_s", f"{stretch_s} is no length", "Give s, above 0"))
    if seed < 0:
        raise AnglesError(fault("seed", f"{seed} is below 0", "Give 0 or more"))
    of_type("angles", angles, LinkAngles, like=_LIKE_ANGLES)
    t, phi, sigma = _checked(angles)
    links = phi.shape[1]
    out = np.empty((len(t), links, 3))
    cov = np.empty((len(t), links, 3, 3))
    factors = np.empty(links)
    order = 3 if white_jerk else 4
    white = np.random.default_rng(seed).standard_normal((len(t), links))
    for k in range(links):
        y = np.ascontiguousarray(phi[:, k])
        s, given = _sigmas(y, sigma[:, k], k)
        factor, knots, log_q = _native.learn_noise(t, y, s, order, scale_sigma or not given, stretch_s)
        x, p, _, calibration = _native.smooth_angles(
            t, y, s, order, factor, knots, log_q, np.ascontiguousarray(white[:, k])
        )
        c = np.asarray(calibration)
        out[:, k], cov[:, k], factors[k] = x, p * c[:, None] * c[None, :], factor
    found = bool(np.all(np.isfinite(out)) and np.all(np.isfinite(cov)))
    return LinkStates(
        t,
        out[:, :, 0],
        out[:, :, 1],
        out[:, :, 2],
        cov,
        factors,
        "smoother",
        "done" if found else "failed",
        "" if found else "the smoother gave numbers that are not finite: check times and sigmas",
        _names(angles),
    )


@dataclass(frozen=True, eq=False, repr=False)
class PointStates(TableResult):
    """Places, velocities and accelerations of P points at T times, x right and y up.

    Attributes
    ----------
    t_s : ndarray of float, shape (T,)
        Time, s.
    names : tuple of str
        Names of the points.
    unit : {"m", "px"}
        Unit of length.
    xy, v, a : ndarray of float, shape (T, P, 2)
        Places in `unit`, velocities in `unit`/s, accelerations in `unit`/s2.
    covariance : ndarray of float, shape (T, P, 2, 3, 3)
        Of place, velocity and acceleration along each axis, by the noise; that of a scale is not in it.
    sigma_factor : ndarray of float, shape (P, 2)
        By what the places' sigmas were multiplied to agree with their own scatter.
    """

    t_s: Array
    names: tuple[str, ...]
    unit: str
    xy: Array
    v: Array
    a: Array
    covariance: Array
    sigma_factor: Array

    @property
    def speed(self) -> Array:
        """Speed of each point, (T, P), `unit`/s."""
        return np.asarray(np.hypot(self.v[..., 0], self.v[..., 1]))

    def __repr__(self) -> str:
        """A line for people."""
        return f"<PointStates: {self.t_s.size} times x {len(self.names)} points, {self.unit}>"

    def _repr_html_(self) -> str:
        """The first rows, for a notebook."""
        return html_rows(repr(self)[1:-1], dict(list(self.to_columns().items())[:8]))

    def to_columns(self) -> dict[str, Array]:
        """The states as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (T,)
            ``time_s``, and of each point ``x_n0_m``, ``vx_n0_m_s``, ``ax_n0_m_s2``, the same of y, their standard
            uncertainties ``sigma_x_n0_m``, ..., and ``speed_n0_m_s``; ``px`` in place of ``m`` without a scale.
        """
        out = {"time_s": self.t_s}
        ends = (self.unit, f"{self.unit}_s", f"{self.unit}_s2")
        sigma = np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=3, axis2=4), 0.0))
        for p, name in enumerate(self.names):
            for k, axis in enumerate("xy"):
                stems = (axis, f"v{axis}", f"a{axis}")
                for i, (stem, end, part) in enumerate(
                    zip(stems, ends, (self.xy, self.v, self.a), strict=True)
                ):
                    out[f"{stem}_{name}_{end}"] = part[:, p, k]
                    out[f"sigma_{stem}_{name}_{end}"] = sigma[:, p, k, i]
            out[f"speed_{name}_{self.unit}_s"] = self.speed[:, p]
        return out


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """Coordinates of points in the place of angles."""

    t_s: Array
    phi_rad: Array
    sigma_rad: Array


@typed()
def point_states(places: Places, *, stretch_s: float = STRETCH_S, seed: int = 0) -> PointStates:
    """Velocity and acceleration of each point by the smoother of `states`, with standard uncertainties.

    Parameters
    ----------
    places : Places
        Places of P points at T times.
    stretch_s : float
        Length of the stretches in each of which the process's intensity is the most likely one, s; inf is one for all.
    seed : int
        Of the noise that calibrates the covariances.

    Returns
    -------
    PointStates
        Places, velocities and accelerations in the places' unit.

    Raises
    ------
    AnglesError
        For times that do not increase, or a point with fewer than 50 places.
    """
    total, count = places.xy.shape[:2]
    flat = places.xy.reshape(total, 2 * count)
    sigma = np.repeat(places.sigma, 2, axis=1)
    for k, name in enumerate(places.names):
        seen = int(np.isfinite(places.xy[:, k, 0]).sum())
        if seen < LEAST_SAMPLES:
            advice = (
                f"At least {LEAST_SAMPLES} are needed to smooth them; leave the point out with "
                + Setting("points")
            )
            raise AnglesError(fault(f"point {name}", f"{seen} places", advice))
    found = states(_Coordinates(places.t_s, flat, sigma), stretch_s=stretch_s, seed=seed)

    def of_points(values: Array) -> Array:
        return np.asarray(values.reshape(total, count, 2))

    return PointStates(
        places.t_s,
        places.names,
        places.unit,
        of_points(found.phi_rad),
        of_points(found.w_rad_s),
        of_points(found.a_rad_s2),
        found.covariance.reshape(total, count, 2, 3, 3),
        found.sigma_factor.reshape(count, 2),
    )


@typed()
def savitzky_golay(angles: Angles, *, window: int = 31, degree: int = 4) -> LinkStates:
    """States by a polynomial through the samples around each: the simple alternative to `states`.

    Parameters
    ----------
    angles : LinkAngles
        Angles, rad, at T times in equal steps; anything with ``t_s``, ``phi_rad`` and ``sigma_rad``.
    window : int
        Number of samples, odd.
    degree : int
        Degree of the polynomial, at least 2.

    Returns
    -------
    LinkStates
        NaN where the window reaches over an end or over an angle not seen. The covariance is that of the noise alone:
        what the polynomial flattens is not in it.

    Raises
    ------
    AnglesError
        For unequal steps or a window that is even, too short for its degree, or longer than the record.
    """
    of_type("angles", angles, LinkAngles, like=_LIKE_ANGLES)
    t, phi, sigma = _checked(angles)
    step = float(np.median(np.diff(t)))
    # A tenth of a sample displaces the polynomial's argument by less than the noise does.
    if np.any(np.abs(np.diff(t) - step) > 0.1 * step):
        i = int(np.argmax(np.abs(np.diff(t) - step) > 0.1 * step)) + 1
        raise AnglesError(
            fault("angles", f"the step to {t[i]:g} s is not {step:g} s", "Use states()", place=f"row {i}")
        )
    if window % 2 == 0 or window <= degree or window > len(t) or degree < 2:
        raise AnglesError(
            fault(
                "savitzky_golay",
                f"window {window}, degree {degree}, {len(t)} samples",
                "The window must be odd, longer than the degree (at least 2) and within the record",
            )
        )
    half = window // 2
    x = np.arange(-half, half + 1) * step
    rows = np.linalg.pinv(np.vander(x, degree + 1, increasing=True))[:3] * [[1.0], [1.0], [2.0]]
    links = phi.shape[1]
    out = np.full((len(t), links, 3), np.nan)
    cov = np.full((len(t), links, 3, 3), np.nan)
    for k in range(links):
        y = np.lib.stride_tricks.sliding_window_view(phi[:, k], window)
        out[half : len(t) - half, k] = y @ rows.T
        s, _ = _sigmas(phi[:, k], sigma[:, k], k)
        v = np.lib.stride_tricks.sliding_window_view(s**2, window)
        cov[half : len(t) - half, k] = np.einsum("iw,tw,jw->tij", rows, v, rows, optimize=True)
    return LinkStates(
        t,
        out[:, :, 0],
        out[:, :, 1],
        out[:, :, 2],
        cov,
        np.ones(links),
        f"savitzky-golay {window}/{degree}",
        link_names=_names(angles),
    )


def _names(angles: Angles) -> tuple[str, ...]:
    """The links' names, where what holds the angles has them."""
    return angles.link_names if isinstance(angles, LinkAngles) else ()


def _checked(angles: Angles) -> tuple[Array, Array, Array]:
    t = np.ascontiguousarray(angles.t_s, dtype=np.float64)
    phi = np.asarray(angles.phi_rad, dtype=np.float64)
    sigma = np.asarray(angles.sigma_rad, dtype=np.float64)
    if t.ndim != 1 or phi.ndim != 2 or len(phi) != len(t) or sigma.shape != phi.shape:
        raise AnglesError(
            fault(
                "angles",
                f"times {t.shape}, angles {phi.shape}, sigmas {sigma.shape}",
                "Give (T,), (T, L), (T, L)",
            )
        )
    if not np.all(np.isfinite(t)):
        raise AnglesError(
            fault("angles", "a time is not finite", place=f"row {int(np.argmin(np.isfinite(t)))}")
        )
    if np.any(np.diff(t) <= 0):
        i = int(np.argmax(np.diff(t) <= 0)) + 1
        raise AnglesError(fault("angles", f"{t[i]:g} s does not come after {t[i - 1]:g} s", place=f"row {i}"))
    return t, phi, sigma


def _sigmas(phi: Array, sigma: Array, link: int) -> tuple[Array, bool]:
    """Positive sigmas for every time, and whether any were given."""
    seen = np.isfinite(phi)
    if seen.sum() < LEAST_SAMPLES:
        raise AnglesError(
            fault(
                f"phi{link + 1}",
                f"{int(seen.sum())} angles",
                f"At least {LEAST_SAMPLES} are needed to smooth them",
            )
        )
    bad = seen & np.isfinite(sigma) & (sigma < 0)
    if np.any(bad):
        i = int(np.argmax(bad))
        raise AnglesError(
            fault(f"sigma{link + 1}", f"{sigma[i]:g} rad", "It cannot be negative", place=f"row {i}")
        )
    given = seen & np.isfinite(sigma) & (sigma > 0)
    if not np.any(given):
        return np.full(len(phi), 1e-3), False
    typical = float(np.median(sigma[given]))
    out = np.where(given, sigma, typical)
    return np.ascontiguousarray(np.maximum(out, _LEAST_SHARE * typical)), True
