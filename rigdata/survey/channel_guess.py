"""What a channel may measure, guessed from its unit and its name; every guess says why."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rigdata.calibration import DIMENSIONS
from rigdata.readers.series import is_time
from rigdata.units import UnitError, is_signal, parse_unit, unit_factor

#: Words of rigs in several languages -> quantity; the first that fits counts.
_WORDS = (
    ("speed", r"speed|rpm|drehzahl|tach|keyph|vitesse|giri|^n\d*$|^k\d*$"),
    ("temperature", r"temp|^t\d+|thermo|^tc\d*"),
    ("acceleration", r"acc|beschl|^a\d*[a-z]?$|^a\d+[hvxy]$"),
    ("force", r"force|load|kraft|last|forza|^f[xyhv]?\d*$|^l\d+[hvxy]?$|cell"),
    ("pressure", r"press|druck|^p\d+$"),
    ("displacement", r"disp|prox|probe|weg|gap|sonde|^x\d*[ab]?$|^y\d*[ab]?$|^d[xy]?\d*$|^x\d+[a-d]$|^y\d+[a-d]$"),
)
#: How loggers spell units that a manifest spells otherwise.
_SPELT = {"U/min": "rpm", "1/min": "rpm", "min-1": "rpm", "degc": "degC", "C": "degC", "m/s2": "m/s^2", "Volts": "V",
          "volts": "V", "Volt": "V", "Newtons": "N", "newtons": "N", "Newton": "N", "mils": "mil"}  # fmt: skip


@dataclass(frozen=True)
class ChannelGuess:
    """What a channel may be."""

    quantity: str
    unit: str
    axis: str
    why: str


def guess_channel(name: str, unit: str) -> ChannelGuess:
    """Guess quantity and direction of a channel."""
    usable = usable_unit(unit)
    if is_time(name):
        return ChannelGuess("time", usable or "s", "", "by its name")
    by_unit = quantity_of_unit(usable)
    by_name = next((q for q, pattern in _WORDS if re.search(pattern, name.strip(), re.IGNORECASE)), "")
    if by_unit:
        return ChannelGuess(by_unit, usable, _axis(name, by_unit), f"by its unit {usable}")
    if by_name:
        return ChannelGuess(by_name, usable, _axis(name, by_name), "by its name")
    return ChannelGuess("", usable, "", "neither name nor unit tell")


def usable_unit(unit: str) -> str:
    """Write a logger's unit so that a manifest can hold it; "" if it is none."""
    text = unit.strip().replace("°", "deg").replace("µ", "u").replace("μ", "u")
    text = re.sub(r"\s*/\s*", "/", text)
    text = _SPELT.get(text, text)
    try:
        parse_unit(text)
    except UnitError:
        return ""
    return text


def quantity_of_unit(unit: str) -> str:
    """Quantity that an engineering unit belongs to; "" for volts and for nothing known."""
    if not unit or _is_signal(unit):
        return ""
    for quantity, dimension in DIMENSIONS.items():
        if quantity == "time":
            continue
        try:
            unit_factor(unit, dimension)
        except UnitError:
            continue
        return quantity
    return ""


def _is_signal(unit: str) -> bool:
    try:
        return is_signal(unit)
    except UnitError:
        return False


def _axis(name: str, quantity: str) -> str:
    """Direction from the letters at a name's end, for quantities that have one."""
    if quantity not in ("displacement", "force", "acceleration"):
        return ""
    end = re.search(r"(?:^|[\d_\-. ])([xyhv])$", name.strip(), re.IGNORECASE) or re.match(
        r"[fdal]([xyhv])$", name.strip(), re.I
    )
    if end is None:
        return ""
    return "0 deg" if end[1].lower() in "xh" else "90 deg"
