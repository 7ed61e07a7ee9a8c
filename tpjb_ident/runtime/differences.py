"""What differs between results and the same results computed again: numbers by size, not by text."""

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
    size: float = 0.0  #: largest difference of two numbers: relative, or of their interval's half width
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
    before, now = dict(_values(_content(old))), dict(_values(_content(new)))
    if "" in before:  # no values with places
        return Difference(file, "not judged")
    size, change = 0.0, ""
    for place in before | now:
        a, b = before.get(place), now.get(place)
        base = place.removesuffix("_lo").removesuffix("_hi")
        low, high = before.get(f"{base}_lo"), before.get(f"{base}_hi")
        half = 0.5 * (high - low) if isinstance(low, float) and isinstance(high, float) else 0.0
        if (deviation := _deviation(a, b, half if math.isfinite(half) else 0.0)) > size:
            size, change = deviation, f"{place}: {_shown(a)}, now {_shown(b)}"
    return Difference(file, "differs" if size > tolerance else "numbers", size, change)


def _content(path: Path) -> Any:
    """A file as plain data; None where only bytes can be compared."""
    if path.suffix == ".csv" and path.stem in TABLES:
        rows = read_table(path).to_dict("records")
        return {f"row {number}": row for number, row in enumerate(rows, start=1)}
    return _DOCUMENTS[path.suffix](path.read_text("utf-8")) if path.suffix in _DOCUMENTS else None


def _values(content: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of a document with its place."""
    if isinstance(content, list):
        content = dict(enumerate(content))
    if not isinstance(content, dict):
        yield place, content
        return
    for key, value in content.items():
        if key not in _ASIDE:
            yield from _values(value, f"{place}.{key}".lstrip("."))


def _deviation(a: object, b: object, width: float) -> float:
    """Difference of two values over their size or, where that is larger, half the width of their interval."""
    if not (isinstance(a, int | float) and isinstance(b, int | float) and bool not in (type(a), type(b))):
        return 0.0 if (a, type(a)) == (b, type(b)) else math.inf
    if a == b or (math.isnan(a) and math.isnan(b)):
        return 0.0
    deviation = abs(a - b) / max(abs(a), abs(b), width, _LEAST_SCALE)
    return deviation if math.isfinite(deviation) else math.inf


def _shown(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)[:60]
