"""A monotone smoothing spline as a pivot law: when no physics fits, the points themselves speak.

The logarithm of the compliance is piecewise linear in the logarithm of the load. Whatever its values, the
deflection rises with load; where the points end, the last slope goes on as a power law. Its bends are held
down by a prior (a random walk of the slope), which is what a smoothing spline is (Wahba, 1990), and which
also widens the band outside the points.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray

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
        logs = np.insert(q, FIXED, 0.0)
        weighted = GRID_LOAD * np.exp(GRID_WEIGHTS @ logs)  # d phi / d ln u on the grid
        columns = np.column_stack([weighted, weighted[:, None] * np.delete(GRID_WEIGHTS, FIXED, axis=1)])
        # below the grid the compliance is a power of the load, integrable whatever the slope says
        slope = max((logs[1] - logs[0]) / (NODES[1] - NODES[0]), -0.9)
        total = np.vstack(
            [np.zeros(columns.shape[1]), np.cumsum(0.5 * GRID_STEP * (columns[1:] + columns[:-1]), axis=0)]
        )
        below = columns[0] / (1.0 + slope)
        # that share changes with the slope, so with the first two nodes (both free: the fixed one lies higher up)
        turn = below[0] / (1.0 + slope) / (NODES[1] - NODES[0])
        below[1], below[2] = below[1] + turn, below[2] - turn
        total += below
        # between grid points the integral is a power of the load: interpolate its logarithm
        x = np.clip((np.log(np.maximum(u, 1e-12)) - GRID[0]) / GRID_STEP, None, len(GRID) - 1.0)
        cell = np.clip(x.astype(int), 0, len(GRID) - 2)
        part = x - cell
        value = total[:, 0]
        log = np.log(value)
        phi = np.exp((1.0 - part) * log[cell] + part * log[cell + 1])
        relative = total[:, 1:] / value[:, None]
        jacobian = (1.0 - part)[:, None] * relative[cell] + part[:, None] * relative[cell + 1]
        phi = np.where(u > 0.0, phi, 0.0)
        return phi, jacobian * phi[:, None]


def _interpolation(x: FloatArray) -> FloatArray:
    """Weights (n, nodes) of linear interpolation in ln u; linear extrapolation beyond the ends."""
    cell = np.clip(np.searchsorted(NODES, x) - 1, 0, len(NODES) - 2)
    right = (x - NODES[cell]) / (NODES[cell + 1] - NODES[cell])
    weights = np.zeros((len(x), len(NODES)))
    rows = np.arange(len(x))
    weights[rows, cell] = 1.0 - right
    weights[rows, cell + 1] = right
    return weights


GRID, GRID_STEP = np.linspace(
    np.log(2e-3), np.log(25.0), 320, retstep=True
)  # ln u on which the compliance is integrated
GRID_LOAD = np.exp(GRID)
GRID_WEIGHTS = _interpolation(GRID)
