"""From a node table to the angles of its links: :func:`angles`, the one body that calls the estimators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from pydpend.errors import CHECK, AnglesError, Setting, Text, fault, one_of
from pydpend.kinematics.body_view import BodyView
from pydpend.kinematics.camera import CameraPart, camera_part, known
from pydpend.kinematics.camera_slopes import linkage_slopes, pairwise_slopes, rigid_slopes, zero_slopes
from pydpend.kinematics.hanging import VERTICAL, Raw, zero_for
from pydpend.kinematics.linkage import Linkage, Shape, first_shape
from pydpend.kinematics.linkage_frames import checked_sigma, fit_linkage
from pydpend.kinematics.markers import BodyMarkers, body_markers, sigma_to_image, to_image
from pydpend.kinematics.names import ColumnNames
from pydpend.kinematics.pairwise import pair_angles
from pydpend.kinematics.pose import Pose, fit_pose
from pydpend.kinematics.structure import Structure
from pydpend.kinematics.table import Floats, LinkAngles
from pydpend.kinematics.unwrap import unwrap
from pydpend.nodes import Nodes
from pydpend.typed import typed

if TYPE_CHECKING:
    from pydpend.nodes import Rig

Method = Literal["rigid", "linkage", "pairwise"]
ESTIMATORS: tuple[Method, ...] = get_args(Method)


@typed("zero", "method")
def angles(
    nodes: Nodes,
    estimator: Method = "rigid",
    *,
    zero: str | Sequence[float] | float | Nodes = "rest",
    bodies: Sequence[str] | None = None,
    mirrored: bool = False,
    link_length_m: float | None = None,
    link_length_sigma_m: float = 0.0,
    gaps: Literal["error", "stop"] = "error",
    name: str | None = None,
    method: None = None,
) -> LinkAngles:
    """Angles of links from where their markers are: counter-clockwise positive, zero hanging down.

    Parameters
    ----------
    nodes : Nodes
        Where each marker is in each of T frames.
    estimator : {"rigid", "linkage", "pairwise"}
        ``"rigid"``: weighted least-squares pose of each body by itself, robust against a bad marker. ``"linkage"``:
        one or two links and the joints they share fitted together; needs a pivot that stays in place. ``"pairwise"``:
        the paper's Eqs. 30-32 with a circular mean.
    zero : str, float, sequence of float or Nodes
        ``"rest"`` finds the stretches in which all links hang still, and believes them if nothing in the recording
        contradicts that (docs/explanation/angles.md); ``"vertical"`` is the picture's vertical, with the camera's roll
        as standard uncertainty, 1 deg or as in ``"vertical=0.5"``; the nodes of another recording with the same rig and
        camera take the rest from there; one number per link says at what angles, in rad, the links stand in the rig's
        reference picture; ``"reference_frame"`` says 0 for all.
    bodies : sequence of str, optional
        Names of the links from the pivot outwards; all of the rig's in its order if not given.
    mirrored : bool
        Whether the film was taken from behind.
    link_length_m : float, optional
        Distance of pivot and elbow, m; it puts the scale into ``meta["linkage"]``.
    link_length_sigma_m : float
        Standard uncertainty of that distance, m.
    gaps : {"error", "stop"}
        What to do where a link was hidden for so long that a turn may be lost (more than ``pi / |w|``): refuse, or
        leave the link's angles out from there on and say so in ``meta["notes"]``.
    name : str, optional
        Name of the angles; the recording's if not given.
    method : None
        The old name of `estimator`; refused.

    Returns
    -------
    LinkAngles
        Angles in rad at the T times, unwrapped over turns, the first within (-pi, pi]. ``sigma_rad`` is each frame's
        own standard error, ``camera_rad`` what the camera may be off by in all of them; the uncertainty of the zero,
        common to all frames, is in ``meta["zero"]``. Where the table says that
        its times are uncertain (a variable frame rate in coarse ticks), ``sigma_rad`` holds that too, times the
        link's speed; ``meta["time"]`` says what the times are.

    Raises
    ------
    AnglesError
        For a body never seen, or in one marker only; no rest found, or one in which the links are held and do not
        hang; a turn that may be lost; links that turn too little for a linkage.
    """
    if method is not None:
        raise AnglesError(
            fault("method", "the option has another name now", "Give " + Setting("estimator", method))
        )
    markers = body_markers(nodes, bodies, mirrored)
    _check_length(estimator, len(markers), link_length_m, link_length_sigma_m)
    label = name if name is not None else _label(nodes)
    raw, seen = _estimate(nodes, markers, estimator, mirrored, (link_length_m, link_length_sigma_m))
    notes: list[str] = list(raw.meta.pop("notes", ()))
    ending = nodes.meta.get("ending")
    if isinstance(ending, dict) and ending.get("kind") != "complete":
        why = nodes.damage or ending.get("reason") or ending.get("kind")
        notes.append(f"the node table is not of the whole recording ({why})")
    phi, left_out = _unwrapped(nodes, raw.theta, markers, label, gaps, notes)
    _check_hanging(raw.structure, zero, label)
    offset, zero_meta, doubts = zero_for(nodes, phi, raw, markers, zero, bodies, mirrored, label)
    notes += doubts
    at_zero = zero_slopes(zero, zero_meta, offset, nodes.t_s, seen.slopes, seen.views, mirrored)
    camera, white = seen.part(nodes.rig, at_zero, raw.sigma)
    notes += camera.notes
    phi = phi - offset
    for k in range(phi.shape[1]):
        first = phi[np.flatnonzero(np.isfinite(phi[:, k]))[0], k]
        phi[:, k] -= 2 * np.pi * np.ceil((first - np.pi) / (2 * np.pi))
    meta = {"method": estimator, "mirrored": mirrored, **raw.meta, "zero": zero_meta, "notes": notes}
    meta |= {"left_out": left_out, "camera": camera.meta}
    for key in ("source", "time"):
        if nodes.meta.get(key) is not None:
            meta[key] = nodes.meta[key]
    sigma = _with_time(nodes.t_s, phi, white, _time_sigma_s(nodes))
    links, joints = raw.structure.links, raw.structure.between()
    return LinkAngles(nodes.t_s, phi, sigma, nodes.frame, meta, label, camera.columns_rad, links, joints)


def _check_hanging(structure: Structure, zero: object, label: str) -> None:
    """Raises AnglesError where the zero is to be a rest, and links of a loop hang in none."""
    if isinstance(zero, str) and zero == "rest" and structure.loops:
        closing = structure.loops[0]
        raise AnglesError(
            fault(
                label,
                f"the links close a loop at {closing.name} ({' and '.join(closing.bodies)}), where none hangs by "
                "itself, so a rest is no zero",
                "Give "
                + Setting("zero", VERTICAL)
                + " (angles from the picture's vertical) or "
                + Setting("zero", "reference_frame"),
            )
        )


def _check_chain(structure: Structure, wish: Text) -> None:
    """Raises AnglesError where what is wished needs a pendulum of one or two links."""
    if len(structure.links) > 2 or not structure.is_chain:
        raise AnglesError(
            fault(
                wish,
                f"the links {', '.join(structure.links)} are no pendulum of one or two",
                "Use "
                + Setting("estimator", "rigid")
                + " without it, or name the pendulum's with "
                + Setting("bodies"),
            )
        )


def _time_sigma_s(nodes: Nodes) -> float:
    """Standard uncertainty of each frame's time in s, as the table says; 0 where it says nothing."""
    time = nodes.meta.get("time")
    return float(time.get("sigma_s", 0.0)) if isinstance(time, dict) else 0.0


def _with_time(t_s: Floats, phi: Floats, sigma: Floats, time_sigma_s: float) -> Floats:
    """Standard uncertainties (T, L), rad, of angles whose times have one too, each frame's own.

    A link that turns with w is at another angle by ``w dt``.
    """
    if time_sigma_s == 0.0:
        return sigma
    out = sigma.copy()
    for k in range(phi.shape[1]):
        seen = np.flatnonzero(np.isfinite(phi[:, k]))
        if seen.size > 1:
            rate = np.gradient(phi[seen, k], t_s[seen])
            out[seen, k] = np.hypot(sigma[seen, k], rate * time_sigma_s)
    return out


@typed()
def find_linkage(nodes: Nodes, *, bodies: Sequence[str] | None = None, mirrored: bool = False) -> Linkage:
    """Joints and shape of the links: pivot, elbow, places of the markers, length in px, with uncertainties.

    Parameters
    ----------
    nodes : Nodes
        Where each marker is in each frame.
    bodies : sequence of str, optional
        Names of the links from the pivot outwards; in the rig's order if not given.
    mirrored : bool
        Whether the film was taken from behind.

    Returns
    -------
    Linkage
        Places in the world's directions (x right, y up) and in square pixels, as high as the recorded ones.

    Raises
    ------
    AnglesError
        If the links turn too little to find the joints.
    """
    poses = [fit_pose(m) for m in body_markers(nodes, bodies, mirrored)]
    _check_chain(Structure.of(nodes.rig, [p.markers.name for p in poses]), "find_linkage")
    return fit_linkage(poses[0], poses[1] if len(poses) > 1 else None).linkage


def _check_length(estimator: Method, links: int, length_m: float | None, length_sigma_m: float) -> None:
    """Raises AnglesError for a length that does nothing or makes no sense."""
    if length_m is None:
        if length_sigma_m:
            problem = "an uncertainty of a length that is not given"
            raise AnglesError(
                fault(Setting("link_length_sigma_m"), problem, "Give " + Setting("link_length_m"))
            )
        return
    if not (np.isfinite(length_m) and length_m > 0):
        raise AnglesError(
            fault(Setting("link_length_m"), f"{length_m:g} m is no length", "Give metres, above 0")
        )
    if estimator == "pairwise":
        advice = "Leave it out, or use " + Setting("estimator", "rigid")
        raise AnglesError(fault(Setting("link_length_m"), "the pairs of markers give no joints", advice))
    if links == 1:
        raise AnglesError(fault(Setting("link_length_m"), "a single link has no elbow", "Leave it out"))


def _label(nodes: Nodes) -> str:
    source = nodes.meta.get("source")
    return str(source.get("name", "nodes")) if isinstance(source, dict) else "nodes"


@dataclass(frozen=True, eq=False)
class _Seen:
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
                square = fit_pose(view.moved(camera.asked))
                both = np.isfinite(pose.sigma_rad) & np.isfinite(square.sigma_rad)
                less = square.sigma_scale / pose.sigma_scale
                white[:, k] *= np.where(both, square.sigma_rad / pose.sigma_rad, less)
        names = ColumnNames(tuple(view.markers.name for view in self.views))
        return camera_part(rig, camera, self.slopes, at_zero, white, names), white


def _estimate(
    nodes: Nodes,
    markers: list[BodyMarkers],
    estimator: Method,
    mirrored: bool,
    length: tuple[float | None, float],
) -> tuple[Raw, _Seen]:
    """Turns by an estimator; ``length``: distance of pivot and elbow and its standard uncertainty, m."""
    rig, (length_m, length_sigma_m) = nodes.rig, length
    structure = Structure.of(rig, [m.name for m in markers])
    if estimator not in ESTIMATORS:
        raise AnglesError(one_of("estimator", estimator, ESTIMATORS))
    if estimator == "linkage" or length_m is not None:
        _check_chain(
            structure, Setting("estimator", estimator) if length_m is None else Setting("link_length_m")
        )
    poses = [fit_pose(m) for m in markers]
    views = [BodyView.of(nodes, pose, mirrored) for pose in poses]
    if estimator == "pairwise":
        pairs = [pair_angles(m) for m in markers]
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
            "notes": [
                "the scatter of the pairs (Eq. 32) is not the error of their mean; sigma is the latter"
            ],
        }
        theta = np.stack([p.mean_rad for p in pairs], axis=1)
        sigma = np.stack([p.sigma_rad * s for p, s in zip(pairs, scales, strict=True)], axis=1)
        seen = _Seen(views, poses, pairwise_slopes(views))
        return Raw(theta, sigma, [m.reference_px for m in markers], None, meta, structure), seen
    meta = {"bodies": [_body_meta(p) for p in poses]}
    lower = poses[1] if len(poses) > 1 else None
    if estimator == "rigid":
        theta = np.stack([p.theta_rad for p in poses], axis=1)
        sigma = np.stack([p.sigma_rad for p in poses], axis=1)
        shape = None
        if length_m is not None:
            linked = fit_linkage(poses[0], lower)
            shape = linked.linkage.shape
            meta["linkage"] = _linkage_meta(linked.linkage, rig, mirrored, length_m, length_sigma_m)
        else:
            shape = _shape_or_none(poses) if structure.is_chain else None
        seen = _Seen(views, poses, rigid_slopes(views))
        return Raw(theta, sigma, [p.template_px for p in poses], shape, meta, structure), seen
    linked = fit_linkage(poses[0], lower)
    meta["linkage"] = _linkage_meta(linked.linkage, rig, mirrored, length_m, length_sigma_m)
    sigma, meta["notes"] = checked_sigma(linked, poses)
    shape = linked.linkage.shape
    templates = [shape.upper_px] if lower is None else [shape.upper_px, shape.lower_px]
    weight = np.concatenate([pose.markers.weight for pose in poses], axis=1)
    seen = _Seen(views, poses, linkage_slopes(views, weight, linked))
    return Raw(linked.theta_rad, sigma, templates, shape, meta, structure), seen


def _shape_or_none(poses: list[Pose]) -> Shape | None:
    """The joints of one or two links from the motion; ``None`` of more, or if they turn too little to show them."""
    if len(poses) > 2:
        return None
    try:
        return first_shape(poses[0], poses[1] if len(poses) > 1 else None)
    except AnglesError:
        return None


def _body_meta(pose: Pose) -> dict[str, Any]:
    dropped = (pose.markers.seen & ~pose.used).sum(axis=0)
    return {
        "name": pose.markers.name,
        "nodes": list(pose.markers.nodes),
        "sigma_scale": pose.sigma_scale,
        "covered_factor": pose.covered_factor,
        "frames_without_angle": int(np.isnan(pose.theta_rad).sum()),
        "doubtful_frames": int(pose.doubtful.sum()),
        "markers_left_out": {
            n: int(c) for n, c in zip(pose.markers.nodes, dropped.tolist(), strict=True) if c
        },
    }


def _linkage_meta(
    linkage: Linkage, rig: Rig, mirrored: bool, length_m: float | None, length_sigma_m: float
) -> dict[str, Any]:
    """Places in recorded pixels, lengths and the scale in square ones."""
    meta: dict[str, Any] = {
        "pivot_px": to_image(linkage.shape.pivot_px, rig, mirrored).tolist(),
        "pivot_sigma_px": sigma_to_image(linkage.pivot_sigma_px, rig).tolist(),
        "sigma_scale": linkage.sigma_scale,
    }
    if linkage.shape.links == 2:
        elbow = linkage.shape.pivot_px + linkage.shape.elbow_px
        meta["elbow_in_reference_frame_px"] = to_image(elbow, rig, mirrored).tolist()
        meta["link_length_px"] = linkage.length_px
        meta["link_length_sigma_px"] = linkage.length_sigma_px
        if length_m is not None:
            scale, sigma = linkage.metres_per_px(length_m, length_sigma_m)
            meta["scale_m_per_px"], meta["scale_sigma_m_per_px"] = scale, sigma
    return meta


def _unwrapped(
    nodes: Nodes,
    theta: Floats,
    markers: list[BodyMarkers],
    label: str,
    gaps: Literal["error", "stop"],
    notes: list[str],
) -> tuple[Floats, int]:
    """The angles counted over turns, (T, L), and how many are left out behind a gap in which one may be lost."""
    phi, left_out = np.empty_like(theta), 0
    for k, body in enumerate(markers):
        if not np.isfinite(theta[:, k]).any():
            raise AnglesError(
                fault(
                    label,
                    f"the body {body.name} has no angle in any frame",
                    "Look at " + CHECK + " of the table",
                )
            )
        phi[:, k], lost = unwrap(nodes.t_s, theta[:, k])
        if not lost:
            continue
        gap = lost[0]
        hidden = f"frames {int(nodes.frame[gap.before]) + 1} to {int(nodes.frame[gap.after]) - 1}"
        place = f"{hidden}, body {body.name}"
        problem = (
            f"not seen for {gap.length_s:.4g} s, more than the {gap.limit_s:.4g} s "
            "after which a turn may be lost"
        )
        if gaps == "error":
            raise AnglesError(
                fault(
                    label, problem, "Cut the recording there, or use " + Setting("gaps", "stop"), place=place
                )
            )
        left_out += int(np.isfinite(phi[gap.after :, k]).sum())
        phi[gap.after :, k] = np.nan
        notes.append(f"{place}: {problem}; its angles are left out from there on")
    return phi, left_out
