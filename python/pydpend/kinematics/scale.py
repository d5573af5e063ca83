"""The scale of the centres' stated sigmas by their residuals, as the angles feel it.

Each residual counts as much as its marker does in the angle: ``sum g w r^2 / sum g (1 - h)``, with ``g`` the
marker's share of the frame's information on the angle, times the number of markers, and ``1 - h`` what the fit
leaves of a residual's variance. With equal sigmas and arms that is chi2 over its degrees of freedom. But a half
hidden marker, whose stated sigma is a bound rather than an estimate, has no say in an angle that it hardly moves.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from pydpend.kinematics.table import Floats

PRIOR_DOF = 20.0
"""The stated sigmas count as much as this many degrees of freedom when the residuals rescale them."""

INFLATE_P = 1e-4
"""Below this probability of a frame's chi-square its standard error is scaled up by sqrt(chi2 / dof)."""

REJECT_P = 1e-6
"""A marker is left out if chance makes its squared normalised residual as large less often than this."""

REJECT_HIDDEN_P = 1e-4
"""The bound of `REJECT_P` where a marker of the body is hidden: what hides it may well cover the edge of the next."""

_UNSURE = 5.0
"""A centre whose sigma is this many times the body's usual one is of a marker that is partly hidden."""


def pooled_scale2(scatter: Floats, freedom: Floats, parameters: float = 0.0, dof: float = 1.0) -> float:
    """Square of the factor between true and stated sigmas from all given frames.

    ``scatter`` and ``freedom`` are the two sums of each frame; ``parameters`` of all ``dof`` degrees of freedom went
    into the shape.
    """
    free = float(freedom.sum()) * max(1.0 - parameters / max(dof, 1.0), 0.0)
    return (float(scatter.sum()) + PRIOR_DOF) / (free + PRIOR_DOF)


_SUSPECT = 1.2
"""Beside a hidden marker, one with a sigma this many times its usual one may be covered at its edge."""


def partly_hidden(weight: Floats) -> NDArray[np.bool_]:
    """(T,): frames in which a marker of the body, of weights (T, K), is not seen or far less sure than usual."""
    usual = float(np.median(weight[weight > 0]))
    return np.asarray((weight < usual / _UNSURE**2).any(axis=1))


def suspects(weight: Floats, hidden: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(T, K): markers whose edge may be covered by what hides others of the body, ``hidden`` (T,).

    Their sigma is above their usual one, but not so far that it says by itself how little is known.
    """
    out = np.zeros(weight.shape, dtype=bool)
    for k, own in enumerate(weight.T):
        whole = own[(own > 0) & ~hidden]
        if whole.size:
            usual = np.median(whole)
            out[:, k] = hidden & (own < usual / _SUSPECT**2) & (own > usual / _UNSURE**2)
    return out


def reject_limit(hidden: NDArray[np.bool_]) -> Floats:
    """(T,): squared normalised residual (two degrees of freedom) above which a marker is left out."""
    return np.where(hidden, scipy.special.chdtri(2, REJECT_HIDDEN_P), scipy.special.chdtri(2, REJECT_P))


def hidden_factor(scatter: Floats, freedom: Floats, hidden: NDArray[np.bool_], scale2: float) -> float:
    """The factor by which the angle errs more where the body is partly hidden, 1 or more.

    What hides one marker covers the edge of its neighbour: that centre is off by more than its sigma says, and with
    the others missing nothing in the frame shows it. Over a recording the residuals do.
    """
    return max(1.0, float(np.sqrt(pooled_scale2(scatter[hidden] / scale2, freedom[hidden]))))


def inflation(chi2: Floats, dof: NDArray[np.int64]) -> Floats:
    """Factor on a frame's standard error: 1, or sqrt(chi2 / dof) where chance cannot explain chi2."""
    limit = np.asarray(scipy.special.chdtri(np.arange(1, max(int(dof.max(initial=1)), 1) + 1), INFLATE_P))
    some = np.maximum(dof, 1)
    return np.where((dof > 0) & (chi2 > limit[some - 1]), np.sqrt(chi2 / some), 1.0)
