"""Kept rows: a file of JSON lines to which finished trials are added, and what code a line was made by."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import model
import tpjb_ident.diagnose as decisions
import tpjb_ident.dynamic as dynamic
import tpjb_ident.pivot as pivot

Row = dict[str, Any]


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


def entries(file: Path, code: str | None = None) -> Iterator[Row]:
    """What stands in a file, of one version of the code if given; none without a file. A torn line is no entry."""
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        if code is None or entry["code"] == code:
            yield with_tuples(entry)


def with_tuples(value: Any) -> Any:
    """Lists of a file back into tuples."""
    if isinstance(value, list):
        return tuple(with_tuples(v) for v in value)
    return {k: with_tuples(v) for k, v in value.items()} if isinstance(value, dict) else value


def code_fingerprint() -> str:
    """What a row depends on: the source of identification, diagnosis and model."""
    digest = hashlib.sha256()
    for package in (dynamic, pivot, decisions, model):
        for source in sorted(Path(str(package.__file__)).parent.rglob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
