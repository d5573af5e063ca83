"""The part of the page that says where the energy goes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.plots.damping import coefficients_figure, shares_figure
from pydpend.plots.folder import energy_path, read_columns
from pydpend.plots.style import inline_svg
from pydpend.report.page import Block, Chart, Figure, Heading, Listing, Reset, Section, Series, Table, Text
from pydpend.report.words import with_sigma, with_squares

ZOOM_S = 2.0
"""The first seconds of the energy stand alone too (Fig. 19)."""

MEANING = {
    "mu_v1": "viscous, upper joint",
    "mu_v2": "viscous, lower joint",
    "mu_q1": "air drag, upper link",
    "mu_q2": "air drag, lower link",
    "rmu1": "friction with the load, upper joint",
    "rmu2": "friction with the load, lower joint",
    "tau_c1": "constant dry torque, upper joint",
    "tau_c2": "constant dry torque, lower joint",
    "strip_drag": "air drag of the lower link in its own wind",
    "lambda": "inertia of the lower link",
    "sigma": "gravity on the upper link",
    "kappa": "gravity on the lower link",
    "a3": "coupling of the links",
}


def warnings(fit: dict[str, Any]) -> list[str]:
    """What a reader must know before the numbers."""
    if fit["status"] != "converged":
        return [f"The damping fit did not converge: {fit['message']}"]
    return [f"Damping: {fit['message']}"] if "beyond the noise" in fit["message"] else []


def answer(fit: dict[str, Any]) -> Table:
    """Coefficients and shares with their uncertainties."""
    rows = []

    def add(meaning: str, name: str, value: float | None, sigma: float | None, unit: str) -> None:
        rows.append((meaning, name, f"{with_sigma(value, sigma)} {with_squares(unit)}".strip()))

    for name, c in fit["coefficients"].items():
        add(MEANING.get(name, ""), name, c["value"], c["sigma"], c["unit"])
    for name, value in fit["ratios"].items():
        unit = "1/s2" if name in ("sigma", "kappa") else ""
        add(MEANING.get(name, ""), f"{name}/psi", value, fit.get("ratio_sigmas", {}).get(name), unit)
    for group in ("law", "joint"):
        for name, c in fit["shares"].get(group, {}).items():
            value, sigma = (None if c[k] is None else 100 * c[k] for k in ("value", "sigma"))
            add("share of the energy lost", f"{group} {name}", value, sigma, "%")
    return Table(("meaning", "quantity", "value"), tuple(rows), numbers=frozenset({2}))


def _energy(path: Path, group: str, title: str) -> list[Block]:
    c = read_columns(path)
    t, energy, model = c["time_s"], c["energy_j"], c["model_j"]
    near = t <= t[0] + ZOOM_S
    laws = [n for n in c if n.endswith("_j") and n not in ("energy_j", "model_j")]
    return [
        Chart(
            f"{group}-energy",
            f"Energy{title}",
            group,
            t,
            (
                Series("of the motion (J)", energy, 0),
                Series("start minus all losses (J)", model, 1, dashed=True),
            ),
            y_label="energy (J)",
            height=280,
        ),
        Chart(
            f"{group}-zoom",
            f"Its first {ZOOM_S:g} s",
            f"{group}-zoom",
            t[near],
            (
                Series("of the motion (J)", energy[near], 0),
                Series("start minus all losses (J)", model[near], 1, dashed=True),
            ),
            y_label="energy (J)",
            height=200,
        ),
        Chart(
            f"{group}-residual",
            "Motion minus losses",
            group,
            t,
            (Series("difference (mJ)", 1e3 * (energy - model), 2),),
            y_label="difference (mJ)",
            height=180,
        ),
        Chart(
            f"{group}-works",
            "Energy taken out by each law",
            group,
            t,
            tuple(Series(n.removesuffix("_j"), c[n], i % 6, dashed=i >= 6) for i, n in enumerate(laws)),
            y_label="energy (J)",
        ),
        Reset(group),
    ]


def sections(folder: Path, fit: dict[str, Any], prediction: dict[str, Any] | None) -> list[Section]:
    """Energy, identifiability, trials and prediction."""
    blocks: list[Block] = [Text(fit["message"])]
    blocks += [Listing(tuple(fit["notes"]))] if fit.get("notes") else []
    blocks.append(
        Figure(
            inline_svg(shares_figure(fit["shares"])), "Where the energy goes, with standard uncertainties."
        )
    )
    names = [i.get("name", f"recording {k + 1}") for k, i in enumerate(fit["inputs"])]
    for k, name in enumerate(names):
        path = energy_path(folder, k)
        if path.exists():
            blocks += _energy(path, f"e{k}", f" of {name}" if len(names) > 1 else "")
    out = [Section("damping", "Damping", tuple(blocks))]
    told = fit["identifiability"]
    out.append(
        Section(
            "identifiability",
            "What the data can tell",
            (
                Listing(tuple(told["sentences"])),
                Text(
                    f"Condition number of the scaled information matrix: {told['condition']:.3g}.", quiet=True
                ),
            ),
        )
    )
    trials = folder / "fit" / "trials.json"
    if len(names) > 1 and trials.exists():
        out.append(
            Section(
                "trials", "The recordings beside each other", tuple(_trials(json.loads(trials.read_text())))
            )
        )
    if prediction:
        out.append(Section("prediction", "Prediction", tuple(_prediction(folder, prediction))))
    return out


def _trials(trials: dict[str, Any]) -> list[Block]:
    rows = tuple(
        (
            name,
            *(with_sigma(v, s) for v, s in zip(c["values"], c["sigmas"], strict=True)),
            with_sigma(c["mean"], c["sigma"]),
            "–" if c["p_value"] is None else f"{c['p_value']:.2g}",
            with_squares(c["unit"]),
        )
        for name, c in trials["coefficients"].items()
    )
    count = len(next(iter(trials["coefficients"].values()))["values"]) if rows else 0
    header = ("quantity", *(f"recording {i + 1}" for i in range(count)), "mean", "p of one value", "unit")
    return [
        Text(trials["message"]),
        Figure(
            inline_svg(coefficients_figure(trials["coefficients"])),
            "Each coefficient over the recordings, with standard uncertainties.",
        ),
        Table(header, rows, numbers=frozenset(range(1, count + 3))),
    ]


def _prediction(folder: Path, prediction: dict[str, Any]) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "Each recording predicted from a fit of the others; only the state at each window's start was fitted."
        )
    ]
    for k, (name, p) in enumerate(prediction.items()):
        rows = tuple(
            (
                kind.replace("_", " "),
                f"{window} s",
                *(f"{v:.3f}" for v in (*w["rms_deg"], *w["median_deg"])),
                str(w["n"]),
            )
            for kind in ("in_window", "forecast")
            for window, w in p.get(kind, {}).items()
            if w["n"]
        )
        blocks += [
            Heading(name),
            Table(
                (
                    "kind",
                    "window",
                    "RMS phi1 (deg)",
                    "RMS phi2 (deg)",
                    "median phi1",
                    "median phi2",
                    "windows",
                ),
                rows,
                numbers=frozenset({2, 3, 4, 5, 6}),
            ),
            *_windows(read_columns(folder / name / "windows.csv"), f"w{k}"),
        ]
    return blocks


def _windows(c: dict[str, NDArray[np.float64]], group: str) -> list[Block]:
    """The error of each window over the recording, a chart for each length."""
    out: list[Block] = []
    for n, length in enumerate(np.unique(c["window_s"])):
        here = c["window_s"] == length
        rms = tuple(
            Series(f"phi{j + 1} (deg)", c[f"phi{j + 1}_rms_deg"][here], j, points=True) for j in range(2)
        )
        title = f"RMS error of each window of {length:g} s"
        out.append(
            Chart(
                f"{group}-{n}",
                title,
                group,
                c["start_s"][here],
                rms,
                "start of the window (s)",
                "RMS (deg)",
                180,
            )
        )
    return [*out, Reset(group)]
