"""Finished runs of one identification: what they say of their excitation lines, and of the campaign.

What is kept of a run is small beside its records: some hundred bytes a window.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from rigdata.arrays import ComplexArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import Observation
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.excluded_runs import DEAD_ACCELEROMETER, ExcludedRun
from tpjb_ident.dynamic.runs.run_store import RunResult, RunStore
from tpjb_ident.phasors.line_means import FilmLines, film_lines, mains_force, mains_line
from tpjb_ident.phasors.run_data import RunPhasors


@dataclass(frozen=True)
class RunDigest:
    """What a run says."""

    phasors: RunPhasors = field(repr=False)  #: of its excitation lines alone
    mains: ComplexArray | None  #: (2,) complex, m: displacement at the mains line, where it stands apart
    mains_force: ComplexArray | None  #: (2,) complex, N: oil force at the mains line, where it stands apart
    temperatures: dict[int, float]
    harmonics: tuple[FilmLines | None, ...] = ()
    sample_rate: float = 0.0
    seen: tuple[Observation, ...] = field(default=(), repr=False)

    @property
    def run(self) -> str:
        """Name."""
        return self.phasors.run

    @property
    def point(self) -> OperatingPoint:
        """Set point."""
        return self.phasors.point

    @property
    def excitations(self) -> tuple[float, ...]:
        """Frequencies of its excitation lines [Hz]."""
        return self.phasors.lines.driven

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What its records gave rise to."""
        return self.phasors.conditions


def digest(result: RunResult, sample_rate: float = 0.0) -> RunDigest:
    """Sum up a finished run that was recorded at `sample_rate` [Hz]."""
    phasors = result.phasors
    lines = len(phasors.lines.excitation)
    return RunDigest(
        replace(phasors, z=phasors.z[:, :lines].copy()),
        mains_line(phasors),
        mains_force(phasors),
        result.temperatures,
        film_lines(phasors),
        sample_rate,
        result.seen,
    )


class FinishedRuns:
    """Gathers finished runs; those that cannot be used are left out and named."""

    def __init__(
        self, runs: Sequence[Run], housing_mass: float, again: Callable[[Run], RunResult], store: RunStore | None = None
    ) -> None:
        self._runs, self._mass, self._again, self._store = runs, housing_mass, again, store
        self._digests: dict[int, RunDigest] = {}
        self._left: dict[int, ExcludedRun] = {}

    @property
    def places(self) -> list[int]:
        """Of the runs that can be used, in the campaign's order."""
        return sorted(self._digests)

    @property
    def digests(self) -> list[RunDigest]:
        """Of the runs that can be used, in the order of `places`."""
        return [self._digests[i] for i in self.places]

    @property
    def left_out(self) -> tuple[ExcludedRun, ...]:
        """Runs that take no part, in the campaign's order."""
        return tuple(self._left[i] for i in sorted(self._left))

    def leave_out(self, index: int, why: ExcludedRun) -> None:
        """Note that a run takes no part."""
        self._left[index] = why
        self._digests.pop(index, None)

    def leave_out_dead_accelerometers(self) -> None:
        """Leave out runs with a dead accelerometer, where most of the others show that there is an acceleration."""
        dead = [i for i, one in self._digests.items() if DEAD_ACCELEROMETER in one.conditions]
        if 2 * len(dead) < len(self._digests):
            for i in dead:
                run = self._runs[i]
                (dead_one,) = (c for c in self._digests[i].conditions if c == DEAD_ACCELEROMETER)
                cure = "Check sensor, cable and amplifier; repeat the run"
                problem = Problem("error", run.file, "", dead_one.detail, cure, run.id)
                self.leave_out(i, ExcludedRun(run.id, run.point, RigDataError(problem)))

    def leave_out_unusable(self, errors: Mapping[str, Problem]) -> None:
        """Leave out runs in which the checks found an error of their own."""
        for i in self.places:
            run = self._runs[i]
            if run.id in errors:
                self.leave_out(i, ExcludedRun(run.id, run.point, RigDataError(errors[run.id])))

    def put(self, index: int, result: RunResult | None, mark: str = "") -> None:
        """Take a finished run; None where the store has it under its fingerprint `mark`."""
        run = self._runs[index]
        if result is None and self._store is not None:
            result = self._store.load(run, mark, self._mass)
        if result is None:  # cleared by another command since
            result = self._again(run)
        self._digests[index] = digest(result, run.sample_rate)
