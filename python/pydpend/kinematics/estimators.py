"""The three estimators on the bodies of a recording: turns, their noise, and how they follow the camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from pydpend.errors import AnglesError, one_of
from pydpend.kinematics.body_view import BodyView
from pydpend.kinematics.camera import CameraPart, camera_part, known
from pydpend.kinematics.camera_slopes import linkage_slopes, pairwise_slopes, rigid_slopes
from pydpend.kinematics.first_shape import first_shape
from pydpend.kinematics.hanging import Raw
from pydpend.kinematics.joint_gaps import joint_gaps
from pydpend.kinematics.linkage import Given, Linkage
from pydpend.kinematics.linkage_frames import LinkageAngles, checked_sigma, fit_linkage
from pydpend.kinematics.markers import BodyMarkers, sigma_to_image, to_image
from pydpend.kinematics.names import ColumnNames
from pydpend.kinematics.pairwise import pair_angles
from pydpend.kinematics.pose import Pose, alone, fit_pose
from pydpend.kinematics.shape import GROUND, Shape
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats

if TYPE_CHECKING:
    from pydpend.nodes import Nodes, Rig

Method = Literal["rigid", "linkage", "pairwise"]
ESTIMATORS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True, eq=False)
class Seen:
    """The bodies through the camera: how their turns follow its numbers, (T, L, 5), and their poses."""

    views: list[BodyView]
    poses: list[Pose]
    slopes: Floats

    def part(self, rig: Rig, at_zero: Floats, sigma: Floats) -> tuple[CameraPart, Floats]:
        """The camera's part in the angles, and their noise (T, L).

        ``at_zero`` (L, 5): derivatives of their zero. ``sigma`` (T, L): their noise as the residuals say. Where these
        are the camera's, that is not noise: what they are with the camera that they ask for is.
        """
        evidence = [v.evidence(p.centre_px) for v, p in zip(self.views, self.poses, strict=True)]
        camera = known(rig, evidence)
        white = sigma.copy()
        if camera.significant:
            for k, (view, pose) in enumerate(zip(self.views, self.poses, strict=True)):
                if pose.is_alone:
                    continue
                square = fit_pose(view.moved(camera.asked))
                both = np.isfinite(pose.sigma_rad) & np.isfinite(square.sigma_rad)
                less = square.sigma_scale / pose.sigma_scale
                white[:, k] *= np.where(both, square.sigma_rad / pose.sigma_rad, less)
        names = ColumnNames(tuple(view.markers.name for view in self.views))
        return camera_part(rig, camera, self.slopes, at_zero, white, names), white


@dataclass(frozen=True, eq=False)
class Wishes:
    """Wishes of a caller for the estimators.

    ``length_m``: distance of pivot and elbow and its standard uncertainty, m. ``given``: joints of the ground that are
    known, by name.
    """

    estimator: Method
    mirrored: bool
    length_m: float | None = None
    length_sigma_m: float = 0.0
    given: Mapping[str, Given] | None = None


def poses_of(markers: list[BodyMarkers]) -> list[Pose]:
    """The poses of each body; of one with a single marker the marker alone."""
    return [fit_pose(m) if len(m.nodes) > 1 else alone(m) for m in markers]


def estimate(
    nodes: Nodes, markers: list[BodyMarkers], structure: Structure, wishes: Wishes
) -> tuple[Raw, Seen]:
    """Turns of the bodies by an estimator. Raises :class:`AnglesError` as `pydpend.angles` does."""
    if wishes.estimator not in ESTIMATORS:
        raise AnglesError(one_of("estimator", wishes.estimator, ESTIMATORS))
    if wishes.estimator == "pairwise":
        return _pairwise(nodes, markers, structure, wishes)
    poses = poses_of(markers)
    views = [BodyView.of(nodes, pose, wishes.mirrored) for pose in poses]
    if wishes.estimator == "linkage":
        return _linkage(nodes, poses, views, structure, wishes)
    return _rigid(nodes, poses, views, structure, wishes)


def _pairwise(
    nodes: Nodes, markers: list[BodyMarkers], structure: Structure, wishes: Wishes
) -> tuple[Raw, Seen]:
    pairs = [pair_angles(m) for m in markers]
    poses = [fit_pose(m) for m in markers]
    views = [BodyView.of(nodes, pose, wishes.mirrored) for pose in poses]
    scales = [pose.sigma_scale for pose in poses]
    meta = {
        "bodies": [
            {
                "name": m.name,
                "nodes": list(m.nodes),
                "median_scatter_rad": float(np.nanmedian(p.scatter_rad)),
                "median_sigma_rad": s * float(np.nanmedian(p.sigma_rad)),
                "sigma_scale": s,
            }
            for m, p, s in zip(markers, pairs, scales, strict=True)
        ],
        "notes": ["the scatter of the pairs (Eq. 32) is not the error of their mean; sigma is the latter"],
    }
    theta = np.stack([p.mean_rad for p in pairs], axis=1)
    sigma = np.stack([p.sigma_rad * s for p, s in zip(pairs, scales, strict=True)], axis=1)
    slopes = pairwise_slopes(views)
    # A pair one of whose markers its body contradicts has no angle: of two it cannot be told which is wrong.
    told = np.isfinite(slopes).all(axis=2)
    theta, sigma = np.where(told, theta, np.nan), np.where(told, sigma, np.nan)
    seen = Seen(views, poses, slopes)
    return Raw(theta, sigma, [m.reference_px for m in markers], None, meta, structure), seen


def _rigid(
    nodes: Nodes, poses: list[Pose], views: list[BodyView], structure: Structure, wishes: Wishes
) -> tuple[Raw, Seen]:
    """Each body by itself; one of a single marker by the joints from which it hangs."""
    meta: dict[str, Any] = {"bodies": [_body_meta(p) for p in poses]}
    theta = np.stack([p.theta_rad for p in poses], axis=1)
    sigma = np.stack([p.sigma_rad for p in poses], axis=1)
    slopes = rigid_slopes(views)
    shape = _shape_or_none(poses, structure, wishes)
    linked, covariance = None, None
    single = [p.markers.name for p in poses if p.is_alone]
    if single or wishes.length_m is not None:
        whole = structure.as_pendulum()
        names = whole.links if wishes.length_m is not None else whole.with_ancestors(single)
        index = [structure.links.index(name) for name in names]
        some = [poses[k] for k in index]
        linked = fit_linkage(some, whole.part(names), wishes.given)
        meta["linkage"], meta["notes"] = _linkage_meta(linked, some, nodes.rig, wishes)
        if len(index) == len(poses):
            shape = linked.linkage.shape
    if linked is not None and single:
        turning = linkage_slopes([views[k] for k in index], linked, wishes.given)
        covariance = np.zeros((*theta.shape, len(poses)))
        for i, k in enumerate(index):
            if not poses[k].is_alone:
                continue
            theta[:, k], sigma[:, k] = linked.theta_rad[:, i], linked.sigma_rad[:, i]
            slopes[:, k] = turning[:, i]
            # The linkage's angles use all that the rigid ones do, so that these err with them as they do themselves.
            covariance[:, k, index] = covariance[:, index, k] = linked.covariance_rad2[:, i]
        np.einsum("taa->ta", covariance)[...] = sigma**2
    templates = [p.template_px for p in poses]
    raw = Raw(theta, sigma, templates, shape, meta, structure, linked, covariance)
    return raw, Seen(views, poses, slopes)


def _linkage(
    nodes: Nodes, poses: list[Pose], views: list[BodyView], structure: Structure, wishes: Wishes
) -> tuple[Raw, Seen]:
    """All bodies together by the joints that they share."""
    meta: dict[str, Any] = {"bodies": [_body_meta(p) for p in poses]}
    linked = fit_linkage(poses, structure, wishes.given)
    meta["linkage"], notes = _linkage_meta(linked, poses, nodes.rig, wishes)
    covariance, grown = checked_sigma(linked, poses)
    meta["notes"] = [*notes, *grown]
    shape = linked.linkage.shape
    templates = [shape.local_markers(k) for k in range(shape.links)]
    seen = Seen(views, poses, linkage_slopes(views, linked, wishes.given))
    sigma = np.asarray(np.sqrt(np.einsum("taa->ta", covariance)))
    return Raw(linked.theta_rad, sigma, templates, shape, meta, structure, linked, covariance), seen


def _shape_or_none(poses: list[Pose], structure: Structure, wishes: Wishes) -> Shape | None:
    """The joints from the motion; ``None`` if the links turn too little to show them."""
    given = {name: g.place_px for name, g in (wishes.given or {}).items()}
    try:
        return first_shape(poses, structure.as_pendulum(), given)
    except AnglesError:
        return None


def _body_meta(pose: Pose) -> dict[str, Any]:
    dropped = (pose.markers.seen & ~pose.used).sum(axis=0)
    told = pose.markers.seen[:, 0] if pose.is_alone else np.isfinite(pose.theta_rad)
    return {
        "name": pose.markers.name,
        "nodes": list(pose.markers.nodes),
        "sigma_scale": pose.sigma_scale,
        "covered_factor": pose.covered_factor,
        "frames_without_angle": int((~told).sum()),
        "doubtful_frames": int(pose.doubtful.sum()),
        "markers_left_out": {
            n: int(c) for n, c in zip(pose.markers.nodes, dropped.tolist(), strict=True) if c
        },
    }


def _linkage_meta(
    linked: LinkageAngles, poses: list[Pose], rig: Rig, wishes: Wishes
) -> tuple[dict[str, Any], list[str]]:
    """Places in recorded pixels, lengths and the scale in square ones; and what is doubtful."""
    linkage, mirrored = linked.linkage, wishes.mirrored
    shape = linkage.shape
    names = [j.name for j in shape.structure.joints]
    meta: dict[str, Any] = {"sigma_scale": linkage.sigma_scale}
    for j, link, q in shape.ends:
        if link == GROUND:
            key = "pivot" if j == 0 else names[j]
            meta[f"{key}_px"] = to_image(shape.vectors_px[q], rig, mirrored).tolist()
            meta[f"{key}_sigma_px"] = sigma_to_image(linkage.vector_sigma_px(q), rig).tolist()
    if shape.links == 2 and not shape.trees_afloat and len(names) == 2:
        elbow = shape.joints[1] @ shape.vectors_px
        meta["elbow_in_reference_frame_px"] = to_image(elbow, rig, mirrored).tolist()
    if linkage.lengths:
        meta["link_length_px"] = linkage.length_px
        meta["link_length_sigma_px"] = linkage.length_sigma_px
    if wishes.length_m is not None:
        scale, sigma = linkage.metres_per_px(wishes.length_m, wishes.length_sigma_m)
        meta["scale_m_per_px"], meta["scale_sigma_m_per_px"] = scale, sigma
    meta["joints"], notes = joint_gaps(linkage, poses)
    if linkage.sigma_scale > MISFIT and any(p.is_alone for p in poses):
        notes.append(
            f"the markers are {linkage.sigma_scale:.1f} times as far from where the joints put them as their "
            "uncertainties say: look whether the links hang there, and whether the camera stands still"
        )
    return meta, notes + _far_from_given(linkage, wishes)


FAR = 4.3
"""A given pivot farther from the one found than so many standard uncertainties is told: chance makes one in ten
thousand."""

MISFIT = 3.0
"""Links of one marker whose markers miss the joints by so many times their uncertainties do not hang there."""


def _far_from_given(linkage: Linkage, wishes: Wishes) -> list[str]:
    """Notes on given joints that the motion puts elsewhere."""
    notes = []
    shape = linkage.shape
    for name, known_at in (wishes.given or {}).items():
        j = shape.joint(name)
        q = next(q for i, link, q in shape.ends if i == j and link == GROUND)
        off = float(np.hypot(*(shape.vectors_px[q] - known_at.place_px)))
        if off > FAR * known_at.sigma_px:
            notes.append(
                f"the given {name} is {off:.3g} px from where the motion puts it, and was said to be known to "
                f"{known_at.sigma_px:.3g} px: look at it again, or say how well it is known"
            )
    return notes
