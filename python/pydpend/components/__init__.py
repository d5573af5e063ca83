"""The pendulum's parts as data: Tables 8 to 10 and Sections 4.1 and 8.1, with uncertainties and energies."""

from __future__ import annotations

from pydpend.components.configurations import Configuration, configuration
from pydpend.components.parts import Balls, Cage, Part, Races, Reduced, Rigid, total
from pydpend.components.quantity import Quantity, covariance, values
from pydpend.components.table8 import assumed_places, section_8_1, table_8

__all__ = [
    "Balls",
    "Cage",
    "Configuration",
    "Part",
    "Quantity",
    "Races",
    "Reduced",
    "Rigid",
    "assumed_places",
    "configuration",
    "covariance",
    "section_8_1",
    "table_8",
    "total",
    "values",
]
