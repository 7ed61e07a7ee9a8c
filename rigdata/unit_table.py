"""Units that campaigns use all the time, so that pint (a third of a second) is asked for the others only.

Factor to SI base units by name, per dimension; `tests/rigdata/test_units.py` holds them to pint's own, bit for bit.
"""

from __future__ import annotations

import math

Powers = tuple[tuple[str, int], ...]

_LENGTH, _TIME = (("meter", 1),), (("second", 1),)
_FORCE = (("kilogram", 1), ("meter", 1), ("second", -2))
_PRESSURE = (("kilogram", 1), ("meter", -1), ("second", -2))
_VOLTAGE = (("ampere", -1), ("kilogram", 1), ("meter", 2), ("second", -3))
_FACTORS: dict[Powers, dict[str, float]] = {
    _LENGTH: {"m": 1.0, "meter": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "micrometer": 1e-6, "nm": 1e-9},
    _TIME: {"s": 1.0, "second": 1.0, "ms": 0.001, "us": 1e-6, "min": 60.0, "minute": 60.0, "hour": 3600.0},
    (("second", -1),): {"Hz": 1.0, "hertz": 1.0, "kHz": 1000.0},
    (("kilogram", 1),): {"kg": 1.0, "gram": 0.001, "g": 0.001},
    _FORCE: {"N": 1.0, "newton": 1.0, "kN": 1000.0, "MN": 1e6, "kgf": 9.80665},
    _PRESSURE: {"Pa": 1.0, "kPa": 1000.0, "MPa": 1e6, "bar": 1e5},
    _VOLTAGE: {"V": 1.0, "volt": 1.0, "mV": 0.001, "millivolt": 0.001},
    (("ampere", 1),): {"A": 1.0, "mA": 0.001},
    (("kelvin", 1),): {"K": 1.0, "kelvin": 1.0},
    (("radian", 1),): {
        "rad": 1.0, "radian": 1.0, "deg": math.pi / 180.0, "degree": math.pi / 180.0, "revolution": 2.0 * math.pi,
    },
    (("meter", 1), ("second", -2)): {"standard_gravity": 9.80665},
    (): {"percent": 0.01},
}  # fmt: skip
#: Factor and powers of base units, by name.
COMMON: dict[str, tuple[float, Powers]] = {
    name: (factor, powers) for powers, table in _FACTORS.items() for name, factor in table.items()
}
