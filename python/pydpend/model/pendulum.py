"""The double pendulum as its reduced constants: masses, gravity, geometry (paper Eqs. 26 to 29, 33, 34)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from pydpend.errors import ModelError, fault
from pydpend.tabular import html_table

Array = npt.NDArray[np.float64]

CONSTANTS = (
    "psi_kg_m2",
    "lambda_kg_m2",
    "zeta_kg_m2",
    "a3_kg_m2",
    "sigma_j",
    "kappa_j",
    "m1_kg",
    "m2_kg",
    "l1_m",
)
"""The constants with a covariance, in its order."""


@dataclass(frozen=True, repr=False)
class Model:
    """A planar double pendulum in SI units; angles counter-clockwise positive, zero hanging.

    ``T = psi w1^2 + lambda w2^2 + (zeta + a3 cos(phi2 - phi1)) w1 w2`` (Eq. 26; psi and lambda are half
    moments of inertia) and ``V = sigma (1 - cos phi1) + kappa (1 - cos phi2)`` (Eq. 27).

    ``m1_kg`` and ``m2_kg`` are the masses that joint 1 carries besides link 2, and that joint 2 carries (they
    enter the normal forces only); ``l1_m`` is the distance from pivot to elbow. ``lower_inner_m`` and
    ``lower_outer_m`` are the ends of the lower link along its axis from the elbow (inner may be negative),
    where the air drags on it. ``covariance`` is (9, 9) in the order of `CONSTANTS`.

    Raises ModelError for constants that no pendulum can have, except the parallel-axis bounds, which
    `problems` reports (Table 7 breaks one).
    """

    psi_kg_m2: float
    lambda_kg_m2: float
    zeta_kg_m2: float
    a3_kg_m2: float
    sigma_j: float
    kappa_j: float
    m1_kg: float
    m2_kg: float
    l1_m: float
    g_m_s2: float = 9.81
    lower_inner_m: float = 0.0
    lower_outer_m: float = 0.0
    covariance: Array | None = field(default=None, compare=False, repr=False)
    name: str = "model"

    def __post_init__(self) -> None:
        numbers = [f.name for f in fields(self) if f.name not in ("covariance", "name")]
        for name in numbers:
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ModelError(fault(self.name, f"{name} is {value}", "It must be a finite number"))
        for name in ("psi_kg_m2", "lambda_kg_m2", "l1_m"):
            if getattr(self, name) <= 0:
                raise ModelError(fault(self.name, f"{name} is {getattr(self, name)}", "It must be positive"))
        for name in ("m1_kg", "m2_kg", "g_m_s2"):
            if getattr(self, name) < 0:
                raise ModelError(
                    fault(self.name, f"{name} is {getattr(self, name)}", "It cannot be negative")
                )
        # The smallest determinant over all angles is where |zeta + a3 cos| is largest.
        least = 4 * self.psi_kg_m2 * self.lambda_kg_m2 - (abs(self.zeta_kg_m2) + abs(self.a3_kg_m2)) ** 2
        if least <= 0:
            raise ModelError(
                fault(
                    self.name,
                    "the mass matrix is not positive definite: 4 psi lambda "
                    f"{4 * self.psi_kg_m2 * self.lambda_kg_m2:.4g} <= (|zeta| + |a3|)^2 "
                    f"{(abs(self.zeta_kg_m2) + abs(self.a3_kg_m2)) ** 2:.4g} kg2 m4",
                    "Check lambda_kg_m2 and a3_kg_m2",
                )
            )
        if self.lower_outer_m < self.lower_inner_m:
            raise ModelError(
                fault(
                    self.name,
                    f"the lower link ends ({self.lower_outer_m} m) before it begins ({self.lower_inner_m} m)",
                    "lower_outer_m must be at least lower_inner_m",
                )
            )
        if self.covariance is not None and np.shape(self.covariance) != (len(CONSTANTS), len(CONSTANTS)):
            raise ModelError(
                fault(self.name, f"covariance of shape {np.shape(self.covariance)}", "It must be (9, 9)")
            )

    def __repr__(self) -> str:
        """A line for people."""
        links = f"{self.links} link{'s'[: self.links > 1]}"
        return f"<Model {self.name}: {links}, psi {self.psi_kg_m2:.4g} kg m2, sigma {self.sigma_j:.4g} J>"

    def _repr_html_(self) -> str:
        """The constants with their standard uncertainties, for a notebook."""
        known = self.sigmas()
        rows = ((name, f"{getattr(self, name):.6g}", f"{known[name]:.2g}") for name in CONSTANTS)
        return html_table(self.name, ("constant, SI", "value", "standard uncertainty"), rows)

    @classmethod
    def one_link(
        cls,
        psi_kg_m2: float,
        sigma_j: float,
        m1_kg: float = 0.0,
        g_m_s2: float = 9.81,
        covariance: Array | None = None,
        name: str = "model",
    ) -> Model:
        """A single pendulum: ``2 psi w' = -sigma sin phi - losses``. ``covariance`` is (3, 3), of psi, sigma and m1.

        What stands for the lower link must hang at rest (else it would load joint 1).
        """
        spread = np.zeros((len(CONSTANTS), 3))
        for column, same in enumerate((("psi_kg_m2", "lambda_kg_m2"), ("sigma_j", "kappa_j"), ("m1_kg",))):
            spread[[CONSTANTS.index(n) for n in same], column] = 1.0
        cov = None if covariance is None else spread @ covariance @ spread.T
        return cls(
            psi_kg_m2, psi_kg_m2, 0.0, 0.0, sigma_j, sigma_j, m1_kg, 0.0, 1.0, g_m_s2,
            covariance=cov, name=name,
        )  # fmt: skip

    @property
    def links(self) -> int:
        """2, or 1 where no mass hangs on an elbow and nothing couples the links (`one_link`)."""
        return 1 if self.a3_kg_m2 == 0 and self.m2_kg == 0 else 2

    def constants(self) -> Array:
        """The constants in the order of `CONSTANTS`, shape (9,)."""
        return np.array([getattr(self, name) for name in CONSTANTS])

    def sigmas(self) -> dict[str, float]:
        """Standard uncertainty of each constant; 0 where no covariance is known."""
        if self.covariance is None:
            return dict.fromkeys(CONSTANTS, 0.0)
        return dict(zip(CONSTANTS, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def problems(self) -> list[str]:
        """What is wrong with these constants as one rigid pendulum: broken parallel-axis bounds, in words.

        A link of mass m with its centre at distance d from its joint has at least the inertia m d^2. Needs
        the masses; with a mass of 0 (not known) nothing can be said of that link.
        """
        found = []
        if self.g_m_s2 > 0 and self.m2_kg > 0:
            least = (self.kappa_j / self.g_m_s2) ** 2 / self.m2_kg
            if 2 * self.lambda_kg_m2 < least:
                found.append(
                    "lambda breaks the parallel-axis bound: "
                    f"2 lambda = {2 * self.lambda_kg_m2:.4g} kg m2, but a lower link of {self.m2_kg:.4g} kg "
                    f"with kappa {self.kappa_j:.4g} J has at least {least:.4g}"
                )
        if self.g_m_s2 > 0 and self.m1_kg > 0:
            own = self.sigma_j / self.g_m_s2 - self.m2_kg * self.l1_m
            least = own**2 / self.m1_kg + self.m2_kg * self.l1_m**2
            if 2 * self.psi_kg_m2 < least:
                found.append(
                    "psi breaks the parallel-axis bound: "
                    f"2 psi = {2 * self.psi_kg_m2:.4g} kg m2, but an upper link of {self.m1_kg:.4g} kg "
                    f"with sigma {self.sigma_j:.4g} J has at least {least:.4g}"
                )
        return found

    def checked(self) -> Model:
        """Itself, or ModelError with the first of `problems`."""
        for problem in self.problems():
            raise ModelError(fault(self.name, problem, "Check its inertias and distances"))
        return self

    def coupling(self, phi_rad: npt.ArrayLike) -> Array:
        """``zeta + a3 cos(phi2 - phi1)``, kg m2, for angles (..., 2)."""
        phi = np.asarray(phi_rad, dtype=np.float64)
        return np.asarray(self.zeta_kg_m2 + self.a3_kg_m2 * np.cos(phi[..., 1] - phi[..., 0]))

    def mass_matrix(self, phi_rad: npt.ArrayLike) -> Array:
        """The mass matrix (..., 2, 2), kg m2, for angles (..., 2): T = w' M w / 2."""
        cross = self.coupling(phi_rad)
        out = np.empty((*cross.shape, 2, 2))
        out[..., 0, 0] = 2 * self.psi_kg_m2
        out[..., 1, 1] = 2 * self.lambda_kg_m2
        out[..., 0, 1] = out[..., 1, 0] = cross
        return out

    def kinetic(self, phi_rad: npt.ArrayLike, w_rad_s: npt.ArrayLike) -> Array:
        """Kinetic energy in J (Eq. 26) for angles and rates (..., 2)."""
        w = np.asarray(w_rad_s, dtype=np.float64)
        w1, w2 = w[..., 0], w[..., 1]
        own = self.psi_kg_m2 * w1**2 + self.lambda_kg_m2 * w2**2
        return np.asarray(own + self.coupling(phi_rad) * w1 * w2)

    def potential(self, phi_rad: npt.ArrayLike) -> Array:
        """Potential energy in J (Eq. 27) for angles (..., 2), zero hanging."""
        phi = np.asarray(phi_rad, dtype=np.float64)
        # 2 sin^2 keeps its digits at small angles, where 1 - cos loses them.
        return np.asarray(
            2 * self.sigma_j * np.sin(phi[..., 0] / 2) ** 2 + 2 * self.kappa_j * np.sin(phi[..., 1] / 2) ** 2
        )

    def energy(self, phi_rad: npt.ArrayLike, w_rad_s: npt.ArrayLike) -> Array:
        """Total energy in J (Eq. 22) for angles and rates (..., 2)."""
        return self.kinetic(phi_rad, w_rad_s) + self.potential(phi_rad)


def uniform_bar(mass: float, inertia: float, centre: float) -> tuple[float, float]:
    """Ends, from the joint, of the uniform bar of this mass, central inertia and centre; (centre, centre) for
    no mass. Used where no drawing says how far the lower link reaches."""
    half = math.sqrt(3 * inertia / mass) if mass > 0 and inertia > 0 else 0.0
    return centre - half, centre + half
