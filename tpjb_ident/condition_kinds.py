"""The registry of conditions: every name that a result may say of itself, how grave it is, what it means, what to do.

A new condition is one row of `condition_kinds.csv`. `tpjb_ident.conditions.Condition` refuses a name that is not there.
With an error a number is not to be trusted: the command ends with exit code 3. With a warning the number holds as far
as its interval goes, and somebody should look. A note says how the number was made.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, NamedTuple

from rigdata.near_names import hint
from rigdata.problem import Severity


class UnknownConditionError(LookupError):
    """A condition that is not in the registry: a mistake of the code, not of its input."""


class ConditionKind(NamedTuple):
    """What is known of a condition by its name alone."""

    severity: Severity
    name: str
    meaning: str


#: Lines that may stand on the excitation beside those of the list: higher harmonics, and lines found in the record.
_LINES = (
    *(f"{n}X" for n in range(4, 11)),
    *(f"{kind} {n}" for kind in ("mains", "harmonic") for n in range(2, 11)),
    "found",
)


def _registered() -> dict[str, ConditionKind]:
    text = Path(__file__).with_suffix(".csv").read_text(encoding="utf-8")
    rows: Any = csv.reader(text.splitlines()[1:])
    kinds = [ConditionKind(*row) for row in rows]
    meaning = "Another line is on the excitation and cannot be separated from it. Excite elsewhere."
    kinds += [ConditionKind("warning", f"{line} on excitation line", meaning) for line in _LINES]
    return {kind.name: kind for kind in kinds}


#: Every condition by its name.
KINDS = _registered()


def condition_kind(name: str) -> ConditionKind:
    """Look a condition up."""
    kind = KINDS.get(str(name))
    if kind is None:
        names = hint(name, KINDS, "tpjb_ident/condition_kinds.csv lists them:")
        raise UnknownConditionError(f"condition {str(name)!r} is not known. {names}")
    return kind
