"""The part of the page that says where the energy goes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import RATIO_UNITS
from pydpend.plots.damping import coefficients_figure, shares_figure
from pydpend.plots.folder import read_columns, table_of_fit
from pydpend.plots.style import inline_svg
from pydpend.report.page import (
    Block,
    Chart,
    Figure,
    Heading,
    Listing,
    Reset,
    Section,
    Series,
    Table,
    Text,
    band,
)
from pydpend.report.words import digits, sentence, with_sigma, with_squares

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


SHARE = {"law": "share of the energy lost, by law", "joint": "share of the energy lost, by joint"}

SCALE = (
    "± is one standard uncertainty of the fit. All coefficients are in proportion to psi, half the moment of inertia "
    "about the upper joint, which is the model's; its relative uncertainty is common to them and comes on top."
)


def warnings(fit: dict[str, Any]) -> list[str]:
    """What a reader must know before the numbers."""
    message = _message(fit)
    out = []
    if fit["status"] != "converged":
        out.append(f"The damping fit did not converge, its numbers are where it stopped: {message}")
    elif "beyond the noise" in message:
        out.append(f"Damping: {message}")
    # The sentence on the whole recording; those on single coefficients stand with them.
    out += [s for s in fit["identifiability"]["sentences"] if "too short" in s]
    return out


def _message(fit: dict[str, Any]) -> str:
    return str(fit["message"]).replace(fit["status"], fit["status"].replace("_", " "), 1)


def answer(fit: dict[str, Any], prediction: dict[str, Any] | None) -> list[Block]:
    """Coefficients, shares and prediction errors with their uncertainties."""
    rows = []

    def add(name: str, value: float | None, sigma: float | None, unit: str, meaning: str) -> None:
        rows.append((name, f"{with_sigma(value, sigma)} {with_squares(unit)}".strip(), meaning))

    for name, c in fit["coefficients"].items():
        add(name, c["value"], c["sigma"], c["unit"], MEANING.get(name, ""))
    for name, value in fit["ratios"].items():
        sigma = fit.get("ratio_sigmas", {}).get(name)
        add(f"{name}/psi", value, sigma, _ratio_unit(name), MEANING.get(name, ""))
    for group in SHARE:
        for name, c in fit["shares"].get(group, {}).items():
            value, sigma = (None if c[k] is None else 100 * c[k] for k in ("value", "sigma"))
            add(name, value, sigma, "%", SHARE[group])
    for name, p in (prediction or {}).items():
        for window, w in p.get("in_window", {}).items():
            rms = ", ".join(digits(v) for v in w["rms_deg"])
            rows.append((f"{name} predicted", f"{rms} deg", f"RMS of phi1, phi2 in windows of {window} s"))
    return [
        Table(("quantity", "value", "meaning"), tuple(rows), numbers=frozenset({1})),
        Text(SCALE, quiet=True),
    ]


def _ratio_unit(name: str) -> str:
    return "" if RATIO_UNITS[name] == "1" else RATIO_UNITS[name]


def _residuals(path: Path, group: str, title: str) -> list[Block]:
    """What the fitted motion leaves of each angle, with the standard deviation it was weighted by."""
    c = {k: v if k == "time_s" else np.degrees(v) for k, v in read_columns(path).items()}
    out: list[Block] = []
    for j in (1, 2):
        if f"phi{j}_residual_rad" not in c:
            continue
        left, sigma = c[f"phi{j}_residual_rad"], c[f"phi{j}_sigma_rad"]
        rms = np.sqrt(np.nanmean(left**2))
        out.append(
            Chart(
                f"{group}-left{j}",
                f"phi{j}{title}, measured minus fitted: RMS {digits(rms)} deg",
                group,
                c["time_s"],
                (Series(f"difference of phi{j} (deg)", left, j - 1), *band(sigma)),
                y_label="difference (deg)",
                height=180,
            )
        )
    return out


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
                Series("of the fitted motion (J)", energy, 0),
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
                Series("of the fitted motion (J)", energy[near], 0),
                Series("start minus all losses (J)", model[near], 1, dashed=True),
            ),
            y_label="energy (J)",
            height=200,
        ),
        Chart(
            f"{group}-residual",
            "Fitted motion minus losses",
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
    ]


def sections(folder: Path, fit: dict[str, Any], prediction: dict[str, Any] | None) -> list[Section]:
    """Energy, identifiability, trials and prediction."""
    blocks: list[Block] = [Text(sentence(_message(fit)))]
    blocks += [Listing(tuple(fit["notes"]))] if fit.get("notes") else []
    blocks.append(
        Figure(
            inline_svg(shares_figure(fit["shares"])), "Where the energy goes, with standard uncertainties."
        )
    )
    names = [i.get("name", f"recording {k + 1}") for k, i in enumerate(fit["inputs"])]
    for k, name in enumerate(names):
        path, left = (table_of_fit(table, folder, k) for table in ("energy", "residuals"))
        title = f" of {name}" if len(names) > 1 else ""
        if left.exists():
            blocks += _residuals(left, f"e{k}", title)
        if path.exists():
            blocks += _energy(path, f"e{k}", title)
        if left.exists() or path.exists():
            blocks.append(Reset(f"e{k}"))
    out = [Section("damping", "Damping", tuple(blocks))]
    told = fit["identifiability"]
    out.append(
        Section(
            "identifiability",
            "What the data can tell",
            (
                Listing(tuple(sentence(s) for s in (*_terms(fit), *told["sentences"]))),
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
                "trials",
                "The recordings beside each other",
                tuple(_trials(json.loads(trials.read_text("utf-8")), names)),
            )
        )
    if prediction:
        out.append(Section("prediction", "Prediction", tuple(_prediction(folder, prediction))))
    return out


def _terms(fit: dict[str, Any]) -> list[str]:
    """What the data say of each term, where the terms were compared."""
    return [f"{t['sentence']}." for t in fit.get("terms", {}).values()]


def _trials(trials: dict[str, Any], names: list[str]) -> list[Block]:
    rows = tuple(
        (
            f"{name}/psi" if name in RATIO_UNITS else name,
            *(with_sigma(v, s) for v, s in zip(c["values"], c["sigmas"], strict=True)),
            with_sigma(c["mean"], c["sigma"]),
            sentence(f"{c['spread']:.2g}"),
            "–" if c["p_value"] is None else f"{c['p_value']:.2g}",
            "" if c["unit"] == "1" else with_squares(c["unit"]),
        )
        for name, c in trials["coefficients"].items()
    )
    header = ("quantity", *names, "mean", "spread beyond errors", "p that all are one value", "unit")
    return [
        Text(sentence(trials["message"])),
        Figure(
            inline_svg(coefficients_figure(trials["coefficients"])),
            f"Each coefficient over the recordings ({', '.join(names)}) and its mean, with standard uncertainties.",
        ),
        Table(header, rows, numbers=frozenset(range(1, len(names) + 4))),
    ]


def _prediction(folder: Path, prediction: dict[str, Any]) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "Each recording predicted from a fit of the others. In a window only the state at its start is fitted to "
            "it; a forecast knows the half second before it and no more, and where the lower link tumbles a forecast "
            "is lost to chaos whatever the model: compare its median."
        )
    ]
    for k, (name, p) in enumerate(prediction.items()):
        rows = tuple(
            (
                kind.replace("_", " "),
                f"{window} s",
                *(digits(v, 3) for v in (*w["rms_deg"], *w["median_deg"])),
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
                    "median phi1 (deg)",
                    "median phi2 (deg)",
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
