"""What runs say at their lines: one phasor per channel a block, with the covariance of its noise, all blocks stacked.

A block is one run at one excitation line. Every channel keeps a row of its own, so that a gain, a delay or a clock is
a factor of one row, and a channel that is dead is a row that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.operating_point import OperatingPoint
from rigdata.vector import plane_vector
from tpjb_ident.conditions import Condition

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
    corner_uncertainty: float = 0.0  #: Hz: of a low corner that nobody states, one deviation
    out_of_step: bool = False  #: leads what the springs under the housing make of the cells' force
    axis: float = 0.0  #: rad: as the campaign has it; a run's own counts in its blocks

    def doubted(self, gain: float, turn: float = 0.0) -> Sensor:
        """The sensor, its gain and axis [rad] known no better than this."""
        uncertainty = max(self.uncertainty or 0.0, gain) or None
        return replace(self, uncertainty=uncertainty, axis_uncertainty=max(self.axis_uncertainty, turn))


@dataclass(frozen=True)
class RigStiffness:
    """Dynamic stiffness of the rig without its bearing, at F frequencies: what hoses, seals and cables carry."""

    omega: FloatArray = field(default_factory=lambda: np.zeros(0))  #: (F,), rad/s, rising
    h: ComplexArray = field(default_factory=lambda: np.zeros((0, 2, 2), complex))  #: (F, 2, 2), N/m
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 8, 8)))  #: (F, 8, 8), (N/m)^2

    def weights(self, omega: FloatArray) -> FloatArray:
        """Weights of the frequencies at `omega` (n,), linear between them, (n, F); zero where it is not known."""
        rows = [np.interp(omega, self.omega, one) for one in np.eye(len(self.omega))]
        return np.reshape(rows, (len(self.omega), len(omega))).T * self.known(omega)[:, None]

    def known(self, omega: FloatArray) -> BoolArray:
        """Whether the rig was measured about `omega` (n,), (n,)."""
        if not len(self.omega):
            return np.zeros(len(omega), dtype=bool)
        return (omega >= 0.98 * self.omega[0]) & (omega <= 1.02 * self.omega[-1])

    def at(self, omega: FloatArray) -> ComplexArray:
        """H at `omega` (n,), (n, 2, 2) [N/m]; zero where it is not known."""
        return np.einsum("nf,fij->nij", self.weights(omega), self.h)


@dataclass(frozen=True, repr=False)
class Rig:
    """Sensors in the order of the rows, and the housing that they stand on."""

    sensors: tuple[Sensor, ...]
    mass: float
    mass_uncertainty: float = 0.0
    mount: str = "cells"  #: "cells", "floating", or "unknown": no accelerometer tells
    #: by term: what its test said of sensors that are since taken as uncertain as it showed them
    contradicted: Mapping[str, tuple[Condition, ...]] = field(default_factory=dict)
    bare: RigStiffness = field(default_factory=RigStiffness)
    static: bool = True  #: whether the cells show the static load
    to_set_point: bool = True  #: whether H is that at the set points, not at the runs' own loads
    #: of the clocks of devices, relative: put right in the readings before they became phasors
    rates: Mapping[str, float] = field(default_factory=dict)

    @property
    def out_of_step(self) -> bool:
        """Whether accelerometers lead what the springs under the housing make of the cells' force."""
        return any(sensor.out_of_step for sensor in self.sensors)

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
    uneven: FloatArray  #: (n, 2): scatter of the film's force along X and Y that no repeat averages away, relative
    gain_scatter: FloatArray  #: (n,): of its run's gain, relative: what all lines of a run have in common
    bent: FloatArray  #: (P,): share of H by which the motion may change it, by the film's harmonics or as stated
    band: IntArray  #: (P,): number of the band whose lines share that; -1 of a point by itself

    def __len__(self) -> int:
        return len(self.point)

    @property
    def usual_omega(self) -> float:
        """Median frequency of the blocks [rad/s]; one where there are none."""
        return float(np.median(self.omega)) if len(self) else 1.0

    def noise_power(self, rows: IntArray) -> FloatArray:
        """Sum of the noise's variances of some sensors, (n,)."""
        return np.einsum("njj->n", self.noise[:, rows][:, :, rows]).real

    def part(self, places: slice | IntArray) -> Blocks:
        """Some of the blocks."""
        stacked_names = [f.name for f in fields(self) if f.name not in ("points", "runs", "bent", "band")]
        return replace(self, **{name: getattr(self, name)[places] for name in stacked_names})


def stacked(
    points: Sequence[OperatingPoint],
    runs: Sequence[str],
    sensors: int,
    rows: Sequence[Mapping[str, Any]],
    bent: FloatArray | None = None,
    band: IntArray | None = None,
) -> Blocks:
    """Blocks of rows, each what is known of it by name; one that is said nothing else of is a single still window."""
    none = np.zeros(sensors)
    usual: dict[str, Any] = {
        "point": 0,
        "run": 0,
        "omega": 0.0,
        "z": none + 0j,
        "noise": np.diag(none) + 0j,
        "dof": 1.0,
    }
    usual |= {"present": none > 0, "along": np.zeros((sensors, 2)), "calibration": none.astype(int)}
    usual |= {"slope": none + 0j, "slope_noise": np.eye(sensors) + 0j, "windows": 1.0, "time": 0.0}
    usual |= {"temperature": np.nan, "shaft": np.nan + 0j, "uneven": np.zeros(2), "gain_scatter": 0.0}
    usual |= {"miss": 0j, "miss_error": 0.0}
    columns: dict[str, Any] = {
        "bent": np.zeros(len(points)) if bent is None else bent,
        "band": np.full(len(points), -1) if band is None else band,
    }
    for name, value in usual.items():
        column = np.array([row.get(name, value) for row in rows], np.asarray(value).dtype)
        columns[name] = column.reshape(-1, *np.shape(value))
    return Blocks(tuple(points), tuple(runs), **columns)


def vector(rig: Rig, blocks: Blocks, quantity: str) -> ComplexArray:
    """X and Y of a quantity by least squares over its sensors, (n, 2); NaN without two directions."""
    rows = rig.of(quantity)
    readings = np.where(blocks.present[:, rows], blocks.z[:, rows], np.nan)
    return plane_vector(blocks.along[:, rows], readings)


def film_force(rig: Rig, blocks: Blocks) -> ComplexArray:
    """X and Y of the force of the film (n, 2), without the housing's inertia where accelerometers measure it."""
    force = vector(rig, blocks, "force")
    if len(rig.of("acceleration")) < 2:
        return force
    return force + rig.mass * np.nan_to_num(vector(rig, blocks, "acceleration"))


def totals(place: IntArray, values: FloatArray | BoolArray, number: int) -> FloatArray:
    """Sums of values (n, ..) by place (n,), (number, ..)."""
    sums = np.zeros((number, *values.shape[1:]))
    np.add.at(sums, place, values)
    return sums
