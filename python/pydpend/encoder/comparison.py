"""Video against encoder: gain, offset, delay, residuals, and whose noise explains them (Section 6, Fig. 15)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pydpend.documents import Table
from pydpend.encoder.camera import camera_in
from pydpend.encoder.sync import Course, Synchronisation, synchronise
from pydpend.errors import COMPARE, EncoderError, fault
from pydpend.json_text import JsonResult, plain
from pydpend.kinematics.table import LinkAngles
from pydpend.series import correlation_time, highpass_noise
from pydpend.tabular import TableResult
from pydpend.typed import typed

Floats = NDArray[np.float64]

BLOCK_S = 1.0
"""Agreement below the encoder's noise is judged from means of the residual over this long."""


MOST_DRIFT = 0.5
"""No clocks of one recording differ by half; a motion that fits only so, or backwards, is another one."""

SAME_RAD = 1e-7
"""Angles that agree everywhere within this are the same numbers, written to seven digits or more: the noise of a
video's angle is a thousand times more."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(JsonResult, TableResult):
    """The encoder's n readings on the video's clock, and how far the video is from them (Section 6, Fig. 15).

    Each standard uncertainty is from residuals whose neighbours hang together for `correlation_samples`.

    Attributes
    ----------
    name, encoder_name : str
        Names of the video's and the encoder's recordings.
    link : int
        The video's link, from 0.
    n : int
        Number of readings that were compared.
    sync : Synchronisation
        The clocks.
    t_s : ndarray of float, shape (n,)
        Video time, s.
    video_rad, encoder_rad : ndarray of float, shape (n,)
        Angles, rad; the encoder's with its whole turns taken off, its gain and zero as they are.
    video_sigma_rad : ndarray of float, shape (n,)
        Stated standard uncertainty of the video's angles, rad.
    video_sigma_rms_rad : float
        Root mean square of these, rad; NaN where none is stated.
    encoder_sigma_rad : float
        Stated standard uncertainty of a reading, rad; NaN where none is.
    residual_rad : ndarray of float, shape (n,)
        The video's angle less what the regression makes of the encoder's, rad.
    gain, gain_sigma : float
        Slope of the regression ``video = offset + gain * encoder`` and its standard uncertainty.
    offset_rad, offset_sigma_rad : float
        Its offset, rad.
    delay_s, delay_sigma_s : float
        What of the clocks' offset is left to estimate, s: 0 where it was estimated, the found delay where the
        recorder gave the clocks as one.
    rms_rad, largest_rad : float
        Root mean square and largest residual, rad.
    mean_rad : float
        Mean residual, rad.
    mean_interval_rad : tuple of float
        Its 95 % interval, rad.
    correlation_samples : float
        Number of readings that hang together.
    block_rms_rad, block_expected_rad : float
        Root mean square of the residual's means over 1 s, and what white noise would leave of itself, rad.
    share_encoder, share_video, share_camera, share_unexplained : float
        Parts of the residual's variance that the stated noises explain, that which the film's camera explains with
        numbers within what is stated of it (NaN where nothing is), and the rest (below 0 if the stated noises are too
        large).
    video_noise_rad, encoder_noise_rad : float
        White noise of each series by its own scatter (residual of a local cubic), rad.
    notes : tuple of str
        What should be known of the comparison.
    left_out : int
        How many of the video's angles and the encoder's readings were left out, by the regression too.
    """

    _error: ClassVar = EncoderError
    _source: ClassVar = "compare.json"
    _advice: ClassVar = "Give the compare.json that " + COMPARE + " wrote"

    name: str
    encoder_name: str
    link: int
    n: int
    sync: Synchronisation
    t_s: Floats
    video_rad: Floats
    encoder_rad: Floats
    video_sigma_rad: Floats
    video_sigma_rms_rad: float
    encoder_sigma_rad: float
    residual_rad: Floats
    gain: float
    gain_sigma: float
    offset_rad: float
    offset_sigma_rad: float
    delay_s: float
    delay_sigma_s: float
    rms_rad: float
    largest_rad: float
    mean_rad: float
    mean_interval_rad: tuple[float, float]
    correlation_samples: float
    block_rms_rad: float
    block_expected_rad: float
    share_encoder: float
    share_video: float
    share_unexplained: float
    video_noise_rad: float
    encoder_noise_rad: float
    notes: tuple[str, ...]
    left_out: int
    """How many of the video's angles and the encoder's readings were left out, by the regression too."""
    share_camera: float = float("nan")

    def __repr__(self) -> str:
        """A line for people."""
        rms = float(np.degrees(self.rms_rad))
        names = f"{self.name} against {self.encoder_name}"
        return f"<Comparison {names}: {self.n} readings, RMS {rms:.4g} deg, gain {self.gain:.6f}>"

    @property
    def shares(self) -> dict[str, float]:
        """Known parts of the residual's variance: of ``encoder``, ``video``, ``camera`` and ``unexplained``."""
        parts = (self.share_encoder, self.share_video, self.share_camera, self.share_unexplained)
        named = dict(zip(("encoder", "video", "camera", "unexplained"), parts, strict=True))
        return {name: share for name, share in named.items() if np.isfinite(share)}

    @property
    def stated_sigma_rad(self) -> float:
        """Stated standard uncertainty of a reading less an angle, rad, of what states one; NaN where nothing does."""
        stated = np.array([self.encoder_sigma_rad, self.video_sigma_rms_rad])
        known = np.isfinite(stated)
        return float(np.hypot(*np.where(known, stated, 0.0))) if known.any() else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain values: ``compare.json``. Its series are in a table (`to_columns`) and not here.

        Returns
        -------
        dict
            All numbers, angles in degrees too where people read them; None for what is not known.
        """
        out: dict[str, Any] = plain(
            {
                "video": self.name,
                "encoder": self.encoder_name,
                "link": self.link + 1,
                "n": self.n,
                "clocks": self.sync.to_dict(),
                "gain": self.gain,
                "gain_sigma": self.gain_sigma,
                "offset_rad": self.offset_rad,
                "offset_sigma_rad": self.offset_sigma_rad,
                "delay_s": self.delay_s,
                "delay_sigma_s": self.delay_sigma_s,
                "rms_rad": self.rms_rad,
                "rms_deg": np.degrees(self.rms_rad),
                "largest_rad": self.largest_rad,
                "largest_deg": np.degrees(self.largest_rad),
                "mean_rad": self.mean_rad,
                "mean_interval_95_rad": self.mean_interval_rad,
                "correlation_samples": self.correlation_samples,
                "block_s": BLOCK_S,
                "block_rms_rad": self.block_rms_rad,
                "block_expected_rad": self.block_expected_rad,
                "shares": {
                    "encoder": self.share_encoder,
                    "video": self.share_video,
                    "camera": self.share_camera,
                    "unexplained": self.share_unexplained,
                },
                "stated_sigma_rad": {"encoder": self.encoder_sigma_rad, "video": self.video_sigma_rms_rad},
                "own_noise_rad": {"encoder": self.encoder_noise_rad, "video": self.video_noise_rad},
                "notes": self.notes,
                "left_out": self.left_out,
            }
        )
        return out

    @classmethod
    def of_table(cls, table: Table) -> Comparison:
        """The comparison from a ``compare.json`` that is read already. Its series are empty.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Comparison
            The comparison.

        Raises
        ------
        EncoderError
            Naming the key that is missing or not what it must be.
        """
        shares, stated, own = (table.table(key) for key in ("shares", "stated_sigma_rad", "own_noise_rad"))
        low, high = table.array("mean_interval_95_rad", 2).tolist()
        none = np.zeros(0)
        return cls(
            name=table.text("video"),
            encoder_name=table.text("encoder"),
            link=table.whole("link", 1, 2) - 1,
            n=table.whole("n"),
            sync=Synchronisation.of_table(table.table("clocks")),
            t_s=none,
            video_rad=none,
            encoder_rad=none,
            video_sigma_rad=none,
            video_sigma_rms_rad=stated.number_or_nan("video"),
            encoder_sigma_rad=stated.number_or_nan("encoder"),
            residual_rad=none,
            gain=table.number("gain"),
            gain_sigma=table.number_or_nan("gain_sigma"),
            offset_rad=table.number("offset_rad"),
            offset_sigma_rad=table.number_or_nan("offset_sigma_rad"),
            delay_s=table.number_or_nan("delay_s"),
            delay_sigma_s=table.number_or_nan("delay_sigma_s"),
            rms_rad=table.number("rms_rad"),
            largest_rad=table.number("largest_rad"),
            mean_rad=table.number("mean_rad"),
            mean_interval_rad=(low, high),
            correlation_samples=table.number("correlation_samples"),
            block_rms_rad=table.number_or_nan("block_rms_rad"),
            block_expected_rad=table.number_or_nan("block_expected_rad"),
            share_encoder=shares.number_or_nan("encoder"),
            share_video=shares.number_or_nan("video"),
            share_unexplained=shares.number_or_nan("unexplained"),
            video_noise_rad=own.number_or_nan("video"),
            encoder_noise_rad=own.number_or_nan("encoder"),
            notes=table.texts("notes"),
            left_out=table.whole("left_out"),
            share_camera=shares.number_or_nan("camera") if "camera" in shares else float("nan"),
        )

    def to_columns(self) -> dict[str, Floats]:
        """The residual series as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (n,)
            ``time_s``, ``video_rad``, ``encoder_rad`` and ``residual_rad``.
        """
        return {
            "time_s": self.t_s,
            "video_rad": self.video_rad,
            "encoder_rad": self.encoder_rad,
            "residual_rad": self.residual_rad,
        }


@typed()
def compare(
    video: LinkAngles,
    encoder: LinkAngles,
    link: int = 0,
    *,
    clocks: str = "estimate",
) -> Comparison:
    """Comparison of a link's video angle with an encoder's (:func:`pydpend.encoder_angles`).

    The noise of the encoder, most often the larger by far, is on its own side of the regression, so the gain is not
    pulled towards zero by it.

    Parameters
    ----------
    video : LinkAngles
        Angles of the links, rad.
    encoder : LinkAngles
        The encoder's angles, one link, rad.
    link : int
        Which link of the video the encoder is on, from 0.
    clocks : {"estimate", "given"}
        As in `synchronise`.

    Returns
    -------
    Comparison
        Clocks, gain, offset and residuals, each with its uncertainty.

    Raises
    ------
    EncoderError
        If the recordings share no motion, or are the same.
    """
    sync = synchronise(video, encoder, link, clocks=clocks)
    course = Course.of(video, link)
    seen = encoder.seen[:, 0]
    if not abs(sync.drift) < MOST_DRIFT:
        raise EncoderError(
            fault(
                encoder.name,
                f"by its motion the video's clock would run {1 + sync.drift:.3g} times as fast as its own: it is no "
                f"encoder of link {link + 1} of {video.name}",
                "Check the link, the encoder's column and both rates",
            )
        )
    there = sync.video_time(encoder.t_s[seen])
    angle = course.at(there)
    inside = np.isfinite(angle)
    t = there[inside]
    video_rad = angle[inside]
    encoder_rad = encoder.phi_rad[seen, 0][inside] - 2 * np.pi * sync.turns
    gain = 1.0 / sync.gain
    offset = -sync.zero_rad / sync.gain
    residual = video_rad - offset - gain * encoder_rad
    if float(np.abs(residual).max()) < SAME_RAD:
        raise EncoderError(
            fault(
                encoder.name,
                f"its {residual.size} readings are the very angles that it is compared with: it is the same recording",
                "Give the encoder's own recording",
            )
        )
    together = correlation_time(residual - residual.mean())
    mean = float(residual.mean())
    half = 1.96 * float(residual.std(ddof=1)) * float(np.sqrt(together / residual.size))
    notes = [*map(str, video.meta.get("notes", ())), *map(str, encoder.meta.get("notes", ()))]
    if sync.rival_offset_s is not None:
        notes.append(
            f"the motion repeats itself: a clock offset of {sync.rival_offset_s:.4f} s explains the readings as well; "
            "that with the longer overlap was taken"
        )
    if sync.left_out:
        notes.append(f"{sync.left_out} encoder readings are outliers and were left out of the regression")
    # The regression's noise is that of one encoder reading and one interpolated video angle.
    seen_video = video.seen[:, link]
    sigma_video = np.interp(t, video.t_s[seen_video], video.sigma_rad[seen_video, link])
    stated = encoder.sigma_rad[seen, 0][inside]
    encoder_sigma = float(np.sqrt(np.nanmean(stated**2))) if np.isfinite(stated).any() else float("nan")
    variance = float((residual**2).mean())
    part_encoder = (gain * encoder_sigma) ** 2 / variance
    part_video = (
        float(np.nanmean(sigma_video**2)) / variance if np.isfinite(sigma_video).any() else float("nan")
    )
    if not np.isfinite(part_video):
        notes.append("the video's angles state no uncertainty, so its share of the residual is not known")
    noise = float(np.sqrt((gain * encoder_sigma) ** 2 + np.nan_to_num(part_video) * variance))
    blocks, expected = _blocks(t, residual, noise)
    camera = camera_in(video, link, t, (video_rad - offset) / gain, residual, noise)
    delay, delay_sigma = 0.0, sync.offset_sigma_s
    if sync.given:
        delay, delay_sigma = _delay(course, t, encoder_rad, offset, gain)
        if abs(delay) > 5 * delay_sigma:
            notes.append(
                f"the clocks were said to be one, but the encoder's readings are {1e3 * delay:.3g} +- "
                f"{1e3 * delay_sigma:.2g} ms late: estimate the clocks if nothing synchronised them"
            )
    c = sync.covariance
    slope = np.array([-1.0 / sync.gain, sync.zero_rad / sync.gain**2])
    offset_sigma, gain_sigma = float(np.sqrt(slope @ c[:2, :2] @ slope)), sync.gain_sigma / sync.gain**2
    part_camera = float("nan")
    if camera is not None:
        part_camera = camera.share
        of_offset, of_gain = np.sqrt(np.diag(camera.covariance)).tolist()
        offset_sigma = float(np.hypot(offset_sigma, of_offset))
        gain_sigma = float(np.hypot(gain_sigma, of_gain))
        if of_gain > 0.5 * gain_sigma:
            notes.append(
                f"the film's camera makes {of_gain:.2g} of the gain's standard uncertainty of {gain_sigma:.2g}, and "
                f"{np.degrees(of_offset):.2g} deg of the zero's of {np.degrees(offset_sigma):.2g} deg"
            )
    return Comparison(
        name=video.name,
        encoder_name=encoder.name,
        link=link,
        n=residual.size,
        sync=sync,
        t_s=t,
        video_rad=video_rad,
        encoder_rad=encoder_rad,
        video_sigma_rad=sigma_video,
        video_sigma_rms_rad=float(np.sqrt(part_video * variance)),
        encoder_sigma_rad=encoder_sigma,
        residual_rad=residual,
        gain=gain,
        gain_sigma=gain_sigma,
        offset_rad=offset,
        offset_sigma_rad=offset_sigma,
        delay_s=delay,
        delay_sigma_s=delay_sigma,
        rms_rad=float(np.sqrt(variance)),
        largest_rad=float(np.abs(residual).max()),
        mean_rad=mean,
        mean_interval_rad=(mean - half, mean + half),
        correlation_samples=together,
        block_rms_rad=blocks,
        block_expected_rad=expected,
        share_encoder=part_encoder,
        share_video=part_video,
        share_camera=part_camera,
        share_unexplained=float(1.0 - part_encoder - np.nan_to_num(part_video) - np.nan_to_num(part_camera)),
        video_noise_rad=highpass_noise(video.phi_rad[:, link]),
        encoder_noise_rad=highpass_noise(encoder.phi_rad[:, 0]),
        notes=tuple(notes),
        left_out=video.left_out + encoder.left_out + sync.left_out,
    )


def _blocks(t: Floats, residual: Floats, sigma: float) -> tuple[float, float]:
    """RMS of the residual's means over BLOCK_S, and what white noise of ``sigma`` would leave of itself."""
    index = np.floor((t - t[0]) / BLOCK_S).astype(np.int64)
    number = np.bincount(index)
    total = np.bincount(index, weights=residual)
    full = number >= 0.5 * np.median(number[number > 0])
    mean = total[full] / number[full]
    return float(np.sqrt((mean**2).mean())), float(sigma * np.sqrt((1.0 / number[full]).mean()))


def _delay(course: Course, t: Floats, encoder_rad: Floats, offset: float, gain: float) -> tuple[float, float]:
    """The delay of the encoder's readings behind their stamps, s, with clocks given as one."""
    angle, rate = course.at(t), course.rate_at(t)
    residual = offset + gain * encoder_rad - angle
    rate = rate - rate.mean()
    power = float(rate @ rate)
    if power <= 0:
        return float("nan"), float("nan")
    # A reading of ``delay`` ago differs from the angle of now by -rate * delay.
    delay = -float(rate @ residual) / power
    rest = residual + delay * rate
    together = correlation_time(rest - rest.mean())
    return delay, float(np.sqrt((rest @ rest) / rest.size * together / power))
