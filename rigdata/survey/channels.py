"""What a channel may measure, by its unit and its name; where an entry of a draft comes from."""

import contextlib
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rigdata.calibration import DIMENSIONS, VECTOR_QUANTITIES, reading_gain
from rigdata.manifest.fields import MARK
from rigdata.readers.series import is_time
from rigdata.units import UnitError, is_signal, parse_quantity, parse_unit

#: Tables of `words.toml`.
WORDS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
_SPELLINGS = str.maketrans(WORDS["spellings"])
#: Units that a name may end with after an underscore; V, H and A there are directions and numbers of sensors.
_SUFFIXES = "um|mm|mils?|k?N|lbf|m_s2|m/s2|mps2|g|deg[CF]|rpm|Hz|mV|bar|k?Pa|MPa|psi"
_UNIT_IN_NAME = re.compile(rf"^(.*?)(?:\s*[(\[]([^)\]]{{1,12}})[)\]]|_({_SUFFIXES}))\s*$")
#: What rigs call a pad.
PAD = "(?:pad|shoe|segment|schuh|klotz|patin)"


@dataclass(frozen=True)
class Entry:
    """A value of a draft and its source: "file", what it or its name states; "records", concluded; "guess"; ""."""

    value: Any = None
    source: str = ""
    reason: str = ""

    @property
    def number(self) -> float:
        """The value where it is a number; else NaN."""
        return float(self.value) if isinstance(self.value, (int, float)) else math.nan


OPEN = Entry()


@dataclass(frozen=True)
class ChannelGuess:
    """What a channel may be; `gain` [SI per reading] is NaN until it is calibrated, `axis` in degrees."""

    quantity: Entry
    unit: str
    axis: Entry = OPEN
    polarity: int = 1
    gain: float = math.nan
    hint: float = math.nan  #: direction [deg] that the name hints at
    typed: bool = False  #: whether the axis stands in the manifest
    sign: int = 0  #: polarity that stands in the manifest


#: What channels may be, by name.
Guesses = dict[str, ChannelGuess]
#: Tables of a manifest, by channel.
Tables = Mapping[str, Mapping[str, Any]]


def guess_channel(name: str, unit: str) -> ChannelGuess:
    """Guess what a channel measures, by its unit first."""
    parts = _UNIT_IN_NAME.match(name.strip())
    bare, in_name = (parts[1], parts[2] or parts[3]) if parts else (name.strip(), "")
    usable = usable_unit(unit) or usable_unit(in_name)
    if is_time(name):
        return ChannelGuess(Entry("time", "file"), usable or "s")
    if quantity := quantity_of_unit(usable):
        gain = reading_gain(quantity, usable, None)
        return ChannelGuess(Entry(quantity, "file"), usable, gain=gain, hint=_hint(bare, quantity))
    for quantity, pattern in WORDS["quantities"].items():
        if re.search(pattern, bare, re.IGNORECASE):
            return ChannelGuess(Entry(quantity, "guess", "its name"), usable, hint=_hint(bare, quantity))
    return ChannelGuess(Entry(), usable)


def usable_unit(unit: str) -> str:
    """Write a logger's unit so that a manifest can hold it; "" if it is none."""
    text = re.sub(r"\s*/\s*", "/", unit.strip().translate(_SPELLINGS))
    text = WORDS["units"].get(text.lower(), text)
    try:
        parse_unit(text)
    except UnitError:
        return ""
    return text


def quantity_of_unit(unit: str) -> str:
    """Quantity that an engineering unit belongs to; "" for volts and for nothing known."""
    with contextlib.suppress(UnitError):
        if not unit or is_signal(unit):
            return ""
    for quantity in DIMENSIONS:
        with contextlib.suppress(UnitError):
            reading_gain(quantity, unit, None)
            if quantity != "time":
                return quantity
    return ""


def _hint(name: str, quantity: str) -> float:
    """Direction [deg] that the end of a name hints at, for quantities that have one."""
    if quantity not in VECTOR_QUANTITIES:
        return math.nan
    hints = WORDS["directions"].items()
    return next((float(angle) for angle, end in hints if re.search(end, name, re.IGNORECASE)), math.nan)


def as_described(guess: ChannelGuess, table: Mapping[str, Any]) -> ChannelGuess:
    """A guess with what the manifest says of the channel in its place, as far as it does."""
    quantity, unit, axis = (_text(table, key) for key in ("quantity", "unit", "axis"))
    if quantity and quantity != guess.quantity.value:
        guess = ChannelGuess(Entry(quantity, "file"), guess.unit)
    quantity = guess.quantity.value or ""
    unit = unit or guess.unit
    gain = math.nan
    with contextlib.suppress(UnitError, KeyError):
        gain = reading_gain(quantity, unit, *(table.get(key) for key in ("sensitivity", "full_scale", "excitation")))
    sign = table["polarity"] if table.get("polarity") in (1, -1) else 0
    guess = replace(guess, unit=unit, gain=gain, sign=sign)
    with contextlib.suppress(UnitError):
        angle = math.degrees(parse_quantity(axis, "angle"))
        return replace(guess, axis=Entry(angle, "file"), polarity=sign or 1, typed=True)
    return guess


def _text(table: Mapping[str, Any], key: str) -> str:
    value = table.get(key, "")
    return value if isinstance(value, str) and MARK not in value else ""
