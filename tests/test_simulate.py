"""Motion, energies and events."""

from __future__ import annotations

import numpy as np
import pytest
from pydpend.errors import SimulationError
from pydpend.model import Damping, derived
from pydpend.simulate import simulate

DAMPING = Damping(
    mu_v1=1.8e-5, mu_v2=5e-6, mu_q1=1.4e-5, rmu1=3e-5, rmu2=3e-5, tau_c1=1e-4, tau_c2=1e-5, strip_drag=1e-6
)


def test_energy_is_lost_only_to_the_works() -> None:
    t = np.linspace(0.0, 1.0, 101)
    run = simulate(derived("A"), DAMPING, np.radians([181.0, 181.0, 0.0, 0.0]), t)
    assert run.balance < 1e-7
    assert np.all(np.diff(run.works_j, axis=0) >= 0)
    assert len(run.events) > 0


@pytest.mark.parametrize(
    ("state", "t", "message"),
    [
        ([0.0, 0.0, np.nan, 0.0], [0.0, 1.0], "four finite numbers"),
        ([0.0, 0.0, 0.0], [0.0, 1.0], "four finite numbers"),
        ([0.0, 0.0, 0.0, 0.0], [0.0, 0.0], "index 1: 0 s does not come after 0 s"),
    ],
)
def test_bad_input_is_named(state: list[float], t: list[float], message: str) -> None:
    with pytest.raises(SimulationError, match=message):
        simulate(derived("A"), DAMPING, state, t)
