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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.campaign import Campaign
from tpjb_ident.check.set_points import cell_zero, set_point, without_static_part
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.equation import Rig
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION
from tpjb_ident.runs.point_data import RunsOfPoint

#: Misses beyond this share are no scatter: the set point or the cells are wrong.
MAX_MISS = 0.05
#: A run beyond this share is of another load.
_LARGEST_MISS = 0.3
#: Beyond this direction [rad] they are no scatter either.
MAX_SIDEWAYS = 0.05
#: Miss of all runs alike beyond which the cells are not as certain as stated, or the actuators are not.
_NOTICED = 0.01
#: Beyond these ratios of the cells to the set points in all runs, a sensitivity or a set point is wrong, not a gain.
_CONTRADICTS = (0.7, 1.4)
#: Turned by more than this in all runs [rad], cells are inverted or exchanged, or the load acts elsewhere.
_CONTRADICTS_TURN = 0.5
#: Spread of a half of the runs within which their loads agree: actuators are no better.
_ONE_HALF = 1e-3
#: Runs that are tried as its middle.
_MIDDLES = 500
_MIN_RUNS = 4


@dataclass(frozen=True)
class StaticLoads:
    """What the cells say of the static load of all runs."""

    misses: list[ComplexArray]  #: by point, (n_runs,): deviation from the set point, relative size + i turn [rad]
    common: complex  #: cells over set points, all runs together
    zero: complex = 0j  #: N: what the cells read at no load
    zero_error: float = 0.0

    def conditions(self, point: int) -> Conditions:
        """What to say of one point."""
        size, angle = abs(self.zero), np.degrees(np.angle(self.zero))
        text = f"over the loads of the campaign the cells' mean holds a constant of {size:.0f} N at {angle:.0f} deg "
        text += f"(standard error {self.zero_error:.0f} N); it was taken off"
        return load_conditions(self.misses[point], self.common) + holding((size, "cells-not-tared", text))

    def doubted(self, rig: Rig) -> Rig:
        """The rig, its cells as uncertain as all set points differ from them: either may be wrong."""
        ratio = np.log(self.common or 1 + 0j)
        lost = 1 - np.cos(ratio.imag)  # of a load along them, by cells that are turned
        sizes = np.array([abs(ratio.real) + lost, abs(ratio.imag)])
        gain, turn = (CHANGE_AS_DEVIATION * sizes * (sizes > (_NOTICED, MAX_SIDEWAYS))).tolist()
        sensors = tuple(s.doubted(gain, turn) if s.quantity == "force" else s for s in rig.channels)
        return replace(rig, channels=sensors)


def missed_load(misses: ComplexArray, members: Sequence[int]) -> complex:
    """Missed load of some runs together, relative size + i turn [rad]; none where no scatter explains it."""
    miss = complex(np.mean(misses[list(members)]))
    return miss if abs(miss.real) < _LARGEST_MISS and abs(miss.imag) < MAX_SIDEWAYS else 0j


def static_loads(campaign: Campaign, points: Sequence[RunsOfPoint]) -> StaticLoads:
    """Zero of the cells, and the misses of all runs of a campaign's points; stingers of a floating stator tell none."""
    if campaign.mount == "floating":
        return StaticLoads([np.zeros_like(data.mean_loads) for data in points], 0j)
    uncertainty = max((c.zero_uncertainty for c in campaign.channels.values() if c.quantity == "force"), default=0.0)
    set_points = np.concatenate([np.full(len(data.mean_loads), set_point(data.point)) for data in points])
    zero, error = cell_zero(np.concatenate([data.mean_loads for data in points]), set_points, uncertainty)
    return StaticLoads(*load_misses(points, zero), zero, error)


def load_misses(points: Sequence[RunsOfPoint], zero: complex = 0.0) -> tuple[list[ComplexArray], complex]:
    """Misses of all runs relative to the campaign, and the campaign's own ratio (cell gain, rotation).

    The ratio is the mean of the runs about the half that agrees best; of two such halves the one nearer to the set
    points. Cells that show no static force have none: it is zero then.
    """
    ratios = []  # size and direction; NaN without a load
    for data in points:
        load = set_point(data.point)
        ratios.append((data.mean_loads - zero) / load if load else data.mean_loads * np.nan)
    measured = np.concatenate(ratios)
    measured = measured[np.isfinite(measured)]
    common = _common_ratio(measured) if len(measured) else complex(1.0)
    if without_static_part(measured, len({data.point.static_load for data in points}) < 2):
        common = 0j
    if not 0.5 < abs(common.real) < 2.0:  # such cells correct nothing, but are told
        return [np.zeros(len(ratio), complex) for ratio in ratios], common
    return [np.nan_to_num(ratio / common - 1.0) for ratio in ratios], common


def _common_ratio(ratios: ComplexArray) -> complex:
    """Mean of the ratios (n,) about the one that half of them lie closest to."""
    half = (len(ratios) - 1) // 2 if len(ratios) >= _MIN_RUNS else len(ratios) - 1
    middles = ratios[:: 1 + len(ratios) // _MIDDLES]
    reach = np.sort(np.abs(middles[:, None] - ratios), axis=1)[:, half]
    # groups of runs that each agree among themselves are as good as one another
    alike = np.flatnonzero(reach <= max(2 * reach.min(), _ONE_HALF))
    place = alike[np.argmin(np.abs(middles[alike] - 1))]
    return complex(ratios[np.abs(ratios - middles[place]) <= 4 * reach[place] + 1e-12].mean())


def load_conditions(miss: ComplexArray, common: complex) -> Conditions:
    """Loads that are off by more than scatter, and what all runs share: a gain of the cells, or what no gain explains.

    `miss` (n,): of a point's runs.
    """
    error, aside = (float(np.abs(part).max(initial=0.0)) for part in (miss.real, miss.imag))
    size, turn = abs(common), float(np.angle(common))
    is_gain = _CONTRADICTS[0] <= size <= _CONTRADICTS[1] and abs(turn) <= _CONTRADICTS_TURN
    text = f"the static load by the cells is {size:.3g} times its set point and points {np.degrees(turn):+.1f} deg away"
    return holding(
        (error > MAX_MISS, "static-load-off", f"a run's measured static load is {100 * error:.1f} % off its set point"),
        (
            not size,
            "no-static-force",
            "the cells show no static force: whether the loads meet their set points is not known, nor, unless it is "
            'stated, the cells\' low corner, for which C is widened (filter = "butterworth 1 high 0.1 Hz")',
        ),
        (
            size and not is_gain,
            "cells-contradict-set-points",
            f"{text} in all runs: a sensitivity is wrong, a cell inverted, or the cells are exchanged; or the stator "
            'floats, and they stand in its stingers (mount = "floating" in [housing])',
        ),
        (
            is_gain and max(aside, abs(turn)) > MAX_SIDEWAYS,
            "static-load-turned",
            f"{text} in all runs, in single ones by {np.degrees(aside):.1f} deg more; the cells' axes are taken as "
            "uncertain as what all share",
        ),
        (
            is_gain and abs(size - 1) > _NOTICED,
            "cells-against-set-points",
            f"the cells read {100 * (size - 1):+.2f} % against the set points in all runs alike (gain of the cells or "
            "of the actuators' transducers), and their gains are taken as uncertain as that",
        ),
    )
