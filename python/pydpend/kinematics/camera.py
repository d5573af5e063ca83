"""Effect on the angles of a camera that is not known exactly: five numbers, the same in every frame, never noise.

A body's angle follows the five numbers z of the camera as ``g(t) dz`` (`body_view`). With the covariance C of what is
not known of z,

    cov(phi) = diag(sigma_white^2) + g C g^T

``g C^(1/2)`` is what is kept: five columns per angle. C is what the markers leave of the prior,
``C^-1 = prior^-1 + I`` with I what their distances say. Where they ask for another camera than was used, by d, the
angles are off by that too, and ``d d^T`` is added to C.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pydpend._native import CAMERA_BY_EYE
from pydpend.errors import SETUP, AnglesError, fault
from pydpend.kinematics.body_view import Evidence
from pydpend.kinematics.names import ColumnNames
from pydpend.kinematics.scale import PRIOR_DOF
from pydpend.kinematics.table import CAMERA_NUMBERS, Floats

if TYPE_CHECKING:
    from pydpend.nodes import Rig

ROUNDS = 50
"""Most times that the scale of the residuals and the camera that they ask for are found in turn."""

SETTLED = 1e-3
"""Change of the gain, relative, at which they have settled."""

ORIGINS = {
    "by_eye": "no camera was found or given, so one that was aimed by eye is taken: 3 deg off square, pixels square to "
    "0.2 %, a lens that moves the corners by 3 %, less what the markers tell",
    "found": "as well as the camera that was found in the recording is known",
    "given": "as well as the rig's camera is known",
}
"""Where the camera's uncertainty is from, in words."""


@dataclass(frozen=True, eq=False)
class Known:
    """Knowledge of the camera: the numbers used, and the covariance of what they are off by.

    Attributes
    ----------
    origin : {"by_eye", "found", "given"}
        Where they are from.
    numbers : ndarray of float, shape (5,)
        a, b, v1, v2, k1 (docs/explanation/linking.md).
    covariance : ndarray of float, shape (5, 5)
        Of the numbers used, with the square of `asked` in it.
    asked : ndarray of float, shape (5,)
        How far from them the markers put the camera.
    significant : bool
        Whether that is more than chance explains.
    """

    origin: str
    numbers: Floats
    covariance: Floats
    asked: Floats
    significant: bool

    def root(self) -> Floats:
        """A (5, 5) with ``root root^T`` the covariance: Cholesky's where no number is exact."""
        sure = np.diag(self.covariance) <= 0
        free = np.flatnonzero(~sure)
        out = np.zeros((CAMERA_NUMBERS, CAMERA_NUMBERS))
        out[np.ix_(free, free)] = np.linalg.cholesky(self.covariance[np.ix_(free, free)])
        return out


def camera_of(rig: Rig) -> tuple[str, Floats, Floats | None]:
    """Where a rig's camera is from, its numbers (5,), and their covariance (5, 5) if it has one.

    Raises :class:`AnglesError` for a covariance that is none.
    """
    camera = rig.camera
    if camera is None:
        return "by_eye", np.zeros(CAMERA_NUMBERS), None
    numbers = np.array([*camera["stretch"], *camera["vanishing"], camera["k1"]], dtype=np.float64)
    stated = camera.get("covariance")
    if stated is None:
        return str(camera["origin"]), numbers, None
    covariance = np.asarray(stated, dtype=np.float64)
    free = np.flatnonzero(np.diag(covariance) > 0)
    try:
        np.linalg.cholesky(covariance[np.ix_(free, free)])
        right = np.allclose(covariance, covariance.T, rtol=1e-6, atol=0)
    except np.linalg.LinAlgError:
        right = False
    if not right:
        raise AnglesError(
            fault(
                "rig",
                "it is no covariance: it is not symmetric and positive",
                "Leave it out, or give that of the five numbers",
                place="camera.covariance",
            )
        )
    return str(camera["origin"]), numbers, covariance


def known(rig: Rig, evidence: Sequence[Evidence]) -> Known:
    """Knowledge of a rig's camera, joined with that from the bodies of a recording.

    A camera that was given is as uncertain as is said of it; one without a covariance is exact. One that was found is
    as uncertain as its covariance or as the recording says, whichever is less: both may be of the same frames. What
    the tracker left at 0, and a camera of which nothing is said, was aimed by eye.
    """
    origin, numbers, stated = camera_of(rig)
    by_eye = np.array(CAMERA_BY_EYE)
    prior = np.diag(by_eye**-2.0)
    free = np.arange(CAMERA_NUMBERS)
    if origin == "given":
        free = np.flatnonzero(np.diag(stated) > 0) if stated is not None else free[:0]
        prior = np.zeros_like(prior)
        if stated is not None:
            prior[np.ix_(free, free)] = np.linalg.inv(stated[np.ix_(free, free)])
    own, asked, gain, count = _posterior(prior, free, evidence)
    if origin == "found" and stated is not None:
        own = _sharper(own, stated, by_eye)
    chance = max(free.size, 1) * np.log(max(count, 2))
    return Known(origin, numbers, own + np.outer(asked, asked), asked, bool(gain > chance))


def _posterior(
    prior: Floats, free: NDArray[np.int64], evidence: Sequence[Evidence]
) -> tuple[Floats, Floats, float, int]:
    """Covariance (5, 5), the step (5,) that the markers ask for, the fall of chi-square, and of how many numbers."""
    covariance, asked = np.zeros_like(prior), np.zeros(CAMERA_NUMBERS)
    told = [e for e in evidence if e.dof > 0]
    count = sum(e.dof for e in told)
    if not free.size:
        return covariance, asked, 0.0, count
    block = np.ix_(free, free)
    gain = 0.0
    for _ in range(ROUNDS):
        information, score = prior.copy(), np.zeros(CAMERA_NUMBERS)
        for e in told:
            # Residuals scale the stated sigmas, less those that another camera takes away.
            scale2 = (max(e.chi2_at(asked), 0.0) + PRIOR_DOF) / (e.dof + PRIOR_DOF)
            information += e.information / scale2
            score += e.score / scale2
        covariance[block] = np.linalg.inv(information[block])
        asked = -covariance @ score
        before, gain = gain, float(asked @ information @ asked)
        if abs(gain - before) <= SETTLED * gain:
            break
    return covariance, asked, gain, count


def _sharper(own: Floats, stated: Floats, by_eye: Floats) -> Floats:
    """The covariance with the numbers that were found as they are stated, if that says more than the recording."""
    found = np.flatnonzero(np.diag(stated) > 0)
    weight = by_eye[found] ** -2.0
    if found.size == 0 or weight @ np.diag(stated)[found] >= weight @ np.diag(own)[found]:
        return own
    out = own.copy()
    out[found, :] = 0.0
    out[:, found] = 0.0
    out[np.ix_(found, found)] = stated[np.ix_(found, found)]
    return out


@dataclass(frozen=True, eq=False)
class CameraPart:
    """The camera's part in the angles of one recording.

    ``columns_rad`` (T, L, 5): what each of five independent numbers adds to the angles, for one standard deviation.
    ``meta``: what is told of the camera. ``notes``: what a user should know.
    """

    columns_rad: Floats
    meta: dict[str, Any]
    notes: list[str]


def camera_part(
    rig: Rig, camera: Known, slopes: Floats, at_zero: Floats, sigma: Floats, names: ColumnNames
) -> CameraPart:
    """The camera's part of angles with the derivatives ``slopes`` (T, L, 5), those of their zero ``at_zero`` (L, 5).

    ``sigma`` (T, L): the angles' own standard uncertainties, rad. ``names``: the angles'.
    """
    columns = (slopes - at_zero) @ camera.root()
    rms = rms_of(columns)
    asked = np.sqrt(np.nanmean(((slopes - at_zero) @ camera.asked) ** 2, axis=0))
    noise = np.array([_middle(column) for column in sigma.T])
    meta = {
        "origin": camera.origin,
        "numbers": camera.numbers.tolist(),
        "sigma": np.sqrt(np.diag(camera.covariance)).tolist(),
        "asked": camera.asked.tolist(),
        "rms_rad": rms.tolist(),
        "image_px": list(rig.image_px),
        "pixel_aspect": list(rig.pixel_aspect),
    }
    notes = []
    if (rms > noise).any():
        notes.append(f"{both_parts(noise, rms, names)}: {ORIGINS[camera.origin]}; {WHY_NOT_NOISE}")
    if camera.significant and (asked > noise).any():
        off = " and ".join(f"{v:.2g}" for v in np.degrees(asked))
        notes.append(
            "distances between the markers of a link change as they do not in the plane of the camera used: the "
            f"angles may be off by {off} deg, which is in the camera's part; find the camera with {SETUP}, or track "
            "without a rig"
        )
    return CameraPart(columns, meta, notes)


WHY_NOT_NOISE = (
    "the camera's part is one and the same error in all frames in which a link stands alike, so that no number of "
    "frames averages it out"
)


def rms_of(columns_rad: Floats) -> Floats:
    """Root mean square over the frames of the camera's standard uncertainty of each link, (L,), rad."""
    return np.asarray(np.sqrt(np.nanmean((columns_rad**2).sum(axis=2), axis=0)))


def both_parts(noise_rad: Floats, camera_rad: Floats, names: ColumnNames) -> str:
    """The two parts of each angle's standard uncertainty in words."""
    return ", ".join(
        f"{names.stem(k)}: {np.degrees(n):.2g} deg noise, {np.degrees(c):.2g} deg camera"
        for k, (n, c) in enumerate(zip(noise_rad, camera_rad, strict=True))
    )


def _middle(values: Floats) -> float:
    known_values = values[np.isfinite(values)]
    return float(np.median(known_values)) if known_values.size else 0.0


def central_differences(angle: Callable[[int, float], Floats]) -> Floats:
    """Derivatives (T, L, 5) of angles (T, L) that ``angle(number, step)`` gives for a camera a step away."""
    out = []
    for number, scale in enumerate(CAMERA_BY_EYE):
        # A hundredth of what is not known moves places by hundredths of a pixel: above rounding, below curvature.
        step = 0.01 * scale
        apart = angle(number, step) - angle(number, -step)
        out.append(np.angle(np.exp(1j * apart)) / (2 * step))
    return np.stack(out, axis=-1)
