"""Delays of devices against one another, as far as the manifest states them: one number a device.

Sensors of one clock share a device; without a clock each has a delay of its own, as behind a multiplexer. The housing's
equations tell cells from accelerometers (a spring knows no phase); probes against cells only a film of known form would
tell.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.conditions import Condition, Conditions, holding
from tpjb_ident.estimate.equation import Blocks, Rig
from tpjb_ident.estimate.term import OUT_OF_STEP, Factor, Fitted, Parameter, exceeding
from tpjb_ident.terms.gain import NO_GAIN

if TYPE_CHECKING:
    from tpjb_ident.estimate.solve import Solution

_MILLISECOND = 1e-3
#: Share of the motion by which probes contradict one another that gains leave, and times the noise, for them to do so.
_LEAST, _MANY = 0.005, 9.0
#: Standard errors and phase [rad] from which cells come late, and not the accelerometers early.
_CLEAR, _NOTABLE = 2.0, 0.02


class Delay(Factor):
    """A sensor that comes later by tau reads exp(-i omega tau) times the truth."""

    name = "delay"
    sentence = "{p.name} late by {value:.3g} ms (standard error {error:.2g} ms)"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._omega = blocks.usual_omega
        devices = np.array([sensor.clock or sensor.name for sensor in rig.channels])
        deviation = np.array([sensor.delay_uncertainty for sensor in rig.channels])
        names = list(dict.fromkeys(devices[deviation > 0].tolist()))
        self.sensors = ((devices[:, None] == np.array(names, dtype=str)) & (deviation[:, None] > 0)).astype(float)
        largest = (self.sensors * deviation[:, None]).max(axis=0) / _MILLISECOND
        self.parameters = tuple(Parameter(name, "ms", float(size)) for name, size in zip(names, largest))

    def rate(self, blocks: Blocks) -> ComplexArray:
        """-i omega, per ms."""
        return np.asarray(-1j * _MILLISECOND * blocks.omega)

    def learnt(self, rig: Rig, solution: Solution) -> Rig:
        """Probes beyond two as uncertain, in time and size, as gains alone leave them contradicting one another."""
        off = _beside_motion(solution)
        if off < _LEAST or any(sensor.delay_uncertainty for sensor in rig.channels):
            return super().learnt(rig, solution)
        sensors = list(rig.channels)
        for j in rig.pick("displacement"):
            sensors[j] = replace(sensors[j].doubted(off), delay_uncertainty=off / self._omega)
        text = f"probes contradict one another by {100 * off:.1f} % of the motion, which gains do not explain"
        name = "records-contradicted" if off > NO_GAIN else "probe-gains-differ"
        said = () if name in _contradictions(rig) else (Condition(name, text),)
        return replace(rig, channels=tuple(sensors), contradicted={**rig.contradicted, self.name: said})

    def conditions(self, fitted: Fitted) -> Conditions:
        """Devices that are later than stated; cells that come late where accelerometers showed them out of step."""
        known = self.rig.contradicted.get(self.name, ())
        if self.rig.out_of_step:
            late = np.abs(fitted.value) > np.maximum(_CLEAR * fitted.deviation, _NOTABLE / _MILLISECOND / self._omega)
            out_of_step = (condition for condition in _contradictions(self.rig) if condition == OUT_OF_STEP)
            return (*known, *(out_of_step if late.any() else ()))
        probes = {sensor.name for sensor in self.rig.channels if sensor.quantity == "displacement"}
        named = {self.parameters[k].name for k in exceeding(fitted, self.parameters)} - probes
        return (*known, *holding((named, OUT_OF_STEP, "; ".join(self.words(fitted)))))


def _contradictions(rig: Rig) -> list[Condition]:
    """What all terms' tests have said of a rig."""
    return [condition for conditions in rig.contradicted.values() for condition in conditions]


def _beside_motion(solution: Solution) -> float:
    """What probes show beside motion and tilt of the shaft, as a share of it, root mean square; 0 if noise does."""
    probes, blocks = solution.rig.pick("displacement"), solution.blocks
    along, levers = np.nan_to_num(blocks.along[:, probes]), solution.rig.levers[probes]
    design = np.concatenate([along, levers[:, None] * along], axis=2) if levers.any() else along  # and tilt
    if len(probes) <= design.shape[2]:
        return 0.0
    shown = np.nan_to_num((blocks.z - solution.shift) / solution.factor)[:, probes, None]
    design, shown = (np.where(blocks.present[:, probes, None], rows, 0.0) for rows in (design, shown))
    motion = np.linalg.pinv(design) @ shown
    beside, motion = (shown - design @ motion)[:, :, 0], motion[:, :2, 0]
    size, noise = np.sum(np.abs(beside) ** 2, axis=1), blocks.noise_power(probes)
    if not np.sum(size) > _MANY * np.sum(noise):
        return 0.0
    return float(np.sqrt(np.median(size / np.maximum(np.sum(np.abs(motion) ** 2, axis=1), 1e-300))))
