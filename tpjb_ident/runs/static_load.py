"""The static load of every run against its set point, and what the miss does to the coefficients.

The load misses its set point a little differently in every run, and coefficients depend on load. The
cells measure the miss of each run; the campaign's other loads tell the slope dH/d(ln W), so that the
solve takes every run at its own load.

What the cells say is taken relative to the campaign's own mean: a gain error of the cells would
look like a miss of all runs alike, and the set point is met by the actuators' own transducers.
Misses in direction have a slope of their own, which only the runs' own misses tell: `terms.load_turn`.

Cells that were not tared hold a constant in their mean that no set point explains. The mean force of the runs is
regressed on the set points, with an intercept: F_mean = g W + z, both complex (X + i Y). Without the intercept a zero
that is off looks like a load that misses its set point by more the smaller it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from tpjb_ident.check.set_points import without_static_part
from tpjb_ident.conditions import Condition

#: Misses beyond this share are no scatter: the set point or the cells are wrong.
MAX_MISS = 0.05
#: A run beyond this share is of another load.
_LARGEST_MISS = 0.3
#: Beyond this direction [rad] they are no scatter either.
MAX_SIDEWAYS = 0.05
#: Beyond these ratios of the cells to the set points in all runs, a sensitivity or a set point is wrong, not a gain.
_CONTRADICTS = (0.7, 1.4)
#: Turned by more than this in all runs [rad], cells are inverted or exchanged, or the load acts elsewhere.
_CONTRADICTS_TURN = 0.5
#: Spread of a half of the runs within which their loads agree: actuators are no better.
_ONE_HALF = 1e-3
#: Runs that are tried as its middle.
_MIDDLES = 500
#: Set points must differ by this share for a zero to be told from a gain.
_MIN_RANGE = 0.15
#: Standard errors beyond which an intercept is one,
_CLEAR = 5.0
#: and share of the smallest load that it must have.
_NOTABLE = 0.004
_MIN_RUNS = 4


@dataclass(frozen=True)
class LoadMiss:
    """Relative deviation of each run's static load from its set point."""

    size: FloatArray  #: (n_runs,)
    sideways: FloatArray  #: (n_runs,), rad: the same across it

    def of(self, members: Sequence[int]) -> complex:
        """Missed load of some runs together, relative size + i turn [rad]; none where no scatter explains it."""
        size, turn = float(np.mean(self.size[members])), float(np.mean(self.sideways[members]))
        return complex(size, turn) if abs(size) < _LARGEST_MISS and abs(turn) < MAX_SIDEWAYS else 0j


@dataclass(frozen=True)
class CellZero:
    """What the cells read at no load."""

    force: complex = 0.0
    error: float = 0.0

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of it at the points."""
        if not self.force:
            return ()
        size, angle = abs(self.force), np.degrees(np.angle(self.force))
        text = f"over the loads of the campaign the cells' mean holds a constant of {size:.0f} N at {angle:.0f} deg "
        return (Condition("cells-not-tared", f"{text}(standard error {self.error:.0f} N); it was taken off"),)


class LoadCase(Protocol):
    """Where a point was run, and the mean cell force of its runs (n_runs, 2) [N]: of sines, or over a band."""

    @property
    def point(self) -> OperatingPoint:
        """Set point."""

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, (n_runs, 2) [N]."""


def load_ratio(data: LoadCase, zero: complex = 0.0) -> ComplexArray:
    """Measured mean load (less the cells' zero) over set point for every run: size and direction, complex."""
    loads = data.mean_loads
    set_point = _set_point(data)
    if data.point.static_load <= 0:
        return np.full(len(loads), np.nan + 0j)
    return np.asarray((loads[:, 0] + 1j * loads[:, 1] - zero) / set_point)


def _set_point(data: LoadCase) -> complex:
    return complex(data.point.static_load * np.exp(1j * data.point.static_load_direction))


def load_misses(points: Sequence[LoadCase], zero: complex = 0.0) -> tuple[list[LoadMiss], complex]:
    """Misses of all runs relative to the campaign, and the campaign's own ratio (cell gain, rotation).

    The ratio is the mean of the runs about the half that agrees best; of two such halves the one nearer to the set
    points. Cells that show no static force have none: it is zero then.
    """
    ratios = [load_ratio(data, zero) for data in points]
    measured = np.concatenate(ratios)
    measured = measured[np.isfinite(measured)]
    common = _common_ratio(measured) if len(measured) else complex(1.0)
    none = [LoadMiss(np.zeros(len(r)), np.zeros(len(r))) for r in ratios]
    if without_static_part(measured):
        return none, 0j
    if not len(measured) or not 0.5 < abs(common.real) < 2.0:
        return none, common  # nothing to correct by such cells, but the ratio itself must be told
    relative = [np.nan_to_num(ratio / common - 1.0) for ratio in ratios]
    return [LoadMiss(r.real, r.imag) for r in relative], common


def _common_ratio(ratios: ComplexArray) -> complex:
    """Mean of the ratios (n,) about the one that half of them lie closest to."""
    half = (len(ratios) - 1) // 2 if len(ratios) >= _MIN_RUNS else len(ratios) - 1
    middles = ratios[:: 1 + len(ratios) // _MIDDLES]
    reach = np.sort(np.abs(middles[:, None] - ratios), axis=1)[:, half]
    # groups of runs that each agree among themselves are as good as one another
    alike = np.flatnonzero(reach <= max(2 * float(reach.min()), _ONE_HALF))
    place = alike[np.argmin(np.abs(middles[alike] - 1))]
    return complex(ratios[np.abs(ratios - middles[place]) <= 4 * reach[place] + 1e-12].mean())


def load_conditions(miss: LoadMiss, common: complex) -> tuple[Condition, ...]:
    """Point out loads that are off by more than scatter."""
    conditions = []
    worst = float(np.abs(miss.size).max(initial=0.0))
    if worst > MAX_MISS:
        conditions.append(
            Condition("static-load-off", f"a run's measured static load is {100 * worst:.1f} % off its set point")
        )
    sideways = float(np.abs(miss.sideways).max(initial=0.0))
    if sideways > MAX_SIDEWAYS:
        conditions.append(
            Condition(
                "static-load-turned",
                f"a run's measured static load points {np.degrees(sideways):.1f} deg away from its set direction",
            )
        )
    return (*conditions, *_common_conditions(common))


def _common_conditions(common: complex) -> tuple[Condition, ...]:
    """What all runs share: a gain of the cells, or what no gain explains."""
    size, turn = abs(common), float(np.angle(common))
    if size == 0.0:
        text = (
            "the cells show no static force: whether the loads meet their set points is not known, nor, unless it is "
            'stated, the cells\' low corner, for which C is widened (filter = "butterworth 1 high 0.1 Hz")'
        )
        return (Condition("no-static-force", text),)
    if not _CONTRADICTS[0] <= size <= _CONTRADICTS[1]:
        return (
            Condition(
                "cells-contradict-set-points",
                f"the cells read {size:.3g} times the static load of the set points in all runs: every "
                "coefficient is off by about as much if their sensitivity is wrong",
            ),
        )
    aside = f"the static load by the cells points {np.degrees(turn):+.1f} deg away from its set direction in all runs"
    if abs(turn) > _CONTRADICTS_TURN:
        return (Condition("cells-contradict-set-points", f"{aside}: a cell is inverted, or the cells are exchanged"),)
    conditions = []
    if abs(turn) > MAX_SIDEWAYS:
        conditions.append(Condition("static-load-turned", aside))
    if abs(size - 1) > 0.01:
        conditions.append(
            Condition(
                "cells-against-set-points",
                f"the cells read {100 * (size - 1):+.2f} % against the set points in all runs alike "
                "(gain of the cells or of the actuators' transducers)",
            )
        )
    return tuple(conditions)


@dataclass(frozen=True)
class StaticLoads:
    """What the cells say of the static load of all runs."""

    misses: list[LoadMiss]  #: by point
    common: complex  #: cells over set points, all runs together
    zero: CellZero

    def conditions(self, point: int) -> tuple[Condition, ...]:
        """What to say of one point."""
        return load_conditions(self.misses[point], self.common) + self.zero.conditions()


def static_loads(campaign: Campaign, points: Sequence[LoadCase]) -> StaticLoads:
    """Zero of the cells, and the misses of all runs of a campaign's points."""
    cells = [channel for channel in campaign.channels.values() if channel.quantity == "force"]
    zero_uncertainty = float(max((getattr(cell, "zero_uncertainty", 0.0) for cell in cells), default=0.0))
    means, set_points = [], []
    for data in points:
        means += list(data.mean_loads @ [1.0, 1j])
        set_points += [_set_point(data)] * len(data.mean_loads)
    zero = cell_zero(np.array(means, complex), np.array(set_points, complex), zero_uncertainty)
    return StaticLoads(*load_misses(points, zero.force), zero)


def cell_zero(means: ComplexArray, set_points: ComplexArray, uncertainty: float = 0.0) -> CellZero:
    """Zero of the cells from all runs; `means` (n,), `set_points` (n,) [N]."""
    good = np.isfinite(means) & (np.abs(set_points) > 0)
    y, x = means[good], set_points[good]
    if len(y) < _MIN_RUNS or (np.abs(x - x[0]) < _MIN_RANGE * np.abs(x).max()).all():
        return CellZero()
    size = np.abs(x)
    design = np.stack([x, np.ones_like(x)], axis=1) / size[:, None]
    answer, weight = y / size, np.ones(len(y))
    for _ in range(10):
        root = np.sqrt(weight)[:, None]
        coefficients = np.linalg.lstsq(design * root, answer * root[:, 0], rcond=None)[0]
        residual = np.abs(answer - design @ coefficients)
        scale = 1.4826 * float(np.median(residual)) + 1e-9
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(residual, 1e-300))
    spread = float(np.sum(weight * residual**2) / max(float(weight.sum()) - 2.0, 1.0))
    covariance = np.linalg.inv((design * weight[:, None]).conj().T @ design).real * spread
    zero, error = complex(coefficients[1]), float(np.sqrt(covariance[1, 1]))
    is_clear = abs(zero) > _CLEAR * error and abs(zero) > _NOTABLE * size.min()
    allowed = uncertainty == 0.0 or abs(zero) < 3 * uncertainty + 3 * error
    return CellZero(zero, error) if is_clear and allowed else CellZero()
