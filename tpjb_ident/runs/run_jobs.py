"""Turning all runs of a campaign to phasors: one job per run, wherever the workers are.

A job carries the run's description and reads the file itself, so that little travels out and a few phasors
travel back.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.conditions import Condition, holding, merged
from tpjb_ident.phasors.reading_cache import beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_data import RunPhasors
from tpjb_ident.phasors.run_phasors import PhasorSettings, run_phasors
from tpjb_ident.phasors.shaft import shaft_phases
from tpjb_ident.phasors.windows import RecordTooShortError
from tpjb_ident.runs.finished_runs import ExcludedRun, FinishedRuns, RunDigest, digest
from tpjb_ident.runs.point_data import mean_temperatures, point_of
from tpjb_ident.runs.run_store import RunStore, file_state, fingerprint
from tpjb_ident.runtime.executors import Workers

Progress = Callable[[str, int, int], None]
#: Condition of a run whose accelerometer is dead.
_DEAD_ACCELEROMETER = "accelerometer-dead"


def all_runs(
    campaign: Campaign,
    settings: PhasorSettings,
    progress: Progress,
    workers: Workers | None = None,
    store: RunStore | None = None,
) -> FinishedRuns:
    """What every dynamic run says; one that cannot be used is left out and named."""
    runs = campaign.of_kind("dynamic")
    mass = campaign.housing_mass
    progress(runs[0].id if runs else "", 0, len(runs))
    jobs = []
    for run in runs:  # workers may stand in another folder
        reader: Any = run.reader
        if not reader.path.is_absolute():
            reader = replace(reader, path=reader.path.absolute())
        stored = None if store is None else store.known(run.id)
        jobs.append((replace(run, reader=reader), mass, settings, stored))
    finished: list[RunDigest | ExcludedRun] = []
    results = (workers or Workers()).map(process_run, jobs)
    for run, (mark, result) in zip(runs, results, strict=True):
        if store is not None and mark and isinstance(result, RunDigest):
            store.keep(mark, result)
        if store is not None and result is None:  # or cleared by another command since
            result = store.load(run, mark)
        finished.append(result or one_run(run, mass, settings))
        progress(run.id, len(finished), len(runs))
    gathered = FinishedRuns(tuple(finished))
    return gathered.without(_dead_accelerometers(gathered.digests))


def _dead_accelerometers(digests: Sequence[RunDigest]) -> dict[str, Problem]:
    """Runs with a dead accelerometer, where most of the others show that there is an acceleration."""
    cure = "Check sensor, cable and amplifier; repeat the run"
    dead = {}
    for run in digests:
        for condition in run.phasors.conditions:
            if condition == _DEAD_ACCELEROMETER:
                dead[run.run] = Problem("error", run.observations[0].run.file, "", condition.detail, cure, run.run)
    return dead if 2 * len(dead) < len(digests) else {}


def process_run(
    run: Run, housing_mass: float, settings: PhasorSettings, stored: str | None
) -> tuple[str, RunDigest | ExcludedRun | None]:
    """Fingerprint of a run, and its result unless the fingerprint is the one already `known`.

    The fingerprint is "" where the record changed while it was read: such a result must not be kept. Where nothing
    is kept anywhere (`known` is None) it is not asked for.
    """
    try:
        if stored is None:
            return "", one_run(run, housing_mass, settings)
        with run.opened():  # once for both
            mark = fingerprint(run, housing_mass, settings)
            if mark and mark == stored:
                return mark, None
            before = file_state(run.reader.path)
            result = one_run(run, housing_mass, settings)
        return (mark if before == file_state(run.reader.path) else ""), result
    except (RigDataError, RecordTooShortError) as error:
        return "", ExcludedRun(run.id, run.point, error)


def one_run(run: Run, housing_mass: float, settings: PhasorSettings) -> RunDigest:
    """What one run says."""
    with run.opened():
        cached = with_kept_beginning(run)
        try:
            phasors = run_phasors(cached, housing_mass, settings)
        except RecordTooShortError as error:
            raise RecordTooShortError(f"run {run.id}: {error}", error.needed) from error
        observations = _observed(run, cached, phasors)
        phasors, dead = _without_dead(phasors, observations[0])
        repairs = [f"{p.file}, {p.place}: {p.what}" for p in run.reader.problems() if p.severity == "warning"]
        repaired = holding((repairs, "record-damaged", "; ".join(repairs)))
        conditions = merged(phasors.conditions, dead, repaired)
        result = replace(phasors, conditions=conditions, shaft_phase=shaft_phases(cached, phasors))
        return digest(result, mean_temperatures(cached), run.sample_rate, observations)


def _observed(run: Run, cached: Run, phasors: RunPhasors) -> tuple[Observation, ...]:
    """What the checks make of the run's beginning, at every excitation frequency that was found in it.

    The observations are of the run itself, so that what the beginning holds in memory may go.
    """
    beginning, driven = beginning_of(cached), phasors.lines.driven
    observations = []
    for line, frequency in enumerate(driven):
        point = replace(run.point, excitation=2 * np.pi * frequency)
        observed = observe(replace(beginning, point=point), phasors, line)
        line_run = run if len(driven) == 1 else replace(run, point=point_of(run.point, frequency))
        report = Reporter(line_run, observed.report.findings, observed.report.doubts)
        observations.append(replace(observed, run=line_run, report=report))
    return tuple(observations)


def _without_dead(phasors: RunPhasors, observation: Observation) -> tuple[RunPhasors, tuple[Condition, ...]]:
    """The run without spare channels that the checks call dead; refused with a dead probe or cell.

    What is said of a dead accelerometer: the run may do without.
    """
    dead = {finding.key: finding.problem for finding in observation.report.findings if finding.key.startswith("dead ")}
    grave, conditions, spare = [], [], []
    for k, channel in enumerate(phasors.channels):
        problem = dead.get(f"dead {channel.name}")
        if problem is None:
            continue
        if problem.severity != "error":
            spare.append(k)
        elif channel.quantity == "acceleration":
            conditions.append(Condition(_DEAD_ACCELEROMETER, f"{problem.place} of {phasors.run} {problem.what}"))
        else:
            grave.append(problem)
    if grave:
        raise RigDataError(grave)
    z, mean = phasors.z.copy(), phasors.mean.copy()
    z[:, :, spare], mean[:, spare] = np.nan, np.nan
    return replace(phasors, z=z, mean=mean), tuple(conditions)
