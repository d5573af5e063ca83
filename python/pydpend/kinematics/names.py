"""Names of links and joints, and of the columns that their angles have in tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

NUMBERED = 2
"""Up to so many links their columns are numbered, as the paper's pendulum has them; of more they are named."""

OURS = re.compile(
    r"frame|(phi|sigma)\d+_(rad|deg)|(sigma_)?phi_.+_(rad|deg)|camera\d_phi(\d+|_.+)_rad|covariance_phi.+_rad2"
)
"""Columns of an angles table that are read; others are the user's, or follow from these."""


@dataclass(frozen=True)
class LinkJoint:
    """A joint of two links: its angle ``theta`` is the second link's less the first's.

    Attributes
    ----------
    name : str
        The joint's name.
    links : tuple of str
        Names of its two links, the one nearer the ground first.
    """

    name: str
    links: tuple[str, str]


@dataclass(frozen=True)
class ColumnNames:
    """The columns of an angles table of these links."""

    links: tuple[str, ...]

    def stem(self, link: int) -> str:
        """The name of a link's angle, from 0: ``phi1``, or ``phi_crank`` where there are more than two links."""
        return f"phi{link + 1}" if len(self.links) <= NUMBERED else f"phi_{self.links[link]}"

    def phi(self, link: int) -> str:
        """The column of its angle."""
        return f"{self.stem(link)}_rad"

    def sigma(self, link: int) -> str:
        """The column of its noise."""
        return f"sigma{link + 1}_rad" if len(self.links) <= NUMBERED else f"sigma_{self.stem(link)}_rad"

    def sigma_camera(self, link: int) -> str:
        """The column of the camera's part of its standard uncertainty."""
        if len(self.links) <= NUMBERED:
            return f"sigma_camera{link + 1}_rad"
        return f"sigma_camera_{self.stem(link)}_rad"

    def covariance(self, one: int, other: int) -> str:
        """The column of the covariance of two links' noise."""
        return f"covariance_{self.stem(one)}_{self.stem(other)}_rad2"

    def camera(self, number: int, link: int) -> str:
        """The column of one of the camera's numbers, from 0."""
        return f"camera{number + 1}_{self.stem(link)}_rad"


def numbered_names(count: int) -> tuple[str, ...]:
    """Names of links of which no names are known."""
    return tuple(f"link{k + 1}" for k in range(count))


def noise_beside(stem: str, unit: str) -> str:
    """The name of the column of an angle's noise, beside the angle's own in some unit, both as in a table."""
    return (f"sigma{stem[3:]}" if re.fullmatch(r"phi\d+", stem) else f"sigma_{stem}") + f"_{unit}"


def stems_of(columns: Sequence[str]) -> list[str]:
    """The angles' names among a table's columns: numbered in their order if there are any, else named as they stand.

    Raises ValueError with the number that lacks.
    """
    found = [m for c in columns if (m := re.fullmatch(r"(phi(?:(\d+)|_.+))_(?:rad|deg)", c))]
    numbers = sorted({int(m[2]) for m in found if m[2] is not None})
    if numbers:
        missing = sorted(set(range(1, numbers[-1] + 1)) - set(numbers))
        if missing:
            raise ValueError(missing[0])
        return [f"phi{k}" for k in numbers]
    return list(dict.fromkeys(m[1] for m in found))
