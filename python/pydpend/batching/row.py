"""A recording's row: what its run found, as plain values for ``batch.parquet`` and the page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pydpend.analyse import Outcome, RunState
from pydpend.coefficients import FULL, RATIOS
from pydpend.damping import DampingFit
from pydpend.json_text import plain
from pydpend.nodes import Nodes
from pydpend.recording_folder import RunFile
from pydpend.run_folder import FIT_FOLDER, PAGE, StoredRecording, read_run
from pydpend.worded import Words

CURVE_POINTS = 96
"""Instants of a curve on the page, which is as many pixels wide."""

STAGES = ("track", "angles", "encoder", "fit", "prediction", "markers", "overlay", "report")
"""Stages of which the table has the durations."""

LINKS = 2
"""Links of which the table has the angles' noise, the errors of the prediction and the modes."""

WINDOW_S = "1"
"""Length of the predicted windows whose errors the table has, s, as fit.json names it."""


class State(Words):
    """The states in which a recording of a batch can be."""

    DONE = "done", "done"
    PARTLY = "partly", "partly done"
    """A stage could not be done, or the fit did not converge."""
    FAILED = "failed", "failed"


class Light(Words):
    """The traffic light of a recording."""

    GREEN = "green", "no warning"
    YELLOW = "yellow", "look at the warnings"
    RED = "red", "no result"


_NUMBERS = (
    *("seconds", "rate_hz", "duration_s", "seen", "marker_rms_px", "encoder_rms_deg"),
    *("start_s", "stop_s", "chi2"),
    *(f"{name}{end}" for name in FULL for end in ("", "_sigma", "_over_psi", "_over_psi_sigma")),
    *(f"ratio_{name}{end}" for name in RATIOS for end in ("", "_sigma")),
    *(f"{name}{k + 1}_{unit}" for name, unit in (("noise", "deg"), ("mode", "hz")) for k in range(LINKS)),
    *(f"predicted_1s_phi{k + 1}_deg" for k in range(LINKS)),
    *(f"{stage}_s" for stage in STAGES),
)
_WHOLE = ("tries", "frames", "nodes", "links", "width_px", "height_px", "samples")
_TEXTS = (
    *("name", "path", "state", "light", "reason", "command", "report", "worker", "began", "rig", "rig_file"),
    *("codec", "zero_from", "fit_status", "fit_message", "film_sha256", "options", "version", "key"),
)

COLUMNS: Mapping[str, str] = {
    **dict.fromkeys(_TEXTS, "text"),
    "warnings": "texts",
    **dict.fromkeys(_WHOLE, "whole"),
    **dict.fromkeys(_NUMBERS, "number"),
}
"""Columns of ``batch.parquet`` and the kind of value of each; those of the sheet that are kept come after them."""


def row_of_run(outcome: Outcome) -> dict[str, Any]:
    """The findings of a run, as columns of `COLUMNS`; ``curve`` and ``sketch`` are the page's alone."""
    run = read_run(outcome.folder)
    recording = run.recordings[0]
    out: dict[str, Any] = {
        **_state(outcome),
        "warnings": list(outcome.warnings),
        "report": PAGE,
        "film_sha256": run.inputs[0][2],
        "version": run.version,
    }
    out |= {f"{name.rpartition('/')[2]}_s": took for name, took in outcome.seconds.items()}
    if recording.did("track") or recording.kind == "nodes":
        out |= _of_nodes(recording)
    if recording.did("angles"):
        out |= _of_angles(recording)
    if recording.did("encoder"):
        out["encoder_rms_deg"] = math.degrees(recording.comparison().rms_rad)
    if recording.did("overlay"):
        out["overlay"] = recording.file(RunFile.OVERLAY).relative_to(run.path).as_posix()
    if FIT_FOLDER in run.stages:
        out |= _of_fit(run.fit_folder.fit())
    known: dict[str, Any] = plain(out)
    return known


def _state(outcome: Outcome) -> dict[str, Any]:
    """State, light and the reason for it."""
    if outcome.status is not RunState.DONE:
        # A stage that only waits for another is not the reason.
        not_done = [why for why in outcome.reasons.values() if not why.startswith("it needs ")]
        reason = not_done[0] if not_done else outcome.message
        return {"state": State.PARTLY, "light": Light.YELLOW, "reason": reason}
    if outcome.warnings:
        return {"state": State.DONE, "light": Light.YELLOW, "reason": outcome.warnings[0]}
    return {"state": State.DONE, "light": Light.GREEN, "reason": ""}


def _of_nodes(recording: StoredRecording) -> dict[str, Any]:
    nodes = recording.nodes()
    out: dict[str, Any] = {
        "frames": nodes.frame.size,
        "nodes": len(nodes.rig.nodes),
        "seen": float(nodes.seen.mean()) if nodes.seen.size else None,
        "rate_hz": _rate(nodes),
        "duration_s": float(nodes.t_s[-1] - nodes.t_s[0]) if len(nodes) else 0.0,
        "width_px": nodes.rig.image_px[0],
        "height_px": nodes.rig.image_px[1],
        "codec": nodes.meta.get("source", {}).get("codec"),
        "sketch": _sketch(nodes),
    }
    if recording.did("markers"):
        off = recording.residual_px(nodes)
        if np.isfinite(off).any():
            out["marker_rms_px"] = math.sqrt(np.nanmean(off**2))
    return out


def _rate(nodes: Nodes) -> float | None:
    """Frames per second of recorded time."""
    gaps = np.diff(nodes.t_s)
    return float(1 / np.median(gaps)) if gaps.size and np.median(gaps) > 0 else None


def _sketch(nodes: Nodes) -> dict[str, Any]:
    """The markers in the rig's reference picture, per mille of its longer side, body by body."""
    rig = nodes.rig
    scale = 1000 / max(rig.image_px)
    bodies = [
        [[round(rig.nodes[i].x_px * scale), round(rig.nodes[i].y_px * scale)] for i in rig.indices(body)]
        for body in rig.bodies
    ]
    return {"size": [round(side * scale) for side in rig.image_px], "bodies": bodies}


def _of_angles(recording: StoredRecording) -> dict[str, Any]:
    angles = recording.angles()
    about = recording.angles_about()
    out: dict[str, Any] = {
        "links": angles.links,
        "frames": angles.t_s.size,
        "duration_s": float(angles.t_s[-1] - angles.t_s[0]),
        "zero_from": (about.get("zero") or {}).get("from"),
        "curve": _curve(angles.t_s, np.degrees(angles.phi_rad)),
    }
    for k in range(min(LINKS, angles.links)):
        sigma = angles.sigma_rad[:, k]
        if np.isfinite(sigma).any():
            out[f"noise{k + 1}_deg"] = math.degrees(float(np.nanmedian(sigma)))
    return out


def _curve(t_s: Any, phi_deg: Any) -> list[list[int | None]]:
    """Each link's angle at evenly spaced instants, deg; None where it is not known."""
    at = np.linspace(t_s[0], t_s[-1], CURVE_POINTS)
    near = np.clip(np.searchsorted(t_s, at), 0, t_s.size - 1)
    return [
        [round(v) if math.isfinite(v) else None for v in phi_deg[near, k].tolist()]
        for k in range(phi_deg.shape[1])
    ]


def _of_fit(fit: DampingFit) -> dict[str, Any]:
    given = fit.inputs[0]
    out: dict[str, Any] = {
        "fit_status": str(fit.status),
        "fit_message": fit.message,
        "chi2": fit.chi2,
        "samples": fit.n,
        "start_s": given.start_s,
        "stop_s": given.stop_s,
    }
    over = "" if fit.scale_known else "_over_psi"
    for name, one in fit.coefficients.items():
        out |= {f"{name}{over}": one.value, f"{name}{over}_sigma": one.sigma}
    for name, one in fit.ratios.items():
        out |= {f"ratio_{name}": one.value, f"ratio_{name}_sigma": one.sigma}
    for k, mode in enumerate(fit.modes_hz[:LINKS]):
        out[f"mode{k + 1}_hz"] = mode
    if WINDOW_S in fit.prediction:
        for k, error in enumerate(fit.prediction[WINDOW_S].rms_deg[:LINKS]):
            out[f"predicted_1s_phi{k + 1}_deg"] = error
    return out


def relative_to_results(row: dict[str, Any], run: Path, results: Path) -> None:
    """Gives the row's files their names relative to the folder of the batch."""
    for name in ("report", "overlay"):
        if row.get(name):
            row[name] = (run / row[name]).relative_to(results).as_posix()
