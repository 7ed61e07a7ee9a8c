"""Finished runs of one identification, and all windows of one operating point, gathered from its runs.

What is kept of a run is small beside its records: some hundred bytes a window. A run with a damaged file or a dead
channel says nothing, and nothing else suffers from that. A point keeps its answer as long as other runs excite it; one
that loses all of its runs is told as lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import Observation
from tpjb_ident.columns import amount, place_of
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.phasors.run_data import SHORT, FilmLines, RunPhasors, film_lines, mains_lines
from tpjb_ident.rounding import listed

#: Runs named one by one; more are counted.
_LISTED = 6
#: Share of a frequency within which lines of several runs are one.
_ONE_LINE = 5e-4


@dataclass(frozen=True, repr=False)
class RunDigest(RunPhasors):
    """What a run says: the phasors of its excitation lines, and what is left of all others."""

    mains: ComplexArray | None = None  #: (2,) complex, m: displacement at the mains line, where it stands apart
    mains_force: ComplexArray | None = None  #: (2,) complex, N: oil force at the mains line, where it stands apart
    harmonics: tuple[FilmLines | None, ...] = ()
    observations: tuple[Observation, ...] = ()


def digest(phasors: RunPhasors, observations: tuple[Observation, ...] = ()) -> RunDigest:
    """Sum up the phasors of all lines of a run."""
    lines = len(phasors.lines.excitation)
    excitation = replace(phasors, z=phasors.z[:, :lines].copy(), residual=phasors.residual[:lines])
    mains, force = mains_lines(phasors)
    return RunDigest(
        **vars(excitation), mains=mains, mains_force=force, harmonics=film_lines(phasors), observations=observations
    )


@dataclass(frozen=True)
class ExcludedRun:
    """A dynamic run that takes no part."""

    run: str
    point: OperatingPoint
    error: Exception

    @property
    def reason(self) -> str:
        """The first reason, in one line."""
        return str(self.error).partition("\n")[0]

    def belongs(self, point: OperatingPoint, any_excitation: bool) -> bool:
        """Whether the run is one of an operating point, whatever the run's lines are or only at its set point."""
        alike = self.point.static_key == point.static_key
        return alike and (any_excitation or self.point.excitation_hz == point.excitation_hz)


def without_runs(point: OperatingPoint, excluded: Sequence[ExcludedRun], any_excitation: bool) -> Conditions:
    """What a point has to say of its runs that take no part."""
    runs = [run.run for run in excluded if run.belongs(point, any_excitation)]
    return holding((runs, "run-left-out", f"without {', '.join(runs)}, which cannot be used"))


def excluded_runs(
    excluded: Sequence[ExcludedRun], of: int, points: Sequence[OperatingPoint], any_excitation: bool
) -> Conditions:
    """Which of the campaign's `of` dynamic runs take no part, and why; which operating points have no run left."""
    reasons = listed([f"{run.run} ({run.reason})" for run in excluded], _LISTED, "; ")
    lost, places = [], []
    for run in excluded:
        if not any(run.belongs(point, any_excitation) for point in points):
            lost.append(run.run)
            load = run.point.static_load
            places.append(amount(load, "load") if any_excitation else place_of(load, run.point.excitation_hz))
    runs = listed(lost, _LISTED)
    return holding(
        (excluded, "runs-left-out", f"{len(excluded)} of {of} dynamic runs take no part: {reasons}"),
        (lost, "point-lost", f"no usable run at {'; '.join(dict.fromkeys(places))}: {runs}"),
    )


@dataclass(frozen=True)
class FinishedRuns:
    """All runs of a campaign, in its order: what they say, or why they take no part."""

    outcomes: tuple[RunDigest | ExcludedRun, ...]

    @property
    def digests(self) -> list[RunDigest]:
        """Of the runs that can be used."""
        return [outcome for outcome in self.outcomes if isinstance(outcome, RunDigest)]

    @property
    def excluded(self) -> list[ExcludedRun]:
        """Runs that take no part."""
        return [outcome for outcome in self.outcomes if isinstance(outcome, ExcludedRun)]

    def without(self, problems: Mapping[str, Problem]) -> FinishedRuns:
        """The runs, those with an error of their own left out; raises the first error where none remains."""
        outcomes = []
        for outcome in self.outcomes:
            if isinstance(outcome, RunDigest) and outcome.run in problems:
                outcome = ExcludedRun(outcome.run, outcome.point, RigDataError(problems[outcome.run]))
            outcomes.append(outcome)
        remaining = FinishedRuns(tuple(outcomes))
        if outcomes and not remaining.digests:
            raise remaining.excluded[0].error
        return remaining


@dataclass(frozen=True)
class RunsOfPoint:
    """Runs at one operating point, with sines or over a band."""

    point: OperatingPoint
    runs: tuple[Any, ...]  #: of `RunPhasors`, or what is made of them

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.run for run in self.runs)

    @property
    def inertia(self) -> float:
        """Housing mass whose inertia stays in the cells' force [kg]: none where accelerometers measure it."""
        return 0.0 if self.runs[0].pick("acceleration") else self.runs[0].housing_mass

    @property
    def mean_loads(self) -> ComplexArray:
        """Mean cell force of every run, X + i Y, shape (n_runs,) [N]."""
        return np.array([finite_mean(run.means("force")) @ [1.0, 1j] for run in self.runs])

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

    @property
    def omega(self) -> float:
        """Excitation frequency as found in the runs, else as set [rad/s]."""
        frequency = float(np.median([run.lines.driven[i] for run, i in zip(self.runs, self.lines)]))
        return self.point.excitation if abs(frequency - self.point.excitation_hz) < 1e-6 else 2 * np.pi * frequency

    @property
    def film_lines(self) -> list[FilmLines | None]:
        """What the film makes of the line in every run that says so."""
        return [run.harmonics[line] for run, line in zip(self.runs, self.lines) if run.harmonics]

    @property
    def whole(self) -> BoolArray:
        """Windows that have phasors of displacement and force, (n,)."""
        return np.asarray(np.isfinite(self.D).all(axis=1) & np.isfinite(self.F).all(axis=1))

    @property
    def mass(self) -> float:
        """Housing mass whose inertia is in F [kg]: zero where no accelerometer measures it."""
        return self.runs[0].housing_mass - self.inertia

    def counted(self, weights: FloatArray | float = 1.0) -> list[tuple[RunPhasors, IntArray]]:
        """Runs with the places of their whole windows, those that have any; of some weight where one is given, (n,)."""
        good = self.whole & (weights > 0)
        counted = []
        for i, run in enumerate(self.runs):
            places = np.flatnonzero(good & (self.run_index == i))
            if len(places):
                counted.append((run, places))
        return counted

    def says(self, condition: str) -> bool:
        """Whether one of the runs carries a condition of this name."""
        return any(condition in run.conditions for run in self.runs)


def finite_mean(rows: FloatArray) -> FloatArray:
    """Mean of the complete rows, (2,); NaN where there is none; `rows` (n, 2)."""
    good = rows[np.isfinite(rows).all(axis=1)]
    return good.mean(axis=0) if len(good) else np.full(2, np.nan)


def gather(runs: Sequence[RunPhasors]) -> list[PointData]:
    """Group runs by operating point; a record with several excitation lines feeds several points."""
    loads: dict[tuple[object, ...], dict[OperatingPoint, list[tuple[RunPhasors, int]]]] = {}
    for run in runs:
        for i, frequency in enumerate(run.lines.driven):
            line = point_of(run.point, frequency)
            points = loads.setdefault(line.static_key, {})
            # of one set point that the drive missed, runs find the frequency each by itself
            alike = (p for p in points if abs(p.excitation - line.excitation) <= _ONE_LINE * p.excitation)
            points.setdefault(next(alike, line), []).append((run, i))
    members: dict[OperatingPoint, list[tuple[RunPhasors, int]]] = {}
    for points in loads.values():
        members |= points
    return [point_data(*pair) for pair in sorted(members.items(), key=lambda pair: pair[0].key)]


def point_of(point: OperatingPoint, frequency: float) -> OperatingPoint:
    """Operating point of one line; the set point's frequency where the line belongs to it."""
    nominal = point.excitation_hz
    if abs(frequency - nominal) <= 0.02 * max(nominal, 1e-9):
        return point
    return replace(point, excitation=2 * np.pi * round(frequency, 3))


def point_data(point: OperatingPoint, members: list[tuple[RunPhasors, int]]) -> PointData:
    """Windows of a point's runs, each with the line that is meant."""
    runs, lines = zip(*members)
    D, F = [run.displacement[:, i] for run, i in members], [run.force[:, i] for run, i in members]
    index = np.repeat(np.arange(len(runs)), [len(d) for d in D])
    return PointData(point, runs, lines, np.concatenate(D), np.concatenate(F), index)


def mean_temperatures(run: Run) -> dict[int, float]:
    """Mean temperature per pad over a run [K]; pads with several sensors give their mean."""
    means = []
    for sensor in run.temperatures():
        values = run.record(sensor.name, 0, SHORT).values
        values = values[np.isfinite(values)]
        if sensor.pad is not None and len(values):
            means.append({sensor.pad: float(values.mean())})
    return pad_means(means)


def pad_means(runs: Sequence[dict[int, float]]) -> dict[int, float]:
    """Mean temperature by pad over the runs that have it [K]."""
    means = {}
    for pad in sorted(set[int]().union(*runs)):
        means[pad] = float(np.mean([run[pad] for run in runs if pad in run]))
    return means
