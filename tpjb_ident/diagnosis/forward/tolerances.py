"""Stated tolerances: how well the drawing, the data sheet and the instruments are known, one standard deviation each.

They come from the bearing file's ``[tolerances]``, from ``--tolerance NAME=VALUE``, or from the defaults of
`rig-export.md`, which are what a good workshop and an ISO oil grade hold.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from model.bearing import Bearing
from model.possible import KEYS
from rigdata.near_names import hint
from rigdata.units import UnitError, example_of, parse_quantity
from tpjb_ident.diagnosis.observations.constants import TRUSTED
from tpjb_ident.errors import BadInputError


@dataclass(frozen=True)
class StatedTolerance:
    """One stated tolerance: one standard deviation in SI, and where it comes from."""

    value: float
    source: str = "default"


#: Defaults of `rig-export.md`; `bearing_keys.toml` says of which dimension each is.
DEFAULTS: dict[str, float] = {
    "viscosity": 0.05,
    "viscosity_exponent": 0.03,
    "supply_temperature": 0.5,
    "assembled_clearance": 2e-6,
    "pad_clearance": 3e-6,
    "clearance_scatter": 2e-6,
    "bore_scatter": 2e-6,
    "pivot_stiffness_scatter": 0.05,
    "film_heat": 0.07,
    "thermometer": 0.5,
    "pivot_offset": 0.005,
    "pad_arc": 0.01,
    "pad_length": 0.01,
    "pivot_angle": math.radians(0.2),
    "probe_gain": 0.005,
    "cell_gain": 0.002,
    "model": TRUSTED["h"],
}

#: A larger share was meant in per cent.
_LARGEST = 0.5


@dataclass(frozen=True)
class Tolerances:
    """Everything that may be off without being a finding."""

    stated: Mapping[str, StatedTolerance] = field(
        default_factory=lambda: {name: StatedTolerance(value) for name, value in DEFAULTS.items()}
    )
    centre: float = 10e-6

    def __getitem__(self, name: str) -> float:
        """One standard deviation, SI."""
        return self.stated[name].value

    def states(self, values: Mapping[str, str | float], source: str) -> Tolerances:
        """Return a copy with other values: texts with units or SI numbers."""
        table = dict(self.stated)
        for name, value in values.items():
            if name not in DEFAULTS:
                raise BadInputError(f"tolerance {name!r} ({source}): not known. {hint(name, DEFAULTS)}")
            dimension = KEYS["keys"]["tolerances"][name].partition(",")[0]
            try:
                number = parse_quantity(value, dimension, name) if isinstance(value, str) else float(value)
            except (UnitError, ValueError) as error:
                raise BadInputError(f"tolerance {name} ({source}): {error}") from error
            if not 0.0 <= number < (_LARGEST if dimension == "ratio" else math.inf):
                raise BadInputError(
                    f"tolerance {name} ({source}): {value!r} is below zero, or {100 * _LARGEST:g} % and more. "
                    f'Write, for instance, "2 {example_of(dimension)}".'
                )
            table[name] = StatedTolerance(number, source)
        return Tolerances(table, self.centre)

    def layered(self, bearing: Bearing) -> Tolerances:
        """Return a copy with what a bearing file states where the command line states nothing."""
        typed = {k: v.value for k, v in self.stated.items() if v.source == "command line"}
        return self.states(dict(bearing.tolerances), "bearing file").states(typed, "command line")
