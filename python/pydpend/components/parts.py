"""Moving parts and their energies (paper Section 4.1 and 8.1, Eqs. 20 and 21; docs/reference/physics.md section 2).

A part's energies and its share of the reduced constants are arithmetic on named quantities, so floats, arrays
of Monte Carlo samples, complex steps and SymPy symbols may go in. Lengths, masses and inertias may have any
coherent unit; inertias are about the part's own centre.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pydpend.bearings import rates, ratios

Values = Mapping[str, Any]


@dataclass(frozen=True)
class Reduced:
    """The constants of Eqs. 26 and 27 without g, and what the joints carry.

    ``sigma_g`` and ``kappa_g`` are sigma/g and kappa/g, first moments of mass.
    """

    psi: Any = 0
    lam: Any = 0
    zeta: Any = 0
    a3: Any = 0
    sigma_g: Any = 0
    kappa_g: Any = 0
    m1: Any = 0
    m2: Any = 0

    def __add__(self, other: Reduced) -> Reduced:
        return Reduced(*(getattr(self, k) + getattr(other, k) for k in REDUCED))


REDUCED = ("psi", "lam", "zeta", "a3", "sigma_g", "kappa_g", "m1", "m2")


@dataclass(frozen=True)
class Rigid:
    """Fixed on a link, at a distance of its centre from the link's joint.

    ``along`` names the distance from the joint (pivot or elbow) along the link, signed; ``distance`` the true (for
    many parts the root-mean-square) distance where it is another. None is zero: at the joint itself.
    """

    body: int
    along: str | None = None
    distance: str | None = None


@dataclass(frozen=True)
class Races:
    """The links that a bearing's races turn with (0 the stand, 1 the upper link, 2 the lower link), and its place."""

    inner: int
    outer: int
    at_elbow: bool
    d_inner: str = "d_I"
    d_ball: str = "d_B"


@dataclass(frozen=True)
class Cage:
    """The ball spacer of a bearing: turns with the ball carrier's rate."""

    races: Races


@dataclass(frozen=True)
class Balls:
    """The balls of one bearing: they go round with the carrier and spin."""

    races: Races
    number: int


@dataclass(frozen=True)
class Part:
    """One kind of part. ``count`` is how many there are (bearings for `Cage` and `Balls`).

    ``carried`` is the link (1 or 2) whose mass it adds to in the joints' normal forces (Eq. 33), 0 for what
    hangs on the stand.
    """

    item: str
    name: str
    mass: str | None
    inertia: str | None
    place: Rigid | Cage | Balls
    count: int = 1
    carried: int = 0

    def kinetic(
        self,
        q: Values,
        phi1: Any,
        phi2: Any,
        w1: Any,
        w2: Any,
        cos: Any,
        ball_sum: Any = 0,
        length: str = "l_u",
    ) -> Any:
        """Kinetic energy of all ``count`` of them.

        ``cos`` is the cosine to use, ``ball_sum`` the balls' Lambda (0 for equally spaced balls).
        """
        m, inertia = self._mass(q), self._inertia(q)
        lu = q[length]
        if isinstance(self.place, Rigid):
            along, square = self._place(q)
            if self.place.body == 1:
                return self.count * (inertia + m * square) * w1**2 / 2
            moving = lu**2 * w1**2 + 2 * lu * along * w1 * w2 * cos(phi2 - phi1) + square * w2**2
            return self.count * (m * moving + inertia * w2**2) / 2
        races = self.place.races
        carrier, spin = rates(
            q[races.d_inner], q[races.d_ball], (0, w1, w2)[races.inner], (0, w1, w2)[races.outer]
        )
        centre = (lu * w1) ** 2 if races.at_elbow else 0
        if isinstance(self.place, Cage):
            return self.count * (m * centre + inertia * carrier**2) / 2
        n = self.count * self.place.number
        radius = (q[races.d_inner] + q[races.d_ball]) / 2
        energy = n * (m * (centre + (radius * carrier) ** 2) + inertia * spin**2) / 2
        if races.at_elbow:
            energy = energy + self.count * m * lu * w1 * radius * carrier * ball_sum
        return energy

    def potential(self, q: Values, phi1: Any, phi2: Any, g: Any, cos: Any, length: str = "l_u") -> Any:
        """Potential energy, zero with both links hanging."""
        share = self.reduced(q, length)
        return g * (share.sigma_g * (1 - cos(phi1)) + share.kappa_g * (1 - cos(phi2)))

    def reduced(self, q: Values, length: str = "l_u") -> Reduced:
        """The part's share of the reduced constants (errata section 0; Table 9 and 10 corrected)."""
        m, inertia = self._mass(q), self._inertia(q)
        lu = q[length]
        n = self.count
        total = n * (self.place.number if isinstance(self.place, Balls) else 1) * m
        carried = {"m1": total if self.carried == 1 else 0, "m2": total if self.carried == 2 else 0}
        if isinstance(self.place, Rigid):
            along, square = self._place(q)
            if self.place.body == 1:
                return Reduced(psi=n * (inertia + m * square) / 2, sigma_g=n * m * along, **carried)
            return Reduced(
                psi=n * m * lu**2 / 2,
                lam=n * (inertia + m * square) / 2,
                a3=n * m * lu * along,
                sigma_g=n * m * lu,
                kappa_g=n * m * along,
                **carried,
            )
        races = self.place.races
        r = ratios(q[races.d_inner], q[races.d_ball])
        carrier = _by_link(races, r.d11, r.d12)
        centre = total * lu**2 if races.at_elbow else 0
        if isinstance(self.place, Cage):
            turning, spinning, spin = n * inertia, 0, (0, 0)
        else:
            balls = n * self.place.number
            turning, spinning, spin = balls * m * r.radius**2, balls * inertia, _by_link(races, r.c11, -r.c12)
        return Reduced(
            psi=(centre + turning * carrier[0] ** 2 + spinning * spin[0] ** 2) / 2,
            lam=(turning * carrier[1] ** 2 + spinning * spin[1] ** 2) / 2,
            zeta=turning * carrier[0] * carrier[1] + spinning * spin[0] * spin[1],
            sigma_g=total * lu if races.at_elbow else 0,
            **carried,
        )

    def _mass(self, q: Values) -> Any:
        return 0 if self.mass is None else q[self.mass]

    def _inertia(self, q: Values) -> Any:
        return 0 if self.inertia is None else q[self.inertia]

    def _place(self, q: Values) -> tuple[Any, Any]:
        """Distance along the link and the square of the true distance."""
        assert isinstance(self.place, Rigid)
        along = 0 if self.place.along is None else q[self.place.along]
        true = along if self.place.distance is None else q[self.place.distance]
        return along, true**2


def _by_link(races: Races, of_inner: Any, of_outer: Any) -> tuple[Any, Any]:
    """A race combination's coefficients on (w1, w2)."""
    coefficients: list[Any] = [0, 0, 0]
    coefficients[races.inner] += of_inner
    coefficients[races.outer] += of_outer
    return coefficients[1], coefficients[2]


def total(parts: Iterable[Part], q: Values, length: str = "l_u") -> Reduced:
    """The reduced constants of all parts together."""
    out = Reduced()
    for part in parts:
        out = out + part.reduced(q, length)
    return out
