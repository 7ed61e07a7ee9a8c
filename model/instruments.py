"""What stands between a bearing and its records: probes and cells that read otherwise than they should.

A measured stiffness is G h S^-1: displacement readings are S times the truth, force readings G times. Effects on
measurement add maps here; everything else in the model is about the bearing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray

#: A sensor map: excitation frequency [rad/s] -> (2, 2) complex; 0 gives what static readings see.
SensorMap = Callable[[float], ComplexArray | FloatArray]


@dataclass(frozen=True)
class Instruments:
    """Linear maps of displacement and force readings."""

    displacement: tuple[SensorMap, ...] = ()
    force: tuple[SensorMap, ...] = ()
    housing_mass: float = 30.0
    cell_stiffness: tuple[float, float] = (4.0e8, 6.0e8)
    probe_axes: tuple[float, float] = (math.pi / 4, 3 * math.pi / 4)
    thermometers: tuple[tuple[int, float], ...] = ()

    def displacement_map(self, omega: float) -> ComplexArray:
        """S(omega): read displacement = S @ true displacement."""
        return _product(self.displacement, omega)

    def force_map(self, omega: float) -> ComplexArray:
        """G(omega): read force = G @ true force."""
        return _product(self.force, omega)

    def shown_stiffness(self, h: ComplexArray, lines: FloatArray) -> ComplexArray:
        """G h S^-1 (n, 2, 2) [N/m]: what the records make of the bearing's `h` (n, 2, 2) at `lines` (n,) [rad/s]."""
        if not (self.force or self.displacement):
            return np.asarray(h)
        at = zip(lines, h, strict=True)
        return np.array([self.force_map(w) @ matrix @ np.linalg.inv(self.displacement_map(w)) for w, matrix in at])

    def shown_position(self, position: FloatArray) -> FloatArray:
        """S(0) position (2,) [m]: where static readings place a shaft that the housing's probes see at `position`."""
        return np.asarray((self.displacement_map(0.0) @ position).real)

    def shown_load(self, force: FloatArray) -> FloatArray:
        """G(0) force (2,) [N]: the static load that the cells tell."""
        return np.asarray((self.force_map(0.0) @ force).real)

    def shown_temperature(self, temperature: FloatArray) -> FloatArray:
        """Temperatures of the pads (pads,) [degC] as their thermometers read them."""
        shown = temperature.copy()
        for pad, offset in self.thermometers:
            shown[pad - 1] += offset
        return shown

    def read_displacement(self, sensor_map: SensorMap) -> Instruments:
        """Return a copy whose displacement readings pass through one more map."""
        return replace(self, displacement=(*self.displacement, sensor_map))

    def read_cells(self, gain: FloatArray) -> Instruments:
        """Return a copy whose load cells read `gain` (2, 2) times the truth.

        Only the cells' part of F_oil = F_cell + m a passes through the gain; with the housing on springs K,
        F_cell = F_oil / (1 - m omega^2 / K).
        """

        def cell_map(omega: float) -> FloatArray:
            share = 1.0 / (1.0 - self.housing_mass * omega**2 / np.array(self.cell_stiffness))
            return np.eye(2) + (gain - np.eye(2)) * share

        return replace(self, force=(*self.force, cell_map))

    def weigh_housing(self, mass_error: float) -> Instruments:
        """Return a copy whose housing weighs `mass_error` [kg] more than stated.

        The force computed with the stated mass lacks mass_error times the housing's acceleration,
        a = -omega^2 F_cell / K.
        """

        def mass_map(omega: float) -> FloatArray:
            share = 1.0 / (np.array(self.cell_stiffness) - (self.housing_mass + mass_error) * omega**2)
            return np.diag(1.0 + mass_error * omega**2 * share)

        return replace(self, force=(*self.force, mass_map))


def _product(maps: tuple[SensorMap, ...], omega: float) -> ComplexArray:
    product = np.eye(2, dtype=np.complex128)
    for reading in maps:
        product = reading(omega) @ product
    return product
