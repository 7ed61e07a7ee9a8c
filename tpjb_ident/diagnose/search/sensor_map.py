"""Sensor map: could constant errors of the sensors explain a disagreement, or is it physics.

Errors of force and displacement channels act as h' = G h S^-1 with one constant pair of 2 x 2 maps at every load,
frequency and speed: G mixes rows (forces), S mixes columns (displacements). Static readings pass through the same maps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.diagnose.observations.observe import ENTRY_NAMES, Element

#: Order of the columns of `sensor_map_columns`.
MAP_NAMES = tuple(f"{side}{entry}" for side in ("force ", "displacement ") for entry in ENTRY_NAMES)


def sensor_map_columns(elements: Sequence[Element], base: FloatArray) -> FloatArray:
    """First-order changes of an observation vector by G = I + g and S = I + s.

    Parameters
    ----------
    elements : sequence of Element
    base : (n,) ndarray
        A prediction.

    Returns
    -------
    (n, 8) ndarray
        Per unit of g (xx, xy, yx, yy), then of s.
    """
    units = [np.eye(4)[i].reshape(2, 2) for i in range(4)]
    zero = np.zeros((2, 2))
    maps = [*((one, zero) for one in units), *((zero, one) for one in units)]
    points = _points(elements)
    return np.column_stack([_change(points, base, force, shift) for force, shift in maps])


def _points(elements: Sequence[Element]) -> list[tuple[str, dict[str, int], float]]:
    """Elements that belong together: (part, index per observable, load direction)."""
    groups: dict[tuple[str, object], dict[str, int]] = {}
    for i, e in enumerate(elements):
        if e.family in {"h", "locus", "load"}:
            part = e.observable[0] if e.family == "h" else e.family
            groups.setdefault((part, e.where), {})[e.observable] = i
    whole = {"h": 4, "k": 4, "c": 4, "locus": 2, "load": 2}
    return [
        (part, members, elements[next(iter(members.values()))].place("direction"))
        for (part, _), members in groups.items()
        if len(members) == whole[part]
    ]


def _change(
    points: Sequence[tuple[str, dict[str, int], float]], base: FloatArray, force: FloatArray, shift: FloatArray
) -> FloatArray:
    out = np.zeros(len(base))
    for part, members, angle in points:
        if part == "locus":
            at = [members["locus_x"], members["locus_y"]]
            out[at] = shift @ base[at]
        elif part == "load":
            along, across = (
                np.array([math.cos(angle), math.sin(angle)]),
                np.array([-math.sin(angle), math.cos(angle)]),
            )
            out[members["load_ratio"]] = along @ force @ along
            out[members["load_turn"]] = across @ force @ along
        else:
            at = [members[f"{part}{name}"] for name in ENTRY_NAMES]
            h = base[at].reshape(2, 2)
            out[at] = (force @ h - h @ shift).ravel()
    return out
