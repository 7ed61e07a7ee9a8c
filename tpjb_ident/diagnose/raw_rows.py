"""Rows of raw trials: appended to a file as they are done, so that an evaluation that was killed goes on."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import model
import tpjb_ident.diagnose as decisions
import tpjb_ident.dynamic as dynamic
import tpjb_ident.pivot as pivot
from tpjb_ident.diagnose.raw_trials import RawBench, RawTrial, run_raw_trials
from tpjb_ident.executors import Workers

Row = dict[str, Any]


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
            known[_key(row)] = _plain(json.loads(json.dumps(row)))
            if told is not None:
                told(row)

    for _, outcome in workers.outcomes(run_raw_trials, [(group,) for group in due], shared):
        keep(outcome.get())
    return [known[_key(asdict(trial))] for group in groups for trial in group]


def append_lines(file: Path, lines: Sequence[str]) -> None:
    """Add whole lines to a file; one that a kill has torn there is ended first, so that it swallows none of them."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("ab+") as out:
        if out.tell():
            out.seek(-1, os.SEEK_END)
            torn = out.read(1) != b"\n"
        else:
            torn = False
        out.write(("\n" * torn + "".join(line + "\n" for line in lines)).encode())


def read_rows(file: Path, code: str | None = None) -> dict[str, Row]:
    """Rows of a file by trial; of one version of the code, if given. A torn last line is no row."""
    rows: dict[str, Row] = {}
    if not file.exists():
        return rows
    for line in file.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if code is None or row["code"] == code:
            made = _plain({k: v for k, v in row.items() if k != "code"})
            rows[_key(made)] = made
    return rows


def code_fingerprint() -> str:
    """What a row depends on: the source of identification, diagnosis and model."""
    digest = hashlib.sha256()
    for package in (dynamic, pivot, decisions, model):
        for source in sorted(Path(str(package.__file__)).parent.rglob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _key(row: Row) -> str:
    return json.dumps([row[k] for k in ("kind", "truth", "size", "noise", "number", "plan")])


def _plain(value: Any) -> Any:
    """Lists of a file back into tuples."""
    if isinstance(value, list):
        return tuple(_plain(v) for v in value)
    return {k: _plain(v) for k, v in value.items()} if isinstance(value, dict) else value
