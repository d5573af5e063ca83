"""The double pendulum as its reduced constants: masses, gravity, geometry (paper Eqs. 26 to 29, 33, 34)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from pydpend.errors import ModelError, fault
from pydpend.tabular import html_table
from pydpend.typed import typed, typed_class

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


@typed_class()
@dataclass(frozen=True, repr=False)
class Model:
    """A planar double pendulum in SI units; angles counter-clockwise positive, zero hanging.

    ``T = psi w1^2 + lambda w2^2 + (zeta + a3 cos(phi2 - phi1)) w1 w2`` (Eq. 26; psi and lambda are half moments of
    inertia) and ``V = sigma (1 - cos phi1) + kappa (1 - cos phi2)`` (Eq. 27).

    Parameters
    ----------
    psi_kg_m2, lambda_kg_m2 : float
        Half moments of inertia of the upper link (with the lower one's mass at the elbow) and of the lower, kg m2.
    zeta_kg_m2, a3_kg_m2 : float
        Coupling of the links' rates: constant part, and factor of the cosine, kg m2.
    sigma_j, kappa_j : float
        Depth of the potential of the upper and the lower link, J.
    m1_kg, m2_kg : float
        Masses that joint 1 carries besides link 2, and that joint 2 carries, kg (they enter the normal forces only).
    l1_m : float
        Distance from pivot to elbow, m.
    g_m_s2 : float
        Gravity, m/s2.
    lower_inner_m, lower_outer_m : float
        Ends of the lower link along its axis from the elbow, m (inner may be negative), where the air drags on it.
    covariance : ndarray of float, shape (9, 9), optional
        Of the constants in the order of ``pydpend.model.CONSTANTS``, SI.
    name : str
        Name of the model, for messages.
    scale_known : bool
        Whether psi is this pendulum's; else all constants are over psi, which is 1 (`of_unknown_scale`).

    Raises
    ------
    ModelError
        For constants that no pendulum can have, except the parallel-axis bounds, which `problems` reports (Table 7
        breaks one).
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
    scale_known: bool = True

    def __post_init__(self) -> None:
        numbers = [f.name for f in fields(self) if f.name not in ("covariance", "name", "scale_known")]
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
    @typed()
    def one_link(
        cls,
        psi_kg_m2: float,
        sigma_j: float,
        m1_kg: float = 0.0,
        g_m_s2: float = 9.81,
        covariance: Array | None = None,
        name: str = "model",
    ) -> Model:
        """A single pendulum: ``2 psi w' = -sigma sin phi - losses``.

        What stands for the lower link must hang at rest (else it would load joint 1).

        Parameters
        ----------
        psi_kg_m2 : float
            Half its moment of inertia about the pivot, kg m2.
        sigma_j : float
            Depth of its potential, J.
        m1_kg : float
            Mass that the joint carries, kg.
        g_m_s2 : float
            Gravity, m/s2.
        covariance : ndarray of float, shape (3, 3), optional
            Of psi, sigma and m1, SI.
        name : str
            Name of the model, for messages.

        Returns
        -------
        Model
            A model of which `links` is 1.

        Raises
        ------
        ModelError
            For constants that no pendulum can have.
        """
        spread = np.zeros((len(CONSTANTS), 3))
        for column, same in enumerate((("psi_kg_m2", "lambda_kg_m2"), ("sigma_j", "kappa_j"), ("m1_kg",))):
            spread[[CONSTANTS.index(n) for n in same], column] = 1.0
        cov = None if covariance is None else spread @ covariance @ spread.T
        return cls(
            psi_kg_m2, psi_kg_m2, 0.0, 0.0, sigma_j, sigma_j, m1_kg, 0.0, 1.0, g_m_s2,
            covariance=cov, name=name,
        )  # fmt: skip

    def of_unknown_scale(self) -> Model:
        """The model as one of which only the ratios are known: all constants over psi, and no masses.

        Returns
        -------
        Model
            The same motion; coefficients fitted with it are over psi, in 1/s, 1 and 1/s2.
        """
        return replace(
            self,
            psi_kg_m2=1.0,
            m1_kg=0.0,
            m2_kg=0.0,
            covariance=None,
            scale_known=False,
            **{
                name: getattr(self, name) / self.psi_kg_m2
                for name in ("lambda_kg_m2", "zeta_kg_m2", "a3_kg_m2", "sigma_j", "kappa_j")
            },
        )

    @property
    def links(self) -> int:
        """2, or 1 where no mass hangs on an elbow and nothing couples the links (`one_link`)."""
        return 1 if self.a3_kg_m2 == 0 and self.m2_kg == 0 else 2

    def constants(self) -> Array:
        """The constants in the order of ``pydpend.model.CONSTANTS``.

        Returns
        -------
        ndarray of float, shape (9,)
            Values, SI.
        """
        return np.array([getattr(self, name) for name in CONSTANTS])

    def sigmas(self) -> dict[str, float]:
        """Standard uncertainty of each constant.

        Returns
        -------
        dict of str to float
            By name, SI; 0 where no covariance is known.
        """
        if self.covariance is None:
            return dict.fromkeys(CONSTANTS, 0.0)
        return dict(zip(CONSTANTS, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def problems(self) -> list[str]:
        """The faults of these constants as one rigid pendulum: broken parallel-axis bounds.

        A link of mass m with its centre at distance d from its joint has at least the inertia m d^2. The bound needs
        the masses; with a mass of 0 (not known) nothing can be said of that link.

        Returns
        -------
        list of str
            One sentence each; empty if nothing is wrong.
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
        """The model itself, if it has no `problems`.

        Returns
        -------
        Model
            Itself.

        Raises
        ------
        ModelError
            With the first of `problems`.
        """
        for problem in self.problems():
            raise ModelError(fault(self.name, problem, "Check its inertias and distances"))
        return self

    @typed()
    def coupling(self, phi_rad: npt.ArrayLike) -> Array:
        """Coupling of the rates, ``zeta + a3 cos(phi2 - phi1)`` (Eq. 26).

        Parameters
        ----------
        phi_rad : array-like, shape (..., 2)
            Angles, rad.

        Returns
        -------
        ndarray of float, shape (...)
            Coupling, kg m2.
        """
        phi = np.asarray(phi_rad, dtype=np.float64)
        return np.asarray(self.zeta_kg_m2 + self.a3_kg_m2 * np.cos(phi[..., 1] - phi[..., 0]))

    @typed()
    def mass_matrix(self, phi_rad: npt.ArrayLike) -> Array:
        """The mass matrix M of ``T = w' M w / 2`` (Eq. 26).

        Parameters
        ----------
        phi_rad : array-like, shape (..., 2)
            Angles, rad.

        Returns
        -------
        ndarray of float, shape (..., 2, 2)
            Mass matrices, kg m2.
        """
        cross = self.coupling(phi_rad)
        out = np.empty((*cross.shape, 2, 2))
        out[..., 0, 0] = 2 * self.psi_kg_m2
        out[..., 1, 1] = 2 * self.lambda_kg_m2
        out[..., 0, 1] = out[..., 1, 0] = cross
        return out

    @typed()
    def kinetic(self, phi_rad: npt.ArrayLike, w_rad_s: npt.ArrayLike) -> Array:
        """Kinetic energy (Eq. 26).

        Parameters
        ----------
        phi_rad : array-like, shape (..., 2)
            Angles, rad.
        w_rad_s : array-like, shape (..., 2)
            Rates, rad/s.

        Returns
        -------
        ndarray of float, shape (...)
            Energy, J.
        """
        w = np.asarray(w_rad_s, dtype=np.float64)
        w1, w2 = w[..., 0], w[..., 1]
        own = self.psi_kg_m2 * w1**2 + self.lambda_kg_m2 * w2**2
        return np.asarray(own + self.coupling(phi_rad) * w1 * w2)

    @typed()
    def potential(self, phi_rad: npt.ArrayLike) -> Array:
        """Potential energy (Eq. 27), zero hanging.

        Parameters
        ----------
        phi_rad : array-like, shape (..., 2)
            Angles, rad.

        Returns
        -------
        ndarray of float, shape (...)
            Energy, J.
        """
        phi = np.asarray(phi_rad, dtype=np.float64)
        # 2 sin^2 keeps its digits at small angles, where 1 - cos loses them.
        return np.asarray(
            2 * self.sigma_j * np.sin(phi[..., 0] / 2) ** 2 + 2 * self.kappa_j * np.sin(phi[..., 1] / 2) ** 2
        )

    @typed()
    def energy(self, phi_rad: npt.ArrayLike, w_rad_s: npt.ArrayLike) -> Array:
        """Total energy (Eq. 22), zero hanging at rest.

        Parameters
        ----------
        phi_rad : array-like, shape (..., 2)
            Angles, rad.
        w_rad_s : array-like, shape (..., 2)
            Rates, rad/s.

        Returns
        -------
        ndarray of float, shape (...)
            Energy, J.
        """
        return self.kinetic(phi_rad, w_rad_s) + self.potential(phi_rad)


def uniform_bar(mass: float, inertia: float, centre: float) -> tuple[float, float]:
    """Ends, from the joint, of the uniform bar of this mass, central inertia and centre; (centre, centre) for no mass.

    Used where no drawing says how far the lower link reaches.
    """
    half = math.sqrt(3 * inertia / mass) if mass > 0 and inertia > 0 else 0.0
    return centre - half, centre + half
