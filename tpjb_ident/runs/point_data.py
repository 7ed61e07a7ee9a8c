"""All windows of one operating point, gathered from its runs, and the film temperatures over them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.operating_point import OperatingPoint
from rigdata.run import Run
from tpjb_ident.phasors.run_phasors import RunPhasors
from tpjb_ident.runs.finished_runs import RunDigest

#: Samples from which a run's temperatures are taken.
_TEMPERATURE_SAMPLES = 2**17


@dataclass(frozen=True)
class RunsOfPoint:
    """Runs at one operating point, with sines or over a band."""

    point: OperatingPoint
    runs: tuple[RunPhasors, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.run for run in self.runs)

    @property
    def inertia(self) -> float:
        """Housing mass whose inertia stays in the cells' force [kg]: none where accelerometers measure it."""
        return 0.0 if self.runs[0].pick("acceleration") else self.runs[0].housing_mass

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, shape (n_runs, 2) [N]."""
        return np.array([finite_mean(run.means("force")) for run in self.runs])

    @property
    def mean_positions(self) -> FloatArray:
        """Mean displacement of every run, shape (n_runs, 2) [m]."""
        return np.array([finite_mean(run.means("displacement")) for run in self.runs])


@dataclass(frozen=True)
class PointData(RunsOfPoint):
    """Windows of all runs at one operating point and one excitation line."""

    lines: tuple[int, ...]
    D: ComplexArray  #: (n, 2) complex, m
    F: ComplexArray  #: (n, 2) complex, N
    run_index: IntArray  #: (n,): windows of one run are repeats of one excitation
    digests: tuple[RunDigest, ...] = ()  #: of the runs, where they are those of a campaign

    @property
    def omega(self) -> float:
        """Excitation frequency as found in the runs, else as set [rad/s]."""
        frequency = float(np.median([run.lines.driven[i] for run, i in zip(self.runs, self.lines)]))
        return self.point.excitation if abs(frequency - self.point.excitation_hz) < 1e-6 else 2 * np.pi * frequency

    @property
    def whole(self) -> BoolArray:
        """Windows that have phasors of displacement and force, (n,)."""
        return np.asarray(np.isfinite(self.D).all(axis=1) & np.isfinite(self.F).all(axis=1))

    @property
    def mass(self) -> float:
        """Housing mass whose inertia is in F [kg]: zero where no accelerometer measures it."""
        return self.runs[0].housing_mass - self.inertia

    def counted(self, weights: FloatArray) -> list[tuple[RunPhasors, IntArray]]:
        """Runs with the places of their whole windows of some weight (n,), those that have any."""
        good = self.whole & (weights > 0)
        places = [np.flatnonzero(good & (self.run_index == i)) for i in range(len(self.runs))]
        return [(run, rows) for run, rows in zip(self.runs, places) if len(rows)]

    def says(self, condition: str) -> bool:
        """Whether one of the runs carries a condition of this name."""
        return any(condition in run.conditions for run in self.runs)


def finite_mean(rows: FloatArray) -> FloatArray:
    """Mean of the complete rows, (2,); NaN where there is none; `rows` (n, 2)."""
    good = rows[np.isfinite(rows).all(axis=1)]
    return good.mean(axis=0) if len(good) else np.full(2, np.nan)


def gather(runs: list[RunPhasors], digests: Sequence[RunDigest] = ()) -> list[PointData]:
    """Group runs by operating point; a record with several excitation lines feeds several points."""
    points = []
    for point, members in group([(run.point, run.lines.driven) for run in runs]):
        data = point_data(point, [(runs[k], i) for k, i in members])
        points.append(replace(data, digests=tuple(digests[k] for k, _ in members if digests)))
    return points


def group(runs: list[tuple[OperatingPoint, tuple[float, ...]]]) -> list[tuple[OperatingPoint, list[tuple[int, int]]]]:
    """Operating points in order, each with the places of its runs and which line of the run is meant."""
    groups: dict[tuple[object, ...], tuple[OperatingPoint, list[tuple[int, int]]]] = {}
    for k, (set_points, frequencies) in enumerate(runs):
        for i, frequency in enumerate(frequencies):
            point = point_of(set_points, frequency)
            groups.setdefault(point.key, (point, []))[1].append((k, i))
    return [groups[key] for key in sorted(groups)]


def point_of(point: OperatingPoint, frequency: float) -> OperatingPoint:
    """Operating point of one line; the set point's frequency where the line belongs to it."""
    nominal = point.excitation_hz
    if abs(frequency - nominal) <= 0.02 * max(nominal, 1e-9):
        return point
    return replace(point, excitation=2 * np.pi * round(frequency, 3))


def point_data(point: OperatingPoint, members: list[tuple[RunPhasors, int]]) -> PointData:
    """Windows of a point's runs, each with the line that is meant."""
    runs = tuple(run for run, _ in members)
    lines = tuple(i for _, i in members)
    D = [run.displacement[:, i] for run, i in zip(runs, lines)]
    F = [run.oil_force(i) for run, i in zip(runs, lines)]
    index = np.repeat(np.arange(len(runs)), [len(d) for d in D])
    return PointData(point, runs, lines, np.concatenate(D), np.concatenate(F), index)


def mean_temperatures(run: Run) -> dict[int, float]:
    """Mean temperature per pad over a run [K]; pads with several sensors give their mean."""
    means = []
    for sensor in run.temperatures():
        values = run.record(sensor.name, 0, _TEMPERATURE_SAMPLES).values
        values = values[np.isfinite(values)]
        if sensor.pad is not None and len(values):
            means.append({sensor.pad: float(values.mean())})
    return pad_means(means)


def pad_means(runs: Sequence[dict[int, float]]) -> dict[int, float]:
    """Mean temperature by pad over the runs that have it [K]."""
    pads = sorted({pad for run in runs for pad in run})
    return {pad: float(np.mean([run[pad] for run in runs if pad in run])) for pad in pads}
