"""The folder of a damping fit: its files by name, written and read.

Owns: every file name of the folder that ``pydpend fit`` writes, and the stage ``fit`` of a run. What is read may come
from anyone, and is checked.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydpend.columns import read_columns
from pydpend.damping import DampingFit, EnergyCurve, Residuals
from pydpend.damping.stored import StoredFit
from pydpend.documents import Table, read_json
from pydpend.errors import ANALYSE, FIT, FitError, PydpendError
from pydpend.json_text import write_json
from pydpend.kinds import expect
from pydpend.model import CONSTANTS
from pydpend.output import AnyPath, path_of, write_text
from pydpend.tabular import write_csv
from pydpend.trials import Trials
from pydpend.worded import Words

if TYPE_CHECKING:
    from pydpend.model import Model


class FitFile(Words):
    """The files of a fit, by name; ``words`` says what each is."""

    FIT = "fit.json", "damping coefficients, uncertainties, shares, identifiability"
    MODEL = (
        "model.json",
        "constants of the model that the fit began from, with their standard uncertainties, SI",
    )
    COEFFICIENTS = "coefficients.csv", "the coefficients as a table"
    SHARES_FIGURE = "shares.png", "where the energy goes"
    TRIALS = "trials.json", "the coefficients of each recording and their mean"
    TRIALS_FIGURE = "trials.png", "the same, drawn (Fig. 20)"
    MAPS_FIGURE = "maps.png", "angle-dependent bias of the tracking"


class FileOfEach(Words):
    """The files that a fit has for each of its recordings; ``words`` says what each is."""

    ENERGY = "energy.csv", "energy of the motion and what each law takes out, J"
    RESIDUALS = (
        "residuals.csv",
        "measured minus fitted angle of each link, and its standard deviation, rad",
    )
    ENERGY_FIGURE = "energy.png", "energy of the motion and what each law takes out (Fig. 19)"

    def of(self, recording: int, recordings: int) -> str:
        """Its name for one of so many recordings, from 0: ``energy.csv`` of the only one, else ``energy-1.csv``."""
        stem, ending = self.value.split(".")
        return self.value if recordings == 1 else f"{stem}-{recording + 1}.{ending}"


_OF_EACH = re.compile(r"(\w+)(?:-\d+)?(\.\w+)")


def about_fit(name: str) -> str:
    """The description of a file of a fit's folder; empty for one that is none."""
    if name in list(FitFile):
        return FitFile(name).words
    found = _OF_EACH.fullmatch(name)
    of_each = "".join(found.groups()) if found else ""
    return FileOfEach(of_each).words if of_each in list(FileOfEach) else ""


@dataclass(frozen=True)
class StoredScale:
    """The constant that stands behind all coefficients, and the model that it is of."""

    model: str
    psi_kg_m2: float
    sigma_kg_m2: float


@dataclass(frozen=True)
class FitFolder:
    """The folder of a fit. What a reader finds missing or damaged raises ``error``."""

    path: Path
    error: type[PydpendError] = FitError

    def file(self, name: FitFile) -> Path:
        """The path of a file."""
        return self.path / name

    def file_of(self, name: FileOfEach, recording: int, recordings: int) -> Path:
        """The path of a file of one recording, from 0, of so many."""
        return self.path / name.of(recording, recordings)

    def files(self, recordings: int, *, figures: bool, maps: bool) -> list[Path]:
        """The files that a fit of so many recordings makes; ``maps``: it learns angle maps."""
        names = [FitFile.FIT, FitFile.COEFFICIENTS]
        names += [FitFile.TRIALS] if recordings > 1 else []
        each = [FileOfEach.ENERGY, FileOfEach.RESIDUALS]
        if figures:
            names += [FitFile.SHARES_FIGURE, *([FitFile.MAPS_FIGURE] if maps else [])]
            names += [FitFile.TRIALS_FIGURE] if recordings > 1 else []
            each.append(FileOfEach.ENERGY_FIGURE)
        of_each = [self.file_of(name, k, recordings) for name in each for k in range(recordings)]
        return [*map(self.file, names), *of_each]

    def write(self, fit: DampingFit, trials: Trials | None = None) -> None:
        """Writes the fit: JSON, the coefficients, and a table of energies and one of residuals per recording."""
        write_text(self.file(FitFile.FIT), fit.to_json())
        columns = fit.to_columns()
        rows = zip(*(columns[key].tolist() for key in ("name", "value", "sigma", "unit")), strict=True)
        lines = ["name,value,sigma,unit", *(f"{n},{v!r},{s!r},{u}" for n, v, s, u in rows)]
        write_text(self.file(FitFile.COEFFICIENTS), "\n".join(lines) + "\n")
        count = len(fit.inputs)
        for k, curve in enumerate(fit.energy):
            write_csv(self.file_of(FileOfEach.ENERGY, k, count), curve.to_columns())
        for k, left in enumerate(fit.residuals):
            write_csv(self.file_of(FileOfEach.RESIDUALS, k, count), left.to_columns())
        if trials is not None:
            write_text(self.file(FitFile.TRIALS), trials.to_json())

    def write_model(self, model: Model) -> None:
        """Writes the constants that the fit began from."""
        sigmas = model.sigmas()
        constants = {
            name: {"value": value, "sigma": sigmas[name]}
            for name, value in zip(CONSTANTS, model.constants().tolist(), strict=True)
            if model.scale_known or name == "psi_kg_m2"
        }
        write_json(self.file(FitFile.MODEL), {"name": model.name, "constants": constants})

    def fit(self) -> DampingFit:
        """The fit, without its tables."""
        return DampingFit.of_table(self._document(FitFile.FIT))

    def scale(self) -> StoredScale | None:
        """The constant behind all coefficients, if the folder has it."""
        if not self.file(FitFile.MODEL).exists():
            return None
        model = self._document(FitFile.MODEL)
        psi = model.table("constants").table("psi_kg_m2")
        return StoredScale(model.text("name"), psi.number("value"), psi.number("sigma"))

    def trials(self) -> Trials | None:
        """The recordings beside each other, if there are several."""
        return Trials.of_table(self._document(FitFile.TRIALS)) if self.file(FitFile.TRIALS).exists() else None

    def energy(self, recording: int) -> EnergyCurve | None:
        """The energy of a recording's fitted motion, if the folder has it."""
        path = self._of_recording(FileOfEach.ENERGY, recording)
        if not path.exists():
            return None
        required = ("time_s", "energy_j", "model_j")
        return EnergyCurve.of_columns(read_columns(path, required, None, error=self.error).values)

    def residuals(self, recording: int) -> Residuals | None:
        """Measured minus fitted angles of a recording, if the folder has them."""
        path = self._of_recording(FileOfEach.RESIDUALS, recording)
        if not path.exists():
            return None
        required = ("time_s", "phi1_residual_rad", "phi1_sigma_rad")
        return Residuals.of_columns(read_columns(path, required, None, error=self.error).values)

    def _of_recording(self, name: FileOfEach, recording: int) -> Path:
        alone = self.file_of(name, 0, 1)
        return alone if alone.exists() else self.file_of(name, recording, 2)

    def _document(self, name: FitFile) -> Table:
        advice = "Do " + (FIT if self.error is FitError else ANALYSE) + " again"
        return read_json(self.file(name), self.error, advice)


def load_fit(path: AnyPath) -> StoredFit:
    """A fit to predict with, from a folder of ``pydpend fit`` (or the file itself). Raises FitError when it is none."""
    path = path_of(path)
    expect(path, ("fit",), FitError)
    file = path / FitFile.FIT if path.is_dir() else path
    return StoredFit.of_table(read_json(file, FitError, "Give the folder that " + FIT + " wrote"))
