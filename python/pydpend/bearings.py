"""Kinematics of the ball bearings (paper Sections 4.2 to 4.4, Table 4; docs/reference/physics.md section 3).

Rates are counter-clockwise positive. ``dI`` is the diameter of the inner race where the balls run, ``dB`` the
diameter of a ball; rolling without slipping fixes the ball carrier's rate ``omega_D`` and the ball's spin
``omega_C`` by the rates of the inner (A) and the outer (B) race.
The functions use arithmetic only, so that numbers, arrays and SymPy symbols may go in.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pydpend.errors import ModelError, fault


@dataclass(frozen=True)
class Ratios:
    """The ratios of Table 9 for one bearing: ``omega_D = D11 w_A + D12 w_B``, ``omega_C = C11 w_A - C12 w_B``."""

    d11: Any
    d12: Any
    c11: Any
    c12: Any
    radius: Any
    """The circle of the ball centres, in the unit of the diameters."""


def ratios(d_inner: Any, d_ball: Any) -> Ratios:
    """Ratios of a bearing from its two diameters (Eqs. 8 and 9; Table 9's D11, D12 corrected, erratum 9)."""
    pitch = d_inner + d_ball
    return Ratios(
        d11=d_inner / (2 * pitch),
        d12=(d_inner + 2 * d_ball) / (2 * pitch),
        c11=d_inner / (2 * d_ball),
        c12=(d_inner + 2 * d_ball) / (2 * d_ball),
        radius=pitch / 2,
    )


def rates(d_inner: Any, d_ball: Any, w_inner: Any, w_outer: Any) -> tuple[Any, Any]:
    """``(omega_D, omega_C)`` in Table 4's sign: the ball's vector spin is ``-omega_C k`` (Eqs. 8, 9, 10)."""
    r = ratios(d_inner, d_ball)
    return r.d11 * w_inner + r.d12 * w_outer, r.c11 * w_inner - r.c12 * w_outer


def ball_angles(eta_rad: Any, number: int) -> npt.NDArray[np.float64]:
    """Angles of all balls from the reference ball's (Eq. 18): the last axis has ``number`` entries."""
    if number < 1:
        raise ModelError(fault("bearings", f"{number} balls", "A bearing has at least one"))
    eta = np.asarray(eta_rad, dtype=np.float64)
    return eta[..., None] + 2.0 * np.pi * np.arange(number) / number


def reference_ball(eta0_rad: Any, d_inner: Any, d_ball: Any, turned_inner: Any, turned_outer: Any) -> Any:
    """Angle of the reference ball after its races turned by the given angles (Eq. 19)."""
    r = ratios(d_inner, d_ball)
    return eta0_rad + r.d11 * turned_inner + r.d12 * turned_outer


def random_phase(number: int, rng: np.random.Generator, size: int | None = None) -> Any:
    """The unknown start of the reference ball, uniform on one pitch, [0, 2 pi / number) (Section 4.4)."""
    return rng.uniform(0.0, 2.0 * np.pi / number, size)


def ball_sum(angles_rad: Any, phi1_rad: Any) -> Any:
    """``Lambda = sum cos(theta_i - phi1)`` over the balls on the last axis (the sum in T83 and Eq. 25).

    For equally spaced balls it is zero whatever the phase (erratum 6), so A1 and A2 multiply nothing and the
    random phase has no effect on the motion. With one ball missing it is minus that ball's cosine.
    """
    angles = np.asarray(angles_rad, dtype=np.float64)
    return np.cos(angles - np.asarray(phi1_rad, dtype=np.float64)[..., None]).sum(axis=-1)
