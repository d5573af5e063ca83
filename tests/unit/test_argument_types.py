"""Every public function that takes an object says so where it is given a path or another object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from pydpend.kinematics import LinkAngles

DEMO = Path(__file__).parent.parent.parent / "fixtures" / "demo"

MODEL = dp.derived("A")
DAMPING = dp.Damping()
TIMES = np.linspace(0.0, 1.0, 11)
ANGLES = LinkAngles(t_s=TIMES, phi_rad=np.zeros((11, 2)), sigma_rad=np.full((11, 2), 1e-3))

CALLS: dict[str, tuple[str, str, Callable[[Any], object]]] = {
    "angles": ("nodes", "Nodes", lambda x: dp.angles(x)),
    "calibrate": ("holds", "Hold", lambda x: dp.calibrate(x)),
    "calibrate each": ("holds", "Hold", lambda x: dp.calibrate([x])),
    "compare": ("video", "LinkAngles", lambda x: dp.compare(x, ANGLES)),
    "compare with": ("encoder", "LinkAngles", lambda x: dp.compare(ANGLES, x)),
    "encoder_angles": ("signal", "EncoderSignal", lambda x: dp.encoder_angles(x)),
    "export": ("result", "Nodes or TableResult", lambda x: dp.export(x, "out.mat")),
    "find_linkage": ("nodes", "Nodes", lambda x: dp.find_linkage(x)),
    "find_rest": ("angles", "LinkAngles", lambda x: dp.find_rest(x)),
    "fit_damping": ("angles", "LinkAngles", lambda x: dp.fit_damping(x, MODEL)),
    "fit_damping each": ("angles", "LinkAngles", lambda x: dp.fit_damping([ANGLES, x], MODEL)),
    "fit_damping model": ("model", "Model", lambda x: dp.fit_damping(ANGLES, x)),
    "lyapunov": ("model", "Model", lambda x: dp.lyapunov(x, DAMPING, [0, 0, 0, 0])),
    "modes": ("model", "Model", lambda x: dp.modes(x)),
    "poincare": ("model", "Model", lambda x: dp.poincare(x, DAMPING, [0, 0, 0, 0], 1.0)),
    "savitzky_golay": ("angles", "LinkAngles", lambda x: dp.savitzky_golay(x)),
    "simulate": ("model", "Model", lambda x: dp.simulate(x, DAMPING, [0, 0, 0, 0], TIMES)),
    "simulate damping": ("damping", "Damping", lambda x: dp.simulate(MODEL, x, [0, 0, 0, 0], TIMES)),
    "simulate_many": ("model", "Model", lambda x: dp.simulate_many(x, DAMPING, [[0, 0, 0, 0]], TIMES)),
    "states": ("angles", "LinkAngles", lambda x: dp.states(x)),
    "synchronise": ("video", "LinkAngles", lambda x: dp.synchronise(x, ANGLES)),
    "write_angles": ("angles", "LinkAngles", lambda x: dp.write_angles(x, "out.csv")),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_path_or_another_object_is_refused_with_what_is_needed(call: str) -> None:
    name, needed, function = CALLS[call]
    for wrong in ("h.csv", Path("h.csv"), 3.5, None, {"a": 1}, np.zeros(3)):
        with pytest.raises(dp.WrongTypeError) as refused:
            function(wrong)
        said = str(refused.value)
        assert said.startswith(f"{name}: ")
        assert f"{needed} is needed" in said
        if isinstance(wrong, (str, Path)) and needed != "Damping":
            assert "Read it first, with dp.read_" in said
            assert "'h.csv'" in said


def test_a_film_in_place_of_angles_is_told_the_whole_way() -> None:
    with pytest.raises(
        dp.WrongTypeError, match=r"^angles: .*it is a film, not an angles table. Next: dp.track\("
    ):
        dp.fit_damping(str(DEMO / "drop.mp4"), MODEL)  # type: ignore[arg-type]


def test_holds_may_be_one_folder() -> None:
    assert len(dp.read_holds(DEMO / "calibration")) == 7
    assert len(dp.read_holds(str(DEMO / "calibration"))) == 7
