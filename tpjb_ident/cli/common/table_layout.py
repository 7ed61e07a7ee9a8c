"""Text tables that fit a width: numbers are never broken, words wrap, what is left over stands below its row."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence

#: Columns between two columns of a table.
SPACE = 2
#: A column of words is not made narrower than this; what needs less room than it has stands below the row instead.
NARROWEST = 14


def cell_len(text: str) -> int:
    """Columns that a text takes on a terminal; wide letters take two."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len as measured  # only where it is needed: help shall be instant

    return measured(text)


def wrapped(text: str, width: int) -> list[str]:
    """Break a sentence at spaces; words that are longer than a line, as paths are, stay whole."""
    lines = textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return lines or [""]


def table_lines(columns: Sequence[str], rows: Sequence[Sequence[str]], words: Collection[int], width: int) -> list[str]:
    """Lay out a table."""
    cells = [max((cell_len(row[i]) for row in rows), default=0) for i in range(len(columns))]
    heads = [max((cell_len(part) for part in column.split()), default=0) for column in columns]
    full = [max(c, cell_len(h)) for c, h in zip(cells, columns, strict=True)]
    fits = sum(full) + SPACE * (len(full) - 1) <= width
    size = full if fits else [max(c, h) for c, h in zip(cells, heads, strict=True)]
    below = _narrow(size, words, width)
    shown = [i for i in range(len(columns)) if i not in below]
    lines = _row([columns[i] for i in shown], [size[i] for i in shown], [i in words for i in shown], bottom=True)
    lines.append("-" * min(width, sum(size[i] for i in shown) + SPACE * (len(shown) - 1)))
    for row in rows:
        lines += _row([row[i] for i in shown], [size[i] for i in shown], [i in words for i in shown])
        for i in below:
            if row[i].strip():
                lines += [f"    {line}" for line in wrapped(f"{columns[i]}: {row[i]}".lstrip(": "), width - 4)]
    return lines


def _narrow(size: list[int], words: Collection[int], width: int) -> list[int]:
    """Make columns of words narrower until the table fits; those that cannot be are to stand below their row."""
    below: list[int] = []
    while (over := _total(size, below) - width) > 0:
        wide = [i for i in words if i not in below and size[i] > NARROWEST]
        if wide:
            widest = max(wide, key=lambda i: size[i])
            size[widest] = max(NARROWEST, size[widest] - over)
        elif rest := [i for i in words if i not in below and i > 0]:
            below.append(max(rest))
        else:
            break  # numbers alone are wider than the terminal: nothing is lost by a long line
    return sorted(below)


def _total(size: Sequence[int], without: Collection[int]) -> int:
    shown = [s for i, s in enumerate(size) if i not in without]
    return sum(shown) + SPACE * (len(shown) - 1)


def _row(cells: Sequence[str], size: Sequence[int], left: Sequence[bool], bottom: bool = False) -> list[str]:
    """Lines of one row; headings stand at the bottom of theirs."""
    parts = [_broken(cell, room) for cell, room in zip(cells, size, strict=True)]
    height = max(map(len, parts), default=1)
    lines = []
    for k in range(height):
        line = []
        for part, room, is_left in zip(parts, size, left, strict=True):
            j = k - (height - len(part)) if bottom else k
            text = part[j] if 0 <= j < len(part) else ""
            blank = " " * max(0, room - cell_len(text))
            line.append(text + blank if is_left else blank + text)
        lines.append((" " * SPACE).join(line).rstrip())
    return lines


def _broken(text: str, room: int) -> list[str]:
    if cell_len(text) <= room:
        return [text]
    return textwrap.wrap(text, max(room, 1), break_on_hyphens=False) or [""]
