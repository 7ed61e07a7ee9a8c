"""Finished runs kept beside the results until all are done: a rerun after a kill goes on where it stopped.

How a stale result is kept out: a kept run counts only if its fingerprint is found again. The fingerprint is the
SHA-256 of everything that the run's phasors depend on: every stored byte of its record, its entry in the manifest
with the calibration of all channels, the housing's mass, the settings, the versions of the numerical packages and
the sources of the code that reads and fits. It is computed anew, from the files, for every run of a rerun (which is
several times quicker than reading and fitting it); nothing is concluded from names, sizes or dates. A record that
changes while it is read is not kept. Files are written whole or not at all, and one that cannot be read is no
result. No pickles: a folder of results may come from anybody.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.problem import Problem
from rigdata.run import Run
from tpjb_ident.check.findings import Finding, Reporter
from tpjb_ident.check.lines import RecordLines
from tpjb_ident.check.observation import Observation
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.runtime.provenance import sha256, source_stamp
from tpjb_ident.runtime.tables import write_atomic

_ARRAYS = ("start", "z", "mean", "scale", "lost", "speeds", "shaft_phase", "record")
_LINES = ("excitation", "nuisance", "faint")
#: What reading says of an entry that is cut off, or that somebody else wrote.
_NOT_OURS = (OSError, ValueError, LookupError, TypeError, EOFError, MemoryError, RuntimeError, zipfile.BadZipFile)


@dataclass(frozen=True)
class RunResult:
    """Phasors and temperatures of a run."""

    phasors: RunPhasors
    temperatures: dict[int, float]
    seen: tuple[Observation, ...] = field(default=(), repr=False)


def fingerprint(run: Run, housing_mass: float, settings: PhasorSettings) -> str:
    """SHA-256 of everything that a run's phasors depend on.

    "" where the run has no file of its own, or none any more.
    """
    reader = getattr(run, "reader", None)
    if reader is None:
        return ""
    try:
        record = reader.stored_hash() if hasattr(reader, "stored_hash") else sha256(reader.path)
    except OSError:  # whoever reads it next says what is wrong with it
        return ""
    entry = (run.id, run.kind, run.point, run.excitation_direction, dict(run.channels), reader)
    described = (dict(getattr(reader, "channels", {})), housing_mass, settings)
    text = "\n".join([record, repr(entry), repr(described), source_stamp()])
    return hashlib.sha256(text.encode()).hexdigest()


class RunStore:
    """A folder of finished runs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def _file(self, run_id: str) -> Path:
        return self.folder / f"{hashlib.sha256(run_id.encode()).hexdigest()[:32]}.npz"

    def known(self, run_id: str) -> str:
        """Fingerprint under which a run is kept, "" if it is not."""
        stored = self._read(run_id)
        return "" if stored is None else str(stored[0]["fingerprint"])

    def _read(self, run_id: str) -> tuple[dict[str, Any], dict[str, np.ndarray]] | None:
        try:
            # opened here: numpy leaves a file open that it cannot understand
            with self._file(run_id).open("rb") as file, np.load(file, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            meta = json.loads(str(arrays.pop("meta")))
            if meta["run"] != run_id or not isinstance(meta["fingerprint"], str):
                return None
        except _NOT_OURS:
            return None  # not there, cut off, or not ours: the run is simply done again
        return meta, arrays

    def keep(self, mark: str, result: RunResult) -> None:
        """Keep a finished run under its fingerprint `mark`."""
        phasors = result.phasors
        arrays: dict[str, Any] = {name: getattr(phasors, name) for name in _ARRAYS}
        arrays.update({f"residual.{i}": bins for i, bins in enumerate(phasors.residual)})
        meta = {
            "fingerprint": mark,
            "run": phasors.run,
            "length": phasors.length,
            "channels": [c.name for c in phasors.channels],
            "device": phasors.device,
            "span": phasors.span,
            "lines": _packed_lines(phasors.lines),
            "conditions": _packed_conditions(phasors.conditions),
            "temperatures": {str(pad): value for pad, value in result.temperatures.items()},
            "seen": [packed(observation) for observation in result.seen],
        }
        text = np.array(json.dumps(meta))
        with suppress(FileNotFoundError):  # another run into the same folder has ended and cleared it
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomic(self._file(phasors.run), lambda path: np.savez(path, meta=text, **arrays))

    def load(self, run: Run, mark: str, housing_mass: float) -> RunResult | None:
        """Give a kept run back; None if it is not there, or not under this fingerprint."""
        stored = self._read(run.id)
        if not mark or stored is None or stored[0]["fingerprint"] != mark:
            return None
        try:
            return self._unpacked(run, *stored, housing_mass)
        except _NOT_OURS:
            return None

    def _unpacked(
        self, run: Run, meta: dict[str, Any], arrays: dict[str, np.ndarray], housing_mass: float
    ) -> RunResult:
        residual = [arrays.pop(f"residual.{i}") for i in range(len(arrays) - len(_ARRAYS))]
        phasors = RunPhasors(
            run=run.id,
            point=run.point,
            direction=run.excitation_direction,
            lines=_unpacked_lines(meta["lines"]),
            length=meta["length"],
            channels=tuple(run.channels[name] for name in meta["channels"]),
            housing_mass=housing_mass,
            conditions=_unpacked_conditions(meta["conditions"]),
            span=None if meta["span"] is None else tuple(meta["span"]),
            device=tuple(meta["device"]),
            residual=tuple(residual),
            **arrays,
        )
        seen = tuple(unpacked(entry, run) for entry in meta["seen"])
        return RunResult(phasors, {int(pad): value for pad, value in meta["temperatures"].items()}, seen)

    def clear(self) -> None:
        """Forget everything; the folder that it lies in goes too if nothing else is there."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):  # other results are in it
            self.folder.parent.rmdir()


def _packed_conditions(conditions: tuple[Condition, ...]) -> list[list[str]]:
    return [[str(c), c.detail] for c in conditions]


def _unpacked_conditions(stored: list[list[str]]) -> tuple[Condition, ...]:
    return tuple(Condition(name, detail) for name, detail in stored)


def _packed_lines(lines: LineSet) -> dict[str, Any]:
    return {
        **{kind: [list(vars(line).values()) for line in getattr(lines, kind)] for kind in _LINES},
        "conditions": _packed_conditions(lines.conditions),
        "speed": lines.speed,
    }


def _unpacked_lines(stored: dict[str, Any]) -> LineSet:
    lines = {kind: tuple(Line(*line) for line in stored[kind]) for kind in _LINES}
    return LineSet(conditions=_unpacked_conditions(stored["conditions"]), speed=stored["speed"], **lines)


def of_run(observation: Observation, run: Run) -> Observation:
    """The same observation, of `run` in place of the one that was looked at: what that kept in memory may go."""
    return replace(
        observation, run=run, report=Reporter(run, list(observation.report.found), set(observation.report.doubts))
    )


def packed(observation: Observation) -> dict[str, Any]:
    """What JSON can hold; samples are left out, dynamic runs have none."""
    lines = (
        None if observation.lines is None else {name: _plain(value) for name, value in vars(observation.lines).items()}
    )
    return {
        "excitation": observation.run.point.excitation,
        "channels": [c.name for c in observation.channels],
        "lines": lines,
        "spread": observation.spread.tolist(),
        "other_line": observation.other_line,
        "speed": observation.speed,
        "digest": observation.digest,
        "found": [[asdict(f.problem), f.key] for f in observation.report.found],
        "doubts": sorted(observation.report.doubts),
    }


def unpacked(stored: Mapping[str, Any], run: Run) -> Observation:
    """What `packed` made, of `run` at the excitation that was looked at."""
    if stored["excitation"] != run.point.excitation:
        run = replace(run, point=replace(run.point, excitation=stored["excitation"]))
    channels = tuple(run.channels[name] for name in stored["channels"])
    lines = stored["lines"]
    observation = [Finding(Problem(**problem), key) for problem, key in stored["found"]]
    return Observation(
        run=run,
        channels=channels,
        lines=None if lines is None else RecordLines(**{name: _array(value) for name, value in lines.items()}),
        spread=np.array(stored["spread"], dtype=float).reshape(3, len(channels)),
        other_line=stored["other_line"],
        samples=np.empty((0, len(channels))),
        speed=stored["speed"],
        digest=stored["digest"],
        report=Reporter(run, observation, set(stored["doubts"])),
    )


def _plain(values: np.ndarray) -> Any:
    return {"re": values.real.tolist(), "im": values.imag.tolist()} if np.iscomplexobj(values) else values.tolist()


def _array(stored: Any) -> np.ndarray:
    if isinstance(stored, dict):
        return np.array(stored["re"]) + 1j * np.array(stored["im"])
    return np.array(stored)
