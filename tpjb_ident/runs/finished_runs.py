"""Finished runs of one identification: what they say of their excitation lines, and of the campaign.

What is kept of a run is small beside its records: some hundred bytes a window.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rigdata.arrays import ComplexArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from tpjb_ident.check.observation import Observation
from tpjb_ident.phasors.line_means import FilmLines, film_lines, mains_lines
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.runs.excluded_runs import ExcludedRun


@dataclass(frozen=True)
class RunDigest:
    """What a run says."""

    phasors: RunPhasors = field(repr=False)  #: of its excitation lines alone
    mains: ComplexArray | None  #: (2,) complex, m: displacement at the mains line, where it stands apart
    mains_force: ComplexArray | None  #: (2,) complex, N: oil force at the mains line, where it stands apart
    temperatures: dict[int, float]
    harmonics: tuple[FilmLines | None, ...] = ()
    sample_rate: float = 0.0
    observations: tuple[Observation, ...] = field(default=(), repr=False)

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
