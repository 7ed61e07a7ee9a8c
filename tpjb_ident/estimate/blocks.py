"""What runs say at their lines: one phasor per channel a block, with the covariance of its noise, all blocks stacked.

A block is one run at one excitation line. Every channel keeps a row of its own, so that a gain, a delay or a clock is
a factor of one row, and a channel that is dead is a row that is missing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.operating_point import OperatingPoint

#: Quantities of the equation, in the order of its rows.
QUANTITIES = ("displacement", "force", "acceleration")


@dataclass(frozen=True)
class Sensor:
    """A channel as the equation knows it: what is stated of it, SI."""

    name: str
    quantity: str
    uncertainty: float | None = None
    axis_uncertainty: float = 0.0
    delay_uncertainty: float = 0.0
    device: str = ""
    plane: float = 0.0
    temperature_coefficient_uncertainty: float = 0.0


@dataclass(frozen=True)
class Rig:
    """Sensors in the order of the rows, and the housing that they stand on."""

    sensors: tuple[Sensor, ...]
    mass: float
    mass_uncertainty: float = 0.0
    mount: str = "cells"  #: "cells", "floating", or "unknown": no accelerometer tells

    def of(self, quantity: str) -> IntArray:
        """Rows of the sensors of a quantity."""
        places = [j for j, sensor in enumerate(self.sensors) if sensor.quantity == quantity]
        return np.array(places, dtype=np.intp)

    def __len__(self) -> int:
        return len(self.sensors)


@dataclass(frozen=True)
class Blocks:
    """All blocks of a campaign, n of them, with m sensors each."""

    points: tuple[OperatingPoint, ...]
    runs: tuple[str, ...]
    point: IntArray  #: (n,): place in `points`
    run: IntArray  #: (n,): place in `runs`
    omega: FloatArray  #: (n,), rad/s: of the line found
    z: ComplexArray  #: (n, m), SI: phasors; 0 where a sensor gives none
    present: BoolArray  #: (n, m)
    along: FloatArray  #: (n, m, 2): unit vectors of the sensors' axes
    calibration: IntArray  #: (n, m): which of its sensor's calibrations a reading was made with
    noise: ComplexArray  #: (n, m, m): covariance of z
    dof: FloatArray  #: (n,): degrees of freedom of the noise, those of its point
    slope: ComplexArray  #: (n, m), 1/s: change of z over time
    slope_noise: ComplexArray  #: (n, m, m): its covariance
    windows: FloatArray  #: (n,): effective number of windows
    time: FloatArray  #: (n,), s: middle of the windows
    temperature: FloatArray  #: (n,), K: of the run; NaN where not known
    miss: ComplexArray  #: (n,): static load against its set point, relative size + i turn [rad]
    miss_error: FloatArray  #: (n,): standard error of the run's own mean load, relative
    shaft: ComplexArray  #: (n,): unit phasor of what turns with the shaft; NaN where the line is not the shaft's
    bent: FloatArray  #: (P,): share of H by which the amplitude of the motion may change it, by the film's harmonics

    def __len__(self) -> int:
        return len(self.point)

    def part(self, places: slice | IntArray) -> Blocks:
        """Some of the blocks."""
        arrays = {name: getattr(self, name)[places] for name in _STACKED}
        return replace(self, **arrays)


_STACKED = (
    "point", "run", "omega", "z", "present", "along", "calibration", "noise", "dof", "slope", "slope_noise",
    "windows", "time", "temperature", "miss", "miss_error", "shaft",
)  # fmt: skip


def vector(rig: Rig, blocks: Blocks, quantity: str) -> ComplexArray:
    """X and Y of a quantity by least squares over its sensors, (n, 2); NaN without two directions."""
    rows = rig.of(quantity)
    if len(rows) < 2:
        return np.full((len(blocks), 2), np.nan + 0j)
    along = blocks.along[:, rows] * blocks.present[:, rows, None]
    gram = np.einsum("nja,njb->nab", along, along)
    determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    plane = determinant > 1e-6
    moment = np.einsum("nja,nj->na", along, blocks.z[:, rows])
    result = np.full((len(blocks), 2), np.nan + 0j)
    result[plane] = np.linalg.solve(gram[plane], moment[plane][:, :, None])[:, :, 0]
    return result


def totals(place: IntArray, values: FloatArray | BoolArray, number: int) -> FloatArray:
    """Sums of values (n,) by place (n,), (number,)."""
    return np.asarray(np.bincount(place, weights=values, minlength=number), dtype=float)
