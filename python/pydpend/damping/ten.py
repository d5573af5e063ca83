"""The paper's ten free coefficients (Section 7.1, Table 6): the load friction of each joint by three of its own.

Eq. 36 has ``mu_c1 = r mu a1``, ``mu_c2 = r mu a2``, ``mu_c3 = r mu a3``, where the constants of Eq. 34 (corrected,
errata 15, 16) are the model's. So the six hold two unknowns. Freed, their works are taken to first order about these
ratios, where Eq. 36 is exact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.coefficients import JOINT_OF, PAPER, TERMS, unit
from pydpend.damping.result_parts import Estimate, TenCoefficients
from pydpend.damping.shooting import Trace, Track
from pydpend.energy import EnergyFit, EnergyProfile
from pydpend.information import invert
from pydpend.model import Model

Floats = NDArray[np.float64]

NAMES = (*PAPER[:4], *(f"mu_c{i}_{j}" for j in (1, 2) for i in (1, 2, 3)))
"""``mu_c1_2`` is the first of joint 2."""
UNITS = {**{n: unit(n) for n in PAPER[:4]}, **{n: "N m" if "c3" in n else "kg m2" for n in NAMES[4:]}}
DETERMINED = 2.0
"""Standard errors that a departure from the model's ratios as large as r mu must be, to be called determined."""
STRICT = 1e4
"""Weight of the conditions on departures that are not, against all the data know."""


def constants(model: Model) -> Floats:
    """a1, a2, a3 of joint 1 and b1, b2, b3 of joint 2 (Eq. 34 corrected), (2, 3), kg m, kg m, N."""
    g, second = model.g_m_s2, model.kappa_j / model.g_m_s2
    return np.array(
        [
            [model.sigma_j / g, second, (model.m1_kg + model.m2_kg) * g],
            [model.m2_kg * model.l1_m, second, model.m2_kg * g],
        ]
    )


def split(path: Trace, values: dict[str, float], model: Model) -> Floats:
    """Powers of the three parts of each joint's load friction for r mu of one, (M, 2, 3), W/m.

    They add up to ``abs(rate) N``.

    They add up to ``abs(rate) N``.
    """
    phi, w = path.state[:, :2], path.state[:, 2:]
    rates = {"upper": w[:, 0], "lower": w[:, 1] - w[:, 0]}
    moments = np.zeros((len(w), 2))
    for name in PAPER:
        rate = w[:, 1] if name == "mu_q2" else rates[JOINT_OF[name]]
        power = values[name] * path.unit_power[:, TERMS.index(name)]
        moment = np.divide(power, rate, out=np.zeros_like(power), where=rate != 0)
        moments[:, 0 if JOINT_OF[name] == "upper" else 1] -= moment
        if name in ("mu_v2", "rmu2"):
            moments[:, 0] += moment
    between = np.sin(phi[:, 1] - phi[:, 0])
    push = model.a3_kg_m2 * between[:, None] * np.column_stack([w[:, 1] ** 2, -(w[:, 0] ** 2)])
    weight = np.array([model.sigma_j, model.kappa_j]) * np.sin(phi)
    a = np.linalg.solve(model.mass_matrix(phi), (push - weight + moments)[..., None])[..., 0]
    force = np.stack([-np.sin(phi) * w**2 + np.cos(phi) * a, np.cos(phi) * w**2 + np.sin(phi) * a], axis=-1)
    force = np.concatenate([force, np.broadcast_to([0.0, 1.0], (len(w), 1, 2))], axis=1)
    parts = constants(model)[None, :, :, None] * force[:, None]
    whole = parts.sum(axis=2)
    size = np.linalg.norm(whole, axis=-1)[..., None]
    along = np.einsum("mjic,mjc->mji", parts, whole)
    rate = np.abs(np.column_stack([rates["upper"], rates["lower"]]))[..., None]
    out: Floats = rate * np.divide(along, size, out=np.zeros_like(along), where=size > 0)
    return out


def fit_ten(
    tracks: Sequence[Track], path: Trace, few: Sequence[EnergyProfile], six: EnergyFit, model: Model
) -> TenCoefficients:
    """Ten coefficients (not negative) from the energies ``few`` that ``six`` was fitted to.

    What the data do not determine of the six mu_c departs least from the model's ratios.
    """
    powers = split(path, dict(zip(PAPER, six.values.tolist(), strict=True)), model)
    blocks, ends = [], np.zeros((2, 3))
    for r, profile in enumerate(few):
        here = path.recording == r
        t = tracks[r][0][path.sample[here]]
        step = np.diff(t)
        step[step > 20 * np.median(step)] = 0.0
        mean = (powers[here][1:] + powers[here][:-1]) / 2
        works = np.concatenate([np.zeros((1, 2, 3)), np.cumsum(mean * step[:, None, None], axis=0)])
        ends += works[-1]
        parts = works[np.searchsorted(t, profile.t_s).clip(0, t.size - 1)]
        # What the fit of six took as the whole is the whole here, too.
        parts[:, :, 2] = profile.unit_works[:, 4:] - parts[:, :, :2].sum(axis=2)
        indicator = np.zeros((profile.t_s.size, len(few)))
        indicator[:, r] = -1.0
        blocks.append(np.hstack([profile.unit_works[:, :4], parts.reshape(-1, 6), indicator]))
    sigma = np.concatenate([np.ones(p.t_s.size) if p.sigma_j is None else p.sigma_j for p in few])
    design = -np.vstack(blocks) / sigma[:, None]
    energy = np.concatenate([p.energy_j for p in few]) / sigma
    typical = np.hypot.reduce([*six.values[4:], *np.sqrt(np.diag(six.covariance)[4:])]) / np.sqrt(2)
    # Departures of the three of a joint from a common r mu, two each.
    free = np.linalg.svd(np.ones((1, 3)))[2][1:]
    departures = np.zeros((4, design.shape[1]))
    departures[:2, 4:7], departures[2:, 7:10] = free, free
    common = np.delete(design, np.s_[4:10], axis=1)
    common = np.column_stack([common, design[:, 4:7].sum(axis=1), design[:, 7:10].sum(axis=1)])
    basis = np.linalg.qr(common / np.linalg.norm(common, axis=0))[0]
    own = design @ departures.T
    own -= basis @ (basis.T @ own)
    _, known, axes = np.linalg.svd(own, full_matrices=own.shape[0] < 4)
    known = np.append(known, np.zeros(4 - known.size))
    undetermined = known * typical < DETERMINED
    strict = STRICT * np.linalg.norm(design[:, 4:10]) * (axes[undetermined] @ departures)
    rows = np.vstack([design, strict])
    size = np.linalg.norm(rows, axis=0)
    low = np.where(np.arange(rows.shape[1]) < 10, 0.0, -np.inf)
    found = scipy.optimize.lsq_linear(
        rows / size, np.append(energy, np.zeros(len(strict))), bounds=(low, np.inf), method="bvls", tol=1e-14
    )
    u = found.x / size
    norm = np.linalg.norm(design, axis=0)
    scaled = design / norm
    freedom = max(design.shape[0] - design.shape[1] + int(undetermined.sum()), 1)
    chi2 = float(np.sum((design @ u - energy) ** 2)) / freedom
    # As the fit of six: energies that scatter by more than their errors have larger ones.
    cov = invert(scaled.T @ scaled) / np.outer(norm, norm) * max(1.0, chi2)
    spread = np.sqrt(np.diag(cov))
    factor = np.concatenate([np.ones(4), constants(model).ravel()])
    one = scaled[:, :10] - scaled[:, 10:] @ np.linalg.lstsq(scaled[:, 10:], scaled[:, :10], rcond=None)[0]
    share = ends / ends.sum(axis=1, keepdims=True)
    sums = np.zeros((2, 10))
    sums[0, 4:7], sums[1, 7:10] = share
    rmu, error = sums @ u[:10], np.sqrt(np.diag(sums @ cov[:10, :10] @ sums.T))
    return TenCoefficients(
        {
            n: Estimate(float(v), float(s), UNITS[n])
            for n, v, s in zip(NAMES, u[:10] * factor, spread[:10] * factor, strict=True)
        },
        {f"rmu{j + 1}": Estimate(float(rmu[j]), float(error[j]), "m") for j in (0, 1)},
        {f"rmu{j + 1}": (share[j] / constants(model)[j]).tolist() for j in (0, 1)},
        10 - int(undetermined.sum()),
        float(np.linalg.cond(one / np.linalg.norm(one, axis=0))),
        chi2 if all(p.sigma_j is not None for p in few) else float("nan"),
    )
