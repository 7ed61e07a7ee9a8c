"""Holds, glitches and blocks: what is found in a load programme, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from tpjb_ident.pivot.steps import find_holds
from tpjb_ident.slow_records.bad_samples import good_samples

RATE = 500.0


def programme(levels, holds, ramp=0.3, overshoot=0.0, leak=0.0, start=250.0):
    """Time, load and the true (start, stop, level) of the holds of a staircase."""
    knots, values, truth = [0.0], [start], []
    for level, hold in zip(levels, holds, strict=True):
        arrival = knots[-1] + ramp
        truth.append((arrival, arrival + hold, level))
        knots += [arrival, arrival + hold]
        values += [level, level]
    time = np.arange(int(knots[-1] * RATE)) / RATE
    load = np.interp(time, knots, values)
    before = start
    for begin, stop, level in truth:
        inside = (time >= begin) & (time < stop)
        since = time[inside] - begin
        load[inside] += overshoot * (level - before) * np.exp(-since / 0.08) + leak * level * since
        before = level
    return time, load, truth


UP = tuple(500.0 * k for k in range(1, 11))
CASES = {
    "up": {"levels": UP, "holds": [1.0] * 10},
    "down": {"levels": UP[::-1][1:], "holds": [1.0] * 9, "start": 5000.0},
    "cycle": {"levels": UP + UP[-2::-1], "holds": [1.0] * 19},
    "unequal": {"levels": UP, "holds": [0.5, 3.0, 0.8, 1.0, 2.0, 0.6, 4.0, 1.0, 0.7, 1.5]},
    "overshoot": {"levels": UP, "holds": [1.5] * 10, "overshoot": 0.15},
    "leaking": {"levels": UP, "holds": [1.0] * 10, "leak": -0.004},
    "long holds": {"levels": UP[::2], "holds": [12.0] * 5},
}


@pytest.mark.parametrize("name", CASES)
def test_every_hold_is_found_and_nothing_else(name):
    time, load, truth = programme(**CASES[name])
    load = load + 2.6 * np.random.default_rng(3).standard_normal(len(load))
    holds = find_holds(time, load)
    assert len(holds) == len(truth)
    for hold, (start, stop, level) in zip(holds, truth, strict=True):
        assert start - 0.05 < hold.start < start + 0.6
        assert stop - 0.15 < hold.stop < stop + 0.05
        assert hold.level == pytest.approx(level, rel=0.01, abs=8.0)


def test_a_continuous_ramp_has_no_holds():
    time = np.arange(6000) / RATE
    load = 250.0 + 400.0 * time + np.random.default_rng(1).normal(0.0, 2.6, len(time))
    assert find_holds(time, load) == ()


def test_jitter_and_a_gap_in_time_do_no_harm():
    time, load, _ = programme(**CASES["up"])
    rng = np.random.default_rng(7)
    keep = (time < 5.0) | (time > 5.4)
    time, load = (time + rng.uniform(-2e-4, 2e-4, len(time)))[keep], load[keep]
    assert len(find_holds(np.sort(time), load)) in (10, 11)  # the gap may split the hold it falls into


@pytest.mark.parametrize("length", [3, 20, 50])
@pytest.mark.parametrize("place", [700, 3000, 6300])
def test_glitches_are_found_whole(length, place):
    time, load, _ = programme(**CASES["up"])
    rng = np.random.default_rng(length)
    values = np.column_stack([load + 2.6 * rng.standard_normal(len(load)), 1e-9 * load])
    values[place : place + length, 0] += 900.0
    good = good_samples(values)
    assert not good[place : place + length].any()
    assert good.sum() >= len(time) - length - 8


def test_clean_ramps_and_corners_are_no_glitches():
    _, load, _ = programme(**CASES["up"])
    values = load[:, None] + 2.6 * np.random.default_rng(0).standard_normal((len(load), 1))
    assert good_samples(values).mean() > 0.9995


def test_missing_values_are_left_out():
    values = np.ones((400, 2)) + 1e-3 * np.random.default_rng(0).standard_normal((400, 2))
    values[100:110, 1] = np.nan
    good = good_samples(values)
    assert not good[100:110].any()
    assert good[130:].all()
