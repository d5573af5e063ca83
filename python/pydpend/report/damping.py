"""The part of the page that says where the energy goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pydpend.coefficients import RATIO_UNITS, WORDS
from pydpend.damping import DampingFit, EnergyCurve, Prediction, Residuals
from pydpend.errors import Setting
from pydpend.fit_folder import StoredScale
from pydpend.fit_status import FitStatus, Verdict
from pydpend.json_text import number
from pydpend.plots.damping import coefficients_figure, shares_figure
from pydpend.plots.style import inline_svg
from pydpend.report.consistency import against_parts, ratio_unit
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
from pydpend.report.words import between, digits, listed, quantity, sentence, signed, with_sigma, with_squares
from pydpend.run_folder import StoredRun
from pydpend.trials import Trials

ZOOM_S = 2.0
"""The first seconds of the energy stand alone too (Fig. 19)."""

SHARE = {
    "viscous": "viscous friction",
    "drag": "air drag",
    "dry": "dry friction",
    "upper": "upper joint and link",
    "lower": "lower joint and link",
}


TOLD_WINDOW_S = "1"
"""The window length of which the answer tells the prediction error, as the tables' keys have it."""


def links_of(fit: DampingFit) -> int:
    """1 for a fit of a single pendulum."""
    return len(fit.modes_hz)


def meaning(name: str, links: int) -> str:
    """The meaning of a coefficient or ratio, in words."""
    words = WORDS.get(name, "")
    return words if links > 1 else words.replace("upper ", "")


def warnings(fit: DampingFit) -> list[str]:
    """The warnings that a reader must know before the numbers."""
    out = []
    if fit.status is not FitStatus.CONVERGED:
        out.append(f"The damping fit did not converge, its numbers are where it stopped: {fit.message}")
    elif fit.within_noise is False:
        out.append(
            "The model or the angles have errors beyond the noise, and the standard errors of the damping carry them: "
            f"{_left(fit)}"
        )
    if fit.method == "energy" and fit.chi2 > 1 + 4 * math.sqrt(2 / fit.n):
        out.append(
            f"These laws do not take out the energy that was lost: chi-square of its {fit.n} values is "
            f"{digits(fit.chi2, 3)}, where noise alone would give 1. The standard errors carry that; "
            f"{Setting('laws', 'full')} or the trajectory fit may tell what is missing."
        )
    for given in fit.inputs:
        off = [
            f"{digits(abs(z))} deg{f' (phi{j})' if links_of(fit) > 1 else ''}"
            for j, (z, wrong) in enumerate(zip(given.zeros_deg, given.zeros_off, strict=False), 1)
            if wrong
        ]
        if off:
            out.append(
                f"{given.name}: the zero of its angles was off by {listed(off)}, as the fit found with a zero "
                "of its own. The damping is free of that; the angles above are not."
            )
    if fit.consistency is not None:
        told = fit.consistency.sentences
        out += [sentence(s.removeprefix("warning: ")) for s in told if s.startswith("warning: ")]
    if fit.omitted is not None and fit.omitted.explains:
        out.append(sentence(fit.omitted.sentence.removeprefix("warning: ")))
    # The sentence on the whole recording; those on single coefficients stand with them.
    if fit.identifiability.too_short:
        out.append(fit.identifiability.warning)
    return out


def _left(fit: DampingFit) -> str:
    """The size of the residuals over their noise, from the mean squares with and without slack."""
    strict, slack = math.sqrt(fit.chi2), math.sqrt(fit.chi2_slack)
    return (
        f"the residuals of the angles are {digits(slack)} times their noise where the motion may jump a little from "
        f"each piece of it to the next, and {digits(strict)} times where it may not."
    )


def answer(fit: DampingFit, predictions: Mapping[str, Prediction], scale: StoredScale | None) -> list[Block]:
    """The answer of the fit: the energy's ways, the model's errors, and the coefficients with their uncertainties."""
    intervals = fit.intervals
    links = links_of(fit)
    header = ["coefficient", "symbol", "value"]
    if fit.camera_sigma:
        header.append("of ±, the camera's")
    if intervals:
        header.append("95 % interval")
    rows = []
    for name, c in fit.coefficients.items():
        unit = "" if c.unit == "1" else with_squares(c.unit)
        row = [meaning(name, links), name, quantity(c.value, c.sigma, unit)]
        if fit.camera_sigma:
            row.append(_of_camera(fit.camera_sigma.get(name), c.sigma))
        if intervals:
            found = intervals.get(name)
            row.append(
                "–" if found is None else f"{between(number(found.low), number(found.high))} {unit}".strip()
            )
        rows.append(tuple(row))
    numbers = frozenset(range(2, len(header)))
    blocks: list[Block] = [Text(s) for s in (_energy_sentence(fit), *_trust(fit, predictions)) if s]
    blocks.append(Table(tuple(header), tuple(rows), numbers=numbers))
    by = "± is one standard uncertainty of the fit."
    if fit.camera_sigma:
        by += (
            " The part of it that the camera's aim and lens make is given too (the squares of the parts add up to "
            "100 %): it is one error of all frames, and a longer film does not make it smaller."
        )
    if intervals:
        by += " The 95 % intervals are by profile likelihood, everything else fitted again."
    blocks.append(Text(f"{by} {_scale(fit, scale, links)}", quiet=True))
    return blocks


def _of_camera(camera: float | None, sigma: float) -> str:
    """The camera's part of a standard uncertainty."""
    return "–" if camera is None or not sigma > 0 else f"{digits(100 * camera / sigma)} %"


def _energy_sentence(fit: DampingFit) -> str:
    """Of the energy lost, what went into which law and where; empty where nothing was lost."""

    def parts(group: str) -> list[tuple[str, str]]:
        found = fit.shares.get(group, {})
        if not all(math.isfinite(c.value) for c in found.values()):
            return []
        if not all(c.sigma < 1.0 for c in found.values()):
            return []
        return [(n, f"{with_sigma(100 * c.value, 100 * c.sigma)} %") for n, c in found.items()]

    laws, joints = parts("law"), parts("joint")
    if not laws:
        return ""
    said = "Of the energy lost, " + listed([f"{much} went into {SHARE[n]}" for n, much in laws])
    if len(joints) > 1:
        said += "; " + listed([f"{much} was lost at the {SHARE[n]}" for n, much in joints])
    return said + "."


def _trust(fit: DampingFit, predictions: Mapping[str, Prediction]) -> list[str]:
    """The errors with which the model describes the angles, and those with which it predicts unseen ones."""
    out = []
    if fit.within_noise:
        out.append(
            f"The equations of motion describe the angles to within their noise (chi-square {fit.chi2:.3f}; 1 is "
            "what noise alone would give)."
        )
    for name, p in predictions.items():
        window = p.in_window.get(TOLD_WINDOW_S)
        if window is not None and window.n:
            out.append(f"{name} predicted from the others, {_errors(window.rms_deg)}.")
    told = fit.prediction.get(TOLD_WINDOW_S)
    if told is not None and len(fit.inputs) == 1:
        out.append(f"The last part predicted from a fit to the rest, {_errors(told.rms_deg)}.")
    return out


def _errors(rms_deg: Sequence[float]) -> str:
    each = listed([f"{digits(v)} deg for phi{j}" for j, v in enumerate(rms_deg, 1)])
    return f"in windows of {TOLD_WINDOW_S} s with the state at the start fitted: RMS error {each}"


def _scale(fit: DampingFit, scale: StoredScale | None, links: int) -> str:
    """The scale behind all coefficients together."""
    where = "upper joint" if links > 1 else "pivot"
    if not fit.scale_known:
        return (
            f"All coefficients are over psi, half the moment of inertia about the {where}, which free motion does not "
            "tell, and so are the energies: times psi in kg m² they are in N m s, N m s² and N m, and J."
        )
    said = (
        f"All coefficients are in proportion to psi, half the moment of inertia about the {where}, which free motion "
        "does not tell"
    )
    if scale is None:
        return f"{said}; it is the model's, and its uncertainty comes on top."
    psi, sigma = scale.psi_kg_m2, scale.sigma_kg_m2
    if not sigma:
        return f"{said}: the model “{scale.model}” gives {psi:.4g} kg m² without an uncertainty."
    return (
        f"{said}: the model “{scale.model}” gives {with_sigma(psi, sigma)} kg m². This {digits(100 * sigma / psi)} % "
        "is common to all coefficients and comes on top."
    )


def _residuals(left: Residuals, group: str, title: str) -> list[Block]:
    """The residuals of each angle, with the standard deviation it was weighted by."""
    out: list[Block] = []
    both = zip(np.degrees(left.residual_rad.T), np.degrees(left.sigma_rad.T), strict=True)
    for j, (off, sigma) in enumerate(both, 1):
        rms = np.sqrt(np.nanmean(off**2))
        out.append(
            Chart(
                f"{group}-left{j}",
                f"phi{j}{title}, measured minus fitted: RMS {digits(rms)} deg",
                group,
                left.t_s,
                (Series(f"difference of phi{j} (deg)", off, j - 1), *band(sigma)),
                y_label="difference (deg)",
                height=180,
            )
        )
    return out


def _energy(curve: EnergyCurve, group: str, title: str, unit: str) -> list[Block]:
    t, energy, model = curve.t_s, curve.energy_j, curve.model_j
    near = t <= t[0] + ZOOM_S
    measured = () if curve.measured_j is None else (curve.measured_j,)
    return [
        Chart(
            f"{group}-energy",
            f"Energy{title}",
            group,
            t,
            (
                *(Series(f"of the measured angles ({unit})", m, 3) for m in measured),
                Series(f"of the fitted motion ({unit})", energy, 0),
                Series(f"start minus all losses ({unit})", model, 1, dashed=True),
            ),
            y_label=f"energy ({unit})",
            height=280,
        ),
        Chart(
            f"{group}-zoom",
            f"Energy{title}, first {ZOOM_S:g} s",
            f"{group}-zoom",
            t[near],
            (
                *(Series(f"of the measured angles ({unit})", m[near], 3) for m in measured),
                Series(f"of the fitted motion ({unit})", energy[near], 0),
                Series(f"start minus all losses ({unit})", model[near], 1, dashed=True),
            ),
            y_label=f"energy ({unit})",
            height=200,
        ),
        Chart(
            f"{group}-residual",
            f"Energy{title}, of the fitted motion minus start less losses",
            group,
            t,
            (Series(f"difference (m{unit})", 1e3 * (energy - model), 2),),
            y_label=f"difference (m{unit})",
            height=180,
        ),
        Chart(
            f"{group}-works",
            f"Energy{title}, taken out by each law",
            group,
            t,
            tuple(Series(n, curve.works_j[:, i], i % 6, dashed=i >= 6) for i, n in enumerate(curve.names)),
            y_label=f"energy ({unit})",
        ),
    ]


def sections(run: StoredRun, fit: DampingFit, predictions: Mapping[str, Prediction]) -> list[Section]:
    """Energy, identifiability, trials and prediction."""
    blocks: list[Block] = [Text(sentence(fit.message))]
    blocks += [Listing(tuple(sentence(n) for n in fit.notes))] if fit.notes else []
    blocks.append(
        Figure(inline_svg(shares_figure(fit.shares)), "Where the energy goes, with standard uncertainties.")
    )
    names = [given.name for given in fit.inputs]
    for k, (name, recording) in enumerate(zip(names, run.recordings, strict=False)):
        energy, left = recording.energy(), recording.residuals()
        title = f" of {name}" if len(names) > 1 else ""
        blocks += [] if left is None else _residuals(left, f"e{k}", title)
        blocks += (
            [] if energy is None else _energy(energy, f"e{k}", title, "J" if fit.scale_known else "J/(kg m²)")
        )
        if left is not None or energy is not None:
            blocks.append(Reset(f"e{k}"))
    out = [Section("damping", "Damping", (*blocks, *_constants(fit), *against_parts(fit), *_ten(fit)))]
    out.append(Section("identifiability", "What the data can tell", tuple(_told(fit))))
    trials = run.fit_folder.trials()
    if len(names) > 1 and trials is not None:
        out.append(Section("trials", "The recordings beside each other", tuple(_trials(trials, names))))
    if predictions:
        out.append(Section("prediction", "Prediction", tuple(_prediction(predictions))))
    return out


def _constants(fit: DampingFit) -> list[Block]:
    """The ratios of the constants that were fitted too, and the small oscillations that follow."""
    links = links_of(fit)
    rows = [
        (meaning(n, links), f"{n}/psi", quantity(e.value, e.sigma, ratio_unit(n)))
        for n, e in fit.ratios.items()
    ]
    for given in fit.inputs:
        for j, (zero, sigma) in enumerate(zip(given.zeros_deg, given.zeros_sigma_deg, strict=False), 1):
            of = f" of {given.name}" if len(fit.inputs) > 1 else ""
            rows.append(
                (f"zero of phi{j}{of} by the fit, from the given one", "", quantity(zero, sigma, "deg"))
            )
    rows.append(("small oscillations", "", f"{listed([f'{f:.4f}' for f in fit.modes_hz])} Hz"))
    return [
        Heading("Constants of the motion"),
        Table(("constant", "symbol", "value"), tuple(rows), numbers=frozenset({2})),
    ]


def _ten(fit: DampingFit) -> list[Block]:
    """The paper's ten coefficients, where they were asked for, under their warning."""
    ten = fit.ten
    if ten is None:
        return []
    rows = tuple((name, quantity(c.value, c.sigma, with_squares(c.unit))) for name, c in ten.values.items())
    return [
        Heading("The paper's ten coefficients"),
        Text(sentence(ten.warning)),
        Table(("coefficient", "value"), rows, numbers=frozenset({1})),
    ]


def _told(fit: DampingFit) -> list[Block]:
    """The terms that the data ask for, those they do not tell apart, and the intervals that are open."""
    told = fit.identifiability
    blocks: list[Block] = []
    if fit.terms:
        rows = []
        for t in fit.terms:
            said = t.verdict.words
            if t.verdict is Verdict.INSEPARABLE:
                said += f" from {t.partner} (correlation {signed(t.correlation, 2)})"
            shown = t.gain > 0
            rows.append(
                (
                    t.name,
                    said,
                    digits(t.gain, 3) if shown else "–",
                    signed(100 * t.prediction, 3) if shown else "–",
                    signed(t.prediction_z, 2) if t.prediction_z else "–",
                )
            )
        header = ["term", "verdict of the data", "fall of 2 log L without it", "prediction, mean square (%)"]
        # One window of prediction has no scatter, and so no error.
        header += ["in standard errors"] if any(t.prediction_z for t in fit.terms) else []
        blocks += [
            Text(
                "Each term was left out in turn and all others fitted again. Without a term that is asked for, twice "
                "the log-likelihood falls by more than 9 and data that were not fitted are predicted no better; "
                "without one that is rejected, neither changes."
            ),
            Table(tuple(header), tuple(row[: len(header)] for row in rows), numbers=frozenset({2, 3, 4})),
        ]
    notes = [f"95 % interval of {n}: {i.note}." for n, i in fit.intervals.items() if i.note]
    blocks.append(Listing(tuple(sentence(s) for s in (*told.sentences, *notes))))
    blocks.append(
        Text(
            f"Condition number of the scaled information matrix: {sentence(format(told.condition, '.3g'))}.",
            quiet=True,
        )
    )
    return blocks


def _trials(trials: Trials, names: list[str]) -> list[Block]:
    rows = tuple(
        (
            f"{name}/psi" if name in RATIO_UNITS else name,
            *(with_sigma(v, s) for v, s in zip(c.values, c.sigmas, strict=True)),
            with_sigma(c.mean, c.sigma),
            sentence(f"{c.spread:.2g}"),
            sentence(f"{c.p_value:.2g}") if math.isfinite(c.p_value) else "–",
            "" if c.unit == "1" else with_squares(c.unit),
        )
        for name, c in trials.spreads.items()
    )
    header = ("quantity", *names, "mean", "spread beyond errors", "p that all are one value", "unit")
    return [
        Text(sentence(trials.message)),
        Figure(
            inline_svg(coefficients_figure(trials.spreads)),
            f"Each coefficient over the recordings ({', '.join(names)}) and its mean, with standard uncertainties.",
        ),
        Table(header, rows, numbers=frozenset(range(1, len(names) + 4))),
    ]


def _prediction(predictions: Mapping[str, Prediction]) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "Each recording predicted from a fit of the others. In a window only the state at its start is fitted to "
            "it; a forecast knows the half second before it and no more, and where a link tumbles it is lost to chaos "
            "whatever the model: compare its median."
        )
    ]
    for k, (name, p) in enumerate(predictions.items()):
        links = max((len(w.rms_deg) for w in p.in_window.values()), default=0)
        rows = tuple(
            (
                kind,
                f"{window} s",
                *(digits(v, 3) for v in (*w.rms_deg, *w.median_deg)),
                str(w.n),
            )
            for kind, group in (("in window", p.in_window), ("forecast", p.forecast))
            for window, w in group.items()
            if w.n
        )
        blocks += [
            Heading(name),
            Table(
                (
                    "kind",
                    "window",
                    *(f"{what} phi{j} (deg)" for what in ("RMS", "median") for j in range(1, links + 1)),
                    "windows",
                ),
                rows,
                numbers=frozenset(range(2, 2 * links + 3)),
            ),
            *_windows(p, f"w{k}"),
        ]
    return blocks


def _windows(found: Prediction, group: str) -> list[Block]:
    """The error of each window over the recording, a chart for each length."""
    out: list[Block] = []
    for n, (length, rows) in enumerate(found.rows.items()):
        rms = tuple(Series(f"phi{j} (deg)", rows[:, j], j - 1, points=True) for j in range(1, rows.shape[1]))
        title = f"RMS error of each window of {length} s"
        out.append(
            Chart(
                f"{group}-{n}",
                title,
                group,
                rows[:, 0],
                rms,
                "start of the window (s)",
                "RMS (deg)",
                180,
            )
        )
    return [*out, Reset(group)]
