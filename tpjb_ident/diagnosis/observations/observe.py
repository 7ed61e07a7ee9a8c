"""Observe: everything a campaign offers as one labelled vector with its covariance.

Families: ``h`` (Re and Im of the four entries per operating point), ``position`` (mean shaft position in the
dynamic tests), ``locus``, ``load`` (the cells' mean reading against the set point), ``clearance`` (polygon sides and
their angles), ``dry`` (tangent compliance of every pivot), ``temperature``.
"""

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from rigdata.arrays import FloatArray
from rigdata.vector import directions
from tpjb_ident.clearance.locus import Locus
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.compare.coefficient_table import ERRORS, VALUES, points_of, read_coefficients
from tpjb_ident.diagnosis.observations.constants import TRUSTED, Deciding
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.runs.point_data import pad_means
from tpjb_ident.terms.mains import MAINS_CORRECTED, MAINS_ON_LINE


@dataclass(frozen=True)
class LocusTest:
    """One load direction of the locus: load [N], direction [rad], speed [rad/s] about +z."""

    load: float
    direction: float
    speed: float

    @property
    def point(self) -> tuple[float, float, float]:
        """The static operating point."""
        return self.load, self.direction, self.speed


@dataclass(frozen=True)
class DynamicTest(LocusTest):
    """Dynamic tests at one static operating point."""

    excitation: tuple[float, ...]
    pads: tuple[int, ...] = ()


@dataclass(frozen=True)
class DryTest:
    """A dry test on one pad: read loads [N] at which the compliance is compared."""

    pad: int
    load: tuple[float, ...]


@dataclass(frozen=True)
class Layout:
    """All tests of a campaign, in the order of the observation vector."""

    dynamic: tuple[DynamicTest, ...]
    locus: tuple[LocusTest, ...] = ()
    dry: tuple[DryTest, ...] = ()
    push_load: float | None = None
    temperature_position: tuple[float, ...] = ()


Where = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Element:
    """What one number of the observation vector is."""

    family: str
    observable: str
    where: Where

    def place(self, name: str) -> float:
        """Coordinate of the operating point; NaN where it has none."""
        return dict(self.where).get(name, math.nan)


def places(elements: Sequence[Element], name: str) -> FloatArray:
    """A coordinate of every element; NaN where it has none, (n,)."""
    return np.array([e.place(name) for e in elements], dtype=float)


def named(elements: Sequence[Element], what: str) -> NDArray[np.str_]:
    """The ``family`` or ``observable`` of every element, (n,)."""
    return np.array([getattr(e, what) for e in elements], dtype=np.str_)


def _at_point(*point: float) -> Where:
    """An operating point as elements have it: load, direction, speed, and excitation where there is one."""
    return tuple(zip(("load", "direction", "speed", "excitation"), point))


#: Family and observables of one test, in the order of its values: K and omega C, a position and a load reading.
_STIFFNESS = [("h", name[:3]) for name in VALUES]
_LOCUS = [("locus", "locus_x"), ("locus", "locus_y"), ("load", "load_ratio"), ("load", "load_turn")]


def _elements(names: Iterable[tuple[str, str]], *places: Where) -> list[Element]:
    """Every observable at every place."""
    return [Element(*name, place) for place, name in itertools.product(places, names)]


def all_elements(layout: Layout, angles: Sequence[float]) -> tuple[Element, ...]:
    """Everything that a layout of tests shows of a bearing with pivots at these angles, in the order of predictions."""
    out = []
    for test in layout.dynamic:
        out += _elements(_STIFFNESS, *(_at_point(*test.point, omega) for omega in test.excitation))
        pads = ((*_at_point(*test.point), ("pad", float(pad))) for pad in test.pads)
        out += _elements([("temperature", "pad_temperature")], *pads)
    out += _elements(_LOCUS, *(_at_point(*test.point) for test in layout.locus))
    for dry in layout.dry:
        loads = ((("pad", float(dry.pad)), ("load", load)) for load in dry.load)
        out += _elements([("dry", "dry_compliance")], *loads)
    if layout.push_load is not None:
        sides = [(("pad", pad), ("angle", float(angle))) for pad, angle in enumerate(angles, start=1)]
        for observable in ("clearance_pushed", "side_angle"):
            out += _elements([("clearance", observable)], *sides)
    return tuple(out)


@dataclass(frozen=True)
class Observations:
    """A campaign as one vector."""

    layout: Layout
    value: FloatArray  #: (n,): SI; dry compliances as logarithms, loads as ratios to the set point
    covariance: FloatArray = field(repr=False)  #: (n, n): random part, from identification
    sigma: FloatArray = field(repr=False)  #: (n,): stated model tolerance of every element
    elements: tuple[Element, ...] = field(repr=False)

    def __len__(self) -> int:
        return len(self.value)

    @property
    def total_sigma(self) -> FloatArray:
        """Measurement and stated model tolerance together: the sigma of the gap."""
        return np.sqrt(np.diag(self.covariance) + self.sigma**2)


def direct_scale(elements: Sequence[Element], value: FloatArray) -> FloatArray:
    """Mean direct coefficient of every element's point and part (k or omega c), of all where none is direct, (n,)."""
    parts = defaultdict[tuple[str, Where], list[int]](list)
    for row, e in enumerate(elements):
        if e.family == "h":
            parts[e.observable[0], e.where].append(row)
    scale = np.ones(len(elements))
    for rows in parts.values():
        direct = [row for row in rows if elements[row].observable[1] == elements[row].observable[2]]
        scale[rows] = np.mean(np.abs(value[direct or rows]))
    return scale


def by_family(elements: Sequence[Element], value: FloatArray, sizes: Mapping[str, float]) -> FloatArray:
    """A size per family or observable, shares of K and omega C in their unit, (n,)."""
    rows = [sizes.get(e.observable, sizes.get(e.family, math.nan)) for e in elements]
    return np.array(rows) * direct_scale(elements, value)


def stated_sigma(elements: Sequence[Element], value: FloatArray, model: float) -> FloatArray:
    """Stated model tolerance of every element; `model`: of K and omega C, (n,)."""
    return by_family(elements, value, {**TRUSTED, "h": model})


#: Values of a test and their covariance, in the order of its elements; what was not measured is NaN.
Part = tuple[FloatArray, FloatArray]


def _gathered(layout: Layout, angles: Sequence[float], parts: Sequence[Part], model: float) -> Observations:
    """All that was measured, as one vector."""
    value, covariance = np.concatenate([v for v, _ in parts]), block_diag(*(c for _, c in parts))
    is_measured = np.isfinite(value) & np.isfinite(np.diag(covariance))
    elements, value = tuple(itertools.compress(all_elements(layout, angles), is_measured)), value[is_measured]
    sigma = stated_sigma(elements, value, model)
    return Observations(layout, value, covariance[np.ix_(is_measured, is_measured)], sigma, elements)


def observe(
    identification: Identification,
    curves: Sequence[PivotCurve] = (),
    locus: Locus | None = None,
    polygon: ClearancePolygon | None = None,
    model: float = TRUSTED["h"],
) -> Observations:
    """Gather a campaign's results into one vector."""
    parts: list[Part] = []
    dynamic = _add_dynamic(parts, identification)
    locus_tests = _add_locus(parts, locus, identification) if locus is not None else ()
    usable = [c for c in curves if c.valid_from < c.valid_to < math.inf]
    dry = tuple(_add_dry(parts, curve) for curve in usable)
    if polygon is None:
        return _gathered(Layout(dynamic, locus_tests, dry), (), parts, model)
    # as read: a gain that differs is one of the things that may be wrong, and shows in K and C as well
    pushed, fitted = polygon.as_read or (polygon.clearance_pushed, polygon.fitted_angle)
    turn = np.array([math.remainder(t, 2 * math.pi) for t in fitted - polygon.angles])
    for value, error in ((pushed, polygon.clearance_pushed_se), (turn, polygon.fitted_angle_se)):
        parts.append((np.asarray(value), np.diag(np.asarray(error) ** 2)))
    layout = Layout(dynamic, locus_tests, dry, float(polygon.push_load))
    return _gathered(layout, polygon.angles.tolist(), parts, model)


def _add_dynamic(parts: list[Part], identification: Identification) -> tuple[DynamicTest, ...]:
    tests = defaultdict[tuple[float, float, float], list[PointResult]](list)
    for p in [p for p in identification.points if not _mains_on_excitation(p)] or identification.points:
        tests[p.point.static_load, p.point.static_load_direction, p.point.spin].append(p)
    out = []
    for static, points in tests.items():
        parts += [_stiffness_part(p) for p in points]
        kelvin = pad_means([p.temperatures for p in points])
        parts.append((np.array([*kelvin.values()]) - 273.15, np.eye(len(kelvin)) * Deciding.temperature**2))
        out.append(DynamicTest(*static, tuple(p.point.excitation for p in points), tuple(kelvin)))
    return tuple(out)


def _mains_on_excitation(result: PointResult) -> bool:
    """Whether mains hum lies on the excitation and could not be taken off: no interval covers that."""
    return MAINS_ON_LINE in result.quality and MAINS_CORRECTED not in result.quality


def _stiffness_part(result: PointResult) -> Part:
    h, covariance = result.stiffness.h, np.asarray(result.stiffness.covariance)
    value = np.concatenate([h.real.ravel(), h.imag.ravel()])
    if "no-spare-direction" in result.quality:  # the interval knows repeats only, not what runs differ by
        scale = direct_scale(_elements(_STIFFNESS, ()), value)
        covariance = covariance + np.diag((Deciding.unseen * scale) ** 2)
    return value, covariance


def _add_locus(parts: list[Part], locus: Locus, identification: Identification) -> tuple[LocusTest, ...]:
    """Positions and load readings; a load that misses its set point moves both, so they share an error."""
    out = []
    spread = np.diag(np.square(Deciding.missed))
    points = [p.point for p in locus.points]
    tests = [LocusTest(point.static_load, point.static_load_direction, point.spin) for point in points]
    chosen, moved = _spread(tests), moved_by_miss(locus, identification)
    for test, p, moved_by in zip(tests, locus.points, moved, strict=True):
        if test not in chosen:
            continue
        turn = math.remainder(p.load_direction - p.point.static_load_direction, 2 * math.pi)
        stacked = np.vstack([moved_by, np.eye(2)])
        covariance = stacked @ spread @ stacked.T
        covariance[:2, :2] += p.covariance
        parts.append((np.array([*p.position, p.load / test.load, turn]), covariance))
        out.append(test)
    return tuple(out)


def _spread(tests: Sequence[LocusTest]) -> set[LocusTest]:
    """Every second, third .. direction where a load and a speed have more than `_DIRECTIONS`."""
    groups = defaultdict(list)
    for test in dict.fromkeys(tests):
        groups[(test.load, test.speed)].append(test)
    chosen = set()
    for group in groups.values():
        around = sorted(group, key=lambda test: test.direction % (2 * math.pi))
        chosen.update(around[:: -(-len(around) // _DIRECTIONS)])
    return chosen


def _add_dry(parts: list[Part], curve: PivotCurve) -> DryTest:
    load = np.array([curve.valid_from + s * (curve.valid_to - curve.valid_from) for s in Deciding.dry_shares])
    covariance = curve.relative_stiffness_covariance(load)
    covariance = covariance + np.diag(Deciding.dry_shape**2 * np.diag(covariance))
    parts.append((-np.log(np.asarray(curve.stiffness(load), float)), covariance))
    return DryTest(curve.pad, tuple(load.tolist()))


#: Load directions per load and speed that are enough: the locus of five pads has five waves, two directions to each.
_DIRECTIONS = 10


def moved_by_miss(locus: Locus, identification: Identification) -> list[FloatArray]:
    """Change of every position with the load's size, and its direction: the locus turns about its middle, (2, 2)."""
    out = []
    for p in locus.points:
        load, speed = p.point.static_load, p.point.spin
        more = load * directions(p.point.static_load_direction) / _stiffness(identification, load)
        alike = [q.position for q in locus.points if (q.point.static_load, q.point.spin) == (load, speed)]
        x, y = p.position - np.mean(alike, axis=0)
        out.append(np.column_stack([more, [-y, x]]))
    return out


def _stiffness(identification: Identification, load: float) -> float:
    """Mean direct stiffness at the nearest load and the lowest excitation [N/m]."""
    points = [p for p in identification.points if np.isfinite(p.stiffness.h).all()]
    if not points:
        return math.inf
    return min(points, key=lambda p: (abs(p.point.static_load - load), p.point.excitation)).stiffness.direct[0]


def observe_table(path: Path, reading_error: float | None = None, model: float = TRUSTED["h"]) -> Observations:
    """Read a table of coefficients."""
    tests = defaultdict[tuple[float, float, float], list[tuple[float, FloatArray, FloatArray]]](list)
    rows = read_coefficients(path, reading_error)
    for point, values, errors in zip(points_of(rows), rows[VALUES].to_numpy(), rows[ERRORS].to_numpy()):
        factor = np.where(np.arange(len(values)) < 4, 1.0, point.excitation)
        row = point.excitation, factor * values, factor * errors
        tests[point.static_load, point.static_load_direction, point.spin].append(row)
    dynamic, parts = [], []
    for static, points in tests.items():
        dynamic.append(DynamicTest(*static, tuple(row[0] for row in points)))
        parts += [(value, np.diag(error**2)) for _, value, error in points]
    table = _gathered(Layout(tuple(dynamic)), (), parts, model)
    least = Deciding.axis * (reading_error or 0.0) * direct_scale(table.elements, table.value)
    return replace(table, covariance=np.maximum(table.covariance, np.diag(least**2)))
