"""What differs between results and the same results computed again: numbers by size, not by text."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import TABLES

#: Kinds of file whose numbers are compared; of others only the bytes are.
_DOCUMENTS = {".json": json.loads, ".toml": tomllib.loads}
#: What should be zero and is not, as 1e-19 m or 1e-13 deg, is measured by this.
_LEAST_SCALE = 1e-6
#: Of what a document holds, that tells of its making.
_ASIDE = ("finished", "versions")


@dataclass(frozen=True)
class Difference:
    """How a file differs from the one computed again."""

    file: str
    state: str  #: same | numbers | differs | not judged | missing | new
    size: float = (
        0.0  #: largest difference of two numbers: relative, or of the interval's half width where there is one
    )
    where: str = ""

    @property
    def matters(self) -> bool:
        """Whether it is more than rounding."""
        return self.state in ("differs", "missing", "new")


def compared(first: Path, second: Path, file: str, tolerance: float) -> Difference:
    """Compare a file of one folder with that of another; numbers may differ by a relative `tolerance`."""
    old, new = first / file, second / file
    if not old.is_file() or not new.is_file():
        return Difference(file, "missing" if old.is_file() else "new")
    if old.read_bytes() == new.read_bytes():
        return Difference(file, "same")
    before, now = _content(old), _content(new)
    if before is None:
        return Difference(file, "not judged")
    size, where = 0.0, ""
    for place, a, b, width in _pairs(before, now):
        off = _off(a, b, width)
        if off > size:
            size, where = off, f"{place}: {_shown(a)}, now {_shown(b)}"
    return Difference(file, "differs" if size > tolerance else "numbers", size, where)


def _shown(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)[:60]


def _off(a: object, b: object, width: float) -> float:
    """Difference of two values over their size or, where that is larger, half the width of their interval."""
    if not (isinstance(a, int | float) and isinstance(b, int | float) and bool not in (type(a), type(b))):
        return 0.0 if (a, type(a)) == (b, type(b)) else math.inf
    if a == b or (math.isnan(a) and math.isnan(b)):
        return 0.0
    scale = max(abs(a), abs(b), width if math.isfinite(width) else 0.0, _LEAST_SCALE)
    off = abs(a - b) / scale
    return off if math.isfinite(off) else math.inf


def _content(path: Path) -> Any | None:
    """A file as plain data; None where only bytes can be compared."""
    if path.suffix == ".csv" and path.stem in TABLES:
        rows = read_table(path).to_dict("records")
        return {f"row {number}": row for number, row in enumerate(rows, start=1)}
    parse = _DOCUMENTS.get(path.suffix)
    return None if parse is None else parse(path.read_text("utf-8"))


def _pairs(old: Any, new: Any, place: str = "", width: float = 0.0) -> Iterator[tuple[str, Any, Any, float]]:
    """Values of two files that belong together, with their place and half the width of their interval."""
    if isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        for key in old:
            if key not in _ASIDE:
                yield from _pairs(old[key], new[key], f"{place}.{key}" if place else str(key), _half_width(old, key))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from _pairs(a, b, f"{place}[{index}]")
    else:
        yield place, old, new, width


def _half_width(values: dict[str, Any], name: str) -> float:
    base = name.removesuffix("_lo").removesuffix("_hi")
    low, high = values.get(f"{base}_lo"), values.get(f"{base}_hi")
    return 0.5 * (high - low) if isinstance(low, float) and isinstance(high, float) else 0.0
