"""Finished runs of one identification: what they say of their excitation lines, or why they take no part.

What is kept of a run is small beside its records: some hundred bytes a window. A run with a damaged file or a dead
channel says nothing, and nothing else suffers from that. A point keeps its answer as long as other runs excite it; one
that loses all of its runs is told as lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rigdata.arrays import ComplexArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from tpjb_ident.check.observation import Observation
from tpjb_ident.columns import amount, place_of
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.phasors.line_means import FilmLines, film_lines, mains_lines
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.rounding import listed

#: Runs named one by one; more are counted.
_LISTED = 6


@dataclass(frozen=True, repr=False)
class RunDigest:
    """What a run says."""

    phasors: RunPhasors  #: of its excitation lines alone
    mains: ComplexArray | None  #: (2,) complex, m: displacement at the mains line, where it stands apart
    mains_force: ComplexArray | None  #: (2,) complex, N: oil force at the mains line, where it stands apart
    temperatures: dict[int, float]
    harmonics: tuple[FilmLines | None, ...] = ()
    sample_rate: float = 0.0
    observations: tuple[Observation, ...] = ()

    @property
    def run(self) -> str:
        """Name."""
        return self.phasors.run

    @property
    def point(self) -> OperatingPoint:
        """Set point."""
        return self.phasors.point


def digest(
    phasors: RunPhasors,
    temperatures: dict[int, float],
    sample_rate: float = 0.0,
    observations: tuple[Observation, ...] = (),
) -> RunDigest:
    """Sum up the phasors of all lines of a run that was recorded at `sample_rate` [Hz]."""
    lines = len(phasors.lines.excitation)
    excitation = replace(phasors, z=phasors.z[:, :lines].copy(), residual=phasors.residual[:lines])
    return RunDigest(excitation, *mains_lines(phasors), temperatures, film_lines(phasors), sample_rate, observations)


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


def without_runs(point: OperatingPoint, excluded: Sequence[ExcludedRun], any_excitation: bool) -> tuple[Condition, ...]:
    """What a point has to say of its runs that take no part."""
    runs = [run.run for run in excluded if run.belongs(point, any_excitation)]
    return holding((runs, "run-left-out", f"without {', '.join(runs)}, which cannot be used"))


def excluded_runs(
    excluded: Sequence[ExcludedRun], of: int, points: Sequence[OperatingPoint], any_excitation: bool
) -> tuple[Condition, ...]:
    """Which of the campaign's `of` dynamic runs take no part, and why; which operating points have no run left."""
    reasons = listed([f"{run.run} ({run.reason})" for run in excluded], _LISTED, "; ")
    lost = [run for run in excluded if not any(run.belongs(point, any_excitation) for point in points)]
    places = [place_of(run.point.static_load, run.point.excitation_hz) for run in lost]
    if any_excitation:
        places = [amount(run.point.static_load, "load") for run in lost]
    runs = listed([run.run for run in lost], _LISTED)
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
        outcomes: list[RunDigest | ExcludedRun] = []
        for outcome in self.outcomes:
            if isinstance(outcome, RunDigest) and outcome.run in problems:
                outcome = ExcludedRun(outcome.run, outcome.point, RigDataError(problems[outcome.run]))
            outcomes.append(outcome)
        remaining = FinishedRuns(tuple(outcomes))
        if outcomes and not remaining.digests:
            raise remaining.excluded[0].error
        return remaining
