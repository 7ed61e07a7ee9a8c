"""Systematic errors besides the gains: axes, delays and the housing's mass, as far as the manifest states them.

Each is one number for the whole campaign, so the draws are shared by all points, as those of the gains are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign
from rigdata.vector import directions
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData

_QUANTITIES = ("displacement", "force", "acceleration")


@dataclass(frozen=True)
class GainDraws:
    """Random 2x2 gain errors of the vector quantities.

    A channel's gain error is one number for the whole campaign, so it moves all points together: the draws are shared,
    and the covariance over all points carries the correlation.
    """

    displacement: FloatArray  #: `displacement`, `force`, `acceleration` (n, 2, 2)
    force: FloatArray
    acceleration: FloatArray
    unstated: tuple[str, ...]

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of channels without a stated uncertainty."""
        if not self.unstated:
            return ()
        text = f"no uncertainty in the manifest for {', '.join(self.unstated)}: their systematic part is left out"
        return (Condition("calibration-uncertainty-unstated", text),)


def gain_draws(channels: Mapping[str, Any], n: int, seed: int) -> GainDraws:
    """Draw Gaussian gain errors for every displacement, force and acceleration channel."""
    rng = np.random.default_rng(seed)
    matrices, unstated = {}, []
    for quantity in ("displacement", "force", "acceleration"):
        chosen = [c for c in channels.values() if c.quantity == quantity and c.axis is not None]
        sigma = np.array([c.uncertainty or 0.0 for c in chosen])
        if quantity != "acceleration":
            unstated += [c.name for c in chosen if c.uncertainty is None]
        errors = paired_draws(rng, n, len(chosen)) * sigma
        matrices[quantity] = _on_vectors(np.array([float(c.axis) for c in chosen]), 1 + errors)
    return GainDraws(matrices["displacement"], matrices["force"], matrices["acceleration"], tuple(unstated))


def _on_vectors(axes: FloatArray, gains: NDArray[Any]) -> NDArray[Any]:
    """What gains (n, m) of channels along `axes` (m,) do to X and Y, (n, 2, 2)."""
    if len(axes) < 2:
        return _unit(len(gains))
    along = directions(axes)
    return np.einsum("ac,nc,cb->nab", np.linalg.pinv(along), gains, along)


def _unit(n: int) -> FloatArray:
    return np.broadcast_to(np.eye(2), (n, 2, 2))


def apparent_change(data: PointData, stiffness: DynamicStiffness, draws: GainDraws) -> FloatArray:
    """Change of the eight entries of H in every draw [N/m], shape (n, 8).

    The inertia force is a small part of F; its share of H is found by regression of the housing
    acceleration on the displacements, so each draw takes a few 2x2 products instead of a new fit.
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


@dataclass(frozen=True)
class SystematicSources:
    """Draws of what the manifest states."""

    axes: dict[str, FloatArray]  #: (m,), rad: stated axes of the channels of each quantity
    turns: dict[str, FloatArray]  #: (n, m), rad
    delays: dict[str, FloatArray]  #: (n, m), s
    mass: FloatArray  #: (n,)

    def changes(self, data: PointData, stiffness: DynamicStiffness) -> dict[str, FloatArray]:
        """Change of the eight entries of H in every draw [N/m], (n, 8), by source."""
        table = {}
        if self.turns:
            table["axis"] = apparent_change(data, stiffness, self._draws(self._turned))
        if self.delays:
            table["delay"] = apparent_change(data, stiffness, self._draws(lambda q: self._delayed(q, stiffness.omega)))
        if len(self.mass):
            heavier = np.eye(2) * (1 + self.mass)[:, None, None]
            identity = np.broadcast_to(np.eye(2), heavier.shape)
            table["mass"] = apparent_change(data, stiffness, GainDraws(identity, identity, heavier, ()))
        return table

    def _draws(self, matrices: Any) -> GainDraws:
        displacement, force, acceleration = (matrices(quantity) for quantity in _QUANTITIES)
        return GainDraws(displacement, force, acceleration, ())

    def _turned(self, quantity: str) -> FloatArray:
        axes = self.axes[quantity]
        if quantity not in self.turns or len(axes) < 2:
            return _unit(_count(self.turns))
        return np.einsum("ac,ncb->nab", np.linalg.pinv(directions(axes)), directions(axes + self.turns[quantity]))

    def _delayed(self, quantity: str, omega: float) -> NDArray[Any]:
        if quantity not in self.delays:
            return _unit(_count(self.delays))
        return _on_vectors(self.axes[quantity], np.exp(-1j * omega * self.delays[quantity]))


def _count(draws: Mapping[str, FloatArray]) -> int:
    return len(next(iter(draws.values())))


def systematic_sources(campaign: Campaign, n: int, seed: int) -> SystematicSources:
    """Draw axes, delays and mass within what the manifest states, in pairs of opposite sign.

    Channels of one clock, or of one quantity where no clock is stated, share one device and so the error of its delay.
    """
    chosen = {q: [c for c in campaign.channels.values() if c.quantity == q and c.axis is not None] for q in _QUANTITIES}
    rng = np.random.default_rng(seed)
    turns, delays = {}, {}
    devices: dict[str, FloatArray] = {}
    for quantity, channels in chosen.items():
        sigma = np.array([getattr(c, "axis_uncertainty", 0.0) for c in channels])
        if sigma.any():
            turns[quantity] = paired_draws(rng, n, len(channels)) * sigma
        late = np.array([getattr(c, "delay_uncertainty", 0.0) for c in channels])
        if late.any():
            for channel in channels:
                devices.setdefault(channel.clock or quantity, paired_draws(rng, n, 1)[:, 0])
            delays[quantity] = np.stack([devices[c.clock or quantity] for c in channels], axis=1) * late
    uncertain = getattr(campaign, "mass_uncertainty", 0.0)
    mass = paired_draws(rng, n, 1)[:, 0] * uncertain / campaign.housing_mass if uncertain else np.empty(0)
    axes = {q: np.array([float(c.axis or 0.0) for c in channels]) for q, channels in chosen.items()}
    return SystematicSources(axes, turns, delays, mass)


def paired_draws(rng: np.random.Generator, n: int, *shape: int) -> FloatArray:
    """Standard normal draws in pairs of opposite sign, so that they have no mean, (n, *shape)."""
    half = rng.standard_normal((max(n // 2, 1), *shape))
    return np.concatenate([half, -half])
