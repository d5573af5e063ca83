"""A finished fit as it predicts other recordings, made just now or read back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pydpend.damping.fitted_recording import AngleMaps
from pydpend.damping.maps import Maps, corrected
from pydpend.damping.prediction import WINDOWS_S, Prediction, initial_state, predict
from pydpend.damping.recording import prepare
from pydpend.damping.result import DampingFit
from pydpend.decay import check_pendulum
from pydpend.documents import Table
from pydpend.errors import FitError, ModelError, Setting, fault
from pydpend.kinematics import LinkAngles
from pydpend.model import Model
from pydpend.model.file import MOST


@dataclass(frozen=True)
class StoredFit:
    """Parameters of the motion and angle-bias maps of a finished fit."""

    parameters: dict[str, float]
    maps: Maps | None

    @classmethod
    def of(cls, fit: DampingFit) -> StoredFit:
        """A fit just made, as if it had been written and read."""
        return cls(dict(fit.parameters), None if fit.maps is None else Maps.of(fit.maps))

    @classmethod
    def of_table(cls, content: Table) -> StoredFit:
        """From a ``fit.json`` that is read already: only what predicts is looked at.

        Raises the document's error for parameters that are no pendulum's.
        """
        table = content.table("parameters")
        parameters = {name: table.number(name) for name in table}
        for name, value in parameters.items():
            if abs(value) > MOST:
                table.refuse(name, f"{value:g} is no number of a pendulum")
        maps = None
        if "maps" in content:
            maps = Maps.of(AngleMaps.of_table(content.table("maps")))
        stored = cls(parameters, maps)
        try:
            stored.model()
        except KeyError as problem:
            content.refuse("parameters", f"there is no parameter {problem.args[0]}")
        except ModelError as problem:
            content.refuse("parameters", str(problem))
        return stored

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
        check_pendulum(angles)
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
