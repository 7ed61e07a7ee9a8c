"""Systematic errors besides the gains: axes, delays and the housing's mass, as far as the manifest states them.

Each is one number for the whole campaign, so the draws are shared by all points, as those of the gains are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigdata.campaign import Campaign
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.corrections.calibration_uncertainty import GainDraws, apparent_change
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData

_QUANTITIES = ("displacement", "force", "acceleration")


@dataclass(frozen=True)
class SystematicSources:
    """Draws of what the manifest states.

    Attributes
    ----------
    axes : dict of str to (m,) ndarray
        Stated axes of the channels of each quantity [rad].
    turns, delays : dict of str to (n, m) ndarray
        Drawn errors of axes [rad] and delays [s]; empty where none is stated.
    mass : (n,) ndarray
        Drawn relative errors of the housing's mass; empty where none is stated.
    """

    axes: dict[str, FloatArray]
    turns: dict[str, FloatArray]
    delays: dict[str, FloatArray]
    mass: FloatArray

    def changes(self, data: PointData, stiffness: DynamicStiffness) -> dict[str, FloatArray]:
        """Change of the eight entries of H in every draw [N/m], (n, 8), by source.

        Parameters
        ----------
        data : PointData
        stiffness : DynamicStiffness
        """
        found = {}
        if self.turns:
            found["axis"] = apparent_change(data, stiffness, self._draws(self._turned))
        if self.delays:
            found["delay"] = apparent_change(data, stiffness, self._draws(lambda q: self._delayed(q, stiffness.omega)))
        if len(self.mass):
            heavier = np.eye(2) * (1 + self.mass)[:, None, None]
            same = np.broadcast_to(np.eye(2), heavier.shape)
            found["mass"] = apparent_change(data, stiffness, GainDraws(same, same, heavier, ()))
        return found

    def _draws(self, matrices: Any) -> GainDraws:
        displacement, force, acceleration = (matrices(quantity) for quantity in _QUANTITIES)
        return GainDraws(displacement, force, acceleration, ())

    def _turned(self, quantity: str) -> FloatArray:
        axes = self.axes[quantity]
        if quantity not in self.turns or len(axes) < 2:
            return _unit(self.turns)
        real = axes + self.turns[quantity]
        return np.einsum("ac,ncb->nab", np.linalg.pinv(_directions(axes)), _directions(real))

    def _delayed(self, quantity: str, omega: float) -> ComplexArray | FloatArray:
        axes = self.axes[quantity]
        if quantity not in self.delays or len(axes) < 2:
            return _unit(self.delays)
        gains = np.exp(-1j * omega * self.delays[quantity])
        return np.einsum("ac,nc,cb->nab", np.linalg.pinv(_directions(axes)), gains, _directions(axes))


def _directions(axes: FloatArray) -> FloatArray:
    return np.stack([np.cos(axes), np.sin(axes)], axis=-1)


def _unit(draws: Mapping[str, FloatArray]) -> FloatArray:
    n = len(next(iter(draws.values())))
    return np.broadcast_to(np.eye(2), (n, 2, 2))


def systematic_sources(campaign: Campaign, n: int, seed: int) -> SystematicSources:
    """Draw axes, delays and mass within what the manifest states, in pairs of opposite sign.

    Channels of one clock, or of one quantity where no clock is stated, share one device and so the error of its delay.

    Parameters
    ----------
    campaign : rigdata.campaign.Campaign
    n : int
        Draws.
    seed : int
    """
    chosen = {q: [c for c in campaign.channels.values() if c.quantity == q and c.axis is not None] for q in _QUANTITIES}
    rng = np.random.default_rng(seed)
    turns, delays = {}, {}
    devices: dict[str, FloatArray] = {}
    for quantity, channels in chosen.items():
        sigma = np.array([getattr(c, "axis_uncertainty", 0.0) for c in channels])
        if sigma.any():
            turns[quantity] = _pairs(rng, n, len(channels)) * sigma
        late = np.array([getattr(c, "delay_uncertainty", 0.0) for c in channels])
        if late.any():
            for channel in channels:
                devices.setdefault(channel.clock or quantity, _pairs(rng, n, 1)[:, 0])
            delays[quantity] = np.stack([devices[c.clock or quantity] for c in channels], axis=1) * late
    uncertain = getattr(campaign, "mass_uncertainty", 0.0)
    mass = _pairs(rng, n, 1)[:, 0] * uncertain / campaign.housing_mass if uncertain else np.empty(0)
    axes = {q: np.array([float(c.axis or 0.0) for c in channels]) for q, channels in chosen.items()}
    return SystematicSources(axes, turns, delays, mass)


def _pairs(rng: np.random.Generator, n: int, m: int) -> FloatArray:
    half = rng.standard_normal((max(n // 2, 1), m))
    return np.concatenate([half, -half])
