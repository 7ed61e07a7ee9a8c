"""A monotone smoothing spline as a pivot law: when no physics fits, the points themselves speak.

The logarithm of the compliance is piecewise linear in the logarithm of the load. Whatever its values, the
deflection rises with load; where the points end, the last slope goes on as a power law. Its bends are held
down by a prior (a random walk of the slope), which is what a smoothing spline is (Wahba, 1990), and which
also widens the band outside the points.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NODES = np.log(np.array([0.08, 0.16, 0.3, 0.55, 1.0, 1.6, 2.4, 4.0]))  # ln(W / W_r); the one at 0 is the scale
FIXED = 4  # the node at the reference load: its value is zero, the scale stands beside it
TYPICAL_SLOPE = -0.15  # of ln(compliance) over ln(load), between linear (0) and a sphere (-1/3)
SLOPE_SPREAD = 0.25
BEND_SPREAD = 0.2  # change of that slope from node to node, standard deviation


def _prior() -> tuple[FloatArray, FloatArray]:
    """Mean (k,) and precision (k, k): a slope at the reference load, and small bends."""
    free = np.delete(np.arange(len(NODES)), FIXED)
    slopes = np.zeros((len(NODES) - 1, len(NODES)))
    gaps = np.diff(NODES)
    for j in range(len(NODES) - 1):
        slopes[j, j], slopes[j, j + 1] = -1.0 / gaps[j], 1.0 / gaps[j]
    bends = np.diff(slopes, axis=0) / BEND_SPREAD
    rows = np.vstack([bends, slopes[FIXED] / SLOPE_SPREAD])[:, free]
    return TYPICAL_SLOPE * NODES[free], rows.T @ rows


@dataclass(frozen=True)
class SplineLaw:
    """Monotone smoothing spline; the shape parameters are ln(compliance) at the nodes."""

    name: str = "spline"
    prior: tuple[FloatArray, FloatArray] = field(default_factory=_prior, repr=False)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the free nodes."""
        return tuple(f"ln psi({np.exp(x):.2g})" for k, x in enumerate(NODES) if k != FIXED)

    @property
    def prior_mean(self) -> FloatArray:
        """(k,) a gentle power law."""
        return self.prior[0]

    @property
    def prior_precision(self) -> FloatArray:
        """(k, k) what holds the bends down."""
        return self.prior[1]

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Wide: nothing here can break monotony."""
        k = len(NODES) - 1
        return np.full(k, -4.0), np.full(k, 4.0)

    def psi(self, u: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compliance shape and its derivative; see `Law.psi`."""
        weights = _interpolation(np.log(np.maximum(u, 1e-9)))
        value = np.exp(weights @ np.insert(q, FIXED, 0.0))
        return value, np.delete(weights, FIXED, axis=1) * value[:, None]

    def phi(self, u: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deflection shape and its derivative; see `Law.phi`."""
        # between nodes the compliance is a power of u: each piece integrates exactly
        full = np.insert(q, FIXED, 0.0)
        value = _integral(u, full)
        jacobian = np.empty((len(u), len(full)))
        for j in range(len(full)):
            step = np.zeros(len(full))
            step[j] = 1e-4
            jacobian[:, j] = (_integral(u, full + step) - _integral(u, full - step)) / 2e-4
        return value, np.delete(jacobian, FIXED, axis=1)


def _interpolation(x: FloatArray) -> FloatArray:
    """Weights (n, nodes) of linear interpolation in ln u; linear extrapolation beyond the ends."""
    cell = np.clip(np.searchsorted(NODES, x) - 1, 0, len(NODES) - 2)
    right = (x - NODES[cell]) / (NODES[cell + 1] - NODES[cell])
    weights = np.zeros((len(x), len(NODES)))
    rows = np.arange(len(x))
    weights[rows, cell] = 1.0 - right
    weights[rows, cell + 1] = right
    return weights


def _integral(u: FloatArray, logs: FloatArray) -> FloatArray:
    """Integral of the compliance from zero to u (n,)."""
    slopes = np.diff(logs) / np.diff(NODES)
    # towards zero load the compliance must stay integrable
    slopes[0] = max(slopes[0], -0.95)
    knots = np.exp(NODES)
    left = np.exp(logs[:-1]) / knots[:-1] ** slopes
    power = slopes + 1.0
    power = np.where(np.abs(power) < 1e-9, 1e-9, power)
    lower = knots[:-1].copy()
    lower[0] = 0.0
    first = np.where(lower > 0, np.where(lower > 0, lower, 1.0) ** power, 0.0)
    upper = knots[1:].copy()
    whole = left / power * (upper**power - first)
    start = np.r_[0.0, np.cumsum(whole)[:-1]]
    cell = np.clip(np.searchsorted(knots, u) - 1, 0, len(NODES) - 2)
    inside = left[cell] / power[cell] * (np.maximum(u, 0.0) ** power[cell] - first[cell])
    return np.asarray(start[cell] + inside)
