"""Comparison of terms: those that the data ask for, those they reject, and those they cannot tell apart.

Every law is fitted at once to a part of the data; then each is left out in turn, with the same slack. The gain
in likelihood says what the fitted data think of a term, the prediction of the rest what it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FULL, parameters, ratios_of
from pydpend.damping import shooting
from pydpend.damping.camera import cameras_of
from pydpend.damping.prediction import predict, split
from pydpend.damping.recording import Recording
from pydpend.damping.result_parts import Term
from pydpend.damping.shooting import Progress
from pydpend.damping.trajectory import FLOOR, HUBER, SEGMENT_S, length_of
from pydpend.damping.uncertainty import covariance
from pydpend.fit_status import Verdict
from pydpend.information import check_errors
from pydpend.model import Model

Floats = NDArray[np.float64]

WINDOW_S = 1.0
"""Windows in which the data that were left out are predicted."""
ASKED = 9.0
"""Gain in twice the log-likelihood beyond which a term is asked for: three standard errors."""
WORSE = 2.0
"""Standard errors by which a prediction must differ to count."""


def verdict(gain: float, prediction_z: float, correlation: float) -> Verdict:
    """The verdict of the data on a term, from its three numbers."""
    if gain > ASKED and prediction_z > -WORSE:
        return Verdict.ASKED_FOR
    if abs(correlation) > 0.9:
        return Verdict.INSEPARABLE
    if gain < 1.0 and prediction_z < WORSE:
        return Verdict.REJECTED
    return Verdict.UNDECIDED


def compare_terms(
    recordings: Sequence[Recording],
    model: Model,
    names: Sequence[str] = FULL,
    *,
    ratios: bool = True,
    progress: Progress | None = None,
) -> tuple[Term, ...]:
    """The terms ``names`` judged on recordings ready for a fit.

    All but the last recording are fitted and the last one predicted, or of a single one the last part. ``ratios``:
    whether the inertial ratios are free.

    All but the last recording are fitted and the last one predicted, or of a single one the last part. ``ratios``:
    whether the inertial ratios are free.

    Raises FitError as a fit does, and when nothing can be left out.
    """
    known, unknown = split(recordings)
    tracks = [r.track for r in known]
    wanted = [*(ratios_of(known[0].angles.links) if ratios else ()), *names]
    begun = shooting.settled(
        tracks,
        [r.span for r in known],
        length_of(known, SEGMENT_S),
        parameters(model),
        np.zeros((len(known), 2)),
        free=wanted,
        bounded=names,
    )
    huber = HUBER * max(1.0, begun.chi2) ** 0.5
    full = shooting.solve(
        tracks,
        begun.segments,
        begun.parameters,
        begun.zeros_rad,
        free=wanted,
        bounded=names,
        slack=FLOOR,
        huber=huber,
        cameras=cameras_of(known),
    )
    cov = covariance(full, model_error=True)
    rows = [full.names.index(name) for name in wanted]
    check_errors(wanted, cov[np.ix_(rows, rows)])
    scale = np.sqrt(np.diag(cov))
    related = cov / np.outer(scale, scale)

    def squares(values: dict[str, float]) -> Floats:
        rows = predict(unknown, values, (WINDOW_S,), forecasts=False).rows[f"{WINDOW_S:g}"]
        out: Floats = (rows[:, 1:] ** 2 / np.square(np.degrees(unknown.noise.measured_rad))).sum(axis=1)
        return out

    with_all = squares(full.parameters)
    terms = []
    for k, name in enumerate(names):
        if progress is not None:
            progress(k + 1, len(names), full.chi2)
        gain = relative = z = 0.0
        # A term that is zero beside the others is left out already, also of the parameters.
        if full.parameters.get(name, 0.0) > 0:
            without = shooting.solve(
                tracks,
                full.segments,
                full.parameters | {name: 0.0},
                full.zeros_rad,
                free=[n for n in wanted if n != name],
                slack=list(full.slack),
                learned=False,
                bounded=[n for n in names if n != name],
                huber=huber,
                cameras=full.cameras,
            )
            gain = 2 * (without.cost - full.cost) / max(1.0, full.chi2)
            change = squares(without.parameters) - with_all
            error = float(change.std(ddof=1) / np.sqrt(change.size)) if change.size > 1 else 0.0
            z = float(change.mean()) / error if error > 0 else 0.0
            relative = float(change.mean() / with_all.mean())
        at = full.names.index(name)
        partners = {n: float(related[at, full.names.index(n)]) for n in names if n != name}
        partner = max(partners, key=lambda n: abs(partners[n])) if partners else ""
        correlation = partners.get(partner, 0.0)
        terms.append(Term(name, gain, relative, z, partner, correlation, verdict(gain, z, correlation)))
    return tuple(terms)
