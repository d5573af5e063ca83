"""The double pendulum's constants and damping coefficients: what every computation on it starts from."""

from __future__ import annotations

from pydpend.model.file import check_model_called, model_called, of_ratios, read_model
from pydpend.model.laws import FORCES, LAW_TABLE, UNITS, Damping, constants, parameters
from pydpend.model.pendulum import CONSTANTS, Model, uniform_bar
from pydpend.model.reduce import (
    G_MM_S2,
    TABLE_7,
    ModelWarning,
    derived,
    from_parts,
    jacobian,
    published,
    reduced_constants,
)

__all__ = [
    "CONSTANTS",
    "FORCES",
    "G_MM_S2",
    "LAW_TABLE",
    "TABLE_7",
    "UNITS",
    "Damping",
    "Model",
    "ModelWarning",
    "check_model_called",
    "constants",
    "derived",
    "from_parts",
    "jacobian",
    "model_called",
    "of_ratios",
    "parameters",
    "published",
    "read_model",
    "reduced_constants",
    "uniform_bar",
]
