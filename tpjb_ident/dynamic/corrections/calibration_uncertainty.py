"""Systematic uncertainty: what calibration errors within the manifest's limits do to the coefficients.

A channel's gain error is one number for the whole campaign, so it moves all points together: the
draws are shared, and the covariance over all points carries the correlation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData


@dataclass(frozen=True)
class GainDraws:
    """Random 2x2 gain errors of the vector quantities.

    Attributes
    ----------
    displacement, force, acceleration : (n, 2, 2) ndarray
        What a true vector (X, Y) is multiplied by in a draw; the unit matrix when nothing is known.
    unstated : tuple of str
        Displacement and force channels without a stated uncertainty.
    """

    displacement: FloatArray
    force: FloatArray
    acceleration: FloatArray
    unstated: tuple[str, ...]

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of channels without a stated uncertainty."""
        if not self.unstated:
            return ()
        told = f"no uncertainty in the manifest for {', '.join(self.unstated)}: their systematic part is left out"
        return (Condition("calibration-uncertainty-unstated", told),)


def gain_draws(channels: Mapping[str, Any], n: int, seed: int) -> GainDraws:
    """Draw Gaussian gain errors for every displacement, force and acceleration channel.

    Parameters
    ----------
    channels : mapping of str to rigdata.calibration.Channel
    n : int
        Draws; they come in pairs of opposite sign, so that their mean is zero.
    seed : int
    """
    rng = np.random.default_rng(seed)
    matrices, unstated = {}, []
    for quantity in ("displacement", "force", "acceleration"):
        chosen = [c for c in channels.values() if c.quantity == quantity and c.axis is not None]
        sigma = np.array([c.uncertainty or 0.0 for c in chosen])
        if quantity != "acceleration":
            unstated += [c.name for c in chosen if c.uncertainty is None]
        half = rng.standard_normal((max(n // 2, 1), len(chosen)))
        errors = np.concatenate([half, -half]) * sigma
        matrices[quantity] = _vector_gains([float(c.axis) for c in chosen], errors)
    return GainDraws(matrices["displacement"], matrices["force"], matrices["acceleration"], tuple(unstated))


def _vector_gains(axes: list[float], errors: FloatArray) -> FloatArray:
    """Channels along `axes` with relative errors -> matrices on (X, Y), shape (n, 2, 2)."""
    if len(axes) < 2:
        return np.broadcast_to(np.eye(2), (len(errors), 2, 2)).copy()
    directions = np.stack([np.cos(axes), np.sin(axes)], axis=1)
    return np.einsum("ac,nc,cb->nab", np.linalg.pinv(directions), 1 + errors, directions)


def apparent_change(data: PointData, stiffness: DynamicStiffness, draws: GainDraws) -> FloatArray:
    """Change of the eight entries of H in every draw [N/m], shape (n, 8).

    The inertia force is a small part of F; its share of H is found by regression of the housing
    acceleration on the displacements, so each draw takes a few 2x2 products instead of a new fit.

    Parameters
    ----------
    data : PointData
    stiffness : DynamicStiffness
    draws : GainDraws
    """
    h = stiffness.h
    if not np.isfinite(h).all():
        return np.full((len(draws.force), 8), np.nan)
    weights = stiffness.weights.min(axis=1)
    good = (weights > 0) & np.isfinite(data.D).all(axis=1) & np.isfinite(data.A).all(axis=1)
    root = np.sqrt(weights[good])[:, None]
    inertia = data.runs[0].housing_mass * np.linalg.lstsq(data.D[good] * root, data.A[good] * root, rcond=None)[0].T
    if not np.isfinite(inertia).all() or data.runs[0].acceleration is None:
        inertia = np.zeros((2, 2), dtype=complex)
    inverse = np.linalg.inv(draws.displacement)
    drawn = (draws.force @ (h - inertia) + draws.acceleration @ inertia) @ inverse
    change = (drawn - h).reshape(len(drawn), 4)
    return np.concatenate([change.real, change.imag], axis=1)
