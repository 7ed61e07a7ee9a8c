"""What the records of a run leave: phasors of every channel in every window, and the settings they were made with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.vector import inverse_directions
from tpjb_ident.conditions import Condition
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.lines import LineSet, LineSettings
from tpjb_ident.phasors.windows import WindowSettings

QUANTITIES = ("displacement", "force", "acceleration")


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted."""

    lines: LineSettings = field(default_factory=LineSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()
    find_lines: bool = True


@dataclass(frozen=True)
class PhasorBlock:
    """Phasors of one vector quantity in some windows of one run."""

    phasors: ComplexArray  #: (n_windows, n_lines, 2) complex: X and Y at every line, SI; NaN where a window gave none
    mean: FloatArray  #: (n_windows, 2): mean of the quantity, SI
    noise: FloatArray  #: (n_windows, 2): robust standard deviation of what the lines leave
    lost: FloatArray  #: (n_windows,): share of the samples left out (bad or missing)


@dataclass(frozen=True)
class RunPhasors:
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
    speeds: FloatArray  #: (n_windows,)
    conditions: tuple[Condition, ...] = ()
    shaft_phase: ComplexArray = field(default_factory=lambda: np.empty(0, complex))  #: (n_lines,) complex
    span: tuple[float, float] | None = None  #: s: part of the record with one excitation; None: all of it
    device: tuple[str, ...] = ()  #: (n_channels,): clock terms exist between devices only
    #: (n_whole_lines, n_channels) complex, SI: phasors of the whole record's lines, those of the windows first
    record: ComplexArray = field(default_factory=lambda: np.empty((0, 0), complex))
    #: by excitation line (n_bins, n_channels) complex: residual of the whole record in the bins around it
    residual: tuple[ComplexArray, ...] = ()

    @cached_property
    def displacement(self) -> PhasorBlock:
        """X and Y of the probes."""
        return self._vector("displacement")

    @cached_property
    def cell_force(self) -> PhasorBlock:
        """X and Y of the cells."""
        return self._vector("force")

    @cached_property
    def acceleration(self) -> PhasorBlock | None:
        """X and Y of the accelerometers; None where there are none."""
        return self._vector("acceleration") if self.pick("acceleration") else None

    def pick(self, quantity: str) -> list[int]:
        """Places of the channels of a quantity."""
        return [i for i, c in enumerate(self.channels) if c.quantity == quantity]

    def _vector(self, quantity: str) -> PhasorBlock:
        """X and Y of a quantity from its channels, those left out that a window says nothing of."""
        places = self.pick(quantity)
        axes = tuple(float(self.channels[i].axis or 0.0) for i in places)
        z, mean, scale = self.z[:, :, places], self.mean[:, places], self.scale[:, places]
        n_windows, n_lines = z.shape[:2]
        phasors = np.full((n_windows, n_lines, 2), np.nan + 0j)
        means, noise = np.full((n_windows, 2), np.nan), np.full((n_windows, 2), np.nan)
        usable = np.isfinite(z).any(axis=1) & np.isfinite(mean)
        for rows, members in _patterns(usable):
            inverse = inverse_directions(tuple(axes[i] for i in members))
            phasors[rows] = z[rows][:, :, members] @ inverse.T
            means[rows] = mean[rows][:, members] @ inverse.T
            noise[rows] = np.sqrt(scale[rows][:, members] ** 2 @ (inverse**2).T)
        return PhasorBlock(phasors, means, noise, self.lost[:, places].max(axis=1, initial=0.0))

    def divided(self, gains: ComplexArray) -> RunPhasors:
        """The run without gains of its channels at the whole record's lines, (n_whole_lines, n_channels)."""
        residual = tuple(bins / gain for bins, gain in zip(self.residual, gains))
        record = self.record / gains if len(self.record) else self.record
        return replace(self, z=self.z / gains[: self.z.shape[1]], record=record, residual=residual)

    def oil_force(self, line: int | slice = 0) -> ComplexArray:
        """Oil-force phasors at one line, shape (n, 2) [N], or at several, (n, n_lines, 2)."""
        a = None if self.acceleration is None else self.acceleration.phasors[:, line]
        return oil_force(self.cell_force.phasors[:, line], a, 0.0 if a is None else self.housing_mass)


def _patterns(usable: BoolArray) -> list[tuple[BoolArray, list[int]]]:
    """Windows by the channels that they say something of: windows (n,) and places of the channels, two at least."""
    if usable.all():
        return [(np.ones(len(usable), dtype=bool), list(range(usable.shape[1])))]
    patterns, pattern_of = np.unique(usable, axis=0, return_inverse=True)
    table = [(pattern_of.ravel() == k, np.flatnonzero(pattern).tolist()) for k, pattern in enumerate(patterns)]
    return [(rows, members) for rows, members in table if len(members) > 1]


def oil_force(cell_force: ComplexArray, housing_acceleration: ComplexArray | None, housing_mass: float) -> ComplexArray:
    """Oil-film force phasors, (..., 2) [N]; `cell_force` (..., 2) [N], `housing_acceleration` (..., 2).

    Housing balance: F_oil = F_cell + m_h a_h, with F_cell the force with which the housing pushes the cells and a_h the
    absolute acceleration of the housing.
    """
    if not (np.isfinite(housing_mass) and housing_mass >= 0):
        raise BadInputError(f"housing mass must be finite and not negative, got {housing_mass} kg")
    if housing_acceleration is None:
        return np.asarray(cell_force, dtype=complex)
    return np.asarray(cell_force + housing_mass * housing_acceleration, dtype=complex)
