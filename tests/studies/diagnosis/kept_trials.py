"""Kept trials: rows that are written down as they are made, so that an evaluation that was killed goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.studies.diagnosis.kept_rows import Row, append_lines, code_fingerprint, entries, with_tuples
from tests.studies.diagnosis.trials import Trial
from tpjb_ident.runtime.executors import Task, Workers, in_order


def kept_trials(
    team: Workers,
    task: Task,
    trials: Sequence[Trial],
    shared: Any,
    file: Path | None = None,
    told: Callable[[Row], None] | None = None,
) -> list[Row]:
    """Run trials in order, or take rows that this very code has made before.

    Parameters
    ----------
    team : Workers
    task : callable
        ``task(shared, trial)`` gives a row.
    trials : sequence of Trial
    shared : object
    file : Path, optional
        Where rows are kept.
    told : callable, optional
        Called with every row that has been made now.
    """
    code = code_fingerprint()
    known = {} if file is None else {e["key"]: e["row"] for e in entries(file, code)}
    due = [trial for trial in trials if _key(trial) not in known]
    for trial, row in zip(due, in_order(team, task, [(trial,) for trial in due], shared), strict=True):
        line = json.dumps({"code": code, "key": _key(trial), "row": row}, default=float)
        if file is not None:
            append_lines(file, [line])
        known[_key(trial)] = with_tuples(json.loads(line)["row"])
        if told is not None:
            told(row)
    return [known[_key(trial)] for trial in trials]


def _key(trial: Trial) -> str:
    return json.dumps([type(trial).__name__, *asdict(trial).values()])
