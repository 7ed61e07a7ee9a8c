"""On which line of a TOML text a key stands, so that a message can say it."""

from __future__ import annotations

import re

_TABLE = re.compile(r"\s*(\[\[?)([^\[\]#]+)\]\]?\s*(?:#.*)?$")
_LONGEST = 1000
_KEY = re.compile(r"\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\s]+)")
Path = tuple[str | int, ...]


def key_lines(text: str) -> dict[Path, int]:
    """Map the path of every table and key to its line (1-based).

    Parameters
    ----------
    text : str
        TOML. Entries of arrays of tables count from 0: ``("runs", 3, "file")``.

    Returns
    -------
    dict
        A best effort: keys inside inline tables and multi-line strings are not told apart from others,
        so the lines serve messages only.
    """
    lines: dict[Path, int] = {}
    counts: dict[str, int] = {}
    table: Path = ()
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST:
            continue
        header = _TABLE.match(line)
        if header is not None:
            name = tuple(a or b or c for a, b, c in _PART.findall(header[2]))
            if header[1] == "[[":
                index = counts.get(header[2].strip(), 0)
                counts[header[2].strip()] = index + 1
                table = (*name, index)
            else:
                table = name
            lines.setdefault(table, number)
            continue
        key = _KEY.match(line)
        if key is not None:
            lines.setdefault((*table, key[1].strip("\"'")), number)
    return lines


def place_of(lines: dict[Path, int], path: Path) -> str:
    """Say where `path` stands: ``"line 14, [channels.X1A] sensitivity"``.

    Parameters
    ----------
    lines : dict of tuple to int
        Line numbers, by keys down to the one meant.
    path : tuple
        Keys down to the one meant.
    """
    words = _spell(path)
    at: Path = path
    while at and at not in lines:
        at = at[:-1]
    return f"line {lines[at]}, {words}" if at else words


def _spell(path: Path) -> str:
    if len(path) == 1:
        return str(path[0])
    if path and path[0] == "runs" and len(path) > 1 and isinstance(path[1], int):
        rest = "".join(f" {p}" for p in path[2:])
        return f"[[runs]] no. {path[1] + 1}{rest}"
    table = ".".join(str(p) for p in path[:-1])
    return f"[{table}] {path[-1]}" if table not in {"channels"} else f"[channels.{path[-1]}]"
