"""Settings of the phasor extraction, and what it keeps of a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigdata.operating_point import OperatingPoint
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.records.oil_force import oil_force
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.spectral_lines.lines import LineSet, LineSettings
from tpjb_ident.dynamic.spectral_lines.windows import WindowSettings


@dataclass(frozen=True)
class PhasorSettings:
    """How phasors are extracted.

    Attributes
    ----------
    lines : LineSettings
    windows : WindowSettings
    delays : dict
        Seconds by which a quantity's channels are recorded late, where that is known.
    excitation_lines : tuple of float
        Excitation frequencies [Hz] for records that hold several; empty takes the run's own.
    find_lines : bool
        Look for lines that nobody mentioned and fit them along.
    """

    lines: LineSettings = field(default_factory=LineSettings)
    windows: WindowSettings = field(default_factory=WindowSettings)
    delays: dict[str, float] = field(default_factory=dict)
    excitation_lines: tuple[float, ...] = ()
    find_lines: bool = True


@dataclass(frozen=True)
class RunPhasors:
    """What is kept of a run.

    Attributes
    ----------
    run : str
    point : OperatingPoint
        Set points of the run.
    direction : float or None
        Direction of the excitation [rad].
    lines : LineSet
        As fitted; excitation lines first.
    start : (n,) ndarray
        Start of every window [s].
    length : float
        Of a window [s].
    displacement, cell_force, acceleration : PhasorBlock
        `acceleration` is None where the rig has none.
    housing_mass : float
    speeds : (n,) ndarray
        Shaft speed in every window by the tachometer [Hz]; NaN where there is none.
    conditions : tuple of Condition
    shaft_phase : (n_lines,) complex ndarray
        Unit phasor of what turns with the shaft at every excitation line that stands on 1X, 2X or 3X; NaN elsewhere,
        and where it is not known.
    """

    run: str
    point: OperatingPoint
    direction: float | None
    lines: LineSet
    start: FloatArray
    length: float
    displacement: PhasorBlock
    cell_force: PhasorBlock
    acceleration: PhasorBlock | None
    housing_mass: float
    speeds: FloatArray
    conditions: tuple[Condition, ...] = ()
    shaft_phase: ComplexArray = field(default_factory=lambda: np.empty(0, complex))

    def oil_force(self, line: int = 0) -> ComplexArray:
        """Oil-force phasors at one line, shape (n, 2) [N].

        Parameters
        ----------
        line : int, optional
            Place among the excitation lines.
        """
        a = None if self.acceleration is None else self.acceleration.phasors[:, line]
        return oil_force(self.cell_force.phasors[:, line], a, 0.0 if a is None else self.housing_mass)
