"""Loading and unloading: the loop between the branches, its energy and loss factor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tpjb_ident.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Hysteresis:
    """Loop of one load cycle.

    Attributes
    ----------
    energy, energy_se : float
        Area between the branches [J] over the loads that both cover.
    loss_factor, loss_factor_se : float
        energy / (pi dF dx / 4), with dF and dx the ranges of load and deflection of the loop: for an
        elliptic loop the tangent of the loss angle.
    load_range : (float, float)
        Loads that both branches cover [N].
    """

    energy: float
    energy_se: float
    loss_factor: float
    loss_factor_se: float
    load_range: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.load_range
        return (
            f"loop from {low:.0f} to {high:.0f} N: {self.energy:.3g} J (se {self.energy_se:.1g}), "
            f"loss factor {self.loss_factor:.3g} (se {self.loss_factor_se:.1g})"
        )


def measure_loop(
    load: FloatArray, deflection: FloatArray, covariance: FloatArray, branch: IntArray
) -> Hysteresis | None:
    """Area between loading and unloading points."""
    up, down = branch > 0, branch < 0
    if up.sum() < 2 or down.sum() < 2:
        return None
    low = max(load[up].min(), load[down].min())
    high = min(load[up].max(), load[down].max())
    if not high > low:
        return None
    grid = np.linspace(low, high, 200)
    width = np.zeros(len(grid))
    gains = np.zeros((2, 200, len(load)))
    for k, mask in enumerate((down, up)):
        order = np.flatnonzero(mask)[np.argsort(load[mask], kind="stable")]
        gains[k][:, order] = _interpolation(grid, load[order])
        width += (1 if k == 0 else -1) * (gains[k][:, order] @ deflection[order])
    # trapezoid weights times interpolation weights: the area is linear in the points, so is its error
    trapezoid = np.full(len(grid), grid[1] - grid[0])
    trapezoid[[0, -1]] *= 0.5
    energy = float(trapezoid @ width)
    sensitivity = trapezoid @ (gains[0] - gains[1])
    energy_se = float(np.sqrt(max(sensitivity @ covariance @ sensitivity, 0.0)))
    ends = np.interp([low, high], np.sort(load[up]), deflection[up][np.argsort(load[up])])
    stored = math.pi / 4.0 * float(high - low) * abs(float(ends[1] - ends[0]))
    if stored == 0.0:
        return None
    return Hysteresis(energy, energy_se, energy / stored, energy_se / stored, (float(low), float(high)))


def _interpolation(grid: FloatArray, knots: FloatArray) -> FloatArray:
    """Weights (grid, knots) of linear interpolation at sorted knots; equal knots are told apart by a hair."""
    x = knots + 1e-9 * max(float(np.ptp(knots)), 1.0) * np.arange(len(knots))
    cell = np.clip(np.searchsorted(x, grid) - 1, 0, len(x) - 2)
    right = np.clip((grid - x[cell]) / (x[cell + 1] - x[cell]), 0.0, 1.0)
    weights = np.zeros((len(grid), len(x)))
    rows = np.arange(len(grid))
    weights[rows, cell] = 1.0 - right
    weights[rows, cell + 1] += right
    return weights
