"""Numbers that no bearing has: refused by name, before they overflow somewhere in the film or the pad.

The bounds are far wider than any machine. What lies within them and still cannot work ends in a named status; what lies
beyond is a slip of the keyboard or of a unit.
"""

from __future__ import annotations

import math
from typing import Any

from model.bearing import Bearing, BearingError, Material, Oil, Pad, Pivot

_LENGTH = (1e-6, 1e3, "m")
_STIFF, _POISSON = (1e3, 1e15, "Pa"), (-0.99, 0.499, "")
#: Smallest and largest value, and unit, of every number, by the class that holds it.
BOUNDS: dict[type, dict[str, tuple[float, float, str]]] = {
    Bearing: {"journal_diameter": _LENGTH, "length": _LENGTH},
    Pad: {
        "pivot_angle": (-1e3, 1e3, "rad"),
        "arc": (1e-6, 2 * math.pi, "rad"),
        "pivot_offset": (0.0, 1.0, ""),
        "pad_clearance": (1e-12, 1.0, "m"),
        "assembled_clearance": (-1.0, 1.0, "m"),
        "thickness": _LENGTH,
        "babbitt_thickness": (0.0, 1e3, "m"),
        "elastic_thickness": _LENGTH,
        "mass": (0.0, 1e9, "kg"),
        "moment_of_inertia": (0.0, 1e12, "kg m^2"),
        "back_convection": (0.0, 1e9, "W/m^2/K"),
        "leading_edge_pressure": (0.0, 1e9, "Pa"),
    },
    Material: {
        "youngs_modulus": _STIFF,
        "poissons_ratio": _POISSON,
        "thermal_expansion": (-1.0, 1.0, "1/K"),
        "conductivity": (1e-9, 1e9, "W/m/K"),
    },
    Pivot: {
        "youngs_modulus": _STIFF,
        "poissons_ratio": _POISSON,
        "contact_length": (1e-9, 1e3, "m"),
        "housing_diameter": (1e-9, 1e3, "m"),
        "pivot_diameter": (1e-9, 1e3, "m"),
        "sphere_diameter": (1e-9, 1e3, "m"),
    },
    Oil: {
        "viscosity_40": (1e-12, 1e9, "Pa s"),
        "viscosity_exponent": (-1e3, 1e3, "1/K"),
        "density_40": (1e-6, 1e9, "kg/m^3"),
        "thermal_expansion": (-100.0, 100.0, "1/K"),
        "specific_heat": (1e-9, 1e12, "J/kg/K"),
        "conductivity": (0.0, 1e9, "W/m/K"),
        "supply_temperature": (-273.15, 1e6, "degC"),
        "supply_flow": (1e-300, math.inf, "m^3/s"),  # above zero; infinite where none is stated
    },
}
#: A pivot's sizes are NaN where its kind has none.
_MAY_BE_ABSENT = {"contact_length", "housing_diameter", "pivot_diameter", "sphere_diameter"}


def check_possible(bearing: Bearing) -> None:
    """Refuse a bearing with a number that no bearing has."""
    _check(bearing, bearing.name)
    _check(bearing.oil, "oil")
    checked: Any = None
    for k, pad in enumerate(bearing.pads):
        _check(pad, f"pad {k + 1}")
        _check(bearing.pivot_of(pad), f"pivot of pad {k + 1}")
        if (pad.backing, pad.babbitt) != checked:  # the pads of a bearing are of one make, as a rule
            checked = pad.backing, pad.babbitt
            _check(pad.backing, f"pad {k + 1}, backing")
            _check(pad.babbitt, f"pad {k + 1}, babbitt")


def _check(part: Any, place: str) -> None:
    for name, (low, high, unit) in BOUNDS[type(part)].items():
        value = getattr(part, name)
        if not low <= value <= high and not (name in _MAY_BE_ABSENT and math.isnan(value)):
            bounds = f"{low:g} to {high:g} {unit}".rstrip()
            raise BearingError(
                f"{place}: {name} is {value!r}; no bearing has that ({bounds}). Check the number and its unit."
            )
