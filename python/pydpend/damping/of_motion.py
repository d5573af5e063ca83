"""A pendulum of which no mass is known: its constants over psi, as its own motion has them, to start a fit from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pydpend.coefficients import OF_LOAD
from pydpend.damping.recording import prepare
from pydpend.errors import FitError, Setting, fault
from pydpend.fit_options import FitOptions
from pydpend.kinematics import LinkAngles
from pydpend.link_states import LinkStates, states
from pydpend.model import Model

Floats = NDArray[np.float64]

WINDOW_S = 0.2
"""Length of the windows over which the equations of motion are averaged, s: short against a swing, and long enough that
the rates' noise is small in them."""

G_M_S2 = 9.81
"""Gravity, m/s2: with it the motion tells the distance of the joints, which strip drag needs."""

NEAREST = 1e-3
"""Smallest ratio that is taken for one, relative to 1: below there is no such link."""


def pendulum_of(recordings: Sequence[LinkAngles]) -> Model:
    """Constants over psi (psi is 1 kg m2) from the equations of motion, linear in them, over windows of `WINDOW_S`.

    Only a start: the trajectory fit has them free. Lower link and joints are as long as a uniform bar from the elbow on
    and g make them.

    Raises FitError for motions that determine no ratios.
    """
    moved = [states(a) for a in recordings]
    names = ", ".join(a.name for a in recordings)
    if any(m.status != "done" for m in moved):
        raise FitError(fault(names, "its states cannot be found", "Give angles with fewer gaps"))
    if recordings[0].links == 1:
        rows = np.vstack([_one(m) for m in moved])
        (sigma, *_) = _solved(rows, names)
        return Model.one_link(1.0, _positive(sigma, "sigma", names), name="ratios").of_unknown_scale()
    upper = np.vstack([_upper(m) for m in moved])
    a3, sigma, *_ = _solved(upper, names)
    a3 = _positive(a3, "a3", names)
    lower = np.vstack([_lower(m) for m in moved])
    turning, kappa, *_ = a3 * _solved(lower, names)
    turning, kappa = _positive(turning, "lambda", names), _positive(kappa, "kappa", names)
    # The mass matrix of a pendulum is positive definite; noise may have it otherwise.
    turning = max(turning, 1.05 * a3**2 / 4)
    return Model(
        1.0,
        turning,
        0.0,
        a3,
        _positive(sigma, "sigma", names),
        kappa,
        0.0,
        0.0,
        G_M_S2 * a3 / kappa,
        G_M_S2,
        0.0,
        3 * turning * G_M_S2 / kappa,
        name="ratios",
    ).of_unknown_scale()


def pendulum_of_decay(recordings: Sequence[LinkAngles], options: FitOptions) -> Model:
    """Constants over psi from the free decays alone, with the angles' zeros by their own swing.

    Raises FitError too for options that need the constants.
    """
    if options.pinned:
        problem = "the elbow of two links is pinned, and nothing of the links is known"
        raise FitError(fault(Setting("model", "ratios"), problem, "Give one link's angles, or the constants"))
    if not options.is_trajectory or not options.frees_ratios:
        problem = "the ratios are not known, and this fit takes them from the model"
        advice = "Give the constants, or leave " + Setting("method") + " and " + Setting("ratios") + " out"
        raise FitError(fault(Setting("model", "ratios"), problem, advice))
    rough = pendulum_of(recordings)
    decays = []
    for r in (prepare(a, rough, options.start_s, options.stop_s) for a in recordings):
        t = r.angles.t_s
        keep = (t >= r.span[0]) & (t <= r.span[1])
        decays.append(
            LinkAngles(t[keep], r.angles.phi_rad[keep], r.angles.sigma_rad[keep], name=r.angles.name)
        )
    return pendulum_of(decays)


def without_load(names: Sequence[str], options: FitOptions) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The coefficients that can be had without masses, and a note on those that cannot.

    Raises FitError for one that was asked for by its name.
    """
    gone = [n for n in names if n in OF_LOAD]
    if gone and options.laws not in ("full", "paper"):
        problem = f"{gone[0]} is a friction in proportion to the load of the bearings, and no mass is known"
        advice = "Give the constants, or other laws (tau_c1 is a dry friction without the load)"
        raise FitError(fault(Setting("laws"), problem, advice))
    kept = tuple(n for n in names if n not in OF_LOAD)
    said = (
        f"{' and '.join(gone)} left out: the load of the bearings is not known without masses" if gone else ""
    )
    return kept, (said,) if said else ()


def _positive(value: float, name: str, recordings: str) -> float:
    if not value > NEAREST:
        raise FitError(
            fault(
                recordings,
                f"the motion alone does not tell the pendulum's constants ({name}/psi comes out as {value:.3g})",
                "Give a recording that swings far, or the constants with " + Setting("model", "mine.toml"),
            )
        )
    return float(value)


def _solved(rows: Floats, names: str) -> Floats:
    """Least squares of the last column by the others, robust: rows far off (beside gaps) count less."""
    good = rows[np.isfinite(rows).all(axis=1)]
    if len(good) < 4 * rows.shape[1]:
        raise FitError(fault(names, "too little of the motion is seen", "Give angles with fewer gaps"))
    weight = np.ones(len(good))
    found = np.zeros(rows.shape[1] - 1)
    size = np.maximum(np.linalg.norm(good[:, :-1], axis=0), 1e-300)
    for _ in range(10):
        scaled = good[:, :-1] / size * weight[:, None]
        found = np.linalg.lstsq(scaled, good[:, -1] * weight, rcond=1e-10)[0] / size
        left = np.abs(good[:, -1] - good[:, :-1] @ found)
        limit = 3 * 1.4826 * max(float(np.median(left)), 1e-300)
        weight = np.sqrt(np.minimum(1.0, limit / np.maximum(left, 1e-300)))
    return np.asarray(found, dtype=np.float64)


def _averaged(t_s: Floats, columns: Floats, derivatives: Floats) -> Floats:
    """Means of ``columns`` (T, C), and of the time derivatives of ``derivatives`` (T, D), over smooth windows."""
    dt = float(np.median(np.diff(t_s)))
    half = max(3, round(WINDOW_S / dt / 2))
    u = np.arange(-half, half + 1) / (half + 1)
    bump = (1 - u**2) ** 2
    slope = -4 * u * (1 - u**2) / ((half + 1) * dt)
    mean, change = bump / bump.sum(), -slope / bump.sum()
    starts = np.arange(0, t_s.size - 2 * half, half)
    even = np.abs(t_s[starts + 2 * half] - t_s[starts] - 2 * half * dt) < 0.5 * dt
    at = starts[even, None] + np.arange(2 * half + 1)
    out = np.concatenate([mean @ columns[at], change @ derivatives[at]], axis=1)
    return np.asarray(out, dtype=np.float64)


def _losses(w: Floats, between: Floats) -> Floats:
    """Columns that friction may be in proportion to, so that it does not go into the ratios."""
    return np.column_stack([w, between, np.abs(w) * w, np.sign(w), np.sign(between)])


def _one(m: LinkStates) -> Floats:
    w = m.w_rad_s[:, 0]
    columns = np.column_stack([np.sin(m.phi_rad[:, 0]), w, np.abs(w) * w, np.sign(w)])
    rows = _averaged(m.t_s, columns, w[:, None])
    return np.column_stack([rows[:, :4], -2 * rows[:, 4]])


def _upper(m: LinkStates) -> Floats:
    """Eq. 5.1 over psi: 2 a1 + a3 (cos d a2 + sin d w2^2) + sigma sin phi1 = losses, with d = phi1 - phi2."""
    phi, w = m.phi_rad, m.w_rad_s
    d = phi[:, 0] - phi[:, 1]
    both = np.sin(d) * w[:, 0] * w[:, 1]
    columns = np.column_stack([both, np.sin(phi[:, 0]), _losses(w[:, 0], w[:, 1] - w[:, 0])])
    rows = _averaged(m.t_s, columns, np.column_stack([np.cos(d) * w[:, 1], w[:, 0]]))
    return np.column_stack([rows[:, 0] + rows[:, -2], rows[:, 1:-2], -2 * rows[:, -1]])


def _lower(m: LinkStates) -> Floats:
    """Eq. 5.2 over a3: 2 lambda a2 + kappa sin phi2 - losses = -(cos d a1 - sin d w1^2)."""
    phi, w = m.phi_rad, m.w_rad_s
    d = phi[:, 0] - phi[:, 1]
    both = np.sin(d) * w[:, 0] * w[:, 1]
    columns = np.column_stack([np.sin(phi[:, 1]), _losses(w[:, 1], w[:, 1] - w[:, 0]), both])
    rows = _averaged(m.t_s, columns, np.column_stack([w[:, 1], np.cos(d) * w[:, 0]]))
    return np.column_stack([2 * rows[:, -2], rows[:, :-3], rows[:, -3] - rows[:, -1]])
