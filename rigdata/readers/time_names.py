"""Which columns are times, and in what unit, by their names: loggers write them in the language of their users."""

from __future__ import annotations

import re

from rigdata.arrays import FloatArray

_WORDS = (
    r"date[ /_-]*time|date and time|datum[ /_+-]*(?:und )?(?:uhr)?zeit|time|zeit(?:stempel)?|temps|tempo|tiempo|uhrzeit"
    r"|timestamps?|elapsed ?time|relative ?time"
)
# a lone t is a time, T and T1 are thermometers
_TIME = re.compile(rf"(?:(?i:{_WORDS})\b|t$|t\s*[\[(])")
_FACTORS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}


def is_time(name: str) -> bool:
    """Whether a column of this name holds times.

    Parameters
    ----------
    name : str
        As the file has it.

    >>> [is_time(n) for n in ("Zeit", "Time  1 - default sample rate", "t", "T", "T1", "Temperature")]
    [True, True, True, False, False, False]
    """
    return bool(_TIME.match(name.strip()))


def seconds(values: FloatArray, unit: str) -> FloatArray:
    """Times in seconds; an unknown unit counts as seconds.

    Parameters
    ----------
    values : (n,) ndarray
        As read.
    unit : str
        As the file states it.
    """
    return values * _FACTORS.get(unit.strip().strip("[]()"), 1.0)
