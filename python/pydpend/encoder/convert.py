"""From an encoder's volts to angles: rails, wraps and uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pydpend.encoder.calibration import Calibration
from pydpend.encoder.signal import EncoderSignal
from pydpend.errors import CALIBRATE, EncoderError, Setting, fault
from pydpend.kinematics.table import LinkAngles
from pydpend.kinematics.unwrap import unwrap
from pydpend.typed import typed

Floats = NDArray[np.float64]

RAIL_SIGMAS = 4.0
"""A reading within this many standard deviations of a rail may be cut off by it."""

MOST_LEFT_OUT = 0.5
"""With more than this part of the readings unusable there is no signal to speak of."""


@typed()
def encoder_angles(signal: EncoderSignal, calibration: Calibration | None = None) -> LinkAngles:
    """The encoder's angle over time: one link, rad, unwrapped.

    Parameters
    ----------
    signal : EncoderSignal
        Readings, V or rad.
    calibration : Calibration, optional
        The line between volts and angle; needed for volts, refused for rad.

    Returns
    -------
    LinkAngles
        Angles (T, 1), rad, zero where the calibration's is. ``sigma_rad`` is the noise of a reading; of a signal in
        rad it is taken from itself (residual of a local cubic). Readings at or beyond the rails have no angle (NaN)
        and are counted in ``meta``; so are those taken while a single-turn encoder jumps from one rail to the other.
        ``meta["systematic_rad"]`` is the largest uncertainty that the line adds, common to all readings.

    Raises
    ------
    EncoderError
        For volts without a calibration, more than half of the readings unusable, or a gap in which an encoder of a
        single turn may have lost one.
    """
    if signal.unit == "rad":
        if calibration is not None:
            raise EncoderError(
                fault(Setting("calibration"), f"{signal.name} is an angle already, not volts", "Leave it out")
            )
        from pydpend.series import highpass_noise

        noise = highpass_noise(signal.value)
        sigma = np.full((signal.value.size, 1), noise if noise > 0 else np.nan)
        phi = signal.value
        if (np.abs(np.diff(phi))[np.diff(signal.t_s) <= 1.5 * signal.step_s] > np.pi).any():
            phi = _counted(signal, phi)
        meta = {
            "source": "encoder, in angle",
            "notes": list(signal.notes),
            "left_out": signal.left_out,
            "sigma_rad": float(sigma[0, 0]),
        }
        return LinkAngles(signal.t_s, phi[:, None], sigma, None, meta, signal.name)
    if calibration is None:
        raise EncoderError(
            fault(
                signal.name,
                "it is in volts and there is no calibration",
                "Give " + Setting("calibration") + "; make one with " + CALIBRATE,
            )
        )
    volts = signal.value
    low, high = calibration.range_v
    margin = RAIL_SIGMAS * calibration.noise_v
    beyond = (volts < low - margin) | (volts > high + margin)
    notes = list(signal.notes)
    at_rail = np.zeros(volts.size, dtype=bool)
    jumping = np.zeros(volts.size, dtype=bool)
    if calibration.wraps:
        jumping = _jumping(volts, high - low)
    else:
        at_rail = ~beyond & ((volts <= low + margin) | (volts >= high - margin))
    for what, mask in (
        (f"beyond the range of {low:g} to {high:g} V", beyond),
        (f"at a rail of {low:g} to {high:g} V, the angle is cut off there", at_rail),
        ("taken while the encoder jumped from one rail to the other", jumping),
    ):
        if mask.any():
            first = float(signal.t_s[np.argmax(mask)])
            notes.append(f"{int(mask.sum())} readings {what} (the first at {first:.6g} s); they are left out")
    bad = beyond | at_rail | jumping
    if bad.mean() > MOST_LEFT_OUT:
        raise EncoderError(
            fault(
                signal.name,
                f"{100 * bad.mean():.0f} % of the readings cannot be used ({notes[-1]})",
                "Check the range",
            )
        )
    good = ~bad
    counted = volts
    if calibration.wraps:
        per_turn = (high - low) / (2 * np.pi)
        counted = per_turn * _counted(signal, np.where(good, volts / per_turn, np.nan))
    phi = np.where(good, calibration.angle_rad(counted), np.nan)
    sigma = np.where(good, calibration.noise_rad, np.nan)
    meta = {
        "source": "encoder",
        "readings_at_rails": int(at_rail.sum()),
        "readings_beyond_range": int(beyond.sum()),
        "readings_while_jumping": int(jumping.sum()),
        "systematic_rad": float(np.nanmax(np.where(good, calibration.systematic_rad(counted), np.nan))),
        "notes": notes,
        "left_out": signal.left_out + int(bad.sum()),
    }
    return LinkAngles(signal.t_s, phi[:, None], sigma[:, None], None, meta, signal.name)


def _counted(signal: EncoderSignal, wrapped_rad: Floats) -> Floats:
    """The angle of a single-turn encoder counted over turns. Raises :class:`EncoderError` if a gap may lose one."""
    phi, lost = unwrap(signal.t_s, wrapped_rad)
    if lost:
        gap = lost[0]
        raise EncoderError(
            fault(
                signal.name,
                f"no readings for {gap.length_s:.4g} s, more than the {gap.limit_s:.4g} s after which a turn of a "
                "single-turn encoder may be lost",
                "Cut the recording there",
                place=f"after {signal.t_s[gap.before]:.6g} s",
            )
        )
    return phi


def _jumping(volts: Floats, span: float) -> NDArray[np.bool_]:
    """Readings in the middle of a jump: far from both neighbours, which are nearly a span apart."""
    out = np.zeros(volts.size, dtype=bool)
    before, after = np.abs(np.diff(volts))[:-1], np.abs(np.diff(volts))[1:]
    whole = np.abs(volts[2:] - volts[:-2])
    out[1:-1] = (whole > 0.6 * span) & (before > 0.1 * span) & (after > 0.1 * span)
    return out
