"""Records that have landed: nobody writes to them any more; those that no run names, by their name or content."""

import math
import re
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.campaign import Campaign, run_in_file
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.survey.spectrum import amplitude_spectrum, strongest
from rigdata.vector import directions
from tpjb_ident.runs.run_jobs import FileState, file_state


class NewFiles:
    """Follows files until they are stable."""

    def __init__(
        self, settle: float, clock: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._settle, self._clock, self._steady = settle, clock, steady
        self._since: dict[Path, tuple[FileState, float]] = {}

    def look(self, paths: Iterable[Path]) -> tuple[dict[Path, FileState], list[Path]]:
        """Stable files with their state, and those that are still being written.

        An empty file is still being written: a logger has opened it and holds the samples back.
        """
        stable = {}
        written = []
        now = self._steady()
        for path in paths:
            state = file_state(path)
            before = self._since.pop(path, None)
            if state is None:
                continue
            size, changed, _ = state
            if before is None or before[0] != state:
                # a file that was finished before we first looked need not be waited for
                age = self._clock() - 1e-9 * changed if before is None else 0.0
                before = state, now - max(0.0, age)
            self._since[path] = before
            if size > 0 and now - before[1] >= self._settle:
                stable[path] = state
            else:
                written.append(path)
        return stable, written


#: What loggers and people append to the name of a record that is made again.
_AGAIN = re.compile(r"[-_. (]*(?:r|rep|repeat|again|copy|wdh|bis|v|no|nr)?[-_. ]*\d{0,4}[a-d]?\)?", re.IGNORECASE)
#: How near the record must be to a planned set point: load vector and frequency as shares, direction [rad].
_NEAR_LOAD, _NEAR_LINE, _NEAR_DIRECTION = 0.1, 0.01, math.radians(10.0)
#: The planned line must hold this share of the oscillation of the force.
_DRIVEN = 0.5


@dataclass(frozen=True)
class Unplanned:
    """A record that the manifest does not name."""

    file: str
    run: Run | None
    like: str
    why: str


def place_record(campaign: Campaign, path: Path, done: frozenset[str]) -> Unplanned:
    """Find the planned run that a record is, or repeats."""
    file, stem = path.relative_to(campaign.path).as_posix(), path.stem
    named = []
    for run in campaign.runs:
        if stem.lower().startswith(run.id.lower()) and _AGAIN.fullmatch(stem[len(run.id) :]):
            named.append(run)
    planned, evidence = max(named, key=lambda run: len(run.id), default=None), "its name"
    if planned is None:
        try:
            planned, evidence = _by_content(campaign, path, file), "load and line"
        except RigDataError as error:
            return Unplanned(file, None, "", f"cannot be read ({error.problems[0].what})")
    if planned is None:
        return Unplanned(file, None, "", "no planned run has its load, frequency and direction")
    run_id = file if any(run.id == stem for run in campaign.runs) else stem
    text = f"{'repeats' if planned.id in done else 'is'} {planned.id} by {evidence}"
    return Unplanned(file, run_in_file(planned, path, file, run_id), planned.id, text)


def _by_content(campaign: Campaign, path: Path, file: str) -> Run | None:
    """The one planned dynamic or locus run whose mean force and line the record shows; None if none or several."""
    candidates = [run for run in campaign.runs if run.kind in ("dynamic", "locus")]
    if not candidates:
        return None
    record = run_in_file(candidates[0], path, file, path.stem).vector("force")
    force = record.values[np.isfinite(record.values).all(axis=1)]
    if len(force) < 16:
        return None
    fitting = [run for run in candidates if _fits(run, force, record.rate)]
    tests = {(run.kind, run.point, run.excitation_direction) for run in fitting}
    return fitting[0] if len(tests) == 1 else None


def _fits(run: Run, force: FloatArray, rate: float) -> bool:
    point = run.point
    # the housing is pulled the way the film carries the shaft: cells read the load on the shaft, reversed or not
    planned = point.static_load * directions(point.static_load_direction)
    mean = force.mean(axis=0)
    if min(np.linalg.norm(mean - planned), np.linalg.norm(mean + planned)) > _NEAR_LOAD * point.static_load:
        return False
    oscillation = force - mean
    size = np.sqrt((oscillation**2).sum(axis=1).mean())
    if run.kind != "dynamic":
        return size < 0.02 * point.static_load
    along = np.linalg.svd(oscillation, full_matrices=False)[2][0]
    lines = strongest(*amplitude_spectrum(oscillation @ along, rate), 1)
    if not lines or abs(lines[0].frequency / point.excitation_hz - 1.0) > _NEAR_LINE:
        return False
    if lines[0].amplitude < _DRIVEN * size * math.sqrt(2.0):
        return False
    if run.excitation_direction is None:
        return True
    away = math.atan2(along[1], along[0]) - run.excitation_direction
    return abs((away + math.pi / 2) % math.pi - math.pi / 2) < _NEAR_DIRECTION
