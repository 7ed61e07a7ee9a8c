"""Named conditions: what a result has to say about itself besides its numbers.

A new condition is one row of `condition_kinds.csv`: name, how grave it is, what it means, what to do; a `Condition`
refuses a name that is not there. With an error a number is not to be trusted: the command ends with exit code 3. With a
warning the number holds as far as its interval goes, and somebody should look. A note says how the number was made.
"""

import csv
import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Self, get_args

from rigdata import problem
from rigdata.near_names import hint

#: How grave a condition or a finding can be, the gravest first.
SEVERITIES = get_args(problem.Severity)
#: What is to be said of one thing, in order.
Conditions = tuple["Condition", ...]
#: Lines that may stand on the excitation beside those of the list: higher harmonics, and lines found in the record.
_LINES = ["found", *(f"{n}X" for n in range(4, 11))]
for _n in range(2, 11):
    _LINES += [f"mains {_n}", f"harmonic {_n}"]


class UnknownConditionError(LookupError):
    """A condition that is not in the registry: a mistake of the code, not of its input."""


class ConditionKind(NamedTuple):
    """What is known of a condition by its name alone."""

    severity: problem.Severity
    name: str
    meaning: str


def _registered() -> dict[str, ConditionKind]:
    text = Path(__file__).with_name("condition_kinds.csv").read_text(encoding="utf-8")
    rows: Any = csv.reader(text.splitlines()[1:])
    kinds = [ConditionKind(*row) for row in rows]
    meaning = "Another line is on the excitation and cannot be separated from it. Excite elsewhere."
    kinds += [ConditionKind("warning", f"{line} on excitation line", meaning) for line in _LINES]
    return {kind.name: kind for kind in kinds}


#: Every condition by its name.
KINDS = _registered()


class Condition(problem.Condition):
    """A name of the registry, with its severity there and a sentence on what was found."""

    __slots__ = ()

    def __new__(cls, name: str, detail: str = "") -> Self:
        """Make a condition from its name and its sentence."""
        kind = KINDS.get(str(name))
        if kind is None:
            names = hint(name, KINDS, "tpjb_ident/condition_kinds.csv lists them:")
            raise UnknownConditionError(f"condition {str(name)!r} is not known. {names}")
        return super().__new__(cls, kind.name, kind.severity, detail)

    def __reduce__(self) -> tuple[Any, ...]:
        return Condition, (str(self), self.detail)

    @property
    def meaning(self) -> str:
        """What it means to the reader, and what to do."""
        return KINDS[str(self)].meaning


def merged(*groups: Conditions) -> Conditions:
    """Conditions of several steps in order, each name once (the first detail counts)."""
    return tuple(dict.fromkeys(itertools.chain(*groups)))


def holding(*rows: tuple[object, str, str]) -> Conditions:
    """Conditions from rows of test, name and sentence: those whose test holds."""
    return tuple(Condition(name, detail) for test, name, detail in rows if test)


def untrusted(conditions: Iterable[Condition]) -> Conditions:
    """Those that forbid trust in the number that they belong to: a command that has one ends with exit code 3."""
    return tuple(condition for condition in conditions if condition.severity == "error")


def led_by(doubt: str, sentences: Sequence[str]) -> Sequence[str]:
    """Sentences on a result behind the first line of why it is not to be trusted; as they are where it is."""
    first = doubt.partition("\n")[0].rstrip(":.")
    return (f"NOT to be trusted: {first}.", *sentences) if doubt else sentences


def sentences(conditions: Iterable[Condition]) -> tuple[str, ...]:
    """Every condition as one line, name and detail."""
    return tuple(map(Condition.sentence, conditions))


def errors_in(quality: object) -> list[str]:
    """Names in a cell of a column `quality` that forbid trust in its row."""
    return [name for name in str(quality).split("; ") if name in KINDS and KINDS[name].severity == "error"]
