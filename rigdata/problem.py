"""What is wrong with an export, in words with which the person at the rig can repair it."""

from __future__ import annotations

import json
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self

Severity = Literal["error", "warning", "note"]
#: From as many problems of one sort on they are counted, not listed.
ALIKE = 4
#: Keys with more dots than this nest deeper than any file of ours; parsing them takes the square of their length.
MAX_DEPTH = 64
#: A step of a dotted key: a bare or quoted piece and its dot.
_STEP = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_BOMB = re.compile(rf"(?<![\w.-])(?:(?:{_STEP}){{{MAX_DEPTH + 1}}}|[0-9]\w{{4000}})")


class RigError(ValueError):
    """Something that this package was given cannot be used; the message says what, where and what to do."""


@dataclass(frozen=True)
class Problem:
    """One finding: where, what, and what to do about it.

    Attributes
    ----------
    severity : {"error", "warning", "note"}
        An error makes the file or the run unusable; a warning needs a look; a note is for information.
    file : str
        File name as the user knows it (relative to the campaign).
    place : str
        Line, column, key, channel, dataset: as near to the trouble as is known; "" if the whole file.
    what : str
        What is wrong.
    cure : str
        What to do.
    run : str or None
        Run id, where the problem belongs to one run.

    Examples
    --------
    >>> print(Problem("warning", "campaign.toml", "line 3", "mass is missing", "Add it"))
    campaign.toml, line 3: mass is missing. Add it
    """

    severity: Severity
    file: str
    place: str
    what: str
    cure: str
    run: str | None = None

    def __post_init__(self) -> None:
        # Names and cells come from strangers' files: control and direction marks must not steer a terminal.
        for name in ("file", "place", "what", "cure"):
            text = getattr(self, name)
            for letter in set(text) - {"\n"}:
                if not letter.isprintable():
                    text = text.replace(letter, letter.encode("unicode_escape").decode())
            object.__setattr__(self, name, text)

    def __str__(self) -> str:
        location = f"{self.file}, {self.place}" if self.place else self.file
        return f"{location}: {self.what}. {self.cure}"


class Condition(str):
    """What a result says of itself: a short name that compares like a string, and knows how much it matters."""

    __slots__ = ("detail", "pads", "severity")
    severity: Severity
    detail: str
    pads: tuple[int, ...]

    def __new__(cls, name: str, severity: Severity, detail: str = "", pads: tuple[int, ...] = ()) -> Self:
        """Make a condition from its name, its weight, its sentence and its pads."""
        condition = super().__new__(cls, name)
        condition.severity, condition.detail, condition.pads = severity, detail, pads
        return condition

    def __reduce__(self) -> tuple[Any, ...]:
        return Condition, (str(self), self.severity, self.detail, self.pads)

    def sentence(self) -> str:
        """Name and detail in one line."""
        return f"{self!s}: {self.detail}" if self.detail else str(self)


class RigDataError(RigError):
    """A campaign, manifest or record file that cannot be used; carries every problem found.

    Examples
    --------
    >>> try:
    ...     ti.load_campaign("nowhere")
    ... except RigDataError as error:
    ...     print(error.problems[0].what)
    there is no such file or folder
    """

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(map(str, gathered(self.problems))))

    def __reduce__(self) -> tuple[type[RigDataError], tuple[tuple[Problem, ...]]]:
        return RigDataError, (self.problems,)  # so that it travels back whole from a worker process


def gathered(problems: Iterable[Problem]) -> Iterator[Problem]:
    """Tell once what is the same but for its numbers in many runs, an error at many places of a run or manifest."""
    groups = defaultdict(list)
    for p in problems:
        words = re.sub(r"[-+]?\d[\d.e+-]*", "#", p.what)
        groups[p.severity, words, p.file if p.severity == "error" else ""].append(p)
    for first, *repeats in groups.values():
        if len(repeats) + 1 < ALIKE:
            yield from (first, *repeats)
            continue
        places = []
        for p in repeats:
            place = p.place.split(",")[0] if p.severity == "error" else p.run or p.file
            if place not in places:
                places.append(place)
        times = f"{len(repeats)} more times, such as {', '.join(places[:3])}"
        yield replace(first, what=f"{first.what} (the like {times})")


def refuse(file: str, place: str, fault: str, cure: str, run: str | None = None) -> RigDataError:
    """The error to raise for one thing that stops the reading: file, place, what is wrong, what to do."""
    return RigDataError(Problem("error", file, place, fault, cure, run))


def shown(value: object) -> str:
    """`value` in a message: quoted, short, on one line, controls escaped."""
    if isinstance(value, str):
        text = repr(value[:200])  # which escapes control characters and marks of direction
    elif isinstance(value, (dict, list)):  # may be nested too deeply to be printed
        text = "a table" if isinstance(value, dict) else "an array"
    elif isinstance(value, int) and abs(value) > 10**60:  # may have more digits than Python prints
        text = "a whole number of hundreds of digits"
    else:
        text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."


def tables_beside(module: str, name: str) -> dict[str, Any]:
    """Tables of a TOML file of ours, next to the module whose file is given."""
    return tomllib.loads(Path(module).with_name(name).read_text("utf-8"))


def toml_value(value: Any) -> str:
    """A value as TOML writes it: texts quoted, controls escaped."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML from a stranger; a `RigError`, or tomllib's own, before it can take long."""
    bomb = _BOMB.search(text)
    if bomb is not None:
        line = text.count("\n", 0, bomb.start()) + 1
        raise RigError(f"line {line} nests far too deeply, or holds a whole number of thousands of digits")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise RigError("nested far too deeply") from error
