"""Clock offset and drift between video and encoder, by maximum likelihood.

Model: a reading at encoder time ``t`` is ``zero + gain * phi(t + offset + drift (t - reference))`` plus
white noise, with ``phi`` the video's angle. What tells the times apart is the rate: the information on the
offset is ``sum (gain w / sigma)^2``. With all four unknowns fitted together to the angles themselves, this
is the maximum likelihood on the rates with the zero free, without ever differencing noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.documents import Table
from pydpend.errors import EncoderError, fault, one_of
from pydpend.json_text import JsonResult, plain
from pydpend.kinematics.table import LinkAngles
from pydpend.series import correlation_time, highpass_noise
from pydpend.typed import typed

Floats = NDArray[np.float64]

COARSE_S = 0.01
"""Grid of the first search over all starts, s."""

RATE_S = 0.04
"""The video's rate is the slope of a cubic through this long, s."""

RATE_SIGMAS = 4.0
"""A rate below this many of its own standard errors counts as rest."""

LEAST_OVERLAP_S = 1.0
"""Video and encoder must share at least this long, s."""

OUTLIER_SIGMAS = 6.0
"""Readings further from the fit than this (of the residuals' robust standard deviation) are left out."""


ALIKE = 1.05
"""Fits whose residuals differ by less than this factor explain the readings equally well."""


@dataclass(frozen=True, eq=False, repr=False)
class Synchronisation(JsonResult):
    """The encoder's clock on the video's, with gain and zero of its angles.

    ``video time = t + offset_s + drift (t - reference_s)`` for an encoder time ``t``.

    Attributes
    ----------
    offset_s : float
        Difference of the clocks at `reference_s`, s.
    drift : float
        How much faster the video's clock runs, relative.
    gain : float
        Encoder angle per video angle; negative if the encoder counts the other way.
    zero_rad : float
        Encoder angle where the video's is zero, rad, within (-pi, pi].
    turns : int
        Whole turns between the two zeros.
    reference_s : float
        Encoder time at which `offset_s` holds, s.
    covariance : ndarray of float, shape (4, 4)
        Of (zero, gain, offset, drift), in rad and s, from the residuals and their autocorrelation.
    sigma_rad : float
        Standard deviation of the residual, rad.
    n : int
        Number of readings used.
    left_out : int
        Number of readings left out as outliers.
    correlation_samples : float
        Number of readings that hang together.
    given : bool
        Whether the clocks were said to be one; offset and drift are then 0 and not fitted.
    rival_offset_s : float or None
        Another offset that explains the readings as well, over a shorter time, s; None if there is none.
    """

    _error: ClassVar = EncoderError
    _source: ClassVar = "the clocks"

    offset_s: float
    drift: float
    gain: float
    zero_rad: float
    turns: int
    reference_s: float
    covariance: Floats
    sigma_rad: float
    n: int
    left_out: int
    correlation_samples: float
    given: bool = False
    rival_offset_s: float | None = None

    def __repr__(self) -> str:
        """A line for people."""
        offset = f"{self.offset_s:.6g} +- {self.offset_sigma_s:.1g} s"
        return f"<Synchronisation: offset {offset}, drift {1e6 * self.drift:.3g} ppm, gain {self.gain:.6f}>"

    @property
    def offset_sigma_s(self) -> float:
        """Standard uncertainty of the offset at ``reference_s``, s."""
        return float(np.sqrt(self.covariance[2, 2]))

    @property
    def drift_sigma(self) -> float:
        """Standard uncertainty of the drift."""
        return float(np.sqrt(self.covariance[3, 3]))

    @property
    def gain_sigma(self) -> float:
        """Standard uncertainty of the gain."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def zero_sigma_rad(self) -> float:
        """Standard uncertainty of the zero, rad."""
        return float(np.sqrt(self.covariance[0, 0]))

    def to_dict(self) -> dict[str, Any]:
        """The clocks as plain values.

        Returns
        -------
        dict
            All fields and the standard uncertainties of offset and drift; None for what is not known.
        """
        out: dict[str, Any] = plain(
            {
                "given": self.given,
                "offset_s": self.offset_s,
                "offset_sigma_s": self.offset_sigma_s,
                "drift": self.drift,
                "drift_sigma": self.drift_sigma,
                "reference_s": self.reference_s,
                "rival_offset_s": self.rival_offset_s,
                "turns": self.turns,
                "gain": self.gain,
                "zero_rad": self.zero_rad,
                "covariance": self.covariance,
                "sigma_rad": self.sigma_rad,
                "n": self.n,
                "left_out": self.left_out,
                "correlation_samples": self.correlation_samples,
            }
        )
        return out

    @classmethod
    def of_table(cls, table: Table) -> Synchronisation:
        """The clocks from a document that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave, or ``clocks`` of a comparison.

        Returns
        -------
        Synchronisation
            The clocks.

        Raises
        ------
        EncoderError
            Naming the key that is missing or not what it must be.
        """
        return cls(
            table.number("offset_s"),
            table.number("drift"),
            table.number("gain"),
            table.number("zero_rad"),
            table.whole("turns", -(2**53)),
            table.number("reference_s"),
            table.array("covariance", 4, 4),
            table.number("sigma_rad"),
            table.whole("n"),
            table.whole("left_out"),
            table.number("correlation_samples"),
            table.flag("given"),
            table.number("rival_offset_s") if "rival_offset_s" in table else None,
        )

    @typed()
    def video_time(self, t_s: Floats) -> Floats:
        """The video's time at encoder times.

        Parameters
        ----------
        t_s : ndarray of float
            Times on the encoder's clock, s, of any shape.

        Returns
        -------
        ndarray of float
            Times on the video's clock, s.
        """
        return t_s + self.offset_s + self.drift * (t_s - self.reference_s)


@dataclass(frozen=True, eq=False)
class Course:
    """One link's angle as a smooth function of time, NaN where it was not seen.

    Its rate is smoothed over RATE_S, and 0 where that is not RATE_SIGMAS of its own errors: where the link
    rests, the slope of the bare spline is the frames' noise, which would pass for information on the clocks.
    """

    spline: scipy.interpolate.CubicSpline
    t: Floats
    step: float
    rate_t: Floats
    rate: Floats

    @staticmethod
    def of(angles: LinkAngles, link: int) -> Course:
        """A cubic spline through the seen frames. Raises :class:`EncoderError` if there are too few."""
        # All of scipy.stats comes with it: half of what `import pydpend` would take.
        from scipy.signal import savgol_coeffs, savgol_filter

        if not 0 <= link < angles.links:
            raise EncoderError(fault(angles.name, f"it has {angles.links} link(s), not a link {link + 1}"))
        seen = angles.seen[:, link]
        if seen.sum() < 10:
            raise EncoderError(
                fault(angles.name, f"{angles.columns.stem(link)} is seen in {int(seen.sum())} frames only")
            )
        t = angles.t_s[seen]
        spline = scipy.interpolate.CubicSpline(t, angles.phi_rad[seen, link])
        step = angles.step_s
        grid = np.arange(t[0], t[-1] + step / 2, step)
        window = min(max(5, 2 * round(RATE_S / step / 2) + 1), grid.size - 1 + grid.size % 2)
        order = min(3, window - 1)
        rate = savgol_filter(spline(grid), window, order, deriv=1, delta=step)
        noise = highpass_noise(angles.phi_rad[:, link])
        error = noise * float(np.linalg.norm(savgol_coeffs(window, order, deriv=1, delta=step)))
        rate = np.where(np.abs(rate) > RATE_SIGMAS * error, rate, 0.0) if error > 0 else rate
        return Course(spline, t, step, grid, np.asarray(rate))

    def at(self, t: Floats) -> Floats:
        """Angle; NaN outside and within gaps of more than one frame."""
        return np.where(self._known(t), self.spline(t), np.nan)

    def rate_at(self, t: Floats) -> Floats:
        """Rate, rad/s; NaN where the angle is."""
        return np.where(self._known(t), np.interp(t, self.rate_t, self.rate), np.nan)

    def _known(self, t: Floats) -> NDArray[np.bool_]:
        after = np.clip(np.searchsorted(self.t, t), 1, self.t.size - 1)
        hole = (self.t[after] - self.t[after - 1]) > 1.5 * self.step
        outside = (t < self.t[0]) | (t > self.t[-1])
        return np.asarray(~hole & ~outside)


@typed()
def synchronise(
    video: LinkAngles,
    encoder: LinkAngles,
    link: int = 0,
    *,
    clocks: str = "estimate",
) -> Synchronisation:
    """The encoder's clock against the video's, with gain and zero, by maximum likelihood.

    Parameters
    ----------
    video : LinkAngles
        Angles of the links, rad.
    encoder : LinkAngles
        The encoder's angles, one link, rad.
    link : int
        Which link of the video the encoder is on, from 0.
    clocks : {"estimate", "given"}
        ``"estimate"``: any difference of starts; the recordings must overlap for at least a second of motion.
        ``"given"``: the recorder synchronised them (as Photron's DAQ control does); only gain and zero are fitted.

    Returns
    -------
    Synchronisation
        Offset, drift, gain and zero with their covariance.

    Raises
    ------
    EncoderError
        If they do not overlap or nothing moves.
    """
    course = Course.of(video, link)
    seen = encoder.seen[:, 0]
    t, phi = encoder.t_s[seen], encoder.phi_rad[seen, 0]
    if t.size < 10:
        raise EncoderError(
            fault(encoder.name, f"only {t.size} readings have an angle", "Check range and column")
        )
    if clocks not in ("estimate", "given"):
        raise EncoderError(one_of("clocks", clocks, ("estimate", "given")))
    given = clocks == "given"
    fits = []
    for shift, sense in [(0.0, 1.0), (0.0, -1.0)] if given else _coarse(course, t, phi):
        fitted = _fit(course, t, phi, shift, sense, given)
        if fitted is not None:
            fits.append(fitted)
    if not fits:
        raise EncoderError(
            fault(
                f"{video.name} and {encoder.name}",
                f"no {LEAST_OVERLAP_S:g} s of common motion was found",
                "They must show the same motion, and enough of it; check the link and the column",
            )
        )
    least = min(f.sigma_rad for f in fits)
    alike = sorted((f for f in fits if f.sigma_rad <= ALIKE * least), key=lambda f: f.n, reverse=True)
    best = alike[0]
    others = [
        f.offset_s for f in alike[1:] if f.gain * best.gain < 0 or abs(f.offset_s - best.offset_s) > COARSE_S
    ]
    return replace(best, rival_offset_s=others[0] if others else None)


def _bins(course_t: Floats, phi: Floats, start: float, count: int) -> tuple[Floats, Floats]:
    """Mean rates over bins of COARSE_S from differences of bin means, and where they are known."""
    index = np.floor((course_t - start) / COARSE_S).astype(np.int64)
    inside = (index >= 0) & (index < count) & np.isfinite(phi)
    number = np.bincount(index[inside], minlength=count)
    total = np.bincount(index[inside], weights=phi[inside], minlength=count)
    mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    wide = 3
    rate = np.full(count, np.nan)
    if count > 2 * wide:
        rate[wide:-wide] = (mean[2 * wide :] - mean[: -2 * wide]) / (2 * wide * COARSE_S)
    known = np.isfinite(rate)
    return np.where(known, rate, 0.0), known.astype(np.float64)


def _coarse(course: Course, t: Floats, phi: Floats) -> list[tuple[float, float]]:
    """The most likely (shift, sense): where the video explains most of the encoder's squared rate.

    Explained power ``sum (2 +-w_e w_v - w_v^2)`` over the overlap: unlike a correlation coefficient it is not
    drawn to overlaps in which nothing moves.
    """
    grid = np.arange(course.t[0], course.t[-1], min(COARSE_S / 4, course.step))
    video_phi = course.at(grid)
    n_video = int((course.t[-1] - course.t[0]) / COARSE_S) + 1
    n_encoder = int((t[-1] - t[0]) / COARSE_S) + 1
    # An encoder slower than the bins leaves holes in them: fill by a line, it is only the first search.
    fine = np.arange(t[0], t[-1], COARSE_S / 2)
    wv, kv = _bins(grid, video_phi, float(course.t[0]), n_video)
    we, ke = _bins(fine, np.interp(fine, t, _smoothed(t, phi)), float(t[0]), n_encoder)
    size = 1 << int(n_video + n_encoder).bit_length()
    fv, fe = np.fft.rfft(wv, size), np.fft.rfft(we, size)
    cross = np.fft.irfft(fv * fe.conj(), size)
    power = np.fft.irfft(np.fft.rfft(wv**2, size) * np.fft.rfft(ke, size).conj(), size)
    common = np.fft.irfft(np.fft.rfft(kv, size) * np.fft.rfft(ke, size).conj(), size)
    lags = np.arange(size)
    lags = np.where(lags >= size // 2, lags - size, lags)
    enough = common * COARSE_S >= LEAST_OVERLAP_S
    out: list[tuple[float, float, float]] = []
    for sense in (1.0, -1.0):
        score = np.where(enough, 2 * sense * cross - power, -np.inf)
        for _ in range(3):
            best = int(np.argmax(score))
            if not np.isfinite(score[best]) or score[best] <= 0:
                break
            shift = float(course.t[0] - t[0] + lags[best] * COARSE_S)
            out.append((float(score[best]), shift, sense))
            score = np.where(np.abs(lags - lags[best]) * COARSE_S < 0.15, -np.inf, score)
    out.sort(reverse=True)
    return [(shift, sense) for score, shift, sense in out if score > 0.5 * out[0][0]]


def _smoothed(t: Floats, phi: Floats) -> Floats:
    """A running mean over about 10 ms."""
    width = max(1, round(COARSE_S / float(np.median(np.diff(t)))) | 1)
    if width == 1 or t.size < width:
        return phi
    padded = np.concatenate([np.full(width // 2, phi[0]), phi, np.full(width // 2, phi[-1])])
    return np.convolve(padded, np.full(width, 1 / width), "valid")


def _fit(
    course: Course, t: Floats, phi: Floats, shift: float, sense: float, given: bool
) -> Synchronisation | None:
    inside = np.isfinite(course.at(t + shift))
    if inside.sum() < 10 or float(inside.sum()) * float(np.median(np.diff(t))) < LEAST_OVERLAP_S:
        return None
    reference = float(t[inside][0])
    free = 2 if given else 4
    rate = np.where(inside, course.rate_at(t + shift), 0.0)
    energy = np.where(np.isfinite(rate), rate**2, 0.0)
    if energy.sum() <= 0:
        return None
    middle = float((energy * t).sum() / energy.sum())
    length = float(np.ptp(t[inside]))
    # Parameters about the middle of the motion, so that a drift does not spoil the first steps.
    p = np.array([0.0, sense, shift, 0.0])
    first = course.at(t + shift)
    p[0] = float(np.median((phi - sense * first)[inside]))
    keep = np.ones(t.size, dtype=bool)
    for span in (0.05, 0.15, 0.5, 2.0, 2.0):
        part = keep & (np.abs(t - middle) <= max(span * length, 0.5))
        for _ in range(12):
            residual, jacobian = _residual(course, t, phi, p, middle)
            use = part & np.isfinite(residual)
            if use.sum() < 10:
                return None
            j, r = jacobian[use][:, :free], residual[use]
            if span < 0.2 and not given:
                j = j[:, [0, 2]]
                step2 = np.linalg.lstsq(j, r, rcond=None)[0]
                step = np.array([step2[0], 0.0, step2[1], 0.0])
            else:
                step = np.zeros(4)
                scale = np.sqrt((j**2).sum(axis=0))
                scale[scale == 0] = 1.0
                step[:free] = np.linalg.lstsq(j / scale, r, rcond=None)[0] / scale
            step[2] = np.clip(step[2], -0.05, 0.05)
            p = p + step
            if abs(step[2]) < 1e-9 and abs(step[1]) < 1e-9:
                break
        if span >= 2.0:
            robust = 1.4826 * float(np.median(np.abs(residual[use] - np.median(residual[use]))))
            keep = ~(np.abs(residual) > OUTLIER_SIGMAS * max(robust, 1e-12))
    residual, jacobian = _residual(course, t, phi, p, middle)
    use = keep & np.isfinite(residual)
    j, r = jacobian[use][:, :free], residual[use]
    dof = max(int(use.sum()) - free, 1)
    variance = float(r @ r) / dof
    together = correlation_time(np.where(use, residual, np.nan))
    covariance = np.zeros((4, 4))
    scale = np.sqrt((j**2).sum(axis=0))
    if (scale == 0).any():
        return None
    normal = (j / scale).T @ (j / scale)
    if np.linalg.cond(normal) > 1e12:
        return None
    covariance[:free, :free] = np.linalg.inv(normal) / np.outer(scale, scale) * variance * together
    # From the middle of the motion to the first common reading.
    move = np.eye(4)
    move[2, 3] = reference - middle
    covariance = move @ covariance @ move.T
    turns = round(p[0] / (2 * np.pi))
    return Synchronisation(
        float(p[2] + p[3] * (reference - middle)),
        float(p[3]),
        float(p[1]),
        float(p[0] - 2 * np.pi * turns),
        int(turns),
        reference,
        covariance,
        float(np.sqrt(variance)),
        int(use.sum()),
        int((~keep).sum()),
        together,
        given,
    )


def _residual(course: Course, t: Floats, phi: Floats, p: Floats, middle: float) -> tuple[Floats, Floats]:
    zero, gain, offset, drift = p
    there = t + offset + drift * (t - middle)
    angle, rate = course.at(there), course.rate_at(there)
    residual = phi - zero - gain * angle
    jacobian = np.stack([np.ones_like(t), angle, gain * rate, gain * rate * (t - middle)], axis=1)
    return residual, jacobian
