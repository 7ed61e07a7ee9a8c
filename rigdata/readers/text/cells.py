"""Text files of any encoding: their lines, their numbers as a stream of ASCII bytes, and what a cell holds."""

import codecs
import contextlib
import datetime
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rigdata.arrays import FloatArray

#: How much of a file is looked at to find how it is written; the names must be in it [characters].
HEAD = 2**18
#: Longer lines come in pieces [characters].
_PIECE = 2**20
#: Text that is parsed at a time, and the longest line [bytes].
BLOCK = 2**22
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_ASCII = bytes(range(128)) + b"\x7f" * 128


def text_encoding(path: Path, encoding: str | None) -> str:
    """Codec of a text file: its byte-order mark, else what is stated, else detected."""
    with path.open("rb") as stream:
        head = stream.read(65536)
    for mark, codec in _BOMS:
        if head.startswith(mark):
            return codec
    if encoding is not None:
        return encoding
    for first, codec in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = head[first:400:2]
        if len(head) >= 4 and half.count(0) > 0.9 * len(half):
            return codec
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the head may end inside a character
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def head_lines(path: Path, encoding: str) -> list[str]:
    """Complete lines of the head of a file, without their ends."""
    with path.open(encoding=encoding, errors="replace") as stream:
        text = stream.read(HEAD)
    lines = text.split("\n")
    if len(text) == HEAD or not lines[-1]:
        lines.pop()
    return lines


def all_lines(path: Path, encoding: str) -> Iterator[str]:
    """Every line of a file, without its end; very long lines come in pieces."""
    with path.open(encoding=encoding, errors="replace") as stream:
        while line := stream.readline(_PIECE):
            yield line.removesuffix("\n")


def is_ascii_based(encoding: str) -> bool:
    """Whether digits, delimiters and line ends are single ASCII bytes in `encoding`, from the file's first byte on."""
    sample = '\t\r\n",.;|+-0123456789 eE'
    return sample.encode(encoding) == sample.encode("ascii")


def number_blocks(path: Path, encoding: str, delimiter: str) -> Iterator[bytes]:
    """Whole lines of a text file in blocks for pyarrow: ASCII, runs of blanks that part cells a tab.

    Numbers, delimiters and line ends are ASCII; every other character has become DEL, since pyarrow takes all text
    for UTF-8. Its threads would hold a stream of Python's while the interpreter ends, which aborts the program.
    """
    import pyarrow as pa

    decoder = None if is_ascii_based(encoding) else codecs.getincrementaldecoder(encoding)("replace")
    begun_line = b""
    with path.open("rb") as stream:
        while True:
            block = stream.read(BLOCK)
            is_end = not block
            if decoder is not None:
                block = decoder.decode(block, final=is_end).encode("utf-8", "replace")
            text = begun_line + block
            end = len(text) if is_end else (text.rfind(b"\n") + 1 or text.rfind(b"\r") + 1)
            lines, begun_line = text[:end], text[end:]
            if not lines.isascii():
                lines = lines.replace(b"\xe2\x88\x92", b"-").translate(_ASCII)  # the sign of U+2212
            if delimiter == " ":
                trimmed = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", lines)
                lines = re.sub(rb"[ \t]+", b"\t", trimmed)
            if lines:
                yield lines
            if is_end:
                return
            if len(begun_line) > BLOCK:
                raise pa.ArrowInvalid(f"a line is longer than {BLOCK >> 20} MB")


_CLOCK = r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?(?:\s?([AaPp])\.?[Mm]\.?)?"
_ZONE = r"(?:\s?(?:Z|UTC|[+-]\d{2}:?\d{2}))?"
#: Year first (ISO 8601), day first with points, day or month first with slashes, no date.
_ISO = r"(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ]\s?"
_STAMP = re.compile(rf"(?:{_ISO}|(\d{{1,2}})[./](\d{{1,2}})[./](\d{{4}})[T ]\s?)?{_CLOCK}{_ZONE}")
_DATE = re.compile(r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{4}")
_DAY = 86400.0
#: Ways in which loggers and spreadsheets write "no value".
_MISSING_WORDS = """
    n.a. n/v n.v. k.A. #NULL! #REF! #BEZUG! #NUM! #ZAHL! #NAME? ***** ******
    NaN nan NAN -NaN -nan -nan(ind) - -- --- ---- ----- * *** ? NA N/A n/a #N/A #NA #NV #VALUE! #WERT! #DIV/0!
    null NULL None none 1.#QNAN -1.#QNAN 1.#IND -1.#IND 1.#INF -1.#INF 1,#QNAN -1,#QNAN 1,#IND -1,#IND 1,#INF
    -1,#INF 1.#R OVL +OVL -OVL OL +OL -OL OVER OVERLOAD OVERFLOW Overflow INVALID Invalid ERR inf -inf +inf Inf
    -Inf INF -INF
"""
MISSING = dict.fromkeys(["", *_MISSING_WORDS.split()])
#: The mark between thousands by the decimal mark: where both are in a number, it can be read in one way.
THOUSANDS = {".": ",", ",": "."}
_NUMBER = {}
for _mark, _between in THOUSANDS.items():
    _digits = rf"[0-9]{{1,3}}(?:[{_between}][0-9]{{3}})+[{_mark}][0-9]+|[0-9]+(?:[{_mark}][0-9]*)?|[{_mark}][0-9]+"
    _NUMBER[_mark] = re.compile(rf"[+−-]?(?:{_digits})(?:[eE][+-]?[0-9]+)?")


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, with or without a date.

    >>> [is_stamp(c) for c in ("2019-07-22T11:31:22.125Z", "22.07.2019 11:31:22,125", "11:31:22.5", "12.5")]
    [True, True, True, False]
    """
    return _STAMP.fullmatch(cell) is not None


def is_date(cell: str) -> bool:
    """Whether a cell holds a date alone: such a column tells nothing within a run."""
    return _DATE.fullmatch(cell) is not None


def is_entry(cell: str) -> bool:
    """Whether a cell can stand in a table of numbers: a number, none, a time of day or a date."""
    return looks_like(cell) or cell in MISSING or is_stamp(cell) or is_date(cell)


def stamp_seconds(cells: Sequence[str | None]) -> tuple[FloatArray, int]:
    """Seconds (n,) from the first stamp of a column, and how many cells hold none where one should be.

    Midnight between stamps without a date is a day.
    """
    matches = [_STAMP.fullmatch(cell) if cell else None for cell in cells]
    bad = sum(map(bool, cells)) - sum(map(bool, matches))
    days: dict[str, float] = {}
    seconds = np.array([np.nan if match is None else _seconds(match, days) for match in matches])
    good = np.isfinite(seconds)
    if not good.any():
        return seconds, bad
    stamped = seconds[good]
    if not days:
        midnights = np.cumsum(np.diff(stamped) < -0.5 * _DAY)
        stamped = stamped + _DAY * np.concatenate([[0.0], midnights])
    seconds[good] = stamped - stamped[0]
    return seconds, bad


def _seconds(match: re.Match[str], days: dict[str, float]) -> float:
    """Seconds of a stamp; `days` holds those at which each date began."""
    *date, hour, minute, second, fraction, half = match.groups()
    hours = int(hour) if not half else int(hour) % 12 + 12 * (half in "Pp")
    start = 0.0
    if any(date):
        text = "/".join(filter(None, date))
        if text not in days:
            days[text] = np.nan
            year, month, day = (int(part) for part in (date[:3] if date[0] else date[:2:-1]))
            for month_and_day in ((day, month), (month, day)):  # as it is written; where that is none, month first
                with contextlib.suppress(ValueError):
                    days[text] = _DAY * datetime.date(year, *month_and_day).toordinal()
        # counted from the first day: seconds since 1970 would cost the digits below a microsecond
        start = days[text] - next(iter(days.values()))
    return start + 3600.0 * hours + 60.0 * int(minute) + float(f"{second}.{fraction or 0}")


def is_number(cell: str, decimal: str) -> bool:
    """Whether `cell` (stripped) is a number with that decimal mark."""
    return _NUMBER[decimal].fullmatch(cell) is not None


def looks_like(cell: str) -> bool:
    """Whether `cell` is a number with either decimal mark."""
    return is_number(cell, ".") or is_number(cell, ",")


def number_pattern(decimal: str) -> str:
    """Regular expression (RE2) of a number, for whole columns."""
    return f"^(?:{_NUMBER[decimal].pattern})$"
