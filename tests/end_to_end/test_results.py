"""Results of a fit and of a run as files: what is read is what was written, and one type has the files of a run."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydpend.damping import DampingFit, fit_damping
from pydpend.errors import FitError
from pydpend.fit_folder import FileOfEach, FitFile
from pydpend.fit_status import FitStatus
from pydpend.model import derived
from pydpend.recording_folder import RunFile
from pydpend.run_folder import PAGE, PREDICTION, README, RECORD, read_run

from tests.support.free_decays import measured, released

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture(scope="module", params=["trajectory", "energy"])
def fit(request: pytest.FixtureRequest) -> DampingFit:
    """With everything that a fit of its method can have."""
    angles = measured(released(11, 16.0, 250.0), 11, 0.05)
    if request.param == "energy":
        return fit_damping(angles, derived("A"), "energy", "paper", ten_coefficients=True)
    return fit_damping(
        angles, derived("A"), laws="mu_v2,mu_q1", prediction=True, comparison=True, intervals="profile"
    )


def test_a_fit_is_read_as_it_was_written(fit: DampingFit) -> None:
    again = DampingFit.from_json(fit.to_json())
    assert again.to_json() == fit.to_json()
    assert again.status is FitStatus.CONVERGED
    assert again.coefficients == fit.coefficients
    assert again.terms == fit.terms
    assert again.ten == fit.ten
    assert again.identifiability == fit.identifiability
    np.testing.assert_array_equal(again.covariance, fit.covariance)
    assert json.loads(fit.to_json()) == fit.to_dict()


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("status",), "fine", "key status: 'fine' is not known"),
        (("method",), 3, "key method: text is expected, not 3"),
        (("within_noise",), "yes", "key within_noise: true or false is expected"),
        (("coefficients", "mu_v2", "value"), None, "key coefficients.mu_v2.value: a number is expected, not null"),
        (("covariance", "matrix"), [[1.0]], "key covariance.matrix: a list of 6 is expected"),
        (("terms", "mu_q1", "verdict"), "perhaps", "key terms.mu_q1.verdict: 'perhaps' is not known"),
        (("inputs",), {}, "key inputs"),
        (("notes",), [1], "key notes[0]: text is expected, not 1"),
    ],
)  # fmt: skip
def test_an_odd_fit_is_one_line(path: tuple[str, ...], value: Any, message: str) -> None:
    angles = measured(released(11, 6.0, 250.0), 11, 0.05)
    found = fit_damping(angles, derived("A"), laws="mu_v2,mu_q1", comparison=True).to_dict()
    place = found
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(FitError, match=re.escape(message)) as caught:
        DampingFit.from_json(json.dumps(found))
    assert "\n" not in str(caught.value)


def test_a_run_is_read_whole(demo_run: Path) -> None:
    run = read_run(demo_run)
    (recording,) = run.recordings
    assert (recording.name, recording.kind) == ("drop", "film")
    nodes = recording.nodes()
    assert recording.residual_px(nodes).shape == nodes.status.shape
    overlay, comparison, energy = recording.overlay(), recording.comparison(), recording.energy()
    assert overlay is not None
    assert overlay.size_px[0] <= 640
    assert comparison.t_s.shape == comparison.residual_rad.shape
    assert energy is not None
    assert "mu_v1" in energy.names
    assert energy.works_j.shape == (energy.t_s.size, len(energy.names))
    fit, scale = run.fit_folder.fit(), run.fit_folder.scale()
    assert fit.to_json() == (demo_run / "fit" / "fit.json").read_text("utf-8")
    assert scale is not None
    assert 0.005 < scale.sigma_kg_m2 / scale.psi_kg_m2 < 0.02
    assert run.fit_folder.trials() is None
    assert run.predictions() == {}


def test_names_of_a_run_s_files_stand_in_one_place() -> None:
    """In code; helps and docstrings speak of them too. ``pydpend compare`` and ``predict`` have their own folders."""
    names = (*RunFile, *FitFile, *FileOfEach, RECORD, PAGE, README, PREDICTION)
    allowed = {
        "fit.json": {"fit_folder.py", "result.py"},
        "trials.json": {"fit_folder.py", "trials.py"},
        "encoder.json": {"recording_folder.py", "calibration.py"},
        "windows.csv": {"recording_folder.py", "predict.py"},
        "residuals.parquet": {"recording_folder.py", "compare.py"},
    }
    wrong = []
    for path in sorted((ROOT / "python" / "pydpend").rglob("*.py")):
        text = re.sub(r'"""[\s\S]*?"""', "", path.read_text("utf-8"))
        found = [str(name) for name in names if f'"{name}"' in text]
        homes = {"run_folder.py", "recording_folder.py", "fit_folder.py"}
        wrong += [f"{path.name}: {name}" for name in found if path.name not in allowed.get(name, homes)]
    assert not wrong
