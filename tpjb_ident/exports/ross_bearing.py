"""A bearing file as the Python call that builds the same bearing in ROSS, with what that cannot hold in remarks."""

from __future__ import annotations

import math
from pathlib import Path
from statistics import fmean
from typing import Any

from rigdata.operating_point import ROTATIONS
from tpjb_ident.exports.rotor_programs import ross_version
from tpjb_ident.runtime.tables import printable, write_text

_ZERO_CELSIUS = 273.15
_CLOCKWISE = ROTATIONS[1]


#: What the versions call the same thing.
_NAMES = {
    2: {"speed": "frequency", "preload": "pre_load", "match": "determine_eccentricity", "load": "load=[fx, fy]"},
    3: {"speed": "speed", "preload": "preload", "match": "match_load", "load": "fxs_load=fx, fys_load=fy"},
}


def write_ross_bearing(folder: Path, bearing: Any, version: int | None = None) -> None:
    """Write ross_bearing.py: a function of node, speed and load that gives a ``ross.TiltingPad``."""
    if bearing.rotation == _CLOCKWISE:  # oil goes round the ring in the order of the pads
        bearing = bearing.with_pads(bearing.pads[::-1])
    number, reason = ross_version(version)
    names = _NAMES[number]
    head = [
        f"# {printable(bearing.name)}, written by tpjb-ident for ROSS {number}, {reason}.",
        "# The shaft turns counter-clockwise; angles from +x. What this call cannot hold:",
        *(f"# - {printable(remark)}" for remark in _not_held(bearing, number)),
        "import ross as rs", "", "",
        "def bearing(n, speed, fx, fy, **options):",
        '    """At node n: speed [rad/s], an array; fx, fy: static load on the shaft [N]; any option of TiltingPad."""',
        "    arguments = dict(",
    ]  # fmt: skip
    arguments = {names["preload"]: _preloads(bearing), **_arguments(bearing)}
    lines = [f"        {name}={value!r}," for name, value in arguments.items()]
    tail = [
        f"        {names['load']}, {names['speed']}=speed,",
        f"        equilibrium_type='{names['match']}', thermal_type='adiabatic',",
        "    )",
        "    return rs.TiltingPad(n=n, **{**arguments, **options})",
    ]
    write_text(folder / "ross_bearing.py", "\n".join([*head, *lines, *tail]) + "\n")


def _arguments(bearing: Any) -> dict[str, Any]:
    """What both versions call the same."""
    pads, oil, hot = bearing.pads, bearing.oil, 100.0
    angles = [pad.pivot_angle for pad in pads]
    lubricant = {
        "liquid_viscosity1": oil.viscosity_40,
        "temperature1": 40.0 + _ZERO_CELSIUS,
        "liquid_viscosity2": float(oil.viscosity(hot)),
        "temperature2": hot + _ZERO_CELSIUS,
        "liquid_density": oil.density_40,
        "liquid_specific_heat": oil.specific_heat,
        "liquid_thermal_conductivity": oil.conductivity,
    }
    return {
        "journal_diameter": bearing.journal_diameter,
        "radial_clearance": fmean(pad.assembled_clearance for pad in pads),
        "pad_thickness": fmean(pad.thickness for pad in pads),
        "pivot_angle": [math.pi - a for a in angles] if bearing.rotation == _CLOCKWISE else angles,
        "pad_arc": [pad.arc for pad in pads],
        "pad_axial_length": [bearing.length] * len(pads),
        "offset": [pad.pivot_offset for pad in pads],
        "lubricant": lubricant,
        "oil_supply_temperature": oil.supply_temperature + _ZERO_CELSIUS,
    }


def _preloads(bearing: Any) -> list[float]:
    """Preload by pad that gives each its machined clearance from the one assembled clearance that ROSS takes."""
    assembled = fmean(pad.assembled_clearance for pad in bearing.pads)
    return [1.0 - assembled / pad.pad_clearance for pad in bearing.pads]


def _not_held(bearing: Any, version: int) -> list[str]:
    """What a call of `TiltingPad` loses of a bearing."""
    pads = bearing.pads
    remarks = [
        f"pivots ({bearing.pivot.kind}): rigid here; no law per pad, and none that was measured",
        "mass of pads, their bending, heat into them, thermal expansion of the oil",
    ]
    if bearing.rotation == _CLOCKWISE:
        remarks.append("the sense of the drawing, clockwise: this is its mirror image, x to -x, last pad first")
    if len({pad.assembled_clearance for pad in pads}) > 1:
        clearances = ", ".join(f"{1e6 * pad.assembled_clearance:.4g}" for pad in pads)
        remarks.append(f"assembled clearance by pad ({clearances} um): the mean stands for all")
    if len({pad.thickness for pad in pads}) > 1:
        remarks.append("thickness by pad: the mean stands for all")
    if version == 2 and len({(pad.arc, pad.pivot_offset, pad.pad_clearance) for pad in pads}) > 1:
        remarks.append("pads that differ: ROSS 2 takes arc, offset and preload of the first for all")
    return remarks
