"""Period, logarithmic decrement and quality factor of a single pendulum by its angle alone: no mass, no length.

A swing's turning points give its amplitude A over time, its passages through the middle the period. What takes the
amplitude down is told by how: viscous friction by ``-dA/dt = a A``, drag of the square of the speed by ``b A^2``, dry
friction by ``c``, averaged over a swing; in gravity each times its factor for a swing that is not small. The fewest
that chance (Bayes' criterion) does not rule out stand.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from pydpend.documents import Table
from pydpend.errors import SELECT, AnglesError, Setting, fault
from pydpend.json_text import plain
from pydpend.kinematics import LinkAngles
from pydpend.link_states import LinkStates, states
from pydpend.tabular import TableResult, html_rows
from pydpend.typed import typed

Array = npt.NDArray[np.float64]

START = Setting("start_s") + " and " + Setting("stop_s")
"""How a part of a recording is taken."""

LEAST_SWINGS = 3
"""Whole swings that a period and a decay take, at least."""

LAWS = ("viscous", "quadratic", "dry")
"""Laws of the amplitude's decay: in proportion to it, to its square, and independent of it."""

UNEVEN = 0.2
"""Half swings of a single pendulum that differ by more than this part, but for the amplitude, are of something else."""


@dataclass(frozen=True, eq=False, repr=False)
class RingDown(TableResult):
    """The free swing of a single pendulum, as its angle tells it.

    Attributes
    ----------
    name, link : str
        The recording's name and the link's.
    swings : int
        Whole swings.
    period_s, period_sigma_s : float
        Period of a small swing and its standard uncertainty, s: that of each swing less what its amplitude adds.
    amplitude_coefficient, amplitude_coefficient_sigma : float
        The period's rise with the amplitude, ``T = T0 (1 + k A^2)``: 1/16 for a pendulum in gravity, 0 for a spring.
    middle_rad : float
        Angle about which it swings, rad.
    first_amplitude_rad, last_amplitude_rad : float
        Amplitudes at the ends, rad.
    laws : tuple of str
        What takes the amplitude down: of ``viscous``, ``quadratic`` and ``dry`` those that are needed.
    rates, rates_sigma : tuple of float
        Of each of these, in its order, ``a`` (1/s), ``b`` (1/(rad s)) or ``c`` (rad/s), and its standard uncertainty.
    decrement, decrement_sigma : float
        Natural logarithm of the ratio of two amplitudes a period apart, at `at_amplitude_rad`.
    q : float
        Quality factor there: pi over the decrement.
    at_amplitude_rad : float
        The geometric mean of the first and last amplitude, rad, at which decrement and q hold.
    chi2_by_laws : dict of str to float
        Chi-square of the amplitudes per degree of freedom for each choice of laws, with their uncertainties.
    t_s, amplitude_rad, amplitude_sigma_rad : ndarray of float, shape (K,)
        Each turning point's time, amplitude and standard uncertainty.
    """

    name: str
    link: str
    swings: int
    period_s: float
    period_sigma_s: float
    amplitude_coefficient: float
    amplitude_coefficient_sigma: float
    middle_rad: float
    first_amplitude_rad: float
    last_amplitude_rad: float
    laws: tuple[str, ...]
    rates: tuple[float, ...]
    rates_sigma: tuple[float, ...]
    decrement: float
    decrement_sigma: float
    q: float
    at_amplitude_rad: float
    chi2_by_laws: dict[str, float]
    t_s: Array
    amplitude_rad: Array
    amplitude_sigma_rad: Array

    def __repr__(self) -> str:
        """A line for people."""
        return (
            f"<RingDown {self.name} {self.link}: {self.swings} swings, T {self.period_s:.6g} s, Q {self.q:.4g}, "
            f"{' and '.join(self.laws)}>"
        )

    def _repr_html_(self) -> str:
        """The first turning points, for a notebook."""
        return html_rows(repr(self)[1:-1], self.to_columns())

    def to_columns(self) -> dict[str, Array]:
        """The turning points as columns of a table.

        Returns
        -------
        dict of str to ndarray, each of shape (K,)
            ``time_s``, ``amplitude_rad`` and ``sigma_amplitude_rad``.
        """
        return {
            "time_s": self.t_s,
            "amplitude_rad": self.amplitude_rad,
            "sigma_amplitude_rad": self.amplitude_sigma_rad,
        }

    def to_dict(self) -> dict[str, Any]:
        """The numbers as plain values, without the turning points.

        Returns
        -------
        dict
            Every other attribute by name; None for what is not known.
        """
        table = ("t_s", "amplitude_rad", "amplitude_sigma_rad")
        return {f.name: plain(getattr(self, f.name)) for f in fields(self) if f.name not in table}

    @classmethod
    def of_table(cls, table: Table) -> RingDown:
        """The swing from the plain values of `to_dict`, of a document that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_dict` gave.

        Returns
        -------
        RingDown
            The swing, without its turning points.

        Raises
        ------
        PydpendError
            Naming the key that is missing or not what it must be; of the kind of the document's errors.
        """
        none = np.zeros(0)
        chi2 = table.table("chi2_by_laws")
        numbers = {
            f.name: table.number_or_nan(f.name) for f in fields(cls) if f.type == "float" and f.name != "q"
        }
        q = table.number_or_nan("q")
        return cls(
            name=table.text("name"),
            link=table.text("link"),
            swings=table.whole("swings"),
            laws=table.texts("laws"),
            rates=table.numbers_or_nan("rates"),
            rates_sigma=table.numbers_or_nan("rates_sigma"),
            # Without losses it is infinite, which JSON cannot hold.
            q=float("inf") if np.isnan(q) else q,
            chi2_by_laws={laws: chi2.number_or_nan(laws) for laws in chi2},
            t_s=none,
            amplitude_rad=none,
            amplitude_sigma_rad=none,
            **numbers,
        )


@typed()
def ring_down(
    angles: LinkAngles, link: str | None = None, *, start_s: float | None = None, stop_s: float | None = None
) -> RingDown:
    """Period, damping law, logarithmic decrement and quality factor of a single pendulum that swings freely.

    Parameters
    ----------
    angles : LinkAngles
        Angles with one link that swings to and fro.
    link : str, optional
        Which link; the only one if not given.
    start_s, stop_s : float, optional
        The free swing's first and last time, s; all of the recording if not given.

    Returns
    -------
    RingDown
        What the swing tells.

    Raises
    ------
    AnglesError
        For fewer than three swings, several links of which none is named, or a motion that is no single pendulum's.
    """
    if link is None and angles.links > 1:
        advice = f"Name one of {', '.join(angles.link_names)}, or take it by " + SELECT
        raise AnglesError(fault(angles.name, f"angles of {angles.links} links", advice))
    one = angles.select(link if link is not None else angles.link_names[0]).between(start_s, stop_s)
    moving = states(one)
    turns, phi, sigma = _turning_points(moving)
    if turns.size < 2 * LEAST_SWINGS + 1:
        problem = f"{turns.size} turning points, which are fewer than {LEAST_SWINGS} swings"
        raise AnglesError(fault(one.name, problem, "Give a longer recording, or another part with " + START))
    middle = float(np.median(phi[1:-1] / 2 + (phi[:-2] + phi[2:]) / 4))
    amplitude = np.abs(phi - middle)
    crossings, crossing_sigma = _crossings(moving, middle, turns)
    half = np.diff(crossings)
    usual = float(np.median(half))
    if np.ptp(half) > UNEVEN * usual * (1 + float(amplitude.max()) ** 2 / 4):
        raise AnglesError(
            fault(
                one.name,
                f"its half swings take {half.min():.3g} to {half.max():.3g} s: this is no single pendulum's free swing",
                "Give the part that swings freely with " + START,
            )
        )
    period = _period(crossings, crossing_sigma, turns, amplitude)
    # A rise of the period that is nearer gravity's 1/16 than none.
    in_gravity = period[2] > 1 / 32
    decay = _decay(turns, amplitude, sigma, in_gravity=in_gravity)
    at = float(np.sqrt(amplitude[0] * amplitude[-1]))
    powers = np.array([{"viscous": 1.0, "quadratic": at, "dry": 1 / at}[law] for law in decay.laws])
    whole = period[0] * (1 + period[2] * at**2)
    if in_gravity:
        powers = powers * [float(_wide(law, np.array(at))) for law in decay.laws]
        whole += period[0] * float(_beyond(np.array(at)))
    decrement = whole * float(powers @ decay.rates)
    error = whole * float(np.sqrt(powers @ decay.covariance @ powers))
    return RingDown(
        one.name,
        one.link_names[0],
        (crossings.size - 1) // 2,
        *period,
        middle,
        float(amplitude[0]),
        float(amplitude[-1]),
        decay.laws,
        tuple(decay.rates.tolist()),
        tuple(np.sqrt(np.diag(decay.covariance)).tolist()),
        decrement,
        error,
        float(np.pi / decrement) if decrement > 0 else float("inf"),
        at,
        decay.chi2,
        turns,
        amplitude,
        sigma,
    )


def _error(moving: LinkStates, which: int) -> Array:
    """Standard uncertainties (T,) of angles (0) or rates (1); those of a table without noise are rounded to 0."""
    return np.asarray(np.sqrt(np.maximum(moving.covariance[:, 0, which, which], 0.0)))


def _turning_points(moving: LinkStates) -> tuple[Array, Array, Array]:
    """Times, angles and their standard uncertainties where the rate changes its sign for good."""
    t, w = moving.t_s, moving.w_rad_s[:, 0]
    w_sigma = _error(moving, 1)
    # A rate below four of its errors has no sure sign: at rest there are no turns.
    sign = np.where(np.abs(w) > 4 * w_sigma, np.sign(w), 0.0)
    sure = np.flatnonzero(sign)
    change = np.flatnonzero(np.diff(sign[sure]))
    rows = []
    for i in change:
        a, b = int(sure[i]), int(sure[i + 1])
        inside = np.flatnonzero(np.diff(np.sign(w[a : b + 1]))) + a
        rows.append(int(inside[len(inside) // 2]))
    k = np.array(rows, dtype=np.int64)
    if not k.size:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    # The rate's zero between two samples, and the angle there by the parabola.
    share = w[k] / (w[k] - w[k + 1])
    step = t[k + 1] - t[k]
    at = t[k] + share * step
    phi = moving.phi_rad[k, 0] + w[k] * share * step / 2
    return at, phi, _error(moving, 0)[k]


def _crossings(moving: LinkStates, middle: float, turns: Array) -> tuple[Array, Array]:
    """Times of the passages through the middle between the first and last turning point, and their uncertainties."""
    t, off = moving.t_s, moving.phi_rad[:, 0] - middle
    k = np.flatnonzero(off[:-1] * off[1:] < 0)
    share = off[k] / (off[k] - off[k + 1])
    at = t[k] + share * (t[k + 1] - t[k])
    keep = (at > turns[0]) & (at < turns[-1])
    rate = np.abs(moving.w_rad_s[k, 0])
    sigma = _error(moving, 0)[k] / rate
    return at[keep], sigma[keep]


def _period(
    crossings: Array, sigma: Array, turns: Array, amplitude: Array
) -> tuple[float, float, float, float]:
    """Period of a small swing and its rise with the amplitude squared, each with its standard uncertainty.

    Each passage is at ``t0 + T0 sum (1/2)(1 + k A^2 + ...)``, the rest as in gravity where k is: least squares over all
    passages.
    """
    mean = np.interp((crossings[1:] + crossings[:-1]) / 2, turns, amplitude)

    def summed(halves: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum(halves) / 2])

    count, square, rest = summed(np.ones(mean.size)), summed(mean**2), summed(_beyond(mean))
    side = np.arange(crossings.size) % 2
    # The middle may be off: passages to the right come late by what those to the left come early.
    t0 = 2 * float(np.median(np.diff(crossings)))
    weight = 1 / np.maximum(sigma, 1e-12 + 1e-6 * t0)
    if float(np.ptp(mean)) < 0.05 * float(mean.max()) or float(mean.max()) < 0.1:
        # Nothing tells the rise from the period itself: gravity's is taken.
        design = np.column_stack([np.ones(count.size), count + square / 16 + rest, side])
        found, inverse, scale = _solved(design * weight[:, None], crossings * weight)
        return float(found[1]), scale * float(np.sqrt(inverse[1, 1])), 1 / 16, float("nan")
    k = 0.0
    for beyond in (rest, 0 * rest):
        design = np.column_stack([np.ones(count.size), count + beyond, square, side])
        found, inverse, scale = _solved(design * weight[:, None], crossings * weight)
        k = float(found[2] / found[1])
        if k > 1 / 32:
            break
    slope = np.array([-k, 1.0]) / found[1]
    error = float(np.sqrt(slope @ inverse[1:3, 1:3] @ slope))
    return float(found[1]), scale * float(np.sqrt(inverse[1, 1])), k, scale * error


def _beyond(amplitude: Array) -> Array:
    """The part of a pendulum's period, over that of a small swing, beyond ``1 + A^2 / 16``."""
    a = np.clip(amplitude, 0.0, 3.1)
    return np.asarray(2 / np.pi * scipy.special.ellipk(np.sin(a / 2) ** 2) - 1 - a**2 / 16)


def _solved(design: Array, wanted: Array) -> tuple[Array, Array, float]:
    """Least squares: solution, inverse of the normal matrix, and by what the residuals scale the errors, at least 1."""
    size = np.sqrt((design**2).sum(axis=0))
    found, *_ = np.linalg.lstsq(design / size, wanted, rcond=None)
    left = wanted - design @ (found / size)
    dof = max(wanted.size - size.size, 1)
    inverse = np.linalg.inv((design / size).T @ (design / size)) / np.outer(size, size)
    return found / size, np.asarray(inverse), max(1.0, float(np.sqrt((left**2).sum() / dof)))


@dataclass(frozen=True, eq=False)
class _Decay:
    laws: tuple[str, ...]
    rates: Array
    covariance: Array
    chi2: dict[str, float]


def _wide(law: str, amplitude: Array) -> Array:
    """How much faster than a small swing's law the amplitude of a pendulum falls at an amplitude, by the energy lost.

    A swing loses ``4 A c`` to dry friction, ``b`` times the integral of w^2 dphi to drag and ``a`` times that of w dphi
    to viscous friction, of an energy ``1 - cos A``.
    """
    a = np.clip(amplitude, 1e-3, 3.1)
    slower = 2 / np.pi * scipy.special.ellipk(np.sin(a / 2) ** 2)
    common = a / np.sin(a) / slower
    if law == "dry":
        return np.asarray(common)
    if law == "quadratic":
        return np.asarray(common * (np.sin(a) - a * np.cos(a)) / (a**3 / 3))
    # By phi = A sin u the integrand is smooth, so that few nodes are exact.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    u = np.pi / 4 * (nodes + 1)
    phi = a[..., None] * np.sin(u)
    speed = np.sqrt(np.maximum(2 * (np.cos(phi) - np.cos(a)[..., None]), 0.0))
    whole = np.pi / 4 * (weights * speed * a[..., None] * np.cos(u)).sum(axis=-1)
    return np.asarray(common * whole / (np.pi * a**2 / 4))


def _decay(t: Array, amplitude: Array, sigma: Array, *, in_gravity: bool) -> _Decay:
    """The laws that the amplitudes need, with their rates."""
    fits = {}
    floor = np.maximum(sigma, 1e-9 * amplitude.max())
    for count in range(1, len(LAWS) + 1):
        for laws in combinations(LAWS, count):
            fits[laws] = _fitted(laws, t, amplitude, floor, in_gravity)
    chi2 = {" and ".join(laws): fit[2] / max(t.size - len(laws) - 1, 1) for laws, fit in fits.items()}
    # Where none fits to the errors, these are larger than stated.
    unit = max(1.0, min(chi2.values()))
    allowed = {laws: fit for laws, fit in fits.items() if (fit[0] > 0).all()}
    if not allowed or amplitude[-1] >= amplitude[0]:
        raise AnglesError(
            fault("swing", "the amplitude does not fall", "Give the part that swings freely with " + START)
        )

    def cost(laws: tuple[str, ...]) -> float:
        """Bayes' criterion."""
        return float(allowed[laws][2] / unit + len(laws) * np.log(t.size))

    laws = min(allowed, key=cost)
    rates, covariance, _ = allowed[laws]
    return _Decay(laws, rates, covariance * max(1.0, chi2[" and ".join(laws)]), chi2)


def _fitted(
    laws: tuple[str, ...], t: Array, amplitude: Array, sigma: Array, in_gravity: bool
) -> tuple[Array, Array, float]:
    """Rates of some laws, their covariance, and chi-square."""
    power = {"viscous": 1, "quadratic": 2, "dry": 0}
    span, top = float(t[-1] - t[0]), float(amplitude[0])
    grid = np.linspace(t[0], t[-1], max(400, 8 * t.size))
    fall = max(top - float(amplitude[-1]), 1e-6 * top) / span

    table = np.linspace(0.0, 1.5 * top, 400)
    speeds = np.stack([(table / top) ** power[law] for law in laws])
    if in_gravity:
        speeds = speeds * np.stack([_wide(law, table) for law in laws])

    def model(x: Array) -> Array:
        total = fall * (x[1:] @ speeds)
        a = np.empty(grid.size)
        a[0] = x[0] * top
        step, width = float(grid[1] - grid[0]), float(table[1])
        known = total.tolist()

        def rate(value: float) -> float:
            place = min(max(value / width, 0.0), len(known) - 1.001)
            i = int(place)
            return -float(known[i] + (place - i) * (known[i + 1] - known[i]))

        for i in range(grid.size - 1):
            half = a[i] + step / 2 * rate(a[i])
            a[i + 1] = a[i] + step * rate(half)
        return np.asarray(np.interp(t, grid, a))

    start = np.concatenate([[1.0], np.full(len(laws), 1.0 / len(laws))])

    def misfit(x: Array) -> Array:
        return np.asarray((model(x) - amplitude) / sigma)

    found = scipy.optimize.least_squares(misfit, start, x_scale=1.0, xtol=1e-12, ftol=1e-12)
    scale = np.array([fall / top ** power[law] for law in laws])
    jacobian = np.asarray(found.jac, dtype=np.float64)
    inverse = np.linalg.pinv(jacobian.T @ jacobian)[1:, 1:] * np.outer(scale, scale)
    return found.x[1:] * scale, np.asarray(inverse), float(2 * found.cost)
