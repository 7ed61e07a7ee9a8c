"""Bearing files (`tpjb-bearing/1`, TOML): every key with its unit checked, every fault said with its place and cure."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from model.bearing import BABBITT, ROTATIONS, STEEL, Bearing, BearingError, Material, Oil, Pad, Pivot
from model.toml_text import parse_toml, read_page
from rigdata.near_names import hint
from rigdata.units import ZERO_CELSIUS, UnitError, parse_quantity

_MATERIAL_KEYS = {
    "youngs_modulus": "pressure",
    "poissons_ratio": "ratio",
    "thermal_expansion": "per kelvin",
    "conductivity": "conductivity",
}
_KEYS: dict[str, dict[str, str]] = {
    "": {"schema": "text", "name": "text"},
    "journal": {"diameter": "length"},
    "bearing": {
        "length": "length",
        "assembled_clearance": "length",
        "pad_clearance": "length",
        "rotation": "text",
    },
    "pads": {
        "pivot_angles": "angle",
        "arc": "angle",
        "pivot_offset": "ratio",
        "thickness": "length",
        "babbitt_thickness": "length",
        "elastic_thickness": "length",
        "mass": "mass",
        "moment_of_inertia": "moment of inertia",
        "back_convection": "heat transfer",
        "leading_edge_pressure": "pressure",
    },
    "pads.backing": _MATERIAL_KEYS,
    "pads.babbitt": _MATERIAL_KEYS,
    "pivot": {
        "kind": "text",
        "contact_length": "length",
        "housing_diameter": "length",
        "pivot_diameter": "length",
        "sphere_diameter": "length",
        "youngs_modulus": "pressure",
        "poissons_ratio": "ratio",
    },
    "oil": {
        "grade": "text",
        "supply_temperature": "temperature",
        "supply_flow": "flow",
        "viscosity_40C": "viscosity",
        "viscosity_exponent": "per kelvin",
        "density_40C": "density",
        "thermal_expansion": "per kelvin",
        "specific_heat": "specific heat",
        "conductivity": "conductivity",
    },
}
_OPTIONAL = {
    "schema", "name", "grade", "rotation", "elastic_thickness", "babbitt_thickness", "back_convection", "pivot_offset",
    "contact_length", "housing_diameter", "pivot_diameter", "sphere_diameter", "youngs_modulus", "poissons_ratio",
    "pads.backing", "pads.babbitt", "tolerances", "supply_flow", "leading_edge_pressure",
}  # fmt: skip
#: How well drawing and data sheet are known, one standard deviation each (`rig-export.md`).
_TOLERANCES = {
    "viscosity": "ratio", "viscosity_exponent": "ratio", "supply_temperature": "temperature difference",
    "assembled_clearance": "length", "pad_clearance": "length", "clearance_scatter": "length",
    "pivot_stiffness_scatter": "ratio", "film_heat": "ratio", "thermometer": "temperature difference",
    "probe_gain": "ratio", "model": "ratio", "pivot_offset": "ratio",
}  # fmt: skip
_KEYS["tolerances"] = _TOLERANCES
_MAY_BE_ZERO = {"babbitt_thickness", "back_convection", "viscosity_exponent", "thermal_expansion", "mass",
                "moment_of_inertia", "conductivity", "leading_edge_pressure"}  # fmt: skip
#: Lengths of a pivot.
_PIVOT_SIZES = ("contact_length", "housing_diameter", "pivot_diameter", "sphere_diameter")
#: Entries that may be a list, one value per pad.
_PER_PAD = {
    "pivot_angles", "arc", "pivot_offset", "assembled_clearance", "pad_clearance", "thickness", "babbitt_thickness",
    "elastic_thickness", "mass", "moment_of_inertia", "leading_edge_pressure", *_PIVOT_SIZES,
}  # fmt: skip
#: What makes a pad besides its place, its material and its pivot.
_PAD_SIZES = (
    *(("bearing", key) for key in ("assembled_clearance", "pad_clearance")),
    *(("pads", key) for key in _KEYS["pads"] if key not in ("pivot_angles", "back_convection")),
)


def load_bearing(source: str | Path) -> Bearing:
    """Read a bearing file.

    Parameters
    ----------
    source : str or Path
        Path of a ``tpjb-bearing/1`` TOML file, or its text (recognised by a line break).

    Returns
    -------
    Bearing

    Raises
    ------
    BearingError
        The file is missing, not TOML, has an unknown or missing key, a wrong unit or an impossible value.

    Examples
    --------
    >>> print(f"{1e3 * ti.load_bearing(rocker).oil.viscosity(40.0):.1f} mPa s")
    39.6 mPa s
    """
    if isinstance(source, str) and "\n" in source:
        return parse_bearing(source, "bearing")
    path = Path(source)
    missing = "Give the path of a tpjb-bearing/1 TOML file."
    text = read_page(path, BearingError, "A bearing file is a page of text", missing)
    return parse_bearing(text, path.name)


def parse_bearing(text: str, name: str) -> Bearing:
    """Build a `Bearing` from TOML text; `name` is what error messages call the file."""
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise BearingError(f"{name}: not valid TOML: {error}. Mend that line.") from error
    sections = {key: _section(data, key, name) for key in _KEYS}
    schema = sections[""].get("schema", "tpjb-bearing/1")
    if schema != "tpjb-bearing/1":
        raise BearingError(f"{name}, schema: {schema!r} is not known. This version reads 'tpjb-bearing/1'.")
    values = {key: _read_section(section, key, name) for key, section in sections.items()}
    pads = _pads(values, name)
    return Bearing(
        name=values[""].get("name", name),
        journal_diameter=values["journal"]["diameter"],
        length=values["bearing"]["length"],
        pads=pads,
        pivot=_pivots(values["pivot"], len(pads), name)[0],
        oil=Oil(**{key.removesuffix("C"): value for key, value in values["oil"].items()}),
        rotation=values["bearing"].get("rotation", ""),
        source=name,
        tolerances=tuple(values["tolerances"].items()),
    )


def _section(data: dict[str, Any], key: str, name: str) -> dict[str, Any]:
    section: Any = data
    for part in key.split(".") if key else []:
        section = section.get(part, {} if key in _OPTIONAL else None)
        if section is None:
            raise BearingError(f"{name}: section [{key}] is missing. Add it; see the bundled rocker.toml.")
        if not isinstance(section, dict):
            raise BearingError(f"{name}, {key}: must be a table, got {section!r}. Write it as [{key}].")
    inside = f"{key}." if key else ""
    tables = [child.removeprefix(inside) for child in _KEYS if child and child.startswith(inside)]
    keys = set(_KEYS[key]) | {child.split(".")[0] for child in tables}
    for unknown in set(section) - keys:
        place = f"[{key}] {unknown}" if key else f"[{unknown}]" if isinstance(section[unknown], dict) else unknown
        raise BearingError(f"{name}, {place}: unknown key. {hint(unknown, sorted(keys), 'Known keys:')}")
    return section


def _read_section(section: dict[str, Any], key: str, name: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    material = key.startswith("pads.")
    if material and not section:
        return out
    if key == "tolerances":
        return {entry: _read_tolerance(value, entry, name) for entry, value in section.items()}
    for entry, dimension in _KEYS[key].items():
        place = f"{name}, [{key}] {entry}" if key else f"{name}, {entry}"
        if entry not in section:
            if entry in _OPTIONAL and not material:
                continue
            raise BearingError(f"{place}: missing. Add it with its unit; see the bundled rocker.toml.")
        out[entry] = _read_value(section[entry], entry, dimension, place)
    return out


def _read_tolerance(value: Any, entry: str, name: str) -> float:
    place = f"{name}, [tolerances] {entry}"
    number = _quantity(value, _TOLERANCES[entry], place)
    if not 0.0 <= number < math.inf:
        raise BearingError(f"{place}: must be zero or more, got {value!r}.")
    return number


def _quantity(value: Any, dimension: str, place: str) -> float:
    try:
        return float(parse_quantity(value, dimension, place))
    except UnitError as error:
        raise BearingError(f"{error}. Write a number and a unit in quotes.") from error


def _read_value(value: Any, entry: str, dimension: str, place: str) -> Any:
    if dimension == "text":
        if not isinstance(value, str):
            raise BearingError(f"{place}: must be text, got {value!r}. Put it in quotes.")
        return value
    if isinstance(value, list) and entry in _PER_PAD:
        if any(isinstance(v, list) for v in value):
            raise BearingError(f"{place}: must be a list of quantities, not of lists.")
        return tuple(_read_value(v, entry, dimension, f"{place}[{i}]") for i, v in enumerate(value))
    number = _quantity(value, dimension, place)
    if dimension == "temperature":
        number = round(number - ZERO_CELSIUS, 9)  # the decimals of the file, not those of the difference
    signed = dimension == "temperature" or entry == "pivot_angles"
    if not signed and (number < 0 or (number == 0 and entry not in _MAY_BE_ZERO)):
        raise BearingError(f"{place}: must be positive, got {value!r}.")
    if entry == "poissons_ratio" and not number < 0.5:
        raise BearingError(f"{place}: must be below 0.5, got {value!r}. Steel has 0.3.")
    return number


def _pads(values: dict[str, dict[str, Any]], name: str) -> tuple[Pad, ...]:
    pads, bearing = values["pads"], values["bearing"]
    angles = pads["pivot_angles"]
    if not isinstance(angles, tuple) or not 1 <= len(angles) <= 40:
        raise BearingError(f"{name}, [pads] pivot_angles: must be a list of 1 to 40 angles, pad #1 first.")

    count = len(angles)
    defaults = {"pivot_offset": 0.5, "elastic_thickness": pads["thickness"], "babbitt_thickness": 0.0}
    sizes = {}
    for section, key in _PAD_SIZES:
        value = values[section].get(key, defaults.get(key, 0.0))
        sizes[key] = _per_pad(value, count, f"{name}, [{section}] {key}")
    _check_offsets(angles, sizes["arc"], sizes["pivot_offset"], bearing.get("rotation", ""), name)
    for lining, elastic, thickness in zip(*(sizes[f"{k}thickness"] for k in ("babbitt_", "elastic_", "")), strict=True):
        if not lining < elastic <= thickness:
            raise BearingError(f"{name}, [pads]: need babbitt_thickness < elastic_thickness <= thickness.")
    pivots = _pivots(values["pivot"], count, name)
    return tuple(
        Pad(
            pivot_angle=angles[k],
            **{key: column[k] for key, column in sizes.items()},
            back_convection=pads.get("back_convection", 50.0),
            backing=Material(**values["pads.backing"]) if values["pads.backing"] else STEEL,
            babbitt=Material(**values["pads.babbitt"]) if values["pads.babbitt"] else BABBITT,
            pivot=pivots[k] if len(set(pivots)) > 1 else None,
        )
        for k in range(count)
    )


def _per_pad(value: Any, count: int, place: str) -> tuple[float, ...]:
    """One value for every pad, of a list or of one for all."""
    if not isinstance(value, tuple):
        return (value,) * count
    if len(value) != count:
        raise BearingError(f"{place}: {len(value)} values for {count} pads. Give one each, or one for all.")
    return value


def _pivots(values: dict[str, Any], count: int, name: str) -> list[Pivot]:
    """The pivot of every pad."""
    kind = values["kind"]
    columns = {key: _per_pad(v, count, f"{name}, [pivot] {key}") for key, v in values.items() if key != "kind"}
    pivots = []
    for k in range(count):
        sizes = {key: column[k] for key, column in columns.items()}
        _check_pivot(kind, sizes, name)
        pivots.append(Pivot(kind=kind, **sizes))
    return pivots


def _check_offsets(
    angles: tuple[float, ...], arc: tuple[float, ...], offset: tuple[float, ...], rotation: str, name: str
) -> None:
    """Check the sense of turning, and with it the arcs, which are laid out from the leading edges."""
    if rotation not in ("", *ROTATIONS):
        choices = hint(rotation, ROTATIONS, "Use one of")
        raise BearingError(f"{name}, [bearing] rotation: {rotation!r} is no sense of turning. {choices}")
    from_lower_edge = tuple(1.0 - f for f in offset) if rotation == ROTATIONS[1] else offset
    _check_arcs(angles, arc, from_lower_edge, name)


def _check_arcs(angles: tuple[float, ...], arc: tuple[float, ...], offset: tuple[float, ...], name: str) -> None:
    if any(not 0 < f < 1 for f in offset):
        raise BearingError(f"{name}, [pads] pivot_offset: must lie between 0 and 1 (0.5 is the middle).")
    edges = sorted(((a - f * s) % (2 * math.pi), s, k + 1) for k, (a, s, f) in enumerate(zip(angles, arc, offset)))
    for i, (start, span, number) in enumerate(edges):
        follower = edges[(i + 1) % len(edges)]
        room = (follower[0] - start) % (2 * math.pi) or 2 * math.pi
        if span > room + 1e-9:
            raise BearingError(
                f"{name}, [pads]: pad #{number} overlaps pad #{follower[2]} "
                f"({math.degrees(span):.1f} deg of arc, {math.degrees(room):.1f} deg of room). Check arc, pivot_angles."
            )


def _check_pivot(kind: str, pivot: dict[str, Any], name: str) -> None:
    need = {
        "rocker": {"contact_length", "housing_diameter", "pivot_diameter"},
        "spherical": {"sphere_diameter"},
        "rigid": set(),
    }
    if kind not in need:
        raise BearingError(f"{name}, [pivot] kind: {kind!r} is not known. {hint(kind, need, 'Use one of')}")
    missing = sorted(need[kind] - set(pivot))
    if missing:
        raise BearingError(f"{name}, [pivot] {missing[0]}: missing; a {kind} pivot needs it.")
    if kind == "rocker" and not pivot["pivot_diameter"] < pivot["housing_diameter"]:
        raise BearingError(f"{name}, [pivot]: pivot_diameter must be smaller than housing_diameter.")
