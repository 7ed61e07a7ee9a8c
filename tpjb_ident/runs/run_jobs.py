"""Turning all runs of a campaign to phasors, one job per run, wherever the workers are; finished ones are kept.

A job carries the run's description and reads the file itself, so that little travels out and a few phasors travel back.
Finished runs are kept beside the results until all are done: a rerun after a kill goes on where it stopped.

How a stale result is kept out: a kept run counts only if its fingerprint is found again. The fingerprint is the
SHA-256 of everything that the run's phasors depend on: every stored byte of its record, its entry in the manifest
with the calibration of all channels, the housing's mass, the settings, the limits of the checks, the versions of the
numerical packages and the sources of the code that reads and fits. It is computed anew, from the files, for every run
of a rerun (which is several times quicker than reading and fitting it); nothing is concluded from names, sizes or
dates. A record that changes while it is read is not kept. Files are written whole or not at all, and one that cannot be
read is no result. No pickles: a folder of results may come from anybody.

The rig without its bearing is known from a dry shaker test. What hoses, seals and cables carry past the film is in
the cells' force too. The campaign's `baseline` runs measure it, F = H_b D without oil; in the dynamic runs F = (H +
H_b) D.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.calibration import Channel
from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.findings import QUESTIONS, Finding, Reporter, Verdicts, reach, verdicts
from tpjb_ident.check.observation import Observation, RecordLines, observe
from tpjb_ident.conditions import Condition, Conditions, holding, merged
from tpjb_ident.estimate.equation import RigStiffness
from tpjb_ident.estimators.estimate import estimate_table
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.phasors.frequency import shaft_phases
from tpjb_ident.phasors.lines import Line, LineSet, RecordTooShortError
from tpjb_ident.phasors.run_data import FilmLine, PhasorSettings, RunPhasors, beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_phasors import run_phasors
from tpjb_ident.runs.point_data import ExcludedRun, FinishedRuns, RunDigest, digest, gather, mean_temperatures, point_of
from tpjb_ident.runtime.executors import Workers
from tpjb_ident.runtime.provenance import sha256, source_stamp
from tpjb_ident.runtime.tables import write_atomic

#: What tells whether a file is still the one that was read: size, time of its last change [ns], node.
FileState = tuple[int, int, int]
#: Classes that a result is made of, field by field, and series of values.
_RECORDS = (
    RunDigest, OperatingPoint, LineSet, Line, FilmLine,
    Observation, RecordLines, Reporter, Finding, Problem,
)  # fmt: skip
_MADE: dict[str, Any] = {kind.__name__: kind for kind in (*_RECORDS, tuple, list, set)}


def file_state(path: Path) -> FileState | None:
    """State of an ordinary file; None where there is none, or none that may be looked at."""
    try:
        status = path.stat()
    except OSError:
        return None
    return (status.st_size, status.st_mtime_ns, status.st_ino) if path.is_file() else None


def fingerprint(run: Run, settings: PhasorSettings) -> str:
    """SHA-256 of everything that a run's phasors depend on; "" where its file is gone."""
    reader: Any = run.reader
    try:
        record = reader.stored_hash() if hasattr(reader, "stored_hash") else sha256(reader.path)
    except OSError:  # whoever reads it next says what is wrong with it
        return ""
    entry = (run.id, run.kind, run.point, run.excitation_direction, dict(run.channels), reader)
    described = (dict(reader.channels), run.housing_mass, settings)
    text = "\n".join([record, repr(entry), repr(described), repr(QUESTIONS), source_stamp()])
    return hashlib.sha256(text.encode()).hexdigest()


class RunStore:
    """A folder of finished runs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _file(self, run_id: str) -> Path:
        return self.folder / f"{hashlib.sha256(run_id.encode()).hexdigest()[:32]}.npz"

    def load(self, run: Run) -> tuple[str, RunDigest | None]:
        """Fingerprint under which a run is kept, and what it says; "" and None if it is not."""
        try:
            # opened here: numpy leaves a file open that it cannot understand
            with self._file(run.id).open("rb") as file, np.load(file, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            meta = json.loads(str(arrays.pop("meta")))
            mark, result = meta["fingerprint"], unpacked(meta["result"], arrays, run)
            is_ours = meta["run"] == run.id and isinstance(mark, str) and isinstance(result, RunDigest)
        except Exception:  # whatever reading says of what is not there, cut off, or not ours: the run is done again
            is_ours = False
        return (mark, result) if is_ours else ("", None)

    def keep(self, mark: str, result: RunDigest) -> None:
        """Keep a finished run under its fingerprint `mark`."""
        arrays: dict[str, Any] = {}
        meta = {"fingerprint": mark, "run": result.run, "result": packed(result, arrays)}
        text = np.array(json.dumps(meta))
        with suppress(FileNotFoundError):  # another run into the same folder has ended and cleared it
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomic(self._file(result.run), lambda path: np.savez(path, meta=text, **arrays))

    def clear(self) -> None:
        """Forget everything; the folder that it lies in goes too if nothing else is there."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):  # other results are in it
            self.folder.parent.rmdir()


def packed(value: Any, arrays: dict[str, Any]) -> Any:
    """A value as JSON can hold it: what it is made of by the name of its class, its arrays in `arrays`.

    Channels are those of the run, by name; of the run itself only the excitation is kept that was looked at.
    """
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        name = f"array {len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, Condition):
        return {"condition": [str(value), value.detail]}
    if isinstance(value, Channel):
        return {"channel": value.name}
    if isinstance(value, Run):
        return {"run": value.point.excitation}
    if isinstance(value, dict):
        return {"dict": [[key, packed(item, arrays)] for key, item in value.items()]}
    if isinstance(value, tuple | list | set):
        return {kind: [packed(item, arrays) for item in value]}
    if is_dataclass(value):
        return {kind: {f.name: packed(getattr(value, f.name), arrays) for f in fields(value)}}
    return value


def unpacked(stored: Any, arrays: dict[str, np.ndarray], run: Run) -> Any:
    """What `packed` was given, of `run`."""
    if not isinstance(stored, dict):
        return stored
    ((kind, content),) = stored.items()
    if kind == "array":
        return arrays[content]
    if kind == "condition":
        return Condition(*content)
    if kind == "channel":
        return run.channels[content]
    if kind == "run":
        return replace(run, point=replace(run.point, excitation=content))
    if kind == "dict":
        return {key: unpacked(item, arrays, run) for key, item in content}
    if isinstance(content, list):
        return _MADE[kind](unpacked(item, arrays, run) for item in content)
    return _MADE[kind](**{name: unpacked(item, arrays, run) for name, item in content.items()})


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
    progress(runs[0].id if runs else "", 0, len(runs))
    jobs, former_results = [], []
    for run in runs:  # workers may stand in another folder
        reader: Any = run.reader
        if not reader.path.is_absolute():
            reader = replace(reader, path=reader.path.absolute())
        old_mark, former = (None, None) if store is None else store.load(run)
        jobs.append((replace(run, reader=reader), settings, old_mark))
        former_results.append(former)
    finished: list[Any] = []
    results = (workers or Workers()).map(process_run, jobs)
    for run, former, (mark, result) in zip(runs, former_results, results, strict=True):
        if store is not None and mark and isinstance(result, RunDigest):
            store.keep(mark, result)
        finished.append(result or former)
        progress(run.id, len(finished), len(runs))
    gathered = FinishedRuns(tuple(finished))
    return gathered.without(_dead_accelerometers(gathered.digests))


def _dead_accelerometers(digests: Sequence[RunDigest]) -> dict[str, Problem]:
    """Runs with a dead accelerometer, where most of the others show that there is an acceleration."""
    cure = "Check sensor, cable and amplifier; repeat the run"
    dead = {}
    for run in digests:
        for condition in run.conditions:
            if condition == _DEAD_ACCELEROMETER:
                dead[run.run] = Problem("error", run.observations[0].run.file, "", condition.detail, cure, run.run)
    return dead if 2 * len(dead) < len(digests) else {}


def process_run(run: Run, settings: PhasorSettings, old_mark: str | None) -> tuple[str, RunDigest | ExcludedRun | None]:
    """Fingerprint of a run, and its result unless the fingerprint is `old_mark`.

    The fingerprint is "" where the record changed while it was read: such a result must not be kept. Where nothing
    is kept anywhere (`old_mark` is None) it is not asked for.
    """
    try:
        if old_mark is None:
            return "", one_run(run, settings)
        with run.opened():  # once for both
            mark = fingerprint(run, settings)
            if mark and mark == old_mark:
                return mark, None
            before = file_state(run.reader.path)
            result = one_run(run, settings)
        return (mark if before == file_state(run.reader.path) else ""), result
    except (RigDataError, RecordTooShortError) as error:
        return "", ExcludedRun(run.id, run.point, error)


def one_run(run: Run, settings: PhasorSettings) -> RunDigest:
    """What one run says."""
    with run.opened():
        cached = with_kept_beginning(run)
        try:
            phasors = run_phasors(cached, settings)
        except RecordTooShortError as error:
            raise RecordTooShortError(f"run {run.id}: {error}") from error
        observations = _observed(run, cached, phasors)
        phasors, dead = _without_dead(phasors, observations[0])
        repairs = [f"{p.file}, {p.place}: {p.what}" for p in run.reader.problems() if p.severity == "warning"]
        repaired = holding((repairs, "record-damaged", "; ".join(repairs)))
        conditions = merged(phasors.conditions, dead, repaired)
        phases, temperatures = shaft_phases(cached, phasors), mean_temperatures(cached)
        result = replace(phasors, conditions=conditions, shaft_phase=phases, temperatures=temperatures)
        return digest(result, observations)


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
        report = Reporter(line_run, observed.report.findings, observed.report.cells_doubted)
        observations.append(replace(observed, run=line_run, report=report))
    return tuple(observations)


def _without_dead(phasors: RunPhasors, observation: Observation) -> tuple[RunPhasors, Conditions]:
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


#: Runs that tell of the channels what dynamic runs cannot.
_STATIC = ("dry_pivot", "clearance", "locus")
_CONTRADICTED, _DOUBTFUL, _RUN_GAIN = "records-contradicted", "records-doubtful", "run-gain-off"


def campaign_verdicts(campaign: Campaign, observations: Sequence[Observation]) -> Verdicts:
    """What the checks say of dynamic runs, by run; static runs say what they show of the channels."""
    if not observations:  # runs that are no files
        return Verdicts()
    static = [observe(run) for run in campaign.runs if run.kind in _STATIC]
    reports = [observation.report for observation in judged(campaign, [*observations, *static])[0]]
    reach(reports)
    result = verdicts([report for report in reports if report.run.kind == "dynamic"])
    for report in reports:
        result.doubted.extend(report.doubted)
        for name, deviation in report.off.items():
            result.off[report.run.id, name] = deviation
    for observation in static:
        for i in observation.pick("displacement") if observation.run.kind == "clearance" else ():
            result.swept[observation.run.id, observation.channels[i].name] = np.ptp(observation.spread[:, i]) / 2
    # without accelerometers the inertia stays in the force: that is told, and no reason to refuse
    optional = {f"channel {c.name}" for c in campaign.channels.values() if c.quantity == "acceleration"}
    for run, problems in result.shared.items():
        for problem in tuple(problems):
            if problem.place in optional:
                problems.remove(problem)
                result.doubtful.setdefault(run, []).append(problem)
    return result


def check_conditions(result: Verdicts, runs: Sequence[str]) -> Conditions:
    """What the checks say of one point."""
    conditions = []
    groups = ((_CONTRADICTED, result.shared), (_DOUBTFUL, result.doubtful), (_RUN_GAIN, result.run_gains))
    for name, by_run in groups:
        problems = list(chain.from_iterable(by_run.get(run, ()) for run in runs))
        if problems:
            conditions.append(Condition(name, _sentence(problems)))
    return tuple(conditions)


def _sentence(problems: list[Problem]) -> str:
    """The first finding; how many more there are."""
    different = list(dict.fromkeys(f"{p.place} {p.what}".strip() for p in problems))
    first = f"{problems[0].run}: {different[0]}" if problems[0].run else different[0]
    addition = f"; and {len(different) - 1} more (see tpjb check)" if len(different) > 1 else ""
    return f"{first}{addition}. {problems[0].cure}"


@dataclass(frozen=True, repr=False)
class DryTest:
    """What a campaign's dry shaker test says."""

    stiffness: RigStiffness = field(default_factory=RigStiffness)
    conditions: Conditions = ()  #: where no run gives an answer

    def missing(self, omega: float) -> Conditions:
        """Say where a campaign has baseline runs, but no answer of theirs at `omega` [rad/s]."""
        if self.stiffness.known(np.array([omega]))[0]:
            return ()
        if not len(self.stiffness.omega):
            return self.conditions
        low, high = self.stiffness.omega[[0, -1]] / (2 * np.pi)
        text = f"measured from {low:g} to {high:g} Hz: at this excitation the rig's own stiffness is still inside"
        return (Condition("baseline-missing", text),)


def dry_test(campaign: Campaign, settings: PhasorSettings, method: str) -> DryTest:
    """Dry test of a campaign from its baseline runs."""
    runs = campaign.of_kind("baseline")
    if not runs:
        return DryTest()
    for run in runs:
        errors = [f.problem for f in observe(run).report.findings if f.problem.severity == "error"]
        if errors:  # clipped or dead: there is no dry test without its channels
            raise RigDataError(errors)
    points = gather([run_phasors(run, settings) for run in runs])
    estimates = [estimate_table(phasor_table(p.D, p.F, p.run_index), p.omega, method) for p in points]
    good, bad = [], []
    for est in estimates:
        if np.isfinite(est.covariance).all():
            good.append((est.omega, est.h, est.covariance))
        else:
            bad.append(f"{est.omega / (2 * np.pi):g} Hz")
    good.sort(key=lambda numbers: numbers[0])
    text = f"the baseline runs at {', '.join(bad)} give no answer: two directions are needed"
    conditions = holding((bad, "baseline-missing", text))
    if not good:
        return DryTest(conditions=conditions)
    return DryTest(RigStiffness(*map(np.array, zip(*good))), conditions)
