"""Gap: the root mean square of (measured - predicted) / sigma, over everything, by observable and held out.

Held out are whole operating points to which a model must extrapolate, and which no fit has seen; not random elements:
neighbours are near copies of each other.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import BoolArray, FloatArray
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import Element, Observations, named, places


def held_out(observations: Observations) -> BoolArray:
    """The top load, outer frequencies, further speeds and a sector of the locus; all where there are none, (n,)."""
    family = named(observations.elements, "family")
    load, direction, speed, line = (
        places(observations.elements, name) for name in ("load", "direction", "speed", "excitation")
    )
    moving, still = np.isin(family, ["h", "temperature"]), np.isin(family, ["locus", "load"])
    speeds = Counter(speed[moving].tolist())
    usual = moving & (speed == (speeds.most_common(1)[0][0] if speeds else 0.0))
    out = (moving & ~usual) | (still & np.isin(direction % (2 * np.pi), _sector(direction[still])))
    swept = usual & (family == "h")
    points = set(zip(load[swept].tolist(), direction[swept].tolist(), strict=True))
    for weight, way in points:
        at_point = (load == weight) & (direction == way)
        lines = np.unique(line[swept & at_point])
        if len(lines) >= Deciding.sweep:
            out |= usual & at_point & np.isin(line, lines[[0, -1]])
        elif len(points) > 2 and weight == load[swept].max():
            out |= usual & at_point
    return out if out.any() else ~out


def _sector(directions: FloatArray) -> FloatArray:
    """Neighbouring directions of a locus that are held out."""
    around = np.unique(directions % (2 * np.pi))
    part = Deciding.sectors * np.arange(len(around)) // max(len(around), 1) + 1
    return np.asarray(around[part == Deciding.sector])


def residuals(observations: Observations, prediction: FloatArray) -> FloatArray:
    """(measured - predicted) / sigma, positions and clearances seen from one common centre; `prediction` (n,).

    The centre from which positions are counted is a convention (the clearance polygon's, by some rule) and says
    nothing about the bearing: the shift that fits best is taken off.
    """
    z = (observations.value - prediction) / observations.total_sigma
    shifts = centre_shifts(observations.elements) / observations.total_sigma[:, None]
    return np.asarray(z - shifts @ np.linalg.lstsq(shifts, z, rcond=None)[0])


def centre_shifts(elements: Sequence[Element]) -> FloatArray:
    """Positions and clearances seen from a centre moved by one metre along x and along y, (n, 2)."""
    out = np.zeros((len(elements), 2))
    for i, e in enumerate(elements):
        if e.observable in {"locus_x", "locus_y"}:
            out[i, "xy".index(e.observable[-1])] = -1.0
        elif e.observable == "clearance_pushed":
            angle = e.place("angle")
            out[i] = -math.cos(angle), -math.sin(angle)
    return out


def gap(observations: Observations, prediction: FloatArray, chosen: BoolArray | None = None) -> float:
    """Root mean square of `residuals`; NaN where nothing is chosen; `prediction` (n,), `chosen` (n,)."""
    z = residuals(observations, prediction)
    z = z if chosen is None else z[chosen]
    return float(np.sqrt(np.mean(z**2))) if len(z) else math.nan


def noise_floor(observations: Observations, chosen: BoolArray) -> float:
    """Gap that measurement noise alone would leave under a perfect model; `chosen` (n,)."""
    return math.sqrt(np.mean((np.diag(observations.covariance) / observations.total_sigma**2)[chosen]))


def gap_by_observable(
    observations: Observations, before: FloatArray, after: FloatArray, chosen: BoolArray
) -> dict[str, dict[str, float]]:
    """Held-out gap before and after, per observable; observables without held-out points use all of theirs."""
    names, out = named(observations.elements, "observable"), {}
    for name in dict.fromkeys(names.tolist()):
        part, key = (names == name) & chosen, "heldout"
        if not part.any():
            part, key = names == name, "fitted"
        ends = {"before": before, "after": after}
        out[name] = {f"{key}_{end}": gap(observations, prediction, part) for end, prediction in ends.items()}
    return out


def gap_at(gaps: Mapping[str, float], end: str) -> float:
    """An observable's gap ``_before`` or ``_after``, whether held-out points show it or not."""
    return next((float(v) for k, v in gaps.items() if k.endswith(end)), 0.0)


def coordinate(elements: Sequence[Element], name: str) -> FloatArray:
    """A coordinate of every element, spread over -1 .. 1; 0 where it has none or all are alike, (n,)."""
    values = places(elements, name)
    finite_values = values[np.isfinite(values)]
    if len(finite_values) == 0 or np.ptp(finite_values) <= 1e-12 * max(abs(finite_values).max(), 1e-300):
        return np.zeros(len(values))
    middle, half = 0.5 * (finite_values.max() + finite_values.min()), 0.5 * np.ptp(finite_values)
    return np.where(np.isfinite(values), (values - middle) / half, 0.0)


@dataclass(frozen=True)
class Disagreement:
    """Where measurement and baseline part."""

    observable: str
    where: str
    size_sigma: float
    share: float


#: Rows of the list of disagreements.
_MOST = 12


def localise(observations: Observations, prediction: FloatArray) -> tuple[Disagreement, ...]:
    """Split the squared gap by observable and region, largest share first; `prediction` (n,)."""
    z = residuals(observations, prediction)
    total, names = float(np.sum(z**2)), named(observations.elements, "observable")
    rows = []
    for name in dict.fromkeys(names.tolist()):
        for region, part in _regions(observations.elements, names == name):
            square = float(np.sum(z[part] ** 2))
            rows.append(Disagreement(name, region, math.sqrt(square / part.sum()), square / total if total else 0.0))
    return tuple(sorted(rows, key=lambda d: -d.share)[:_MOST])


#: A factor between these is the one between a radius and a diameter.
_TWICE = 1.75, 2.3


def contradictions(observations: Observations, base: FloatArray) -> tuple[str, ...]:
    """What static tests say of the bearing file without any search; `base` (n,)."""
    names, sentences = named(observations.elements, "observable"), []
    polygon = names == "clearance_pushed"
    if polygon.any():
        measured, drawn = float(np.mean(observations.value[polygon])), float(np.mean(base[polygon]))
        low, high = _TWICE
        ratio = max(measured / drawn, drawn / measured)
        if low <= ratio <= high:
            sentences.append(
                f"The clearance polygon measures {1e6 * measured:.0f} um where the bearing file leads to "
                f"{1e6 * drawn:.0f} um, a factor of {ratio:.2f}: look whether the file gives a diameter for a radius."
            )
    loads = names == "load_ratio"
    if loads.any() and abs(off := float(np.median(observations.value[loads] / base[loads])) - 1.0) > _LOADS:
        sentences.append(f"The cells read {100 * (1 + off):.0f} % of the loads that were set.")
    return tuple(sentences)


#: Share by which cells and set loads may part before that is said.
_LOADS = 0.05


#: Coordinates by which a gap is split, in words, with the factor of their unit.
_COORDINATES = {"load": ("static_load", "N", 1.0), "direction": ("static_load_direction", "deg", 180 / math.pi)}


def _regions(elements: Sequence[Element], mine: BoolArray) -> Iterator[tuple[str, BoolArray]]:
    """Single pads, or halves of the range of the coordinate that varies among the elements."""
    pads = places(elements, "pad")
    levels = np.unique(pads[mine & np.isfinite(pads)])
    if len(levels) > 1:
        yield from ((f"pad {int(k)}", mine & (pads == k)) for k in levels)
        return
    for coordinate, (words, unit, factor) in _COORDINATES.items():
        values = places(elements, coordinate)
        levels = np.unique(values[mine & np.isfinite(values)])
        if len(levels) > 1:
            half = len(levels) // 2
            for part in (levels[:half], levels[half:]):
                ends = dict.fromkeys(f"{end * factor:.0f}" for end in part[[0, -1]])
                yield f"{words} {'-'.join(ends)} {unit}", mine & np.isin(values, part)
            return
    yield "everywhere", mine
