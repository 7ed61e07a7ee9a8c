"""An emulator of the bearing model, so that a thousand campaigns can be diagnosed in an hour.

What a bearing does at a static point is a smooth function of some 25 numbers (oil, clearances and pivots pad by pad,
misalignment, starvation, ..), which are read off the `Setup`: effects and nuisances that move the same number add up
as in the model. Every number by itself is followed by a spline through solved points; what all pads do together, beyond
that, by a spline of its own. Structure and instruments, dry tests and polygon are computed
exactly. Truth and fits use the same emulator: what is tested is the decision, not the solver; raw records of another
program test the rest.
"""

from __future__ import annotations

import functools
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from model.effects import Effect, apply_effects
from model.effects.kind import EffectError
from model.pivots import PivotLaw, ScaledPivot
from model.setup import Setup
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.forward import (
    _PLAIN,
    SENSOR,
    Forward,
    ModelCache,
    NoEquilibriumError,
    SolvedPoint,
    StaticPoint,
)

#: Where a coordinate's spline is solved, as shares of its range, and that range.
Axis = tuple[tuple[float, ...], float]
#: Coordinates: name, where its spline is solved as shares of its range, and that range.
_BOTH = (-1.0, -0.6, -0.3, 0.3, 0.6, 1.0)
_UP = (0.1, 0.25, 0.5, 0.75, 1.0)
_WHOLE: dict[str, Axis] = {
    "viscosity": (_BOTH, 0.5),
    "exponent": (_BOTH, 0.4),
    "heat": (_BOTH, 0.7),
    "supply": (_BOTH, 12.0),
    "arc": (_BOTH, 0.12),
    "damping": (_UP, 2e6),
    "rotation": (_UP, 5e4),
    "rolling": (_UP, 5.0),
    "lean x": (_BOTH, 1.1e-3),
    "lean y": (_BOTH, 1.1e-3),
    "starvation": (_UP, 0.5),
    "carryover": (_UP, 0.98),
}
#: The same, of every pad; and what all pads do together, beyond that.
_OF_A_PAD: dict[str, Axis] = {"offset": (_BOTH, 30e-6), "pivot": (_BOTH, 1.6), "bore": (_BOTH, 40e-6)}
#: Beyond this multiple of its range a number has no equilibrium, as in the model something would give out.
REACH = 1.5


def axes(setup: Setup) -> dict[str, Axis]:
    """Coordinates of a bearing with as many pads as it has; lengths are of a journal of 100 mm."""
    size = setup.bearing.journal_diameter / 0.1
    pads = {f"{name} {k}": row for name, row in _OF_A_PAD.items() for k in range(len(setup.bearing.pads))}
    scale = {"offset": size, "bore": size}
    return {
        name: (shares, reach * scale.get(name.split()[0], 1.0)) for name, (shares, reach) in {**_WHOLE, **pads}.items()
    }


def coordinates(setup: Setup, base: Setup) -> FloatArray:
    """The numbers of a `Setup`, counted from its baseline, in the order of `axes`."""
    oil, first = setup.bearing.oil, base.bearing.oil
    pads = list(zip(setup.bearing.pads, base.bearing.pads, strict=True))
    offsets = np.array([a.assembled_clearance - b.assembled_clearance for a, b in pads])
    softer = np.array([-math.log(_factor(law)) for law in setup.pivots])
    angle, direction = setup.misalignment
    # what leaves the film at once and what warms it less are nearly one
    heat = -math.log(oil.specific_heat / first.specific_heat) + math.log(1.0 - setup.heat_loss)
    whole = [
        math.log(oil.viscosity_40 / first.viscosity_40), math.log(oil.viscosity_exponent / first.viscosity_exponent),
        heat, setup.supply_change, float(np.mean([a.pivot_offset - b.pivot_offset for a, b in pads])),
        setup.pivot_damping, setup.rotational_stiffness, setup.rolling, angle * math.cos(direction),
        angle * math.sin(direction), setup.starvation, setup.carryover,
    ]  # fmt: skip
    bores = [a.pad_clearance - b.pad_clearance for a, b in pads]
    return np.array([*whole, *(offsets + setup.clearance_change), *softer, *bores])


def _factor(law: PivotLaw) -> float:
    return law.stiffness_factor * _factor(law.law) if isinstance(law, ScaledPivot) else 1.0


def at(base: Setup, name: str, value: float) -> Setup:
    """The baseline with one of its numbers moved."""
    kind, _, number = name.partition(" ")
    oil = base.bearing.oil
    scaled = {"viscosity": "viscosity_40", "exponent": "viscosity_exponent"}
    if kind in scaled:
        moved = replace(oil, **{scaled[kind]: getattr(oil, scaled[kind]) * math.exp(value)})
        return base.change(bearing=replace(base.bearing, oil=moved))
    if kind == "heat":
        moved = replace(oil, specific_heat=oil.specific_heat * math.exp(-value))
        return base.change(bearing=replace(base.bearing, oil=moved))
    if kind == "lean":
        lean = np.array([math.cos(base.misalignment[1]), math.sin(base.misalignment[1])]) * base.misalignment[0]
        lean["xy".index(number)] += value
        return base.change(misalignment=(float(np.hypot(*lean)), math.atan2(lean[1], lean[0])))
    simple = {"supply": "supply_change", "damping": "pivot_damping", "rotation": "rotational_stiffness"}
    if kind == "bore":
        return apply_effects(base, [Effect("pad_bore", pad=int(number) + 1, pad_clearance_change=value)])
    if kind == "arc":
        return apply_effects(base, [Effect("pivot_offset_error", offset_change=value)])
    if kind == "offset":
        return apply_effects(base, [Effect("pad_offset", pad=int(number) + 1, radial_offset=value)])
    if kind == "pivot":
        return apply_effects(base, [Effect("soft_pivot", pad=int(number) + 1, stiffness_factor=math.exp(-value))])
    return base.change(**{simple.get(kind, kind): value})


@dataclass(frozen=True)
class Table:
    """Answers of the model as numbers that are nearly linear in the coordinates."""

    names: tuple[str, ...]
    base: FloatArray
    splines: list[CubicSpline] = field(repr=False)
    together: dict[str, CubicSpline] = field(repr=False)

    def __call__(self, place: FloatArray) -> FloatArray:
        """Answers at a place (c,)."""
        out = self.base.copy()
        for i in np.flatnonzero(place):
            out += _follow(self.splines[i], place[i])
        for kind, spline in self.together.items():
            out += _follow(spline, float(np.mean(place[_members(self.names, kind)])))
        return np.asarray(out)


def _members(names: Sequence[str], kind: str) -> list[int]:
    return [i for i, name in enumerate(names) if name.startswith(kind + " ")]


def _follow(spline: CubicSpline, value: float) -> FloatArray:
    """Along a spline, and straight on beyond its ends."""
    inside = min(max(value, spline.x[0]), spline.x[-1])
    out = spline(inside)
    return np.asarray(out + spline(inside, 1) * (value - inside) if inside != value else out)


@dataclass
class Emulated(ModelCache):
    """Stands where the model's memory stands, and never solves anything."""

    base: Setup | None = None
    points: dict[tuple[StaticPoint, tuple[float, ...]], slice] = field(default_factory=dict)
    table: Table | None = None
    axes: dict[str, Axis] = field(default_factory=dict)
    _last: tuple[bytes, FloatArray] | None = None
    _setup: tuple[Setup, FloatArray] | None = None

    def copy(self, near: bool = False) -> Emulated:
        """The same: nothing that is asked changes an answer."""
        return self

    def ask(
        self, setup: Setup, point: StaticPoint, lines: tuple[float, ...], sensors: tuple[float, ...]
    ) -> SolvedPoint:
        """See `Memory.ask`."""
        if self._setup is None or self._setup[0] is not setup:
            self._setup = setup, self._answers(setup)
        asked = lines or (point[2],)
        return _solved(self._setup[1][self.points[(point, asked)]], point, len(asked)).read(setup, lines)

    def _answers(self, setup: Setup) -> FloatArray:
        assert self.base is not None
        assert self.table is not None
        place = coordinates(setup, self.base)
        place[np.abs(place) < 1e-13] = 0.0
        for name, value in zip(self.table.names, place, strict=True):
            if abs(value) > REACH * self.axes[name][1]:
                raise NoEquilibriumError(f"{name} beyond what was solved")
        key = place.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self.table(place)
        return self._last[1]


def _latent(found: SolvedPoint) -> FloatArray:
    """Direct coefficients as logarithms where they are positive, cross ones against them."""
    h = found.h
    direct = np.stack([h[:, 0, 0].real, h[:, 1, 1].real, h[:, 0, 0].imag, h[:, 1, 1].imag])
    cross = np.stack([h[:, 0, 1].real, h[:, 1, 0].real, h[:, 0, 1].imag, h[:, 1, 0].imag])
    parts = [np.arcsinh(direct / _SCALE).ravel(), (cross / _SCALE).ravel(), found.position * 1e5]
    return np.concatenate([*parts, found.temperature, found.pad_load / 1e3])


#: A coefficient far below this acts linearly, one above it as its logarithm [N/m].
_SCALE = 3e7


def _solved(latent: FloatArray, point: StaticPoint, lines: int) -> SolvedPoint:
    direct = _SCALE * np.sinh(latent[: 4 * lines].reshape(4, lines))
    cross = _SCALE * latent[4 * lines : 8 * lines].reshape(4, lines)
    h = np.empty((lines, 2, 2), complex)
    h[:, 0, 0], h[:, 1, 1] = direct[0] + 1j * direct[2], direct[1] + 1j * direct[3]
    h[:, 0, 1], h[:, 1, 0] = cross[0] + 1j * cross[2], cross[1] + 1j * cross[3]
    rest = latent[8 * lines :]
    force = point[0] * np.array([math.cos(point[1]), math.sin(point[1])])
    pads = (len(rest) - 2) // 2
    return SolvedPoint(h, rest[:2] / 1e5, force, rest[2 : 2 + pads], rest[2 + pads :] * 1e3)


def emulate(forward: Forward, kept: Path) -> Emulated:
    """Solve what an emulator needs (seconds), or read it."""
    points: dict[tuple[StaticPoint, tuple[float, ...]], slice] = {}
    count = 0
    for point, lines in _asked(forward):
        size = 8 * len(lines) + 2 + 2 * len(forward.setup.bearing.pads)
        points[(point, lines)] = slice(count, count + size)
        count += size
    if kept.exists():
        table = pickle.loads(kept.read_bytes())
    else:
        table = _tabulate(forward, points)
        kept.write_bytes(pickle.dumps(table))
    return Emulated(base=forward.setup, points=points, table=table, axes=axes(forward.setup))


def _asked(forward: Forward) -> Iterator[tuple[StaticPoint, tuple[float, ...]]]:
    for test in forward.layout.dynamic:
        yield test.point, tuple(test.excitation)
    for test in forward.layout.locus:
        yield test.point, (test.speed,)


def solve(forward: Forward, setup: Setup, points: Any) -> FloatArray:
    """Answers of the model itself, in the emulator's numbers."""
    cache = ModelCache({}, dict(forward.cache.start))
    key = setup.change(**_PLAIN)
    sensors = (SENSOR,) * len(setup.bearing.pads)
    out = []
    for point, lines in points:
        cache.ask(key, point, lines, sensors)
        out.append(_latent(cache.solved[key][(point, lines, sensors)]))
    return np.concatenate(out)


def _tabulate(forward: Forward, points: Any) -> Table:
    start = forward.setup
    base, along = solve(forward, start, points), axes(start)
    names = tuple(along)
    splines = [_spline(forward, points, base, lambda v, n=name: at(start, n, v), *along[name]) for name in names]
    table = Table(names, base, splines, {})
    for kind in _OF_A_PAD:
        members = _members(names, kind)

        def moved(value: float, members: list[int] = members) -> Setup:
            return functools.reduce(lambda setup, i: at(setup, names[i], value), members, start)

        def known(value: float, members: list[int] = members) -> FloatArray:
            place = np.zeros(len(names))
            place[members] = value
            return table(place)

        table.together[kind] = _spline(forward, points, known, moved, *along[f"{kind} 0"])
    return table


def _spline(
    forward: Forward, points: Any, known: FloatArray | Callable[[float], FloatArray], moved: Callable[[float], Setup],
    shares: tuple[float, ...], reach: float,
) -> CubicSpline:  # fmt: skip
    """A spline of what the model says beyond what is known, 0 at the baseline."""
    nodes, values = [], []
    for share in sorted((0.0, *shares)):
        told = known if isinstance(known, np.ndarray) else known(share * reach)
        try:
            values.append(solve(forward, moved(share * reach), points) - told if share else np.zeros_like(told))
        except (NoEquilibriumError, EffectError):  # none there, or nothing that could be built
            continue
        nodes.append(share * reach)
    return CubicSpline(np.array(nodes), np.array(values), bc_type="natural")
