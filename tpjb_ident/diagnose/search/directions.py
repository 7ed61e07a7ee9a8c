"""Directions: what a residual could look like when something is left that no effect describes.

Smooth patterns in the raw observation vector, grouped by what a person would call them: every coefficient over load
and frequency, constant maps of the sensors, the locus over its directions, sides of the polygon, dry tests per pad,
temperatures per pad. A residual that projects on one of them further than noise can is structured, whatever its cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.observations.observe import ENTRY_NAMES, Element
from tpjb_ident.diagnose.search.sensor_map import sensor_map_columns


@dataclass(frozen=True)
class Direction:
    """A group of patterns with one name.

    Attributes
    ----------
    label : str
    columns : (n, m) ndarray
        Changes of the observation vector, of any size.
    """

    label: str
    columns: FloatArray = field(repr=False)


def directions(elements: Sequence[Element], base: FloatArray) -> tuple[Direction, ...]:
    """List the groups of patterns for an observation vector.

    Parameters
    ----------
    elements : sequence of Element
    base : (n,) ndarray
        A prediction: gives coefficients their scale.
    """
    scale = direct_scale(elements, base)
    out = [_coefficient(elements, scale, f"{part}{entry}") for part in "kc" for entry in ENTRY_NAMES]
    out += [Direction("a constant sensor map", sensor_map_columns(elements, base))]
    out += [
        _around(elements, "locus", ("locus_x", "locus_y")),
        _around(elements, "load reading", ("load_ratio", "load_turn")),
    ]
    out += [_singly(elements, "clearance", "clearance_pushed"), _singly(elements, "side angles", "side_angle")]
    out += [
        _per_pad(elements, "dry tests", "dry_compliance"),
        _per_pad(elements, "pad temperatures", "pad_temperature"),
    ]
    return tuple(d for d in out if d.columns.shape[1])


def direct_scale(elements: Sequence[Element], value: FloatArray) -> FloatArray:
    """Mean direct coefficient of every element's point and part (k or omega c); 1 outside ``h``, (n,)."""
    sums: dict[tuple[object, ...], list[float]] = {}
    for e, v in zip(elements, value, strict=True):
        if e.family == "h" and e.observable[1] == e.observable[2]:
            sums.setdefault((e.observable[0], e.where), []).append(abs(float(v)))
    rows = [sums.get((e.observable[0], e.where), [1.0]) if e.family == "h" else [1.0] for e in elements]
    return np.array([float(np.mean(row)) for row in rows])


def coordinate(elements: Sequence[Element], name: str) -> FloatArray:
    """A coordinate of every element, spread over -1 .. 1; 0 where it has none or all are alike, (n,)."""
    values = np.array([e.place(name) for e in elements])
    known = values[np.isfinite(values)]
    if len(known) == 0 or np.ptp(known) <= 1e-12 * max(abs(known).max(), 1e-300):
        return np.zeros(len(values))
    middle, half = 0.5 * (known.max() + known.min()), 0.5 * np.ptp(known)
    return np.where(np.isfinite(values), (values - middle) / half, 0.0)


def _coefficient(elements: Sequence[Element], scale: FloatArray, observable: str) -> Direction:
    mine = np.array([e.observable == observable for e in elements])
    load, line = coordinate(elements, "load"), coordinate(elements, "excitation")
    turn, speed = coordinate(elements, "direction"), coordinate(elements, "speed")
    shapes = [np.ones(len(load)), load, load**2, line, line**2, turn, speed]
    return Direction(observable, _independent([np.where(mine, s * scale, 0.0) for s in shapes]))


def _around(elements: Sequence[Element], label: str, pair: tuple[str, str]) -> Direction:
    angle = np.nan_to_num(np.array([e.place("direction") for e in elements]))
    columns = []
    for name in pair:
        mine = np.array([e.observable == name for e in elements])
        shapes = [np.ones(len(angle)), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
        columns += [np.where(mine, s, 0.0) for s in shapes]
    return Direction(label, _independent(columns))


def _singly(elements: Sequence[Element], label: str, observable: str) -> Direction:
    mine = [i for i, e in enumerate(elements) if e.observable == observable]
    return Direction(label, np.eye(len(elements))[:, mine])


def _per_pad(elements: Sequence[Element], label: str, observable: str) -> Direction:
    load = coordinate(elements, "load")
    pads = np.array([e.place("pad") for e in elements])
    columns = []
    for pad in sorted(set(pads[np.isfinite(pads)])):
        mine = np.array([e.observable == observable for e in elements]) & (pads == pad)
        columns += [np.where(mine, 1.0, 0.0), np.where(mine, load, 0.0)]
    return Direction(label, _independent(columns))


def _independent(columns: Sequence[FloatArray]) -> FloatArray:
    """Drop columns that vanish or follow from those before, (n, m)."""
    if not columns:
        return np.zeros((0, 0))
    kept: list[FloatArray] = []
    basis = np.zeros((len(columns[0]), 0))
    for column in columns:
        size = np.linalg.norm(column)
        if size == 0.0:
            continue
        rest = column / size - basis @ (basis.T @ (column / size))
        if np.linalg.norm(rest) > 1e-3:
            kept.append(column)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return np.column_stack(kept) if kept else np.zeros((len(columns[0]), 0))
