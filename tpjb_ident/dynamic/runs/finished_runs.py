"""Finished runs of one identification: a digest of each in memory, the phasors on disk once they are many.

What compares runs over the whole campaign (loads, mains, grouping) needs a few numbers of each; the phasors of all
windows are needed one operating point at a time. So memory does not grow with the campaign: what a small one leaves
stays in memory, the rest waits in the store of finished runs, or in a temporary folder where there is none.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import Observation
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.excluded_runs import DEAD_ACCELEROMETER, ExcludedRun
from tpjb_ident.dynamic.runs.point_data import finite_mean
from tpjb_ident.dynamic.runs.run_store import RunResult, RunStore
from tpjb_ident.phasors.line_means import FilmLines, film_lines, mains_force, mains_line
from tpjb_ident.phasors.run_data import RunPhasors

#: Bytes of phasors that stay in memory.
ROOM = 8 * 2**20
#: Fingerprint of what this process itself has put into its temporary folder.
_OWN = "this process"


@dataclass(frozen=True)
class RunDigest:
    """What is known of a run without its windows."""

    run: str
    point: OperatingPoint
    excitations: tuple[float, ...]
    conditions: tuple[Condition, ...]
    mean_load: FloatArray  #: (2,), N
    mains: ComplexArray | None  #: (2,) complex, m: displacement at the mains line, where it stands apart
    temperatures: dict[int, float]
    harmonics: tuple[FilmLines | None, ...] = ()
    sample_rate: float = 0.0
    mains_force: ComplexArray | None = None  #: (2,) complex, N: oil force at the mains line, where it stands apart
    window: float = 1.0  #: s: length of its windows
    seen: tuple[Observation, ...] = field(default=(), repr=False)


def digest(result: RunResult, sample_rate: float = 0.0) -> RunDigest:
    """Sum up a finished run that was recorded at `sample_rate` [Hz]."""
    phasors = result.phasors
    return RunDigest(
        phasors.run,
        phasors.point,
        tuple(line.frequency for line in phasors.lines.excitation),
        phasors.conditions,
        finite_mean(phasors.cell_force.mean),
        mains_line(phasors),
        result.temperatures,
        film_lines(phasors),
        sample_rate,
        mains_force(phasors),
        phasors.length,
        result.seen,
    )


def _slim(phasors: RunPhasors) -> RunPhasors:
    """The run without the phasors of nuisance lines: estimates need those of the excitation alone."""
    n = len(phasors.lines.excitation)
    return replace(phasors, z=phasors.z[:, :n].copy())


def _bytes(phasors: RunPhasors) -> int:
    arrays = (phasors.z, phasors.mean, phasors.scale, phasors.lost, *phasors.residual)
    return sum(a.nbytes for a in (*arrays, phasors.start, phasors.speeds))


class FinishedRuns:
    """Puts finished runs away and gives them back."""

    def __init__(
        self,
        runs: Sequence[Run],
        housing_mass: float,
        again: Callable[[Run], RunResult],
        store: RunStore | None = None,
        room: int | None = None,
    ) -> None:
        self._runs, self._mass, self._again, self._store = runs, housing_mass, again, store
        self._room = ROOM if room is None else room
        self._digests: dict[int, RunDigest] = {}
        self._left: dict[int, ExcludedRun] = {}
        self._memory: dict[int, RunPhasors] = {}
        self._marks: dict[int, str] = {}
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> FinishedRuns:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Forget the runs, and take the temporary folder away."""
        self._memory.clear()
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    @property
    def places(self) -> list[int]:
        """Of the runs that can be used, in the campaign's order: what `take` takes."""
        return sorted(self._digests)

    @property
    def digests(self) -> list[RunDigest]:
        """Of the runs that can be used, in the order of `places`."""
        return [self._digests[i] for i in self.places]

    @property
    def all_in_memory(self) -> bool:
        """Whether no run waits on disk: what is made of them may stay in memory too."""
        return len(self._memory) == len(self._digests)

    @property
    def left_out(self) -> tuple[ExcludedRun, ...]:
        """Runs that take no part, in the campaign's order."""
        return tuple(self._left[i] for i in sorted(self._left))

    def leave_out(self, index: int, why: ExcludedRun) -> None:
        """Note that a run takes no part."""
        self._left[index] = why
        self._digests.pop(index, None)
        self._memory.pop(index, None)

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
        """Put a finished run away."""
        run = self._runs[index]
        if result is None and self._store is not None:
            result = self._store.load(run, mark, self._mass)
        if result is None:  # cleared by another command since
            result, mark = self._again(run), ""
        self._digests[index] = digest(result, run.sample_rate)
        phasors = _slim(result.phasors)
        size = _bytes(phasors)
        if size <= self._room:
            self._room -= size
            self._memory[index] = phasors
        elif self._store is not None and mark:
            self._marks[index] = mark
        else:
            self._own().keep(_OWN, replace(result, phasors=phasors))

    def take(self, index: int) -> RunPhasors:
        """Phasors of a run's excitation lines."""
        if index in self._memory:
            return self._memory[index]
        run, mark = self._runs[index], self._marks.get(index, "")
        store = self._store if mark and self._store is not None else self._own()
        result = store.load(run, mark or _OWN, self._mass)
        return _slim((result or self._again(run)).phasors)

    def _own(self) -> RunStore:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="tpjb-runs-")
        return RunStore(Path(self._folder.name) / "runs")
