"""LabVIEW measurement files (.lvm): a header, then segments of a header and a table each."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import Problem, RigDataError
from rigdata.readers.series import Series, equidistant
from rigdata.readers.text.byte_stream import all_lines, codec_of_bytes, text_encoding
from rigdata.readers.text.cells import stamp_seconds

_MAGIC, _END = "LabVIEW Measurement", "***End_of_Header***"
_X, _COMMENT = "X_Value", "Comment"
#: Lines that are held as text at a time: as text a table takes several times the memory of its numbers.
_BLOCK = 20_000


@dataclass
class _Segment:
    """One table with its header: key -> one cell per channel."""

    header: dict[str, list[str]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    rows: list[str] = field(default_factory=list)
    blocks: list[FloatArray] = field(default_factory=list)


def read_series(path: Path) -> list[Series]:
    """Read every channel over time; segments of the same channels follow each other."""
    encoding = text_encoding(path, None)
    codec = codec_of_bytes(encoding)
    lines = (line.decode(codec, "replace") for line in all_lines(path, encoding))
    first = next(lines, "")
    if not first.startswith(_MAGIC):
        raise _refuse(path, "line 1", f"does not begin with {_MAGIC!r}", "Is it a LabVIEW measurement file?")
    separator, decimal = _spelling(lines)
    found: dict[str, list[Series]] = {}
    for segment in _segments(path, lines, separator, decimal):
        for one in _channels(segment, decimal):
            found.setdefault(one.name, []).append(one)
    if not found:
        raise _refuse(path, "", "holds no channel over time", "Export the run again, with its samples")
    return [_joined(parts) for parts in found.values()]


def _refuse(path: Path, place: str, what: str, cure: str) -> RigDataError:
    return RigDataError(Problem("error", path.name, place, what, cure))


def _spelling(lines: Iterator[str]) -> tuple[str, str]:
    """Separator and decimal mark by the file's own header, which ends with this."""
    separator, decimal = "\t", "."
    for line in lines:
        if line.startswith("Separator"):  # it stands behind its own key
            separator = line[len("Separator") :][:1] or separator
        elif line.startswith("Decimal_Separator"):
            decimal = line[len("Decimal_Separator") + 1 :].strip()[:1] or decimal
        elif line.startswith(_END):
            break
    return separator, decimal


def _heading(lines: Iterator[str], separator: str) -> dict[str, list[str]]:
    """Entries of a segment's heading, one cell per channel, up to its end mark; special blocks are left alone."""
    found: dict[str, list[str]] = {}
    special = False
    for line in lines:
        cells = [c.strip() for c in line.split(separator)]
        if cells[0].startswith(_END):
            break
        special = (special or cells[0].startswith("***Start_Special")) and not cells[0].startswith("***End_Special")
        if not special and cells[0]:
            found[cells[0]] = cells[1:]
    return found


def _segments(path: Path, lines: Iterator[str], separator: str, decimal: str) -> Iterator[_Segment]:
    """Segments in order, their rows as numbers; without headings of their own all samples are one."""
    segment: _Segment | None = None
    blank = f"{separator} \t\r\n"
    for line in lines:
        first = line.partition(separator)[0].strip()
        if first == "Channels":
            if segment is not None:
                yield _turned(path, segment, separator, decimal)
            segment = _Segment(header=_heading(lines, separator))
            names = next(lines, "")
            segment.names = [c.strip() for c in names.split(separator)]
        elif first == _X:
            segment = segment or _Segment()
            segment.names = [c.strip() for c in line.split(separator)]
        elif segment is not None and line.strip(blank):
            segment.rows.append(line)
            if len(segment.rows) == _BLOCK:
                _turned(path, segment, separator, decimal)
    if segment is not None:
        yield _turned(path, segment, separator, decimal)


def _turned(path: Path, segment: _Segment, separator: str, decimal: str) -> _Segment:
    """The segment with the rows that it holds as text turned into numbers."""
    segment.blocks.append(_numbers(path, segment, separator, decimal))
    segment.rows.clear()
    return segment


def _channels(segment: _Segment, decimal: str) -> list[Series]:
    values = np.concatenate(segment.blocks)
    found = []
    x: FloatArray | None = None
    number = 0
    for i, name in enumerate(segment.names):
        if name == _X:
            x = values[:, i] if np.isfinite(values[:, i]).any() else None
        elif name and name != _COMMENT:
            number += 1
            if _entry(segment, "X_Dimension", number, "Time").lower() not in ("time", ""):
                continue
            found.append(_series(segment, number, name, values[:, i], x, decimal))
    return found


def _numbers(path: Path, segment: _Segment, separator: str, decimal: str) -> FloatArray:
    """Cells of all rows, NaN where blank; the column of comments is left out."""
    import pandas as pd

    width = len(segment.names)
    used = [i for i, n in enumerate(segment.names) if n and n != _COMMENT]
    if not segment.rows:
        return np.empty((0, width))
    # a blank comment at the end of every row may be left out altogether
    first = segment.rows[0] + separator * max(0, width - 1 - segment.rows[0].count(separator))
    text = io.StringIO("\n".join([first, *segment.rows[1:]]))
    try:
        frame = pd.read_csv(text, sep=separator, decimal=decimal, header=None, names=range(width), usecols=used,
                            index_col=False, dtype=float, skip_blank_lines=False, quoting=3)  # fmt: skip
    except ValueError as error:
        raise _refuse(path, "", f"has text among its numbers ({error})", "Export the run again") from error
    values = np.full((len(frame), width), np.nan)
    values[:, used] = frame.to_numpy(float)
    return values


def _entry(segment: _Segment, key: str, number: int, default: str = "") -> str:
    cells = segment.header.get(key, [])
    return cells[number - 1] if number <= len(cells) else default


def _series(
    segment: _Segment, number: int, name: str, values: FloatArray, x: FloatArray | None, decimal: str
) -> Series:
    def stated(key: str) -> float:
        try:
            return float(_entry(segment, key, number).replace(decimal, "."))
        except ValueError:
            return float("nan")

    count = stated("Samples")
    last = int(count) if 0 < count <= len(values) else len(values)
    values = values[:last]
    step, start = stated("Delta_X"), stated("X0")
    time: FloatArray | None = None
    if step > 0:  # X as written is rounded
        time = equidistant(last, step, start if np.isfinite(start) else 0.0)
    elif x is not None:
        time = x[:last]
    return Series(name, _entry(segment, "Y_Unit_Label", number), values, time, _began(segment, number))


def _began(segment: _Segment, number: int) -> str:
    """Date and time of day at which a channel's segment began."""
    return f"{_entry(segment, 'Date', number)} {_entry(segment, 'Time', number)}".strip()


def _joined(parts: Sequence[Series]) -> Series:
    """Segments of one channel behind each other, by the times that they began, else without a gap."""
    first = parts[0]
    if len(parts) == 1:
        return Series(first.name, first.unit, first.values, first.time)
    values = np.concatenate([p.values for p in parts])
    if any(p.time is None for p in parts):
        return Series(first.name, first.unit, values, None)
    began, bad = stamp_seconds([p.group or None for p in parts])
    times: list[FloatArray] = []
    for i, part in enumerate(parts):
        time = np.asarray(part.time)
        if times:
            end = 2.0 * times[-1][-1] - times[-1][-2] if len(times[-1]) > 1 else times[-1][-1]
            if bad == 0 and np.isfinite(began[i]) and began[i] > 0 and time[0] < end:
                time = time - time[0] + times[0][0] + began[i]
            if time[0] < end - 1e-9:
                time = time - time[0] + end
        times.append(time)
    return Series(first.name, first.unit, values, np.concatenate(times))
