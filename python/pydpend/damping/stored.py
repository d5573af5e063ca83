"""A fit written into its folder, and read back from it to predict with."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pydpend.damping.maps import KNOTS, Maps, corrected
from pydpend.damping.prediction import WINDOWS_S, Prediction, initial_state, predict
from pydpend.damping.recording import prepare
from pydpend.damping.result import DampingFit
from pydpend.documents import read_json
from pydpend.errors import FIT, FitError, ModelError, Setting, fault
from pydpend.kinds import expect
from pydpend.kinematics import LinkAngles
from pydpend.model import Model
from pydpend.model.file import MOST
from pydpend.output import AnyPath, path_of, whole, write_text

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class StoredFit:
    """Parameters of the motion and angle-bias maps of a finished fit."""

    parameters: dict[str, float]
    maps: Maps | None

    @classmethod
    def of(cls, fit: DampingFit) -> StoredFit:
        """A fit just made, as if it had been written and read."""
        return cls(dict(fit.parameters), None if fit.maps is None else Maps.from_dict(fit.maps))

    def model(self) -> Model:
        """The fitted constants as a model."""
        p = self.parameters
        return Model(
            p["psi"],
            p["lambda"],
            p["zeta"],
            p["a3"],
            p["sigma"],
            p["kappa"],
            p["m1"],
            p["m2"],
            p["l1"],
            p["g"],
            p["lower_inner"],
            p["lower_outer"],
            name="the stored fit",
        )

    def predict(
        self,
        angles: LinkAngles,
        windows_s: Sequence[float] = WINDOWS_S,
        *,
        start_s: float | None = None,
        stop_s: float | None = None,
    ) -> Prediction:
        """Predicts a recording's free decay. Raises FitError when it has none, or other links than the fit."""
        model = self.model()
        if angles.links > model.links:
            advice = (
                "Give a table of one link (time_s, phi1_rad; zero where the body hangs), or a fit without "
                + Setting("pinned", True)
            )
            raise FitError(fault(angles.name, "angles of two links, but the fit is of one", advice))
        if angles.links < model.links:
            raise FitError(
                fault(
                    angles.name,
                    "angles of one link, but the fit is of two",
                    "Give a table of both links, or a fit of a one-link model",
                )
            )
        recording = prepare(angles, model, start_s, stop_s)
        return predict(recording, self.parameters, windows_s, self.maps)

    def state(self, angles: LinkAngles, start_s: float, length_s: float) -> NDArray[np.float64]:
        """`initial_state` of a recording's motion with this fit. Raises FitError where it cannot be told."""
        recording = prepare(angles, self.model(), start_s, float(angles.t_s[-1]))
        track = recording.track if self.maps is None else corrected([recording.track], self.maps)[0]
        return initial_state(track, self.parameters, start_s, length_s)


def load_fit(path: AnyPath) -> StoredFit:
    """Reads ``fit.json`` from a folder of ``pydpend fit`` (or the file itself). Raises FitError when it is none."""
    path = path_of(path)
    expect(path, ("fit",), FitError)
    if path.is_dir():
        path = path / "fit.json"
    content = read_json(path, FitError, "Give the folder that " + FIT + " wrote")
    table = content.table("parameters")
    parameters = {name: table.number(name) for name in table}
    for name, value in parameters.items():
        if abs(value) > MOST:
            table.refuse(name, f"{value:g} is no number of a pendulum")
    maps = None
    if "maps" in content:
        maps = Maps(np.radians(content.table("maps").array("knots_deg", 2, 3, KNOTS)))
    stored = StoredFit(parameters, maps)
    try:
        stored.model()
    except KeyError as problem:
        content.refuse("parameters", f"there is no parameter {problem.args[0]}")
    except ModelError as problem:
        content.refuse("parameters", str(problem))
    return stored


def write_json(path: Path, content: dict[str, object]) -> None:
    """One JSON file, whole or not at all."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def files_of_fit(recordings: int, *, figures: bool, maps: bool) -> list[str]:
    """Names of the files that a fit of so many recordings puts into its folder; ``maps``: it learns angle maps."""
    suffixes = [suffix_of(k, recordings) for k in range(recordings)]
    names = ["fit.json", "coefficients.csv"]
    names += [f"{table}{suffix}.csv" for table in ("energy", "residuals") for suffix in suffixes]
    names += ["trials.json"] if recordings > 1 else []
    if figures:
        names += ["shares.png", *(f"energy{suffix}.png" for suffix in suffixes)]
        names += ["maps.png"] if maps else []
        names += ["trials.png"] if recordings > 1 else []
    return names


def write_fit(fit: DampingFit, folder: Path) -> None:
    """Writes ``fit.json``, ``coefficients.csv``, and a table of energies and one of residuals per recording."""
    write_text(folder / "fit.json", fit.to_json())
    rows = ["name,value,sigma,unit"]
    for name, e in (*fit.coefficients.items(), *((f"{k}/psi", e) for k, e in fit.ratios.items())):
        rows.append(f"{name},{e.value!r},{e.sigma!r},{e.unit}")
    write_text(folder / "coefficients.csv", "\n".join(rows) + "\n")
    for k, curve in enumerate(fit.energy):
        head = ["time_s", "energy_j", "model_j", *(f"{n}_j" for n in fit.coefficients)]
        table = [curve.t_s, curve.energy_j, curve.model_j, *curve.works_j.T]
        _write_table(folder / f"energy{recording_suffix(fit, k)}.csv", head, table)
    for k, left in enumerate(fit.residuals):
        head, table = ["time_s"], [left.t_s]
        for j in range(left.residual_rad.shape[1]):
            head += [f"phi{j + 1}_residual_rad", f"phi{j + 1}_sigma_rad"]
            table += [left.residual_rad[:, j], left.sigma_rad[:, j]]
        _write_table(folder / f"residuals{recording_suffix(fit, k)}.csv", head, table)


def _write_table(path: Path, head: Sequence[str], columns: Sequence[Floats]) -> None:
    """A CSV table; nan where there is no number."""
    rows = np.column_stack(list(columns))
    with whole(path) as new:
        np.savetxt(new, rows, fmt="%.9g", delimiter=",", header=",".join(head), comments="")


def recording_suffix(fit: DampingFit, recording: int) -> str:
    """What tells the files of one recording from another's: nothing if there is one, else ``-1``, ``-2``, ..."""
    return suffix_of(recording, len(fit.inputs))


def suffix_of(recording: int, recordings: int) -> str:
    """The same for one of so many recordings."""
    return "" if recordings == 1 else f"-{recording + 1}"
