"""Fits of angles with gaps and outliers: as good as without, but for what is missing."""

from __future__ import annotations

import numpy as np
import pytest
from pydpend.damping import DampingFit, fit_damping
from pydpend.damping.outliers import without_outliers
from pydpend.damping.pieces import ends_of, state_at
from pydpend.model import derived

from tests.support.free_decays import TRUTH, measured, released, with_gaps, with_outliers

MODEL = derived("A")


@pytest.mark.parametrize("seed", [1, 2])
def test_a_fifth_missing_costs_little(seed: int) -> None:
    angles = with_gaps(measured(released(seed, 12.0, 500.0), seed, 0.05), seed)
    fit = fit_damping(angles, MODEL, laws="paper")
    assert fit.status == "converged"
    assert fit.within_noise
    for name, e in fit.coefficients.items():
        assert abs(e.value - getattr(TRUTH, name)) < 4 * e.sigma, name
        assert e.sigma < 0.1 * getattr(TRUTH, name), name


def test_pieces_begin_where_both_links_are_seen() -> None:
    motion = released(4, 6.0, 500.0)
    angles = with_gaps(measured(motion, 4, 0.05), 4)
    ends = ends_of(angles.t_s, angles.phi_rad, (0.5, 5.5), 0.25)
    assert ends is not None
    assert np.diff(ends).min() > 0.1
    # A cubic over 24 ms leaves 0.05 deg / 3 of the angle's noise, and some 0.2 rad/s of the rate's.
    for end in ends[:-1]:
        at = int(np.argmin(np.abs(motion.t_s - end)))
        off = state_at(angles.t_s, angles.phi_rad, end) - np.concatenate(
            [motion.phi_rad[at], motion.w_rad_s[at]]
        )
        assert np.abs(off[:2]).max() < np.radians(0.2)
        assert np.abs(off[2:]).max() < 1.0
    # Without gaps the even ends are good.
    assert ends_of(motion.t_s, motion.phi_rad, (0.5, 5.5), 0.25) is None


def test_outliers_are_found_and_nothing_else() -> None:
    clean = measured(released(5, 12.0, 500.0), 5, 0.05)
    assert without_outliers(clean)[1] == ()
    spoilt = with_outliers(clean, 5)
    wild = spoilt.phi_rad != clean.phi_rad
    assert wild.sum() > 10
    kept, found = without_outliers(spoilt)
    gone = np.isnan(kept.phi_rad)
    # One beside another may go with it; none of more than a degree (8 standard errors of 4 sigma) stays.
    assert (gone & ~wild).sum() <= 2
    assert np.degrees(np.abs(spoilt.phi_rad - clean.phi_rad)[wild & ~gone]).max(initial=0.0) < 1.0
    assert len(found) == gone.sum()
    assert max(abs(o.off_rad) for o in found) == pytest.approx(
        np.abs(spoilt.phi_rad - clean.phi_rad).max(), abs=np.radians(1.0)
    )


def test_a_fit_leaves_outliers_out_and_says_so() -> None:
    clean = measured(released(5, 12.0, 500.0), 5, 0.05)
    fit = fit_damping(with_outliers(clean, 5), MODEL, laws="paper")
    same = fit_damping(clean, MODEL, laws="paper")
    for name, e in fit.coefficients.items():
        # 20 samples of 12000 are missing: what that changes is far below the noise.
        assert abs(e.value - same.coefficients[name].value) < same.coefficients[name].sigma, name
    told = fit.inputs[0].outliers
    assert len(told) > 10
    assert any(f"{len(told)} angles of 6001 samples left out as outliers" in note for note in fit.notes)
    assert DampingFit.from_json(fit.to_json()).inputs[0].outliers == told
