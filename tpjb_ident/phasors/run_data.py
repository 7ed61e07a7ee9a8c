"""What the records of a run leave: phasors of every channel in every window, and the settings they were made with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import VECTOR_QUANTITIES, Channel
from rigdata.operating_point import OperatingPoint
from rigdata.vector import directions, plane_vector
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.bad_samples import usual_scale
from tpjb_ident.phasors.lines import LineSet, LineSettings
from tpjb_ident.phasors.windows import WindowSettings

QUANTITIES = VECTOR_QUANTITIES


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted."""

    lines: LineSettings = field(default_factory=LineSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()


class Directed:
    """What several channels show, side by side; `channels` have a quantity and an axis each."""

    channels: Any

    def pick(self, quantity: str) -> list[int]:
        """Places of the channels of a quantity."""
        return [k for k, channel in enumerate(self.channels) if channel.quantity == quantity]

    def plane(self, quantity: str, values: ComplexArray | FloatArray) -> ComplexArray:
        """X and Y (.., 2) of a quantity from values (.., n_channels) of all channels, NaN where there is none."""
        places = self.pick(quantity)
        along = directions([self.channels[k].axis or 0.0 for k in places])
        return plane_vector(along, np.asarray(values[..., places], complex))


@dataclass(frozen=True)
class RunPhasors(Directed):
    """One run: a phasor per window, line and channel, each fitted at the channel's own sample times."""

    run: str
    point: OperatingPoint
    direction: float | None
    lines: LineSet
    start: FloatArray  #: (n_windows,), s: start of every window
    length: float
    channels: tuple[Channel, ...]  #: of displacement, force, acceleration, in this order
    z: ComplexArray  #: (n_windows, n_lines, n_channels) complex, SI, exp(+i omega t); NaN where a window gives none
    mean: FloatArray  #: (n_windows, n_channels), SI
    scale: FloatArray  #: (n_windows, n_channels): robust standard deviation of the residual
    lost: FloatArray  #: (n_windows, n_channels): share of the samples left out
    housing_mass: float
    conditions: tuple[Condition, ...] = ()
    shaft_phase: ComplexArray = field(default_factory=lambda: np.empty(0, complex))  #: (n_lines,) complex
    span: tuple[float, float] | None = None  #: s: part of the record with one excitation; None: all of it
    device: tuple[str, ...] = ()  #: (n_channels,): clock terms exist between devices only
    #: (n_whole_lines, n_channels) complex, SI: phasors of the whole record's lines, those of the windows first
    record: ComplexArray = field(default_factory=lambda: np.empty((0, 1), complex))
    #: by line of the whole record, (n_bins, n_channels) complex: residual in the bins around it
    residual: tuple[ComplexArray, ...] = ()
    rounding: FloatArray = field(default_factory=lambda: np.empty(0))  #: (n_channels,), SI^2: by it on a line, at most

    @cached_property
    def displacement(self) -> ComplexArray:
        """X and Y of the probes, (n_windows, n_lines, 2) [m]; NaN where a window gave none."""
        return self.plane("displacement", self.z)

    def means(self, quantity: str) -> FloatArray:
        """X and Y of a quantity's mean in every window, (n_windows, 2)."""
        return self.plane(quantity, self.mean).real

    def divided(self, gains: ComplexArray) -> RunPhasors:
        """The run without gains of its channels at the whole record's lines, (n_whole_lines, n_channels)."""
        residual = tuple(bins / gain for bins, gain in zip(self.residual, gains))
        record = self.record / gains[: len(self.record)]
        return replace(self, z=self.z / gains[: self.z.shape[1]], record=record, residual=residual)

    def film_force(self, values: ComplexArray) -> ComplexArray:
        """X and Y (.., 2) of the oil force [N] by values (.., n_channels) of all channels.

        Housing balance: F_oil = F_cell + m_h a_h, with F_cell the force with which the housing pushes the cells and a_h
        the absolute acceleration of the housing.
        """
        force = self.plane("force", values)
        if self.pick("acceleration"):
            force += self.housing_mass * self.plane("acceleration", values)
        return force

    def oil_force(self, line: int | slice = 0) -> ComplexArray:
        """Oil-force phasors at one line, shape (n, 2) [N], or at several, (n, n_lines, 2)."""
        return self.film_force(self.z[:, line])


def complex_median(z: ComplexArray) -> ComplexArray:
    """Median of real and imaginary parts over the first axis; `z` (n, ...)."""
    return np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0)


def phasor_noise(run: RunPhasors, rate: float) -> FloatArray:
    """Standard deviation of a window's phasor by what its lines leave, channel by channel (n_channels,)."""
    return np.maximum(2 * usual_scale(run.scale) / np.sqrt(run.length * rate), np.finfo(float).tiny)
