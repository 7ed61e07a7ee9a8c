"""From a dry record to blocks: glitches, pieces and branches whose number and place can be counted; projection on a
pad's axes, and directions with their standard errors against draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.pivot.test_assemble import on_pad, vectors
from tpjb_ident.phasors.slow_samples import good_samples
from tpjb_ident.pivot.blocks import MOST_BLOCKS, Hold, cut_blocks, find_holds
from tpjb_ident.pivot.dry_record import PadDirection, displacement_direction, load_direction

RATE = 500.0


def noise(n=2000, seed=1):
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("length", [1, 2, 5, 10, 11, 12, 15, 20, 21, 22, 30])
def test_a_disturbance_goes_whole_up_to_its_longest_and_not_at_all_from_twice_that(length):
    """Seen from any sample of it, the neighbourhood before and after must be sound for the most part.

    Of 2 * 10 + 1 samples on either side, eleven spoilt ones are the majority; two samples more go on either side.
    """
    values = noise()
    values[900 : 900 + length] += 1000.0
    found = np.flatnonzero(~good_samples(values[:, None], longest=10))
    seen = length if length <= 11 else 22 - length
    if seen <= 0:
        assert len(found) == 0
    else:
        middle = 900 + (length - 1) / 2
        np.testing.assert_array_equal(found, np.arange(middle - seen / 2 - 1.5, middle + seen / 2 + 2))


@pytest.mark.parametrize(("size", "seen"), [(6.4, False), (7.7, True), (-6.4, False), (-7.7, True)])
def test_seven_standard_deviations_are_a_glitch(size, seen):
    values = noise()
    values[1000] = size
    assert good_samples(values[:, None], longest=30)[1000] == (not seen)


@pytest.mark.parametrize(("steps", "seen"), [(3, False), (5, True)])
def test_a_converter_without_noise_is_known_to_half_a_step(steps, seen):
    values = np.floor(np.arange(2000) / 100.0)
    values[1050] += steps
    assert good_samples(values[:, None], longest=20)[1050] == (not seen)
    # rounding residues are no steps of a converter
    residue = values + 1e-9 * (np.arange(2000) % 2)
    assert good_samples(residue[:, None], longest=20)[1050] == (not seen)


def test_text_that_rounds_a_coarse_converter_makes_no_glitches():
    """Two converters of one step, turned into X: where both step they leave what their text rounds off."""
    rng = np.random.default_rng(3)
    step, signal = 24.0 / 2**16, np.cumsum(np.repeat([0.0, 2e-5], 1500))
    read = [np.round((x + 1e-4 * rng.standard_normal(3000)) / step) * step for x in (9.0 + signal, 11.0 - signal)]
    rounded = np.round(read, 6)
    assert np.ptp(rounded[0] - read[0]) > 1e-7
    assert good_samples(np.array([rounded[0] + rounded[1], rounded[0] - rounded[1]]).T).all()


def test_few_samples_are_taken_as_they_are():
    values = np.array([0.0, 0.1, 0.0, 0.1, 900.0, 0.1, 0.0])[:, None]
    assert good_samples(values).all()
    values[2] = np.nan
    np.testing.assert_array_equal(good_samples(values), np.arange(7) != 2)
    eight = np.array([0.0, 0.1, 0.2, 0.1, 0.0, 0.1, 0.2, 0.1])[:, None]
    assert good_samples(eight).shape == (8,)


def spoilt_programme(seed):
    """Ramps and levels with knocks, some of them near the ends."""
    rng = np.random.default_rng(seed)
    knots = np.cumsum(rng.uniform(100, 400, 8))
    n = int(knots[-1])
    values = np.interp(np.arange(n), knots, rng.uniform(0, 5000, 8)) + rng.standard_normal(n)
    for place in (6, n // 3, n - 9, *rng.integers(0, n - 30, 3)):
        values[place : place + rng.integers(1, 6)] += rng.choice([-1, 1]) * rng.uniform(2000, 4000)
    return values


@pytest.mark.parametrize("seed", range(4))
def test_time_may_run_backwards_and_units_may_differ(seed):
    values = spoilt_programme(seed)
    good = good_samples(values[:, None], longest=25)
    assert 10 < (~good).sum() < 0.12 * len(good)
    np.testing.assert_array_equal(good_samples(values[::-1, None], longest=25), good[::-1])
    np.testing.assert_array_equal(good_samples(-1e-9 * values[:, None], longest=25), good)
    np.testing.assert_array_equal(good_samples(np.column_stack([noise(len(values)), values]), longest=25), good)


@pytest.mark.parametrize("slope", [0.0, 0.2, -0.3])
def test_a_record_may_begin_and_end_within_a_ramp(slope):
    for seed in range(5):
        values = slope * np.arange(600) + noise(600, seed)
        assert good_samples(values[:, None]).all()


def samples(load, start=0.0, rate=RATE, keep=slice(None)):
    time = start + np.arange(len(load)) / rate
    vector = np.column_stack([load, 0.5 * load])
    return time[keep], np.hstack([vector, 1e-9 * vector])[keep]


@pytest.mark.parametrize("start", [0.0, 500.0])
def test_a_ramp_is_cut_into_pieces_of_the_length(start):
    """Ten seconds in pieces of a tenth, each with its exact mean, whenever the clock started."""
    load = 100.0 + 0.8 * np.arange(5001)
    blocks = cut_blocks(*samples(load, start), (), 0.1)
    assert len(blocks) == 100
    np.testing.assert_allclose(np.diff(blocks.time), 0.1, atol=1e-9)
    np.testing.assert_allclose(blocks.duration, 0.1, atol=1e-9)
    np.testing.assert_allclose(blocks.load, 100.0 + 400.0 * (blocks.time - start), rtol=1e-9)
    np.testing.assert_allclose(blocks.across_load, 0.5 * blocks.load, rtol=1e-12)
    np.testing.assert_allclose(blocks.deflection, 1e-9 * blocks.load, rtol=1e-12)
    np.testing.assert_allclose(blocks.across, 1e-9 * blocks.across_load, rtol=1e-12)
    np.testing.assert_allclose(blocks.rate, 400.0, rtol=1e-9)
    np.testing.assert_allclose(blocks.load_spread, 0.0, atol=1e-9)
    assert set(blocks.hold) == {-1}
    assert set(blocks.branch) == {1}
    assert set(cut_blocks(*samples(load[::-1], start), (), 0.1).branch) == {-1}
    some = blocks.take(np.arange(100) % 3 == 0)
    assert len(some) == 34
    np.testing.assert_array_equal(some.load, blocks.load[::3])


@pytest.mark.parametrize(
    ("length", "hold", "pieces"),
    [(0.1, 1.0, 10), (0.1, 0.05, 1), (0.5, 0.19, 0), (0.5, 0.21, 1), (0.5, 0.74, 1), (0.5, 0.76, 2), (0.5, 2.3, 4)],
)
def test_holds_have_pieces_of_their_own_as_long_as_asked_and_short_ones_lose_nothing(length, hold, pieces):
    time = np.arange(3001) / RATE
    load = np.interp(time, [0, 2, 2 + hold, 6], [0, 1000, 1000, 0])
    blocks = cut_blocks(*samples(load), (Hold(2.0, 2.0 + hold, 1000.0),), length)
    held = blocks.hold == 0
    assert held.sum() == pieces
    if pieces:
        piece = length if pieces >= 4 else hold / pieces
        np.testing.assert_allclose(blocks.duration[held], piece, atol=2.1e-3)
        np.testing.assert_allclose(blocks.time[held], 2.0 + piece * (np.arange(pieces) + 0.5), atol=2.1e-3)
    assert (blocks.rate[held] == 0).all()
    assert (blocks.branch[blocks.time < 2.0 + hold] == 1).all()
    assert (blocks.branch[blocks.time > 2.0 + hold + 0.5 * length] == -1).all()
    np.testing.assert_allclose(blocks.duration[~held], length, rtol=0.02)


def test_a_level_in_noise_has_the_spread_of_its_mean():
    load = 1000.0 + 20.0 * noise(20_000)
    blocks = cut_blocks(*samples(load), (Hold(0.0, 40.0, 1000.0),), 0.2)
    np.testing.assert_allclose(blocks.load_spread, 20.0 / np.sqrt(100.0), rtol=0.03)
    assert np.std(blocks.load) == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize(("lost", "kept"), [(23, True), (28, False)])
def test_a_piece_with_half_of_its_samples_stays(lost, kept):
    keep = np.ones(5001, dtype=bool)
    keep[2000 : 2000 + lost] = False
    blocks = cut_blocks(*samples(np.full(5001, 500.0), keep=keep), (Hold(0.0, 10.0, 500.0),), 0.1)
    assert len(blocks) == (100 if kept else 99)


@pytest.mark.parametrize(("rate", "length"), [(40.0, 0.1), (15.0, 0.2), (10.0, 0.3), (1.0, 3.0)])
def test_the_pieces_of_a_slow_logger_are_multiples_of_the_length_with_three_samples(rate, length):
    """A logger of 1 Hz that watches holds of half a minute is a good one: it gave not a single average."""
    load = np.full(int(21 * rate) + 1, 500.0)
    blocks = cut_blocks(*samples(load, rate=rate), (Hold(0.0, 21.0, 500.0),), 0.1)
    assert len(blocks) == int(21.0 / length + 1e-9)
    np.testing.assert_allclose(blocks.duration, length, atol=1.01 / rate)


def test_pieces_hold_whole_periods_of_the_mains():
    """Half a micrometre of pick-up stood in averages of holds that are no multiples of 0.1 s, at thirty times noise."""
    time = np.arange(3001) / RATE
    holds = tuple(Hold(start, start + 0.96, 500.0) for start in np.arange(0.0, 5.0, 1.2))
    for mains in (50.0, 60.0):
        pickup = 5e-7 * np.sin(2 * np.pi * mains * time)
        vectors = np.column_stack([np.full_like(time, 500.0), np.zeros_like(time), pickup, pickup])
        blocks = cut_blocks(time, vectors, holds, 0.1)
        assert np.max(np.abs(blocks.deflection)) < 1e-9


@pytest.mark.parametrize(("held", "seconds"), [(0.0, 440.0), (440.0, 440.0), (220.0, 440.0), (30.0, 40.0)])
def test_long_records_have_as_many_pieces_as_can_be_borne(held, seconds):
    n = int(seconds * 100)
    load = np.interp(np.arange(n + 1) / 100.0, [0, held, seconds], [100.0, 100.0, 5000.0])
    blocks = cut_blocks(*samples(load, rate=100.0), (Hold(0.0, held, 100.0),) if held else (), 0.2)
    length = 0.2 * np.ceil(seconds / MOST_BLOCKS / 0.2 - 1e-6)
    assert len(blocks) == pytest.approx(seconds / length, abs=2)
    assert len(blocks) <= MOST_BLOCKS


def test_the_load_turns_where_it_was_farthest():
    """A way back of 1.5 % of the range is none; where the load has turned, the pieces after its peak go down."""
    knots = ([0, 4, 4.06, 8, 12], [0.0, 1000.0, 970.0, 2000.0, 500.0])
    time = np.arange(6001) / RATE
    load = 300.0 + np.interp(time, *knots)
    blocks = cut_blocks(*samples(load), (), 0.1)
    assert (blocks.branch[blocks.time < 7.99] == 1).all()
    assert (blocks.branch[blocks.time > 8.01] == -1).all()
    mirrored = cut_blocks(*samples(5000.0 - load), (), 0.1)
    np.testing.assert_array_equal(mirrored.branch, -blocks.branch)
    again = cut_blocks(
        *samples(300.0 + np.interp(time, *np.array([[0, 3, 6, 9, 12], [0, 900, 100, 1000, 0]]))), (), 0.1
    )
    turns = again.time[1:][np.diff(again.branch) != 0]
    np.testing.assert_allclose(turns, [3.05, 6.05, 9.05], atol=0.11)
    assert again.branch[0] == 1


def reached(time, load, holds):
    """Whether each hold was reached from below, +1, or from above."""
    blocks = cut_blocks(time, np.outer(load, [1.0, 0.0, 1e-9, 0.0]), holds)
    senses = [set(blocks.branch[blocks.hold == k].tolist()) for k in range(len(holds))]
    assert {len(sense) for sense in senses} == {1}
    return [sense.pop() for sense in senses]


def staircase(rng=None, hold=1.0, ramp=0.5, levels=(1000.0, 2000.0, 3000.0), rate=RATE):
    knots, values = [0.0], [0.0]
    for level in levels:
        knots += [knots[-1] + ramp, knots[-1] + ramp + hold]
        values += [level, level]
    time = np.arange(int(round(knots[-1] * rate))) / rate
    load = np.interp(time, knots, values)
    return time, load if rng is None else load + 5.0 * rng.standard_normal(len(load))


@pytest.mark.parametrize(("start", "unit"), [(0.0, 1.0), (1e3, 1024.0)])
def test_holds_without_noise_have_their_exact_level_branch_and_length(start, unit):
    levels = (1000.0, 2000.0, 3000.0, 2000.0, 1000.0)
    time, load = staircase(levels=levels)
    time, load = time + start, unit * load
    holds = find_holds(time, load)
    assert reached(time, load, holds) == [1, 1, 1, -1, -1]
    assert [hold.level for hold in holds] == pytest.approx(unit * np.array(levels))
    for k, hold in enumerate(holds):
        begin = start + 0.5 + 1.5 * k
        assert begin - 1e-9 <= hold.start < begin + 0.1
        assert begin + 0.9 < hold.stop <= begin + 1.0 + 0.021
        assert hold.duration == hold.stop - hold.start
        assert 0.8 < hold.duration < 1.02


def test_one_bad_bin_does_not_split_a_hold_but_a_move_does():
    rng = np.random.default_rng(2)
    time, load = staircase(rng, hold=2.0)
    knocked = load.copy()
    knocked[(time > 1.52) & (time < 1.56)] += 7.5
    assert len(find_holds(time, knocked)) == 3
    # nine standard deviations of a median of twenty samples are no noise
    step = 9 * 5.0 * np.sqrt(np.pi / 2 / 20)
    load[(time > 1.5) & (time <= 2.5)] += step
    levels = [hold.level for hold in find_holds(time, load)]
    assert levels == pytest.approx([1000.0, 1000.0 + step, 2000.0, 3000.0], abs=5.0)


@pytest.mark.parametrize("samples", [1, 19, 40, 41, 60, 150])
def test_a_record_of_a_few_bins_has_no_holds(samples):
    assert find_holds(np.arange(samples) / RATE, np.full(samples, 500.0)) == ()


@pytest.mark.parametrize(
    ("levels", "branches"),
    [
        ((200.0, 800.0, 1400.0), [1, 1, 1]),
        ((4000.0, 3000.0, 2000.0), [-1, -1, -1]),
        ((200.0, 800.0, 100.0), [1, 1, -1]),
        ((2000.0, 1000.0), [-1, -1]),
    ],
)
def test_noise_does_not_decide_how_a_first_hold_was_reached(levels, branches):
    for seed in range(6):
        time, load = staircase(np.random.default_rng(seed), levels=levels)
        late = time > 0.5  # the record starts when the first level has been reached
        found = find_holds(time[late], load[late])
        assert reached(time[late], load[late], found) == branches


@pytest.mark.parametrize("sense", [1, -1])
def test_a_creep_that_is_slower_than_a_ramp_is_cut_off_either_end(sense):
    """Sixty newtons per second are no ramp of two thousand; thirty newtons are no part of a level known to one."""
    time, load = staircase(hold=3.0, levels=(1000.0, 2000.0))
    load = load + 0.5 * np.random.default_rng(4).standard_normal(len(load))
    begin = 0.5
    since, left = time - begin, begin + 3.0 - time
    load += 60.0 * sense * np.where((since >= 0) & (since < 0.5), 0.5 - since, 0.0)
    load += 60.0 * sense * np.where((left >= 0) & (left < 0.5), 0.5 - left, 0.0)
    first, second = find_holds(time, load)
    assert first.start == pytest.approx(begin + 0.49, abs=0.09)
    assert first.stop == pytest.approx(begin + 2.51, abs=0.09)
    assert first.level == pytest.approx(1000.0, abs=0.3)
    assert second.duration > 2.8


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


def test_jitter_and_a_gap_in_time_do_no_harm():
    time, load, _ = programme(**CASES["up"])
    rng = np.random.default_rng(7)
    keep = (time < 5.0) | (time > 5.4)
    time, load = (time + rng.uniform(-2e-4, 2e-4, len(time)))[keep], load[keep]
    assert len(find_holds(np.sort(time), load)) in (10, 11)  # the gap may split the hold it falls into


LOADS = np.linspace(100.0, 3000.0, 24)
HOLDS = np.repeat(np.arange(8), 3)


def projected(load, displacement, hold=HOLDS, angle=0.0):
    return on_pad(angle, load, displacement, hold, np.ones(len(load)))


def white(scale):
    return SimpleNamespace(covariance=lambda time, duration: scale**2 * np.eye(len(time)))


def test_without_motion_there_is_no_direction():
    some = projected(vectors(0.0, LOADS), np.zeros((len(LOADS), 2)))
    assert displacement_direction(some, white(1e-7)) == PadDirection(0.0, math.inf)


def test_the_stated_error_is_that_of_the_draws():
    scale, drawn = 2e-7, []
    for seed in range(300):
        noise = scale * np.random.default_rng(seed).standard_normal((len(LOADS), 2))
        some = projected(vectors(0.3, LOADS), vectors(0.35, 2e-9 * LOADS) + noise, angle=0.3)
        drawn.append(displacement_direction(some, white(scale)))
    angles, errors = np.array([[d.angle, d.se] for d in drawn]).T
    assert np.mean(angles) == pytest.approx(0.05, abs=4 * np.std(angles) / math.sqrt(300))
    # by hand: the slope across scatters by scale / (root of the sum of squares of the loads about their mean)
    by_hand = scale / math.sqrt(np.sum((LOADS - LOADS.mean()) ** 2)) / 2e-9
    assert np.std(angles) == pytest.approx(by_hand, rel=0.15)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(by_hand, rel=0.1)


def test_blocks_of_one_hold_count_as_one():
    rng = np.random.default_rng(4)
    scattered = vectors(0.0, LOADS) + rng.standard_normal((len(LOADS), 2))
    displacement = np.zeros((len(LOADS), 2))
    alone = projected(scattered, displacement, np.arange(len(LOADS)))
    shared = projected(scattered, displacement, HOLDS)
    between = projected(scattered, displacement, np.full(len(LOADS), -1))
    errors = [load_direction(b).se for b in (alone, shared, between)]
    assert errors[1] / errors[0] == pytest.approx(math.sqrt(3.0))
    assert errors[2] / errors[0] == pytest.approx(math.sqrt(len(LOADS) / 3.0))
