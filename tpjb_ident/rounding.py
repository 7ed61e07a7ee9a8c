"""Numbers as a reader wants them: as many digits as the interval allows, minus signs that do not break."""

import math
from collections.abc import Sequence

MINUS = "\N{MINUS SIGN}"
#: An interval that reaches this many times further to one side than to the other is told by its ends.
_ASKEW = 1.5
#: A deviation of a larger share is told as a ratio.
_TIMES = 3.0


def counted(number: int, thing: str) -> str:
    """A number of things, in the plural unless it is one.

    >>> counted(1, "error"), counted(0, "error")
    ('1 error', '0 errors')
    """
    return f"{number} {thing}{'' if number == 1 else 's'}"


def listed(things: Sequence[str], most: int = 5, between: str = ", ") -> str:
    """The first of many things, and how many more there are.

    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    rest = len(things) - most
    return between.join(things[:most]) + (f" and {rest} more" if rest > 0 else "")


def plain(value: float, digits: int) -> str:
    """A number with `digits` decimals, below zero so many digits before the point rounded; never a negative zero.

    >>> plain(-0.004, 1), plain(1041813.2, -2)
    ('0.0', '1041800')
    """
    text = f"{round(value, digits):.{max(0, digits)}f}"
    return text.replace("-", MINUS) if float(text) else text.lstrip("-")


def significant(value: float, form: str = ".4g") -> str:
    """A number of so many digits, large ones without an exponent.

    >>> significant(1041813.2)
    '1042000'
    """
    text = format(value, form)
    return f"{float(text):.0f}" if "e+" in text else text


def with_interval(value: float, low: float, high: float, scale: float = 1.0) -> str:
    """Value and half the width of its interval, or its ends where it is askew, to the digit that it allows.

    >>> with_interval(163.2841e6, 162.0e6, 164.6e6, 1e6)
    '163.3 ± 1.3'
    >>> with_interval(66.4, 0.0, 294.7)
    '66 (0 to 295)'
    """
    if not math.isfinite(value):
        return "no answer"
    half = 0.5 * (high - low) / scale
    if not math.isfinite(half) or half <= 0:
        return f"{value / scale:.4g}".replace("-", MINUS)
    digits = 1 - math.floor(math.log10(half))
    digits += digits < 0  # three digits of what is in the hundreds and above
    below, above = value - low, high - value
    if max(below, above) > _ASKEW * min(below, above):  # as where a bound cuts it off
        return f"{plain(value / scale, digits)} ({plain(low / scale, digits)} to {plain(high / scale, digits)})"
    return f"{plain(value / scale, digits)} ± {plain(half, digits)}"


def percent(share: float) -> str:
    """A share as a signed percentage; a dash if there is none."""
    return f"{signed(100 * share)}\N{NO-BREAK SPACE}%" if math.isfinite(share) else "–"


def deviation(share: float) -> str:
    """How far a prediction is off what was measured: a signed percentage; far off, how many times that it is.

    >>> deviation(13.152).split(), deviation(0.25).split()
    (['14', 'times'], ['+25.0', '%'])
    """
    if not _TIMES < abs(share) < math.inf:
        return percent(share)
    return f"{fixed(1.0 + share, 0 if abs(share) > 10.0 else 1)}\N{NO-BREAK SPACE}times"


def signed(value: float, digits: int = 1) -> str:
    """A number with its sign, none if it rounds to zero; a dash if there is none."""
    text = fixed(value, digits)
    return text if text[0] in f"{MINUS}–" or not float(text) else f"+{text}"


def fixed(value: float, digits: int = 1) -> str:
    """A plain number; a dash if there is none."""
    return plain(value, digits) if math.isfinite(value) else "–"
