"""Effects in the words and units of an engineer: the words are the effect's own, here they get their numbers."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from model.effects import EffectWords, Parameter, known_effects
from tpjb_ident.columns import UNITS
from tpjb_ident.rounding import fixed, plain, with_interval


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval, SI; "1" is the unit of a ratio, "pad" that of a pad number."""

    value: float
    lo: float
    hi: float
    unit: str = "1"


#: SI unit: the quantity whose unit people read.
_QUANTITIES = {"m": "length", "N/m": "stiffness", "N s/m": "damping", "Pa": "pressure", "kg": "mass"}
#: SI unit: what people read in every system, and its size in SI.
_UNITS = {
    "m/N": ("µm/kN", 1e-9),
    "N m/rad": ("kN m/rad", 1e3),
    "s": ("ms", 1e-3),
    "rad": ("°", math.radians(1.0)),
    "K": ("K", 1.0),
    "W/m^2/K": ("W/m²/K", 1.0),
    "1": ("%", 0.01),
}


def shown_unit(unit: str) -> tuple[str, float]:
    """What people read in place of an SI unit, and its size in SI."""
    return UNITS[_QUANTITIES[unit]] if unit in _QUANTITIES else _UNITS.get(unit, (unit, 1.0))


def label_in_words(name: str) -> str:
    """Name of an effect, a parameter or an observable as people write it."""
    text = re.sub(r"\bpad (\d)", r"pad #\1", name.replace("_", " "))
    return re.sub(r"(?<!load )\bdirection (-?\d+\.?\d*)", lambda m: f"at {plain(math.degrees(float(m[1])), 0)}°", text)


def amount(estimate: Estimate) -> str:
    """A parameter with half its interval in the units that people read."""
    unit, scale = shown_unit(estimate.unit)
    return f"{with_interval(estimate.value, estimate.lo, estimate.hi, scale)} {unit}".replace(" °", "°")


@dataclass(frozen=True)
class _Field:
    """A parameter as a field of `EffectWords.finding` writes it."""

    estimate: Estimate
    parameter: Parameter

    def __format__(self, form: str) -> str:
        value, low, high = self.estimate.value, self.estimate.lo, self.estimate.hi
        neutral = self.parameter.neutral
        if self.parameter.discrete:
            return f"pad #{value:.0f}"
        if "|" in form:
            above, below = form.split("|")
            return above if value > neutral else below
        if form == "size":
            size, low, high = value - neutral, low - neutral, high - neutral
            if size < 0:
                size, low, high = -size, -high, -low
            return amount(Estimate(size, low, high, self.estimate.unit))
        if form == "mm/m":
            return f"{with_interval(value, low, high, 1e-3)} mm/m"
        if form == "°":
            return f"{plain(math.degrees(value), 0)}°"
        return fixed(value, int(form)) if form else amount(self.estimate)


def words_of(name: str) -> EffectWords | None:
    """What an effect says of itself; None for one that has no words, or is not registered here."""
    kind = known_effects().get(name)
    return kind.words if kind is not None else None


def finding(name: str, parameters: Mapping[str, Estimate]) -> str:
    """Say what was found, in one clause with its size; an effect without words by its name."""
    kind, words = known_effects().get(name), words_of(name)
    if kind is None or words is None:
        sizes = ", ".join(f"{key.replace('_', ' ')} {amount(value)}" for key, value in parameters.items())
        return f"{name.replace('_', ' ')}: {sizes}"
    fields: dict[str, _Field | str] = {p.name: _Field(parameters[p.name], p) for p in kind.parameters}
    if kind.per_pad is not None:  # a parameter that each pad has is listed pad by pad
        pads = {key.rpartition("_")[2]: amount(value) for key, value in parameters.items() if key not in fields}
        fields[kind.per_pad.name] = ", ".join(f"#{pad} {size}" for pad, size in pads.items())
    return words.finding.format(**fields)
