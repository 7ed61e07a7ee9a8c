"""Finished runs kept beside the results until all are done: a rerun after a kill goes on where it stopped.

How a stale result is kept out: a kept run counts only if its fingerprint is found again. The fingerprint is the
SHA-256 of everything that the run's phasors depend on: every stored byte of its record, its entry in the manifest
with the calibration of all channels, the housing's mass, the settings, the limits of the checks, the versions of the
numerical packages and the sources of the code that reads and fits. It is computed anew, from the files, for every run
of a rerun (which is several times quicker than reading and fitting it); nothing is concluded from names, sizes or
dates. A record that changes while it is read is not kept. Files are written whole or not at all, and one that cannot be
read is no result. No pickles: a folder of results may come from anybody.
"""

import hashlib
import json
import shutil
import zipfile
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem
from rigdata.run import Run
from tpjb_ident.check.findings import QUESTIONS, Finding, Reporter
from tpjb_ident.check.lines import RecordLines
from tpjb_ident.check.observation import Observation
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.line_means import FilmLine, FilmLines
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.runs.finished_runs import RunDigest
from tpjb_ident.runtime.provenance import sha256, source_stamp
from tpjb_ident.runtime.tables import write_atomic

#: What tells whether a file is still the one that was read: size, time of its last change [ns], node.
FileState = tuple[int, int, int]
#: What reading says of an entry that is cut off, or that somebody else wrote.
_NOT_OURS = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    EOFError,
    MemoryError,
    RuntimeError,
    zipfile.BadZipFile,
)
#: Classes that a result is made of, field by field, and series of values.
_RECORDS = (
    RunDigest, RunPhasors, OperatingPoint, LineSet, Line, FilmLines, FilmLine,
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


def fingerprint(run: Run, housing_mass: float, settings: PhasorSettings) -> str:
    """SHA-256 of everything that a run's phasors depend on; "" where its file is gone."""
    reader: Any = run.reader
    try:
        record = reader.stored_hash() if hasattr(reader, "stored_hash") else sha256(reader.path)
    except OSError:  # whoever reads it next says what is wrong with it
        return ""
    entry = (run.id, run.kind, run.point, run.excitation_direction, dict(run.channels), reader)
    described = (dict(reader.channels), housing_mass, settings)
    text = "\n".join([record, repr(entry), repr(described), repr(QUESTIONS), source_stamp()])
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

    def keep(self, mark: str, result: RunDigest) -> None:
        """Keep a finished run under its fingerprint `mark`."""
        arrays: dict[str, Any] = {}
        meta = {"fingerprint": mark, "run": result.run, "result": packed(result, arrays)}
        text = np.array(json.dumps(meta))
        with suppress(FileNotFoundError):  # another run into the same folder has ended and cleared it
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomic(self._file(result.run), lambda path: np.savez(path, meta=text, **arrays))

    def load(self, run: Run, mark: str) -> RunDigest | None:
        """Give a kept run back; None if it is not there, or not under this fingerprint."""
        stored = self._read(run.id)
        if not mark or stored is None or stored[0]["fingerprint"] != mark:
            return None
        try:
            result = unpacked(stored[0]["result"], stored[1], run)
        except _NOT_OURS:
            return None
        return result if isinstance(result, RunDigest) else None

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
