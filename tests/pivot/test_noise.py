"""Noise where the sums are known: single kinds of noise, exact invariants."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.pivot.test_assemble import record as assembled
from tpjb_ident.phasors.slow_noise import DRIFT_OVER_FLICKER, NoiseModel, NoiseSeries, estimate_noise, flicker_kernel
from tpjb_ident.pivot.blocks import Blocks
from tpjb_ident.pivot.dry_record import pooled_noise

BLOCK = 0.1


def test_white_noise_alone_is_its_level_over_the_time():
    duration = np.array([0.1, 0.4, 2.0])
    covariance = NoiseModel(4e-18, 0.0, 0.0).covariance(np.array([1.0, 2.0, 7.0]), duration)
    np.testing.assert_allclose(covariance, np.diag(4e-18 / duration), rtol=1e-12)
    assert NoiseModel(4e-18, 0.0, 1e-8).mean_variance(2.0) == pytest.approx(2e-18, rel=1e-9)


def test_a_drift_is_a_straight_line_and_a_bend_of_its_own():
    """Two equal random parts: t, and t^2 / (span) about its mean; whenever the clock started."""
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(0.0, 12.0, 30))
    duration = np.full(30, BLOCK)
    span = np.ptp(time)
    t = time - time.mean()
    parts = np.column_stack([t, (t**2 - np.mean(t**2)) / span])
    covariance = NoiseModel(1e-30, 0.0, 1.0).covariance(time, duration)
    np.testing.assert_allclose(covariance, parts @ parts.T, atol=1e-12)
    later = NoiseModel(1e-30, 0.0, 1.0).covariance(time + 1e4, duration)
    np.testing.assert_allclose(later, covariance, atol=1e-9)
    slower = NoiseModel(1e-30, 0.0, 1.0).covariance(3.0 * time, duration)
    np.testing.assert_allclose(slower, 9.0 * covariance, atol=1e-9)


def test_averages_of_flicker_are_those_of_its_instants():
    """Short averages are instants; a long one has the variance of the mean of its parts."""
    time = np.array([0.0, 0.3, 5.0])
    instants = flicker_kernel(time)
    short = flicker_kernel(time, np.full(3, 1e-5))
    np.testing.assert_allclose(short, instants, rtol=1e-3)
    assert (instants[0, 1:] < instants[0, 0]).all()
    for length in (0.2, 2.0, 20.0):
        fine = (np.arange(500) + 0.5) * length / 500
        mean_of_instants = float(np.mean(flicker_kernel(fine)))
        assert flicker_kernel(np.zeros(1), np.array([length]))[0, 0] == pytest.approx(mean_of_instants, rel=5e-3)
        whole = NoiseModel(0.0, 2e-16, 1.0).mean_variance(length)
        assert whole == pytest.approx(2e-16 * mean_of_instants, rel=1e-2)
    # between 0.05 s and 200 s a decade of time holds the same share of a 1/f spectrum
    levels = [flicker_kernel(np.zeros(1), np.array([length]))[0, 0] for length in (0.5, 5.0, 50.0)]
    assert levels[0] - levels[1] == pytest.approx(math.log(10.0), rel=0.1)
    assert levels[0] - levels[1] == pytest.approx(levels[1] - levels[2], rel=0.15)


def white_series(count, seed, n=150, sigma=2e-8, duration=BLOCK):
    rng = np.random.default_rng(seed)
    time = (np.arange(n) + 0.5) * duration
    mean = np.column_stack([np.ones(n), time])
    return [NoiseSeries(time, np.full(n, duration), sigma * rng.standard_normal(n), mean) for _ in range(count)]


@pytest.mark.parametrize("rate", [1e-9, 3e-8, 1e-6])
def test_a_drift_that_cannot_be_learnt_is_the_one_to_be_expected(rate):
    """On a ramp: the stated rate and what flickers, as squares."""
    found = estimate_noise(white_series(6, 8), rate, learn_drift=False)
    expected = math.sqrt(rate**2 + DRIFT_OVER_FLICKER**2 * found.flicker)
    assert found.drift == pytest.approx(expected, rel=0.05)


def test_a_walk_is_told_from_flicker_that_looks_like_it_over_a_second():
    """Over a quarter of a minute it goes three times as far: cycles of load had intervals of half the errors."""
    rng = np.random.default_rng(11)
    series = [
        replace(s, values=s.values + 2e-8 * np.cumsum(rng.standard_normal(len(s.time))) * math.sqrt(BLOCK))
        for s in white_series(10, 3, sigma=2e-9)
    ]
    noise = estimate_noise(series, 1e-8)
    assert noise.walk == pytest.approx(2e-8, rel=0.3)
    covariance = noise.covariance(series[0].time, series[0].duration)
    way = np.zeros(len(covariance))
    way[[0, -1]] = -1.0, 1.0
    assert way @ covariance @ way == pytest.approx(4e-16 * np.ptp(series[0].time), rel=0.5)
    none = estimate_noise(white_series(10, 3, sigma=2e-8), 1e-8)
    assert none.walk < 2e-9


def test_a_computed_record_has_next_to_no_noise():
    time = (np.arange(60) + 0.5) * BLOCK
    late = time > 3.0
    exact = NoiseSeries(time, np.full(60, BLOCK), 3e-6 + 1e-6 * late, np.column_stack([late, ~late]).astype(float))
    found = estimate_noise([exact], 1e-8)
    assert 0.0 < found.white < 1e-22
    still = NoiseSeries(time, np.full(60, BLOCK), np.full(60, 5e-6), np.ones((60, 1)))
    assert 0.0 < estimate_noise([still], 1e-8).white < 1e-22


def test_a_series_needs_more_blocks_than_columns():
    """Three more than the signal has; shorter ones are left out."""
    good = white_series(3, 9)
    short = [NoiseSeries(s.time[:4], s.duration[:4], 1e3 * s.values[:4], s.mean[:4]) for s in good]
    a, b = estimate_noise(good, 1e-8), estimate_noise([*good, *short], 1e-8)
    assert (a.white, a.drift) == (b.white, b.drift)
    with pytest.raises(ValueError, match=r"no series is long enough.*longer holds"):
        estimate_noise(short, 1e-8)
    five = [NoiseSeries(s.time[:5], s.duration[:5], s.values[:5], s.mean[:5]) for s in good]
    assert estimate_noise(five, 1e-8).white > 0.0


TRUE = NoiseModel(white=4e-18, flicker=1e-16, drift=1.5e-8)


def drawn_series(count, seed, n=120):
    """Series of the noise `TRUE` about a parabola."""
    rng = np.random.default_rng(seed)
    time = (np.arange(n) + 0.5) * BLOCK
    duration = np.full(n, BLOCK)
    root = np.linalg.cholesky(TRUE.covariance(time, duration))
    mean = np.column_stack([np.ones(n), np.floor(time), np.floor(time) ** 2])
    return [NoiseSeries(time, duration, root @ rng.standard_normal(n), mean) for _ in range(count)]


def test_levels_are_recovered():
    found = [estimate_noise(drawn_series(10, seed), 1e-8) for seed in range(4)]
    for name in ("white", "flicker", "drift"):
        ratio = np.median([getattr(f, name) for f in found]) / getattr(TRUE, name)
        assert 0.6 < ratio < 1.6, name


def record(seed, held=True, sigma=1e-8, levels=6, per_level=8):
    """A staircase of blocks with white noise about a curve, or a ramp where nothing is held."""
    rng = np.random.default_rng(seed)
    n = levels * per_level
    hold = np.repeat(np.arange(levels), per_level) if held else np.full(n, -1)
    load = 500.0 * (hold + 1.0) if held else np.linspace(200.0, 4000.0, n)
    time = (np.arange(n) + 0.5) * BLOCK
    zeros = np.zeros(n)
    deflection = 4e-9 * load + sigma * rng.standard_normal(n)
    across, branch = sigma * rng.standard_normal(n), np.ones(n, dtype=int)
    blocks = Blocks(time, np.full(n, BLOCK), load, zeros, deflection, across, zeros, zeros, hold, branch)
    holds = tuple(range(levels)) if held else ()
    return replace(assembled(), blocks=blocks, good=np.ones(n, dtype=bool), holds=holds)


def moved(one, shift):
    deflection, across = one.blocks.deflection + shift, one.blocks.across - 2 * shift
    return replace(one, blocks=replace(one.blocks, deflection=deflection, across=across))


def without(records, keep):
    return [replace(one, good=keep) for one in records]


def numbers(noise):
    return [noise.white, noise.flicker, noise.drift]


def alike(a, b):
    """The same, as far as a search that ends within five per cent can tell; little flicker is found less well."""
    assert (np.abs(np.divide(numbers(a), numbers(b)) - 1.0) < [0.03, 0.2, 0.06]).all()


def test_within_holds_any_level_of_any_hold_is_free():
    records = [record(k) for k in range(3)]
    base = pooled_noise(records)
    assert base.white == pytest.approx(1e-16 * BLOCK, rel=0.2)
    rng = np.random.default_rng(5)
    jumped = [moved(r, (1e-6 * rng.standard_normal(6))[r.blocks.hold]) for r in records]
    alike(pooled_noise(jumped), base)
    # about a curve a jump of one hold is noise
    about = pooled_noise(jumped, True)
    assert about.white + about.flicker > 100 * base.white


def test_about_a_curve_any_smooth_law_is_free_and_blocks_left_out_say_nothing():
    records = [record(k) for k in range(3)]
    base = pooled_noise(records, True)
    assert base.white == pytest.approx(1e-16 * BLOCK, rel=0.25)
    u = records[0].blocks.load / 4000.0
    law = 2e-6 + 3e-6 * u * (1.0 - 0.1 * np.log(u)) - 2e-6 * np.exp(-u / 0.15) + 1e-6 * np.exp(-u / 0.06)
    bent = [moved(r, law) for r in records]
    alike(pooled_noise(bent, True), base)
    keep = records[0].blocks.hold != 3
    knocked = [moved(r, 1e-6 * ~keep) for r in records]
    left_out = pooled_noise(without(knocked, keep), True)
    np.testing.assert_allclose(numbers(left_out), numbers(pooled_noise(without(records, keep), True)), rtol=1e-9)
    assert pooled_noise(knocked, True).mean_variance(1.0) > 10 * left_out.mean_variance(1.0)


def test_a_loop_between_the_branches_is_no_noise():
    records = [record(k) for k in range(3)]
    branch = np.where(np.arange(48) < 24, 1, -1)
    both = [replace(r, blocks=replace(r.blocks, branch=branch)) for r in records]
    base = pooled_noise(both, True)
    loop = [moved(r, (branch < 0) * (1e-6 + 3e-10 * r.blocks.load)) for r in both]
    alike(pooled_noise(loop, True), base)


def test_where_some_records_have_holds_ramps_are_not_asked():
    ramps = [record(9, held=False, sigma=3e-7)]
    staircases = [record(k) for k in range(2)]
    assert numbers(pooled_noise([*ramps, *staircases])) == numbers(pooled_noise(staircases))
    both = pooled_noise([*ramps, *staircases], True)
    assert numbers(both) == numbers(pooled_noise(staircases, True))
    # ramps alone: white noise is learnt, drift is not
    alone = pooled_noise([record(k, held=False) for k in range(3)])
    assert alone.white == pytest.approx(1e-16 * BLOCK, rel=0.3)
    assert alone.drift == pytest.approx(math.hypot(1e-8, DRIFT_OVER_FLICKER * math.sqrt(alone.flicker)), rel=0.05)
    curved = [record(k, held=False) for k in range(3)]
    sphere = [moved(r, 3e-6 * np.cbrt(r.blocks.load / 4000.0) ** 2) for r in curved]
    base = pooled_noise(curved, True)
    bent = pooled_noise(sphere, True)
    assert bent.white == pytest.approx(base.white, rel=0.1)
    assert max(bent.flicker, base.flicker) < 0.07 * 1e-16
