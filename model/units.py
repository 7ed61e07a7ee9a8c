"""Quantities with units, as bearing files and notebooks give them, into SI floats.

Inside the model everything is SI and in radians. Temperatures are in degC, because Eq. (4) and (5) of the paper count
from 40 degC; differences of temperatures, and what is per degree, are in K. No other place has kelvins from zero.
"""

from __future__ import annotations

import functools
import math
import re
from typing import Any

from model.errors import ModelError

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?"
_UNIT = r"[A-Za-zµμ°%Ω][A-Za-z0-9µμ°%Ω/*^ .]{0,40}|1/[A-Za-z]{1,10}|"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")
#: Characters of a quantity; more are a slip or a bomb.
LONGEST = 200
#: What each physical dimension is called and its SI unit as pint writes it.
SI_UNITS = {
    "length": "m",
    "angle": "rad",
    "mass": "kg",
    "force": "N",
    "stiffness": "N/m",
    "compliance": "m/N",
    "damping": "N*s/m",
    "rotational stiffness": "N*m/rad",
    "moment of inertia": "kg*m^2",
    "pressure": "Pa",
    "viscosity": "Pa*s",
    "density": "kg/m^3",
    "temperature": "degC",
    "temperature difference": "K",
    "per kelvin": "1/K",
    "specific heat": "J/kg/K",
    "conductivity": "W/m/K",
    "heat transfer": "W/m^2/K",
    "angular speed": "rad/s",
    "time": "s",
    "ratio": "",
}


#: What pint makes of the units that bearing files use, so that it need not be loaded for them; a test holds it so.
COMMON_UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "mm": 0.001, "um": 1e-06, "µm": 1e-06},
    "angle": {"rad": 1.0, "deg": 0.017453292519943295},
    "mass": {"kg": 1.0, "g": 0.001},
    "force": {"N": 1.0, "kN": 1000.0},
    "stiffness": {"N/m": 1.0, "N/um": 1000000.0, "MN/m": 1000000.0},
    "damping": {"N*s/m": 1.0, "kN*s/m": 1000.0},
    "rotational stiffness": {"N*m/rad": 1.0},
    "moment of inertia": {"kg*m^2": 1.0, "kg m^2": 1.0},
    "pressure": {"Pa": 1.0, "MPa": 1000000.0, "GPa": 1000000000.0},
    "viscosity": {"Pa*s": 1.0, "Pa s": 1.0, "mPa*s": 0.001},
    "density": {"kg/m^3": 1.0},
    "temperature difference": {"K": 1.0},
    "per kelvin": {"1/K": 1.0},
    "specific heat": {"J/kg/K": 1.0},
    "conductivity": {"W/m/K": 1.0},
    "heat transfer": {"W/m^2/K": 1.0},
    "angular speed": {"rad/s": 1.0},
    "time": {"s": 1.0, "ms": 0.001, "us": 1e-06},
    "ratio": {"": 1.0, "percent": 0.01},
}


class UnitError(ModelError):
    """A quantity that cannot be read, or has the wrong dimension."""


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None, on_redefinition="ignore")


@functools.lru_cache(maxsize=512)
def _factor(unit: str, dimension: str) -> float:
    """Multiplier from `unit` to the SI unit of `dimension` (not for degC)."""
    if unit in COMMON_UNITS.get(dimension, {}):
        return COMMON_UNITS[dimension][unit]
    return pint_factor(unit, dimension)


def pint_factor(unit: str, dimension: str) -> float:
    """Multiplier from `unit` to the SI unit of `dimension`, by pint."""
    registry = _registry()
    target = SI_UNITS[dimension]
    try:
        factor = float((1.0 * registry.parse_units(unit)).to(registry.parse_units(target)).magnitude)
    except Exception as error:  # pint raises a dozen kinds for a bad unit; all mean the same to a user
        raise UnitError(
            f"unit {unit!r} is not one of {dimension} (expected something like {target or 'a plain number'!r})"
        ) from error
    return factor


def parse_quantity(value: str | float | int, dimension: str, name: str = "value") -> float:
    """Turn ``"0.080 mm"`` into 8e-5."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise UnitError(f"{name}: expected a number with a unit of {dimension}, got {value!r}")
    if isinstance(value, (int, float)):
        if dimension != "ratio":
            raise UnitError(
                f'{name}: {value!r} has no unit; write it with one of {dimension}, e.g. "{value} {SI_UNITS[dimension]}"'
            )
        try:
            return _finite(float(value), name)
        except OverflowError as error:
            raise UnitError(f"{name}: a whole number of hundreds of digits is not a quantity") from error
    if len(value) > LONGEST:
        raise UnitError(f"{name}: a text of {len(value)} characters is not a quantity")
    match = _QUANTITY.fullmatch(value)
    if match is None:
        raise UnitError(f"{name}: {value!r} is not a number with a unit")
    number, unit = float(match[1]), match[2].strip()
    return _finite(_convert(number, unit, dimension, name), name)


def _convert(number: float, unit: str, dimension: str, name: str) -> float:
    try:
        if dimension == "temperature":
            return number - 273.15 if unit == "K" else number * _celsius(unit)
        if dimension == "angular speed" and unit in {"Hz", "rpm", "1/min", "1/s"}:
            return number * 2 * math.pi / (60.0 if "m" in unit else 1.0)
        if not unit and dimension != "ratio":
            raise UnitError(f"{number:g} has no unit; write it with one of {dimension}")
        if unit == "%":
            unit = "percent"
        return number * _factor(unit, dimension)
    except UnitError as error:
        raise UnitError(f"{name}: {error}") from error


def _celsius(unit: str) -> float:
    if unit not in {"degC", "°C", "C", "celsius"}:
        raise UnitError(f"unit {unit!r} is not a temperature (degC or K)")
    return 1.0


def _finite(number: float, name: str) -> float:
    if not math.isfinite(number):
        raise UnitError(f"{name}: {number} is not a finite number")
    return number


def to_si(value: Any, dimension: str, name: str) -> Any:
    """Take SI floats or arrays as they are, pint quantities converted; refuse a wrong dimension."""
    if isinstance(value, str):
        return parse_quantity(value, dimension, name)
    if hasattr(value, "to") and hasattr(value, "magnitude"):
        if dimension == "angular speed" and value.check("1/[time]"):
            unit = str(value.units)
            cycles = 2 * math.pi if unit in {"hertz", "kilohertz"} else 1.0
            return value.to("1/s").magnitude * cycles if cycles != 1.0 else value.to("rad/s").magnitude
        try:
            return value.to(SI_UNITS[dimension]).magnitude
        except Exception as error:  # a foreign registry raises its own DimensionalityError
            raise UnitError(f"{name}: {value} is not a {dimension}") from error
    return value
