"""Points that two moving bodies share, or that a body has in common with the ground: joints, tested for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pydpend.kinematics.constant_distances import LEAST_TOGETHER, Complex, trimmed_rms
from pydpend.kinematics.table import Floats
from pydpend.series import correlation_time

LEAST_TURN = np.radians(1.0)
"""Standard deviation of a turn against each other, rad, below which two bodies show no joint."""

SURE = 0.05
"""A joint must be known to this part of the bodies' size, as a standard uncertainty."""

MISSES = 1.3
"""Bodies that miss a point by more than this many times their noise do not share it."""

MOST = 0.95
"""Part of the frames that counts for a joint: two bodies have a wrong place more often than two markers."""

ARC = np.radians(15.0)
"""A circle is told by an arc of at least this, rad."""

SLACK = 5e-4
"""Part of its distance from a body's middle by which a shared point may be off beyond noise: the camera's rest."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The pose of a body of K markers in T frames: ``place + turn * u`` of the point u of the body.

    ``turn`` is 1 and ``place`` 0 for the ground. ``spread2``: sum of the squared arms, px^2; 0 for one marker, whose
    turn is not known. NaN where not seen.
    """

    turn: Complex
    place: Complex
    template: Complex
    spread2: float
    sigma: float

    @staticmethod
    def ground(frames: int) -> Motion:
        """The pose of what does not move."""
        return Motion(np.ones(frames, complex), np.zeros(frames, complex), np.zeros(0, complex), np.inf, 0.0)

    @staticmethod
    def of(places: Complex, sigma: float) -> Motion:
        """The poses of a body by its markers' places (T, K), of which ``sigma`` is the noise."""
        if places.shape[1] == 1:
            nothing = np.full(len(places), np.nan + 0j)
            return Motion(nothing, places[:, 0], np.zeros(1, complex), 0.0, sigma)
        start = int(np.argmax(np.isfinite(places).sum(axis=1)))
        template = places[start] - np.nanmean(places[start])
        for _ in range(4):
            turn, place = _posed(places, template)
            local = (places - place[:, None]) * turn.conj()[:, None]
            template = np.array([_middle(column) for column in local.T])
            template = template - np.nanmean(template)
        turn, place = _posed(places, template)
        return Motion(turn, place, template, float(np.nansum(np.abs(template) ** 2)), sigma)

    def variance(self, u: complex) -> float:
        """Variance of the place of a point u of the body along each axis, px^2."""
        if np.isinf(self.spread2):
            return 0.0
        arm = abs(u) ** 2 / self.spread2 if self.spread2 else 0.0
        return self.sigma**2 * (1 / self.template.size + arm)


def _middle(z: Complex) -> complex:
    """The median of each coordinate; not a number where nothing is seen."""
    z = z[np.isfinite(z)]
    return complex(np.median(z.real), np.median(z.imag)) if z.size else complex(np.nan, np.nan)


def _posed(places: Complex, template: Complex) -> tuple[Complex, Complex]:
    """Turn and place of each frame by at least two markers."""
    known = np.isfinite(places) & np.isfinite(template)
    count = known.sum(axis=1)
    some = np.maximum(count, 1)
    here = np.where(known, places, 0).sum(axis=1) / some
    there = np.where(known, template, 0).sum(axis=1) / some
    along = np.where(known, (places - here[:, None]) * (template - there[:, None]).conj(), 0).sum(axis=1)
    size = np.abs(along)
    turn = np.where((count > 1) & (size > 0), along / np.where(size > 0, size, 1), np.nan)
    return np.asarray(turn), np.asarray(here - turn * there)


@dataclass(frozen=True, eq=False)
class Shared:
    """A point that two bodies share: where it is on each, how far they miss it over noise, and how well it is known."""

    on: tuple[complex, complex]
    misfit: float
    sigma_px: float

    @property
    def is_joint(self) -> bool:
        """Whether noise explains by how much they miss it."""
        return self.misfit < MISSES


def shared_point(one: Motion, other: Motion, size_px: float) -> Shared | None:
    """The point nearest to being fixed in both; None where they hardly turn against each other or are hardly seen.

    ``size_px``: the mechanism's, for how well it must be known.
    """
    if one.spread2 == 0 or other.spread2 == 0:
        return _on_circle(one, other, size_px)
    seen = np.isfinite(one.turn) & np.isfinite(other.turn)
    if seen.sum() < LEAST_TOGETHER:
        return None
    design = np.stack([one.turn[seen], -other.turn[seen]], axis=1)
    wanted = (other.place - one.place)[seen]
    apart = 1 - abs(complex((design[:, 0].conj() * -design[:, 1]).mean())) ** 2
    if apart < LEAST_TURN**2:
        return None
    found, *_ = np.linalg.lstsq(design, wanted, rcond=None)
    left = wanted - design @ found
    keep = np.abs(left) <= np.quantile(np.abs(left), MOST)
    found, *_ = np.linalg.lstsq(design[keep], wanted[keep], rcond=None)
    left = wanted - design @ found
    rms = trimmed_rms(np.abs(left), MOST) / np.sqrt(2)
    u, v = complex(found[0]), complex(found[1])
    slack = SLACK * max(abs(u), abs(v) if np.isfinite(other.spread2) else 0.0)
    expected = float(np.sqrt(one.variance(u) + other.variance(v) + slack**2))
    together = max(correlation_time(left.real), correlation_time(left.imag))
    sigma = rms * np.sqrt(together / (seen.sum() * apart))
    if sigma > SURE * size_px:
        return None
    return Shared((u, v), rms / expected, float(sigma))


def _on_circle(one: Motion, other: Motion, size_px: float) -> Shared | None:
    """The point of one body about which the other's only marker goes round; None for two of one marker."""
    if one.spread2 == 0:
        turned = _on_circle(other, one, size_px) if other.spread2 else None
        return None if turned is None else Shared(turned.on[::-1], turned.misfit, turned.sigma_px)
    z = (other.place - one.place) * one.turn.conj()
    z = z[np.isfinite(z)]
    if z.size < LEAST_TOGETHER or not np.abs(z - z.mean()).max() > 0:
        return None
    centre, radius, sigma = _circle(z)
    off = np.abs(np.abs(z - centre) - radius)
    z = z[off <= np.quantile(off, MOST)]
    centre, radius, sigma = _circle(z)
    if not (np.isfinite(radius) and sigma < SURE * radius):
        return None
    angle = np.sort(np.angle(z - centre))
    arc = 2 * np.pi - float(np.diff(angle, append=angle[0] + 2 * np.pi).max())
    if arc < ARC:
        return None
    rms = trimmed_rms(np.abs(z - centre) - radius)
    expected = np.sqrt(other.sigma**2 + one.variance(centre) + (SLACK * radius) ** 2)
    return Shared((centre, 0j), float(rms / expected), sigma)


def _circle(z: Complex) -> tuple[complex, float, float]:
    """Centre, radius and the centre's standard uncertainty of the circle through places (T,), by Gauss and Newton."""
    middle = z.mean()
    x = z - middle
    scale = float(np.abs(x).max())
    x = x / scale
    design = np.stack([2 * x.real, 2 * x.imag, np.ones(x.size)], axis=1)
    a, b, c = np.linalg.lstsq(design, np.abs(x) ** 2, rcond=None)[0]
    unknown = np.array([a, b, np.sqrt(max(c + a * a + b * b, 1e-12))])
    slopes = design
    for _ in range(10):
        off = x - complex(unknown[0], unknown[1])
        distance = np.maximum(np.abs(off), 1e-12)
        slopes = np.stack([-off.real / distance, -off.imag / distance, -np.ones(x.size)], axis=1)
        step, *_ = np.linalg.lstsq(slopes, -(distance - unknown[2]), rcond=None)
        unknown = unknown + step
        if np.abs(step).max() < 1e-10:
            break
    left = np.abs(x - complex(unknown[0], unknown[1])) - unknown[2]
    inverse: Floats = np.linalg.pinv(slopes.T @ slopes)
    sigma = trimmed_rms(left) * float(np.sqrt(max(inverse[0, 0], inverse[1, 1]) * correlation_time(left)))
    return complex(middle + scale * complex(unknown[0], unknown[1])), float(scale * unknown[2]), scale * sigma
