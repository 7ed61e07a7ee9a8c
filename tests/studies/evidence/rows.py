"""Rows of trials on disk: one JSON object a line, readable by later versions."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tests.studies.evidence.outcome import Row
from tpjb_ident.runtime.tables import write_text

#: What a line must say to be a trial.
NEEDED = frozenset({"kind", "truth", "size", "noise", "verdict"})
_KEY = ("rung", "kind", "truth", "size", "noise", "number", "plan", "data_set")


class RowsError(ValueError):
    """A file of rows cannot be used; the message says which, where and why."""


def write_rows(file: Path, rows: Iterable[Row]) -> None:
    """Write rows, whole or not at all."""
    write_text(file, "".join(json.dumps(dict(row), default=float) + "\n" for row in rows))


def read_rows(files: Iterable[Path]) -> list[Row]:
    """Rows of files, in their order; of a trial that stands there twice the last.

    Parameters
    ----------
    files : iterable of Path
        As an evaluation keeps them. A torn last line is no row.

    Raises
    ------
    RowsError
        A file cannot be read, a line within it is no trial, or none holds a trial at all.
    """
    found: dict[str, Row] = {}
    names = []
    for file in files:
        names.append(str(file))
        for row in _lines(file):
            key = json.dumps([row.get(name) for name in _KEY])
            found.pop(key, None)
            found[key] = row
    if not found:
        raise RowsError(f"{', '.join(names)}: holds no trials. Give a rows.jsonl that `tpjb evaluate` has written.")
    return list(found.values())


def _lines(file: Path) -> list[dict[str, Any]]:
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RowsError(f"{file}: cannot be read ({error}). Give a rows.jsonl.") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        try:
            row = json.loads(line)
        except json.JSONDecodeError as error:
            if number == len(lines):  # the writer was killed
                continue
            raise RowsError(f"{file}, line {number}: no JSON ({error.msg}). Give a rows.jsonl.") from error
        if isinstance(row, dict) and isinstance(row.get("row"), dict):
            row = row["row"]  # as an evaluation keeps them while it runs
        if not isinstance(row, dict) or NEEDED - row.keys():
            raise RowsError(f"{file}, line {number}: no trial; it lacks {', '.join(sorted(NEEDED - set(row)))}.")
        rows.append({key: _tuples(value) for key, value in row.items() if key != "code"})
    return rows


def _tuples(value: Any) -> Any:
    """Lists of a file back into tuples."""
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    return {k: _tuples(v) for k, v in value.items()} if isinstance(value, dict) else value
