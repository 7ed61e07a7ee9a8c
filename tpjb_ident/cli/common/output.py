"""How loud a command is: for people, quiet, or as one JSON document for other programs.

``--quiet`` leaves warnings and errors only. ``--json`` prints exactly one document to standard output, whatever way the
command ends; messages go to standard error as ever.
"""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SCHEMA = "tpjb-command/1"
#: A result table of more rows is named in the document, not repeated in it.
MOST_ROWS = 5000


@dataclass
class CommandOutput:
    """What a command has printed and written so far."""

    command: str = ""
    as_json: bool = False
    quiet: bool = False
    sentences: list[str] = field(default_factory=list)
    tables: list[dict[str, Any]] = field(default_factory=list)
    remarks: list[dict[str, str]] = field(default_factory=list)
    folder: Path | None = None
    outputs: tuple[str, ...] = ()

    @property
    def silent(self) -> bool:
        """Whether nothing is printed for people."""
        return self.as_json or self.quiet

    def add_files(self, folder: Path, outputs: Sequence[str]) -> None:
        """Note where the results are."""
        self.folder, self.outputs = folder, (*self.outputs, *outputs)

    def document(self, exit_code: int) -> dict[str, Any]:
        """Everything printed, as plain data; ``data`` holds the result tables and JSON files themselves."""
        return {
            "schema": SCHEMA,
            "command": self.command,
            "exit_code": exit_code,
            "results": None if self.folder is None else str(self.folder),
            "outputs": list(self.outputs),
            "said": self.sentences,
            "remarks": self.remarks,
            "tables": self.tables,
            "data": {} if self.folder is None else _data(self.folder, self.outputs),
        }


_current = CommandOutput()


def command_output() -> CommandOutput:
    """Output of the command that runs."""
    return _current


@contextlib.contextmanager
def output_of(command: str, as_json: bool, quiet: bool) -> Iterator[CommandOutput]:
    """Collect the output of a command; with JSON, print the document when the command ends, however it does."""
    import typer

    global _current
    before, _current = _current, CommandOutput(command, as_json, quiet)
    code = 0
    try:
        yield _current
    except typer.Exit as end:
        code = end.exit_code
        raise
    except BaseException:
        code = 1
        raise
    finally:
        mine, _current = _current, before
        if as_json:
            from tpjb_ident.presentation import json_data

            # escapes where standard output is not UTF-8, which every program that reads JSON expects
            ascii_only = "utf" not in (sys.stdout.encoding or "").lower()
            typer.echo(json.dumps(json_data(mine.document(code)), indent=1, ensure_ascii=ascii_only, allow_nan=False))


def _data(folder: Path, outputs: Sequence[str]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in outputs:
        path = folder / name
        if not path.is_file():  # the command failed after it had listed its files
            continue
        if path.suffix == ".parquet":
            found[path.stem] = _records(path)
        elif path.suffix == ".json" and name != "run.json":
            found[path.stem] = json.loads(path.read_text(encoding="utf-8"))
    return found


def _records(path: Path) -> Any:
    import pyarrow.parquet as pq

    table = pq.ParquetFile(path)
    rows = table.metadata.num_rows
    return table.read().to_pylist() if rows <= MOST_ROWS else {"rows": rows, "file": path.name}
