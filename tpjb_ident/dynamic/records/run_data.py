"""What the phasor extraction needs to know of a run, its settings, and what it keeps: phasors and the oil force."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.record import Record, RowReader, VectorRecord
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.lines import LineSet, LineSettings
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.records.windows import WindowSettings
from tpjb_ident.errors import BadInputError


class MeasuredRun(Protocol):
    """A dynamic run whose samples can be asked for; the members are those of `rigdata.run.Run`."""

    @property
    def id(self) -> str:
        """Name of the run."""

    @property
    def point(self) -> OperatingPoint:
        """Set points, SI."""

    @property
    def excitation_direction(self) -> float | None:
        """Direction of the excitation [rad]; None where not stated."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Channels with a quantity, by name."""

    @property
    def length(self) -> int:
        """Samples per channel."""

    @property
    def sample_rate(self) -> float:
        """Nominal sample rate [Hz]."""

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        """X and Y of a quantity, SI."""

    def speed(self, start: int | None = None, stop: int | None = None) -> Record | None:
        """Shaft speed by the tachometer [rad/s]; None where there is none."""

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        """Reader of several quantities at once."""

    def opened(self) -> AbstractContextManager[None]:
        """Keep the file open while the block runs."""


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted."""

    lines: LineSettings = field(default_factory=LineSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()
    find_lines: bool = True


@dataclass(frozen=True)
class RunPhasors:
    """What is kept of a run."""

    run: str
    point: OperatingPoint
    direction: float | None
    lines: LineSet
    start: FloatArray  #: (n,), s: start of every window
    length: float
    displacement: PhasorBlock
    cell_force: PhasorBlock
    acceleration: PhasorBlock | None
    housing_mass: float
    speeds: FloatArray  #: (n,)
    conditions: tuple[Condition, ...] = ()
    shaft_phase: ComplexArray = field(default_factory=lambda: np.empty(0, complex))  #: (n_lines,) complex

    @property
    def blocks(self) -> dict[str, PhasorBlock]:
        """What was measured, by quantity."""
        table = {"displacement": self.displacement, "force": self.cell_force, "acceleration": self.acceleration}
        return {quantity: block for quantity, block in table.items() if block is not None}

    def changed(self, change: Callable[[str, ComplexArray], ComplexArray]) -> RunPhasors:
        """The run with other phasors."""
        new = {q: replace(block, phasors=change(q, block.phasors)) for q, block in self.blocks.items()}
        acceleration = new.get("acceleration")
        return replace(self, displacement=new["displacement"], cell_force=new["force"], acceleration=acceleration)

    def advanced(self, delays: Mapping[str, float]) -> RunPhasors:
        """The run without delays of whole quantities."""
        ahead = {q: np.exp(2j * np.pi * self.lines.frequencies * delay) for q, delay in delays.items() if delay}
        return self.changed(lambda q, z: z * ahead[q][None, :, None] if q in ahead else z) if ahead else self

    def oil_force(self, line: int = 0) -> ComplexArray:
        """Oil-force phasors at one line, shape (n, 2) [N]."""
        a = None if self.acceleration is None else self.acceleration.phasors[:, line]
        return oil_force(self.cell_force.phasors[:, line], a, 0.0 if a is None else self.housing_mass)


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
