"""The part of the page that says where the energy goes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.plots.style import inline_svg
from pydpend.report.page import Block, Chart, Figure, Heading, Listing, Reset, Section, Series, Table, Text
from pydpend.report.words import with_sigma


def warnings(fit: dict[str, Any]) -> list[str]:
    """What a reader must know before the numbers."""
    out = list(fit.get("notes", []))
    if fit["status"] != "converged":
        out.insert(0, f"The damping fit did not converge: {fit['message']}")
    return out


def answer(fit: dict[str, Any]) -> Table:
    """Coefficients and shares with their uncertainties."""
    rows = [(name, with_sigma(c["value"], c["sigma"]), c["unit"]) for name, c in fit["coefficients"].items()]
    rows += [
        (
            f"{name}/psi",
            with_sigma(value, fit.get("ratio_sigmas", {}).get(name)),
            "s^-2" if name in "sigma kappa" else "",
        )
        for name, value in fit["ratios"].items()
    ]
    for group in ("law", "joint"):
        for name, c in fit["shares"].get(group, {}).items():
            percent = with_sigma(*(None if c[k] is None else 100 * c[k] for k in ("value", "sigma")))
            rows.append((f"energy taken by {group} {name}", percent, "%"))
    return Table(("quantity", "value", "unit"), tuple(rows), numbers=frozenset({1}))


def _csv(path: Path) -> dict[str, NDArray[np.float64]]:
    with path.open(encoding="utf-8") as f:
        names = f.readline().strip().split(",")
        values = np.loadtxt(f, delimiter=",", ndmin=2)
    return {n: values[:, i] for i, n in enumerate(names)}


def _energy(path: Path, group: str, title: str) -> list[Block]:
    c = _csv(path)
    t, energy, model = c["time_s"], c["energy_j"], c["model_j"]
    laws = [n for n in c if n.endswith("_j") and n not in ("energy_j", "model_j")]
    return [
        Chart(
            f"{group}-energy",
            f"Energy{title}",
            group,
            t,
            (Series("of the motion (J)", energy, 0), Series("start minus all losses (J)", model, 1)),
            y_label="energy (J)",
            height=280,
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
            tuple(Series(n.removesuffix("_j"), c[n], i) for i, n in enumerate(laws)),
            y_label="energy (J)",
        ),
        Reset(group),
    ]


def sections(folder: Path, fit: dict[str, Any], prediction: dict[str, Any] | None) -> list[Section]:
    """Energy, identifiability, trials and prediction."""
    blocks: list[Block] = [Text(fit["message"])]
    names = [i.get("name", f"recording {k + 1}") for k, i in enumerate(fit["inputs"])]
    for k, name in enumerate(names):
        suffix = "" if len(names) == 1 else f"-{k + 1}"
        path = folder / "fit" / f"energy{suffix}.csv"
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
        out.append(Section("prediction", "Prediction", tuple(_prediction(prediction))))
    return out


def _trials(trials: dict[str, Any]) -> list[Block]:
    from pydpend.plots.report import trials_overview

    rows = tuple(
        (
            name,
            *(with_sigma(v, s) for v, s in zip(c["values"], c["sigmas"], strict=True)),
            with_sigma(c["mean"], c["sigma"]),
            "–" if c["p_value"] is None else f"{c['p_value']:.2g}",
            c["unit"],
        )
        for name, c in trials["coefficients"].items()
    )
    count = len(next(iter(trials["coefficients"].values()))["values"]) if rows else 0
    header = ("quantity", *(f"recording {i + 1}" for i in range(count)), "mean", "p of one value", "unit")
    return [
        Text(trials["message"]),
        Figure(
            inline_svg(trials_overview(trials)),
            "Each coefficient over the recordings, with standard uncertainties.",
        ),
        Table(header, rows, numbers=frozenset(range(1, count + 3))),
    ]


def _prediction(prediction: dict[str, Any]) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "Each recording predicted from a fit of the others; only the state at each window's start was fitted."
        )
    ]
    for name, p in prediction.items():
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
                ("", "window", "RMS phi1 (deg)", "RMS phi2 (deg)", "median phi1", "median phi2", "windows"),
                rows,
                numbers=frozenset({2, 3, 4, 5, 6}),
            ),
        ]
    return blocks
