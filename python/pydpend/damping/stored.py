"""A fit read back from its folder, to predict with."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydpend.angles import LinkAngles
from pydpend.damping.maps import Maps
from pydpend.damping.prediction import WINDOWS_S, Prediction, predict
from pydpend.damping.trajectory import prepare
from pydpend.errors import FitError, fault
from pydpend.model import Model


@dataclass(frozen=True)
class StoredFit:
    """Parameters of the motion and angle-bias maps of a finished fit."""

    parameters: dict[str, float]
    maps: Maps | None

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
        """Predicts a recording's free decay. Raises FitError when it has none."""
        recording = prepare(angles, self.model(), start_s, stop_s)
        return predict(recording, self.parameters, windows_s, self.maps)


def load_fit(path: str | Path) -> StoredFit:
    """Reads ``fit.json`` from a folder of ``pydpend fit`` (or the file itself). Raises FitError when it is
    none."""
    path = Path(path)
    if path.is_dir():
        path = path / "fit.json"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        parameters = {str(k): float(v) for k, v in content["parameters"].items()}
        maps = None if content.get("maps") is None else Maps.from_json(content["maps"])
        stored = StoredFit(parameters, maps)
        stored.model()
    except OSError as problem:
        raise FitError(
            fault(str(path), f"cannot be read ({problem.strerror})", "Give the folder that pydpend fit wrote")
        ) from problem
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise FitError(
            fault(
                str(path),
                f"is not a fit.json of pydpend ({problem!r})",
                "Give the folder that pydpend fit wrote",
            )
        ) from problem
    return stored
