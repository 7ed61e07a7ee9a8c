"""Turning all runs of a campaign to phasors: one after the other, or spread by an executor.

Any `concurrent.futures.Executor` will do: a process pool on one machine, or what a Dask client's
``get_executor()`` gives. A job opens the campaign itself, by its path, so only names travel out and a
few phasors travel back; a job that is lost with its worker is done here.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpjb_ident.dynamic.run_phasors import PhasorSettings, RunPhasors, run_phasors
from tpjb_ident.dynamic.windows import RecordTooShortError

Progress = Callable[[str, int, int], None]
#: Samples from which a run's temperatures are taken.
TEMPERATURE_SAMPLES = 2**17


@dataclass(frozen=True)
class RunResult:
    """What is kept of a run.

    Attributes
    ----------
    phasors : RunPhasors
    temperatures : dict of int to float
        Mean per pad [K].
    """

    phasors: RunPhasors
    temperatures: dict[int, float]


def all_runs(
    campaign: Any, settings: PhasorSettings, progress: Progress, executor: Executor | None = None
) -> list[RunResult]:
    """Phasors and temperatures of every dynamic run, in the campaign's order.

    Parameters
    ----------
    campaign : rigdata.campaign.Campaign
    settings : PhasorSettings
    progress : callable
        Called as progress(text, done, total).
    executor : concurrent.futures.Executor, optional
        Spreads the runs; the numbers are the same.

    Raises
    ------
    RecordTooShortError, rigdata.problem.RigDataError
        Of the first run, in order, that cannot be used.
    """
    runs = campaign.of_kind("dynamic")
    if executor is None:
        jobs = [functools.partial(one_run, run, campaign.housing_mass, settings) for run in runs]
    else:
        futures = [executor.submit(_remote_run, str(campaign.path), run.id, settings) for run in runs]
        jobs = [
            functools.partial(_collected, future, run, campaign.housing_mass, settings)
            for future, run in zip(futures, runs)
        ]
    results = []
    for i, (run, job) in enumerate(zip(runs, jobs)):
        progress(run.id, i, len(runs))
        results.append(job())
    return results


def one_run(run: Any, housing_mass: float, settings: PhasorSettings) -> RunResult:
    """Phasors and temperatures of one run."""
    try:
        phasors = run_phasors(run, housing_mass, settings)
    except RecordTooShortError as error:
        raise RecordTooShortError(f"run {run.id}: {error}", error.needed) from error
    return RunResult(phasors, mean_temperatures(run))


def _collected(future: Any, run: Any, housing_mass: float, settings: PhasorSettings) -> RunResult:
    """Result of a remote job; what went wrong there is tried again here, where the error is whole."""
    try:
        result: RunResult = future.result()
    except Exception:  # a lost worker raises whatever its executor thinks fit
        return one_run(run, housing_mass, settings)
    return result


def _remote_run(path: str, run_id: str, settings: PhasorSettings) -> RunResult:
    campaign = _opened(path)
    return one_run(campaign.run(run_id), campaign.housing_mass, settings)


@functools.lru_cache(maxsize=4)
def _opened(path: str) -> Any:
    from rigdata.campaign import load_campaign

    return load_campaign(path)


def mean_temperatures(run: Any) -> dict[int, float]:
    """Mean temperature per pad over a run [K]; pads with several sensors give their mean."""
    found: dict[int, list[float]] = {}
    for sensor in run.temperatures():
        if sensor.pad is None:
            continue
        values = run.record(sensor.channel, 0, TEMPERATURE_SAMPLES).values
        known = values[np.isfinite(values)]
        if len(known):
            found.setdefault(sensor.pad, []).append(float(known.mean()))
    return {pad: float(np.mean(values)) for pad, values in sorted(found.items())}
