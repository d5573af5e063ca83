"""The single pendulum: a one-link rig, or the double pendulum with its elbow pinned (Section 3.1).

It is fitted as a double pendulum whose lower link is not there: nothing couples to it and it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pydpend.decay import check_pendulum
from pydpend.errors import FitError, Setting, fault
from pydpend.kinematics import LinkAngles
from pydpend.model import Model

Floats = NDArray[np.float64]


def alone(model: Model, name: str | None = None) -> Model:
    """The upper link of ``model`` alone (inertia 2 psi, weight moment sigma, mass m1)."""
    return Model.one_link(model.psi_kg_m2, model.sigma_j, model.m1_kg, model.g_m_s2, name=name or model.name)


def one_body(angles: LinkAngles, elbow_rad: float = 0.0) -> tuple[LinkAngles, float]:
    """Angles (T, 1) of the upper link of a pinned pendulum, and the angle phi2 - phi1 at which it is pinned.

    Where both links were measured, both say where the body is, each with its own weight; with one link the
    pinned angle is ``elbow_rad``. Raises FitError when the links move against each other.
    """
    check_pendulum(angles)
    if angles.links == 1:
        return angles, elbow_rad
    between = angles.phi_rad[:, 1] - angles.phi_rad[:, 0]
    both = np.isfinite(between)
    if not both.any():
        raise FitError(fault(angles.name, "the two links are never seen together", "Give one link's angles"))
    elbow = float(np.median(between[both]))
    spread = float(1.4826 * np.median(np.abs(between[both] - elbow)))
    if spread > np.radians(1.0) or np.abs(between[both] - elbow).max() > np.radians(10.0):
        low, high = np.degrees([between[both].min(), between[both].max()])
        raise FitError(
            fault(
                angles.name,
                f"the elbow is not pinned: phi2 - phi1 goes from {low:.3g} to {high:.3g} deg",
                "Fit it as a double pendulum",
            )
        )
    phi = angles.phi_rad - [0.0, elbow]
    sigma = np.where(angles.sigma_rad > 0, angles.sigma_rad, np.nan)
    # A link without uncertainties counts as one whose are equal.
    weight = (
        np.where(
            np.isfinite(phi), np.where(np.isfinite(sigma), sigma, np.nanmedian(np.append(sigma, 1.0))), np.inf
        )
        ** -2.0
    )
    total = weight.sum(axis=1)
    mean = np.divide(
        np.where(weight > 0, weight * phi, 0.0).sum(axis=1),
        total,
        out=np.full(total.size, np.nan),
        where=total > 0,
    )
    with np.errstate(divide="ignore"):
        error = np.where(np.isfinite(sigma).any(axis=1) & (total > 0), total**-0.5, np.nan)
    camera = angles.camera_rad
    if camera is not None:
        part = np.where(weight > 0, weight, 0.0) / np.where(total > 0, total, 1.0)[:, None]
        camera = (part[..., None] * np.nan_to_num(camera)).sum(axis=1)[:, None]
    body = replace(
        angles,
        phi_rad=mean[:, None],
        sigma_rad=error[:, None],
        camera_rad=camera,
        link_names=angles.link_names[:1],
        joints=(),
    )
    return body, elbow


def pinned(model: Model, elbow_rad: float) -> tuple[Model, float]:
    """The double pendulum with its elbow pinned at phi2 - phi1, as one link.

    Also the angle of the upper link at which that hangs at rest, rad.

    Also the angle of the upper link at which that hangs at rest, rad.
    """
    c, s = np.cos(elbow_rad), np.sin(elbow_rad)
    along, across = model.sigma_j + model.kappa_j * c, model.kappa_j * s
    body = replace(
        model,
        psi_kg_m2=model.psi_kg_m2 + model.lambda_kg_m2 + model.zeta_kg_m2 + model.a3_kg_m2 * c,
        sigma_j=float(np.hypot(along, across)),
        m1_kg=model.m1_kg + model.m2_kg,
        covariance=None,
    )
    return alone(body, f"{model.name}, elbow pinned at {np.degrees(elbow_rad):.3g} deg"), -float(
        np.arctan2(across, along)
    )


def same_links(recordings: Sequence[LinkAngles], model: Model) -> None:
    """Raises FitError for a recording that has not as many links as the model."""
    for a in recordings:
        check_pendulum(a)
        if a.links == 1 and model.links == 2:
            raise FitError(
                fault(
                    a.name,
                    f"angles of one link, but the model {model.name!r} has two",
                    "Give a one-link model (docs/reference/model.md), or "
                    + Setting("pinned", True)
                    + " if the elbow of the two is "
                    "pinned straight",
                )
            )
        if a.links == 2 and model.links == 1:
            raise FitError(
                fault(
                    a.name,
                    f"angles of two links, but the model {model.name!r} has one",
                    "Give a two-link model (docs/reference/model.md), or a table of one link",
                )
            )


def reduced(recordings: list[LinkAngles], model: Model, elbow_pinned: bool) -> tuple[list[LinkAngles], Model]:
    """Recordings of one body, their angles zero where it hangs, and its model.

    Raises FitError when the model has not as many links as the recordings, or these were pinned at different angles.
    """
    if model.links == 1 and elbow_pinned:
        raise FitError(
            fault(
                "fit",
                f"model {model.name!r} has one link and no elbow to pin",
                "Leave " + Setting("pinned", True) + " out",
            )
        )
    if not elbow_pinned:
        same_links(recordings, model)
        return recordings, model
    bodies = [one_body(a) for a in recordings]
    elbows = np.array([elbow for _, elbow in bodies])
    if np.ptp(elbows) > np.radians(2.0):
        raise FitError(
            fault("fit", f"the elbow was pinned at {np.degrees(elbows).round(1)} deg", "Fit each alone")
        )
    body, hanging = pinned(model, float(elbows.mean()))
    return [replace(a, phi_rad=a.phi_rad - hanging) for a, _ in bodies], body
