"""The one way to write a table of ``tests/studies/RESULTS.md``: a study replaces the text of its own section.

A section begins with ``<!-- NAME: begin -->`` and ends with ``<!-- NAME: end -->``. Its first line says which command
made it, on which commit and on which day.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PAGE = HERE / "RESULTS.md"


class Rows:
    """Outcomes of a long study by what identifies them, stored as JSON lines: a study that was stopped goes on."""

    def __init__(self, path: Path | None, *keys: str) -> None:
        self.path, self.keys = path, keys
        lines = path.read_text("utf-8").splitlines() if path is not None and path.exists() else []
        self.known: dict[tuple[Any, ...], dict[str, Any]] = {self._key(row): row for row in map(json.loads, lines)}

    def _key(self, row: dict[str, Any]) -> tuple[Any, ...]:
        return tuple(row[name] for name in self.keys)

    def add(self, row: dict[str, Any]) -> None:
        """Store one outcome."""
        self.known[self._key(row)] = row
        if self.path is not None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row, default=float) + "\n")


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def study_parser(described: str | None, **options: Any) -> argparse.ArgumentParser:
    """What a study can be asked: its options, each by its default or by its type, and to write its section."""
    parser = argparse.ArgumentParser(description=described, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is False:
            parser.add_argument(flag, action="store_true")
        elif isinstance(value, type):
            parser.add_argument(flag, type=value)
        else:
            parser.add_argument(flag, type=type(value), default=value)
    return parser


def report(asked: argparse.Namespace, section: str, text: str, command: str = "") -> None:
    """Print a study's table, and write it where that is asked; `command` makes it again, if not what was typed."""
    if asked.write:
        write_section(section, command or typed(), text)
    else:
        print(text)


def typed() -> str:
    """What was typed to run this study, as it is typed again."""
    return " ".join(["python -m", sys.modules["__main__"].__spec__.name, *sys.argv[1:]])


def write_section(name: str, command: str, text: str, page: Path = PAGE) -> None:
    """Replace a section and print it; `command` is what a reader types to make it again."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, opening, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closing, after = rest.partition(end)
    if not opening or not closing:
        raise LookupError(f"{page.name} has no section {name!r}: add its two marks under a heading")
    source = f"Made by `{command}` on {date.today().isoformat()}, commit {commit()}."
    page.write_text(f"{before}{begin}\n{source}\n\n{text.strip()}\n{end}{after}", encoding="utf-8", newline="\n")
    print(f"{source}\n\n{text}", flush=True)


def commit() -> str:
    """Commit of the checkout, with a plus sign where files differ from it."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty=+"], cwd=HERE, capture_output=True, text=True, check=False
    )
    return told.stdout.strip() or "unknown"
