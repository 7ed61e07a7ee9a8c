"""Bearing files (`tpjb-bearing/1`, TOML): every key with its unit checked, every fault said with its place and cure."""

import math
from pathlib import Path
from typing import Any

from model.bearing import BABBITT, ROTATIONS, STEEL, Bearing, BearingError, Material, Oil, Pad, Pivot, pad_rooms
from model.possible import KEYS, check_possible
from model.toml_text import read_page, read_table
from rigdata.near_names import hint
from rigdata.units import ZERO_CELSIUS, UnitError, parse_quantity

_KEYS: dict[str, dict[str, str]] = KEYS["keys"]
_OPTIONAL_SECTIONS = ("pads.backing", "pads.babbitt", "tolerances")
#: What makes a pad besides its place, its material and its pivot.
_PAD_SIZES = (
    ("bearing", "assembled_clearance"),
    ("bearing", "pad_clearance"),
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
    text = read_page(
        path, BearingError, "A bearing file is a page of text", "Give the path of a tpjb-bearing/1 TOML file."
    )
    return parse_bearing(text, path.name)


def parse_bearing(text: str, name: str) -> Bearing:
    """Build a `Bearing` from TOML text; `name` is what error messages call the file."""
    data = read_table(text, name, "tpjb-bearing/1", BearingError)
    sections = {key: _section(data, key, name) for key in _KEYS}
    values = {key: _read_section(section, key, name) for key, section in sections.items()}
    pads = _pads(values, name)
    bearing = Bearing(
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
    _check_pads(bearing, name)
    check_possible(bearing)
    return bearing


def _section(data: dict[str, Any], key: str, name: str) -> dict[str, Any]:
    section: Any = data
    for part in key.split(".") if key else []:
        section = section.get(part, {} if key in _OPTIONAL_SECTIONS else None)
        if section is None:
            raise BearingError(f"{name}: section [{key}] is missing. Add it; see the bundled rocker.toml.")
        if not isinstance(section, dict):
            raise BearingError(f"{name}, {key}: must be a table, got {section!r}. Write it as [{key}].")
    inside = f"{key}." if key else ""
    tables = [child.removeprefix(inside) for child in _KEYS if child and child.startswith(inside)]
    keys = {*_KEYS[key], *(child.split(".")[0] for child in tables)}
    for unknown in set(section) - keys:
        place = f"[{key}] {unknown}" if key else f"[{unknown}]" if isinstance(section[unknown], dict) else unknown
        raise BearingError(f"{name}, {place}: unknown key. {hint(unknown, sorted(keys), 'Known keys:')}")
    return section


def _read_section(section: dict[str, Any], key: str, name: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    if not section and key in _OPTIONAL_SECTIONS:
        return out
    for entry, kind in _KEYS[key].items():
        dimension, *flags = kind.split(", ")
        place = f"{name}, [{key}] {entry}" if key else f"{name}, {entry}"
        if entry in section:
            out[entry] = _read_value(section[entry], dimension, flags, place)
        elif "optional" not in flags:
            raise BearingError(f"{place}: missing. Add it with its unit; see the bundled rocker.toml.")
    return out


def _read_value(value: Any, dimension: str, flags: list[str], place: str) -> Any:
    if dimension == "text":
        if not isinstance(value, str):
            raise BearingError(f"{place}: must be text, got {value!r}. Put it in quotes.")
        return value
    if isinstance(value, list) and "per pad" in flags:
        flags = [flag for flag in flags if flag != "per pad"]  # no lists of lists
        return tuple(_read_value(v, dimension, flags, f"{place}[{i}]") for i, v in enumerate(value))
    try:
        number = float(parse_quantity(value, dimension, place))
    except UnitError as error:
        raise BearingError(f"{error}. Write a number and a unit in quotes.") from error
    if dimension == "temperature":
        number = round(number - ZERO_CELSIUS, 9)  # the decimals of the file, not those of the difference
    if "signed" not in flags and (number < 0 or (number == 0 and "zero" not in flags)):
        raise BearingError(f"{place}: must be positive, got {value!r}.")
    return number


def _pads(values: dict[str, dict[str, Any]], name: str) -> tuple[Pad, ...]:
    pads = values["pads"]
    angles = pads["pivot_angles"]
    if not isinstance(angles, tuple) or not 1 <= len(angles) <= 40:
        raise BearingError(f"{name}, [pads] pivot_angles: must be a list of 1 to 40 angles, pad #1 first.")

    count = len(angles)
    defaults = {"pivot_offset": 0.5, "elastic_thickness": pads["thickness"], "babbitt_thickness": 0.0}
    sizes: dict[str, Any] = {"pivot_angle": angles}
    for section, key in _PAD_SIZES:
        value = values[section].get(key, defaults.get(key, 0.0))
        sizes[key] = _per_pad(value, count, f"{name}, [{section}] {key}")
    pivots = _pivots(values["pivot"], count, name)
    if len(set(pivots)) > 1:
        sizes["pivot"] = pivots
    backing = Material(**values["pads.backing"]) if values["pads.backing"] else STEEL
    babbitt = Material(**values["pads.babbitt"]) if values["pads.babbitt"] else BABBITT
    alike = {"back_convection": pads.get("back_convection", 50.0), "backing": backing, "babbitt": babbitt}
    return tuple(Pad(**dict(zip(sizes, size)), **alike) for size in zip(*sizes.values()))


def _per_pad(value: Any, count: int, place: str) -> tuple[float, ...]:
    """One value for every pad, of a list or of one for all."""
    if not isinstance(value, tuple):
        return (value,) * count
    if len(value) != count:
        raise BearingError(f"{place}: {len(value)} values for {count} pads. Give one each, or one for all.")
    return value


def _pivots(values: dict[str, Any], count: int, name: str) -> list[Pivot]:
    """The pivot of every pad."""
    kind, need = values["kind"], KEYS["pivot_sizes"]
    if kind not in need:
        raise BearingError(f"{name}, [pivot] kind: {kind!r} is not known. {hint(kind, need, 'Use one of')}")
    for size in need[kind]:
        if size not in values:
            raise BearingError(f"{name}, [pivot] {size}: missing; a {kind} pivot needs it.")
    columns = {key: _per_pad(v, count, f"{name}, [pivot] {key}") for key, v in values.items() if key != "kind"}
    pivots = []
    for k in range(count):
        pivot = Pivot(kind=kind, **{key: column[k] for key, column in columns.items()})
        if kind == "rocker" and not pivot.pivot_diameter < pivot.housing_diameter:
            raise BearingError(f"{name}, [pivot]: pivot_diameter must be smaller than housing_diameter.")
        pivots.append(pivot)
    return pivots


def _check_pads(bearing: Bearing, name: str) -> None:
    """Check the sense of turning, and with it the arcs, which are laid out from the leading edges."""
    if bearing.rotation not in ("", *ROTATIONS):
        choices = hint(bearing.rotation, ROTATIONS, "Use one of")
        raise BearingError(f"{name}, [bearing] rotation: {bearing.rotation!r} is no sense of turning. {choices}")
    for pad in bearing.pads:
        if not pad.babbitt_thickness < pad.elastic_thickness <= pad.thickness:
            raise BearingError(f"{name}, [pads]: need babbitt_thickness < elastic_thickness <= thickness.")
    for number, neighbour, room in pad_rooms(bearing):
        arc = bearing.pads[number - 1].arc
        if arc > room + 1e-9:
            raise BearingError(
                f"{name}, [pads]: pad #{number} overlaps pad #{neighbour} "
                f"({math.degrees(arc):.1f} deg of arc, {math.degrees(room):.1f} deg of room). Check arc, pivot_angles."
            )
