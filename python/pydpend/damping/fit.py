"""The one entry to damping fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import FREE, FULL, RATIOS, parameters, ratios_of
from pydpend.damping import camera, shooting
from pydpend.damping.compare import compare_terms
from pydpend.damping.of_motion import pendulum_of_decay, without_load
from pydpend.damping.omitted import BIAS, Wider, explained, left_out
from pydpend.damping.plausible import check_followed, modes_hz
from pydpend.damping.prediction import held_out
from pydpend.damping.profile import fit_energy
from pydpend.damping.recording import Recording, check_distinct, prepare
from pydpend.damping.result import DampingFit
from pydpend.damping.result_parts import EnergyCurve, estimates
from pydpend.damping.shares import shares, with_measured
from pydpend.damping.shooting import Progress
from pydpend.damping.single import reduced
from pydpend.damping.ten import fit_ten
from pydpend.damping.trajectory import fit_trajectory, plausible_or_raise
from pydpend.damping.uncertainty import identifiability
from pydpend.errors import FitError, fault
from pydpend.fit_options import FitKeywords, FitOptions
from pydpend.information import undetermined
from pydpend.kinematics import LinkAngles
from pydpend.model import Model
from pydpend.typed import typed

Floats = NDArray[np.float64]


@typed()
def fit_damping(
    angles: LinkAngles | Sequence[LinkAngles],
    model: Model,
    method: str | None = None,
    laws: str | Sequence[str] | None = None,
    *,
    options: FitOptions | None = None,
    progress: Progress | None = None,
    **keywords: Unpack[FitKeywords],
) -> DampingFit:
    """Damping coefficients of a double pendulum from its free motion (Section 7.1; docs/explanation/damping.md).

    Parameters
    ----------
    angles : LinkAngles or sequence of LinkAngles
        One recording, or several that are fitted jointly. Angles of one link are a single pendulum's, and need a
        one-link `model`.
    model : Model
        The pendulum's constants, or `pydpend.model.of_ratios` where none is known: everything is over psi then, from
        the motion alone.
    method : {"trajectory", "energy"}, optional
        ``"trajectory"`` (default) fits the equations of motion to the angles; ``"energy"`` is the paper's energy
        profile (Eqs. 35, 37, 38 corrected).
    laws : str or sequence of str, optional
        ``"full"`` (default), ``"paper"`` or names of coefficients.
    options : FitOptions, optional
        All that a fit can be told; keywords go before it.
    progress : callable, optional
        Called with (step, most steps, chi-square).
    **keywords : optional
        Fields of `FitOptions`: ``ratios``, ``free``, ``clock``, ``angle_maps``, ``pinned``, ``ten_coefficients``,
        ``intervals``, ``comparison``, ``prediction``, ``start_s``, ``stop_s``.

    Returns
    -------
    DampingFit
        Coefficients, SI, with standard errors that carry the model's own errors, and everything to judge them by.

    Raises
    ------
    FitOptionError
        For an option that is not known, is wrong or is of the other method.
    FitError
        For recordings without a free decay, models the recordings refute, and angles that do not determine the
        coefficients.
    """
    chosen = FitOptions.of(options, method=method, laws=laws, **keywords)
    chosen.check_own_prediction()
    given = [angles] if isinstance(angles, LinkAngles) else list(angles)
    if not given:
        raise FitError(fault("fit", "there is no recording", "Give at least one"))
    check_distinct(given)
    left_out: tuple[str, ...] = ()
    if not model.scale_known:
        model = pendulum_of_decay(given, chosen)
    single = chosen.pinned or model.links == 1 or any(a.links == 1 for a in given)
    names = chosen.coefficients(single=single)
    if not model.scale_known:
        names, left_out = without_load(names, chosen)
    if single:
        given, model = reduced(given, model, chosen.pinned)
        if not names:
            raise FitError(
                fault(
                    "fit",
                    "no law of the upper joint is asked for",
                    "A single pendulum has mu_v1, mu_q1, rmu1 and tau_c1",
                )
            )
    recordings = [prepare(a, model, chosen.start_s, chosen.stop_s) for a in given]
    try:
        if not chosen.is_trajectory:
            return _energy(recordings, model, names, chosen.ten_coefficients, progress)
        fit = _trajectory(recordings, model, names, chosen, progress)
        return replace(fit, notes=(*fit.notes, *left_out))
    except np.linalg.LinAlgError as problem:
        raise FitError(undetermined(f"their equations have no solution ({problem})")) from problem


def _trajectory(
    recordings: Sequence[Recording],
    model: Model,
    names: Sequence[str],
    options: FitOptions,
    progress: Progress | None,
) -> DampingFit:
    """The trajectory fit, with the prediction and the comparison that are asked for."""
    fit = fit_trajectory(recordings, model, names, options, progress=progress)
    if fit.within_noise is False and options.frees_ratios:
        fit = _with_omitted(fit, recordings, model, names, options)
    if options.prediction:
        bare = options.bare()
        prediction, note = held_out(
            recordings, lambda some: fit_trajectory(some, model, names, bare, checked=False)
        )
        fit = replace(fit, prediction=prediction, notes=(*fit.notes, note))
    if options.comparison:
        try:
            terms = compare_terms(recordings, model, names, ratios=options.frees_ratios, progress=progress)
        except FitError as problem:
            return replace(fit, notes=(*fit.notes, f"the terms were not compared: {problem}"))
        fit = replace(fit, terms=terms)
    return fit


def _with_omitted(
    fit: DampingFit, recordings: Sequence[Recording], model: Model, names: Sequence[str], options: FitOptions
) -> DampingFit:
    """The fit with what laws that were left out would make of it, in its errors and in words."""
    bare = options.bare()

    def wider(more: tuple[str, ...]) -> Wider | None:
        laws = [n for n in FULL if n in names or n in more]
        freed = [n for n in FREE if n in options.freed or n in more]
        maps = options.angle_maps or more == BIAS
        chosen = replace(bare, free=freed, angle_maps=maps)
        try:
            found = fit_trajectory(recordings, model, laws, chosen, checked=False)
        except FitError:
            return None
        further = {n: found.freed[n] for n in freed if n in found.freed}
        return Wider(found.chi2, bool(found.within_noise), found.coefficients, further)

    groups = left_out(
        names,
        options.freed,
        links=recordings[0].angles.links,
        scale_known=model.scale_known,
        maps=options.angle_maps,
    )
    omitted = explained(names, fit.coefficients, fit.chi2, groups, wider)
    if omitted is None:
        return fit
    added = np.array([omitted.sigma.get(n, 0.0) for n in fit.names])
    cov = fit.covariance + np.diag(added**2)
    coefficients = {
        n: replace(e, sigma=float(np.hypot(e.sigma, omitted.sigma.get(n, 0.0))))
        for n, e in fit.coefficients.items()
    }
    return replace(
        fit,
        coefficients=coefficients,
        covariance=cov,
        omitted=omitted,
        notes=(*fit.notes, omitted.sentence),
    )


def _energy(
    recordings: Sequence[Recording], model: Model, names: Sequence[str], ten: bool, progress: Progress | None
) -> DampingFit:
    """The paper's fit, to all recordings at once: common coefficients, an E0 each."""
    for r in recordings:
        plausible_or_raise(r, model)
    tracks = [r.track for r in recordings]
    done = fit_energy(
        tracks, [r.span for r in recordings], model, names, camera.cameras_of(recordings), progress
    )
    fit, few, profiles, smoothed = done.fit, done.few, done.whole, done.smoothed
    check_followed([r.angles.name for r in recordings], smoothed.chi2)
    values = dict(zip(names, fit.values.tolist(), strict=True))
    sigma = dict(zip(names, np.sqrt(np.diag(fit.covariance)).tolist(), strict=True))
    of_camera = {n: s for n, s in zip(names, done.camera_sigma.tolist(), strict=True) if s > 0}
    constants = parameters(model) | values
    works = np.sum([p.unit_works[-1] for p in profiles], axis=0)
    path = shooting.trace(tracks, smoothed.segments, constants)
    freed = fit_ten(tracks, path, few, fit, model) if ten else None
    curves = tuple(
        EnergyCurve(
            p.t_s, p.energy_j, e0 - p.unit_works @ fit.values, p.unit_works * fit.values, tuple(names)
        )
        for p, e0 in zip(profiles, fit.e0_j, strict=True)
    )
    excess = np.max([p.rectification for p in profiles], axis=0)
    duration = float(np.diff(smoothed.segments.times_s, axis=1).sum())
    found = [
        r.zero_of(zeros, np.full(2, np.nan)) for r, zeros in zip(recordings, smoothed.zeros_rad, strict=True)
    ]
    return DampingFit(
        method="energy",
        status=fit.status,
        message=f"{fit.message}; chi-square of the angles {smoothed.chi2:.3f}, of {fit.residual_j.size} energies "
        f"{fit.chi2:.3f}; RMS misfit {1e6 * np.sqrt(np.mean(fit.residual_j**2)):.3g} uJ",
        chi2=fit.chi2,
        n=int(fit.residual_j.size),
        coefficients=estimates(names, values, sigma),
        ratios=estimates(
            ratios_of(recordings[0].angles.links), {n: constants[n] / model.psi_kg_m2 for n in RATIOS}, {}
        ),
        shares=shares(names, values, fit.covariance, works),
        identifiability=identifiability(
            names, fit.covariance, values, [n for n in names if values[n] <= 0], duration
        ),
        modes_hz=modes_hz(model)[: recordings[0].angles.links],
        parameters=constants,
        names=tuple(names),
        covariance=fit.covariance,
        inputs=tuple(
            replace(r.described(zero), e0_j=float(e0))
            for r, e0, zero in zip(recordings, fit.e0_j, found, strict=True)
        ),
        energy=tuple(
            with_measured(curve, r, zeros, model)
            for curve, r, zeros in zip(curves, recordings, smoothed.zeros_rad, strict=True)
        ),
        residuals=shooting.residuals_of(tracks, path, smoothed.zeros_rad),
        ten=freed,
        camera_sigma=of_camera,
        notes=(
            *(note for r in recordings for note in r.notes()),
            *camera.without(recordings),
            *camera.words(sigma, of_camera),
            *(note for r, zero in zip(recordings, found, strict=True) for note in zero.notes(r.angles.name)),
            f"acceleration noise raises |N| by {100 * excess[0]:.1g} and {100 * excess[1]:.1g} % on average; "
            "taken off",
            *(() if freed is None else (f"warning: {freed.warning}",)),
        ),
    )
