"""Rows of raw trials: appended to a file as they are done, so that an evaluation that was killed goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from tests.studies.diagnosis.kept_rows import Row, append_lines, code_fingerprint, entries, with_tuples
from tests.studies.diagnosis.raw_trials import RawBench, RawTrial, run_raw_trials
from tpjb_ident.runtime.executors import Workers


def raw_rows(
    workers: Workers,
    shared: RawBench,
    groups: Sequence[tuple[RawTrial, ...]],
    told: Callable[[Row], None] | None = None,
) -> list[Row]:
    """Run trials, or take the rows that are there already; in the order of `groups`, whatever the workers.

    Parameters
    ----------
    workers : Workers
    shared : RawBench
        With a folder to keep things in, rows that this very code has made before are not made again.
    groups : sequence of tuple of RawTrial
    told : callable, optional
        Called with every row that has been made now.
    """
    file = None if shared.keep is None else shared.keep / "rows.jsonl"
    code = code_fingerprint()
    known = {} if file is None else read_rows(file, code)
    due = [group for group in groups if any(_key(asdict(trial)) not in known for trial in group)]

    def keep(rows: list[Row]) -> None:
        if file is not None:
            append_lines(file, [json.dumps({"code": code, **row}) for row in rows])
        for row in rows:
            known[_key(row)] = with_tuples(json.loads(json.dumps(row)))
            if told is not None:
                told(row)

    for _, outcome in workers.outcomes(run_raw_trials, [(group,) for group in due], shared):
        keep(outcome.get())
    return [known[_key(asdict(trial))] for group in groups for trial in group]


def read_rows(file: Path, code: str | None = None) -> dict[str, Row]:
    """Rows of a file by trial; of one version of the code, if given. A torn last line is no row."""
    made = ({k: v for k, v in entry.items() if k != "code"} for entry in entries(file, code))
    return {_key(row): row for row in made}


def _key(row: Row) -> str:
    return json.dumps([row[k] for k in ("kind", "truth", "size", "noise", "number", "plan")])
