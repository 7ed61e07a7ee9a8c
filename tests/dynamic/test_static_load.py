"""Loads that miss their set points, in size and in direction: campaigns whose law and misses can be written down."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate
from scipy.stats import norm

from tests.dynamic.phasor_cases import H, complex_normal, place, stiff
from tpjb_ident.dynamic.corrections import load_direction
from tpjb_ident.dynamic.corrections.load_direction import (
    CLIPPED_SQUARE,
    HUBER,
    PLAUSIBLE,
    RunRatios,
    direction_slopes,
    run_ratios,
    turned_back,
)
from tpjb_ident.dynamic.corrections.static_load import (
    MAX_MISS,
    MAX_SIDEWAYS,
    UNKNOWN_EXPONENT,
    LoadMiss,
    load_conditions,
    load_misses,
    load_ratio,
    load_slopes,
    to_set_point,
    widened,
)
from tpjb_ident.dynamic.runs.point_data import PointData


def loaded(ratios, load=5000.0, direction=-90.0):
    """A point whose cells read these multiples of the set point, as complex numbers (size, direction)."""
    force = load * np.exp(1j * math.radians(direction)) * np.asarray(ratios, dtype=complex)
    return SimpleNamespace(point=place(load, direction), mean_loads=np.stack([force.real, force.imag], axis=1))


def test_a_ratio_is_size_and_angle_whatever_the_direction():
    given = np.array([1.02, np.exp(0.01j), 0.97 * np.exp(-0.02j)])
    for direction in (-90.0, 0.0, 54.0):
        np.testing.assert_allclose(load_ratio(loaded(given, 3000.0, direction)), given, rtol=1e-12)
    assert np.isnan(load_ratio(SimpleNamespace(point=place(0.0), mean_loads=np.ones((2, 2))))).all()


def test_misses_are_relative_to_what_all_runs_share():
    """A gain and a rotation of the cells move nothing; the mean's own uncertainty is told."""
    scatter = np.array([0.01 + 0.003j, -0.01 - 0.003j, 0.01 - 0.003j, -0.01 + 0.003j])
    for common in (1.0, 1.3 * np.exp(0.1j), 0.55):
        points = [loaded(common * (1 + scatter)), loaded(common * (1 - scatter), 8000.0, 30.0)]
        (first, second), found = load_misses(points)
        assert found == pytest.approx(complex(common))
        np.testing.assert_allclose(first.size, scatter.real, atol=1e-12)
        np.testing.assert_allclose(first.sideways, scatter.imag, atol=1e-12)
        np.testing.assert_allclose(second.size, -scatter.real, atol=1e-12)
        spread = np.concatenate([scatter, -scatter])
        assert first.uncertainty == second.uncertainty == pytest.approx(np.std(spread.real, ddof=1) / math.sqrt(8))
        assert first.turn_uncertainty == pytest.approx(np.std(spread.imag, ddof=1) / math.sqrt(8))


def test_one_run_far_off_does_not_move_what_all_share():
    (miss,), common = load_misses([loaded([0.99, 1.01, 0.99, 1.01, 1.0, 1.06])])
    assert common == pytest.approx(1.0)
    np.testing.assert_allclose(miss.size, [-0.01, 0.01, -0.01, 0.01, 0.0, 0.06], atol=1e-12)
    (exact,), _ = load_misses([loaded([1.1, 1.1, 1.1, 1.6])])
    np.testing.assert_allclose(exact.size, [0.0, 0.0, 0.0, 0.5 / 1.1], atol=1e-12)
    assert exact.uncertainty == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("common", [0.45, 2.2, 1.0j, -0.3])
def test_cells_that_cannot_be_right_correct_nothing_but_are_told(common):
    (miss,), found = load_misses([loaded(common * np.array([0.98, 1.0, 1.02]))])
    np.testing.assert_array_equal(miss.size, 0.0)
    np.testing.assert_array_equal(miss.sideways, 0.0)
    assert miss.uncertainty == 0.0
    assert found == pytest.approx(common)


def test_runs_without_a_load_have_no_miss():
    idle = SimpleNamespace(point=place(0.0), mean_loads=np.ones((3, 2)))
    (none,), common = load_misses([idle])
    assert common == 1.0
    np.testing.assert_array_equal(none.size, np.zeros(3))
    (beside, other), common = load_misses([idle, loaded([0.99, 1.01, np.nan])])
    assert common == pytest.approx(1.0)
    np.testing.assert_array_equal(beside.size, 0.0)
    np.testing.assert_allclose(other.size, [-0.01, 0.01, 0.0], atol=1e-12)


EXPONENTS = np.array([[0.7, -0.4], [1.3, 0.9]]), np.array([[0.2, 0.5], [-0.3, 1.1]])


def power_law(load):
    w = load / 5000.0
    return H.real * w ** EXPONENTS[0] + 1j * H.imag * w ** EXPONENTS[1]


@pytest.mark.parametrize("loads", [(3000.0, 8000.0), (2500.0, 9000.0, 4000.0), (9000.0, 2500.0, 6000.0, 4000.0)])
def test_slopes_of_power_laws_are_their_exponents(loads):
    """At any spacing and in any order; stiffness and damping each with its own."""
    points = [SimpleNamespace(point=place(load)) for load in loads]
    first = [stiff(power_law(load)) for load in loads]
    for slope, est in zip(load_slopes(points, first), first, strict=True):
        np.testing.assert_allclose(slope, EXPONENTS[0] * est.h.real + 1j * EXPONENTS[1] * est.h.imag, rtol=1e-9)


def test_entries_that_change_their_sign_or_vanish_are_straight_or_bent_in_the_logarithm():
    loads = np.array([2500.0, 4000.0, 9000.0])
    t = np.log(loads / 4500.0)
    values = np.stack([t, 2 * t + t**2, 0 * t, 1.0 + 0 * t], axis=1).reshape(3, 2, 2)
    points = [SimpleNamespace(point=place(load)) for load in loads]
    found = load_slopes(points, [stiff(v + 1j * v[::-1]) for v in values])
    expected = np.stack([1 + 0 * t, 2 + 2 * t, 0 * t, 0 * t], axis=1).reshape(3, 2, 2)
    np.testing.assert_allclose(found, expected + 1j * expected[:, ::-1], atol=1e-9)
    two = load_slopes([points[0], points[2]], [stiff(values[0]), stiff(values[2])])
    np.testing.assert_allclose([slope[0, 0] for slope in two], 1.0, rtol=1e-12)


def test_a_slope_is_borrowed_from_the_nearest_excitation_at_the_same_load():
    """Stiffness keeps its slope; omega c has one that goes with the frequency."""
    loads = (3000.0, 8000.0)
    points = [SimpleNamespace(point=place(load, excitation=f)) for f in (20.0, 60.0) for load in loads]
    first = [stiff((1 + k // 2) * power_law(p.point.static_load)) for k, p in enumerate(points)]
    at_35 = SimpleNamespace(point=place(8000.0, excitation=35.0))
    strangers = [place(8000.0, 30.0, 22.0, 35.0), place(8000.0, -90.0, 33.0, 35.0), place(7000.0, excitation=36.0)]
    everyone = [*points, at_35, *(SimpleNamespace(point=p) for p in strangers)]
    found = load_slopes(everyone, [*first, *(stiff(H) for _ in range(4))])
    assert found[5:] == [None] * 3
    np.testing.assert_allclose(found[4], found[1].real + 1j * found[1].imag * 35.0 / 20.0, rtol=1e-12)
    at_45 = load_slopes([*points, SimpleNamespace(point=place(8000.0, excitation=45.0))], [*first, stiff(H)])[4]
    np.testing.assert_allclose(at_45, found[3].real + 1j * found[3].imag * 45.0 / 60.0, rtol=1e-12)
    # an estimate without an answer gives no slope, and may borrow one
    lost = [first[0], stiff(np.full((2, 2), np.nan)), *first[2:]]
    found = load_slopes(points, lost)
    assert found[0] is None or np.isfinite(found[0]).all()
    np.testing.assert_allclose(found[1], found[3].real + 1j * found[3].imag / 3.0, rtol=1e-12)
    idle = [SimpleNamespace(point=place(0.0)), SimpleNamespace(point=place(0.0))]
    assert load_slopes(idle, [stiff(H), stiff(H)]) == [None, None]


def windows(h, n_runs=4, per_run=3, seed=1):
    rng = np.random.default_rng(seed)
    shape = complex_normal(rng, n_runs, 2)
    D = np.repeat(shape, per_run, axis=0)
    index = np.repeat(np.arange(n_runs), per_run)
    runs = tuple(SimpleNamespace(run=f"r{k}") for k in range(n_runs))
    F = np.concatenate([d[None] @ np.asarray(h(k) if callable(h) else h).T for k, d in zip(index, D, strict=True)])
    return PointData(place(), runs, (0,) * n_runs, D, F, np.zeros_like(D), index)


def test_forces_are_brought_to_the_set_point_exactly():
    slope = np.array([[0.5 + 1j, 2.0], [-1j, 3.0]])
    size = np.array([0.01, -0.02, MAX_MISS, 0.0])
    data = windows(lambda k: H + size[k] * slope)
    corrected = to_set_point(data, LoadMiss(size, np.zeros(4)), slope)
    np.testing.assert_allclose(corrected.F, data.D @ H.T, atol=1e-12)
    np.testing.assert_array_equal(corrected.D, data.D)
    assert to_set_point(data, LoadMiss(size, np.zeros(4)), None) is data
    # a run far off tells of a wrong set point, not of scatter
    for far in (1.1 * MAX_MISS, -1.1 * MAX_MISS):
        assert to_set_point(data, LoadMiss(np.array([far, 0, 0, 0]), np.zeros(4)), slope) is data


def test_what_is_not_known_of_the_miss_widens_the_interval():
    est = stiff(H)
    miss = LoadMiss(np.array([0.02, -0.04]), np.zeros(2), 0.003)
    slope = np.array([[1.0 + 2j, 3.0], [-4j, 5.0]])
    shift = 0.003 * np.array([1, 3, 0, 5, 2, 0, -4, 0])
    np.testing.assert_allclose(widened(est, miss, slope).covariance, np.eye(8) + np.outer(shift, shift))
    own = np.diag((UNKNOWN_EXPONENT * math.hypot(0.01, 0.003) * est.vector) ** 2)
    np.testing.assert_allclose(widened(est, miss, None).covariance, np.eye(8) + own)
    lost = stiff(np.full((2, 2), np.nan))
    assert widened(lost, miss, slope) is lost


@pytest.mark.parametrize(
    ("size", "sideways", "common", "named", "figure"),
    [
        (0.01, 0.01, 1.0, (), ""),
        (MAX_MISS, -MAX_SIDEWAYS, 1.005, (), ""),
        (-0.061, 0.0, 1.0, ("static-load-off",), "6.1 %"),
        (0.0, -0.06, 1.0, ("static-load-turned",), "3.4 deg"),
        (0.0, 0.0, 1.02 * np.exp(0.04j), ("cells-against-set-points",), "+2.00 %"),
        (0.0, 0.0, np.exp(-0.3j), ("static-load-turned",), "-17.2 deg"),
        (0.0, 0.0, 1.2 * np.exp(0.3j), ("static-load-turned", "cells-against-set-points"), "+17.2 deg"),
        (0.0, 0.0, 1.0j, ("cells-contradict-set-points",), "+90.0 deg"),
        (0.0, 0.0, -1.0, ("cells-contradict-set-points",), "+180.0 deg"),
        (0.0, 0.0, 0.98, ("cells-against-set-points",), "-2.00 %"),
        (0.0, 0.0, 1.399, ("cells-against-set-points",), "+39.90 %"),
        (0.0, 0.0, 0.69, ("cells-contradict-set-points",), "0.69 times"),
        (0.0, 0.0, -10.0, ("cells-contradict-set-points",), "10 times"),
    ],
)  # fmt: skip
def test_loads_that_are_off_by_more_than_scatter_are_named_with_their_figure(size, sideways, common, named, figure):
    miss = LoadMiss(np.array([0.0, size]), np.array([sideways, 0.0]))
    found = load_conditions(miss, complex(common))
    assert found == named
    assert figure in "".join(c.detail for c in found)
    assert load_conditions(LoadMiss(np.zeros(0), np.zeros(0)), 1.0 + 0j) == ()


def test_a_runs_force_per_displacement_is_h_times_its_shape():
    """Windows that were struck, a third of them, and those without phasors do not count; size and phase neither."""
    data = windows(H, per_run=7)
    rng = np.random.default_rng(2)
    factor = complex_normal(rng, len(data.D), 1)
    D, F = data.D * factor, data.F * factor
    D[0], F[1], D[7] = np.nan, 1e3, 1e3
    F[8, 1] = np.nan
    given = SimpleNamespace(runs=data.runs, point=data.point, D=D, F=F, run_index=data.run_index)
    sideways = np.array([0.01, -0.02, 0.03, MAX_SIDEWAYS])
    found = run_ratios(given, LoadMiss(np.zeros(4), sideways), stiff(H))
    np.testing.assert_allclose(np.linalg.norm(found.shape, axis=1), 1.0)
    np.testing.assert_allclose(found.force, found.shape @ H.T, rtol=1e-9)
    overlap = np.abs(np.einsum("ra,ra->r", found.shape.conj(), data.D[::7])) / np.linalg.norm(data.D[::7], axis=1)
    np.testing.assert_allclose(overlap, 1.0, rtol=1e-9)
    np.testing.assert_array_equal(found.sideways, sideways)
    assert (found.load, found.direct, found.trusted) == (5000.0, (1.75, 0.8), True)
    # a run without windows, or with one at rest, is left out with its miss
    first = np.flatnonzero(data.run_index == 1)[3]
    was, D[first] = D[first].copy(), 0.0
    assert len(run_ratios(given, LoadMiss(np.zeros(4), sideways), stiff(H)).shape) == 3
    D[first] = was
    for spoil in (np.nan, 0.0):
        D[data.run_index == 1] = spoil
        fewer = run_ratios(given, LoadMiss(np.zeros(4), sideways), stiff(H), trusted=False)
        np.testing.assert_array_equal(fewer.sideways, sideways[[0, 2, 3]])
        np.testing.assert_allclose(fewer.force, fewer.shape @ H.T, rtol=1e-9)
        assert not fewer.trusted
    D[data.run_index == 2] = np.nan
    assert run_ratios(given, LoadMiss(np.zeros(4), sideways), stiff(H)) is None


def test_where_nothing_can_be_said_of_the_direction():
    data, miss = windows(H), LoadMiss(np.zeros(4), np.full(4, 0.01))
    assert run_ratios(data, miss, stiff(H)) is not None
    assert run_ratios(windows(H, n_runs=3), LoadMiss(np.zeros(3), np.zeros(3)), stiff(H)) is not None
    assert run_ratios(windows(H, n_runs=2), LoadMiss(np.zeros(2), np.zeros(2)), stiff(H)) is None
    assert run_ratios(data, LoadMiss(np.zeros(4), np.array([0, 0, 0, -0.06])), stiff(H)) is None
    assert run_ratios(data, miss, stiff(np.diag([np.nan, 1.0]))) is None
    idle = SimpleNamespace(runs=data.runs, point=place(0.0), D=data.D, F=data.F, run_index=data.run_index)
    assert run_ratios(idle, miss, stiff(H)) is None


def ratios(slope, load, seed, noise=0.0, sideways=0.01, n=5, trusted=True):
    """Runs of one point, H = 3 H' there, that turns with the load's direction."""
    rng = np.random.default_rng(seed)
    shape = complex_normal(rng, n, 2)
    shape /= np.linalg.norm(shape, axis=1)[:, None]
    aside = sideways * rng.standard_normal(n)
    h = 3.0 * H
    force = shape @ h.T + aside[:, None] * (shape @ slope.T) + noise * complex_normal(rng, n, 2)
    return RunRatios(shape, force, aside, load, stiff(h).direct, trusted)


S = np.random.default_rng(3).standard_normal((4, 2, 2))
LOADS = (2500.0, 4000.0, 9000.0)
MIDDLE = float(np.mean(np.log(LOADS)))


def slope_at(load, s=S):
    k, c = stiff(3.0 * H).direct
    t = math.log(load) - MIDDLE
    return k * (s[0] + t * s[2]) + 1j * c * (s[1] + t * s[3])


def test_how_h_turns_with_the_load_is_found_exactly_where_nothing_is_in_the_way():
    """dH/d(direction) = k (Sk + ln(W / W0) Sk') + i omega c (Sc + ln(W / W0) Sc'), any four matrices."""
    given = [ratios(slope_at(load), load, k) for k, load in enumerate(LOADS)]
    others = [ratios(slope_at(load, -S), load, 9 + k) for k, load in enumerate(LOADS)]
    turns = direction_slopes([(0.0, 1.0)] * 3 + [(0.0, 2.0)] * 4, [*given, *others[:2], None, others[2]])
    assert turns[5] is None
    for k, load in enumerate(LOADS):
        np.testing.assert_allclose(turns[k].slope, slope_at(load), atol=1e-5)
        np.testing.assert_allclose(turns[(3, 4, 6)[k]].slope, slope_at(load, -S), atol=1e-5)
        assert np.abs(turns[k].left).max() < 1e-12


def test_runs_whose_forces_mains_struck_do_not_teach_but_are_told():
    spoilt = ratios(slope_at(LOADS[0]), LOADS[0], 0, noise=5.0, trusted=False)
    given = [spoilt, *(ratios(slope_at(load), load, k, n=8) for k, load in enumerate(LOADS) if k)]
    turns = direction_slopes([(0.0,)] * 3, given)
    for turn, load in zip(turns, LOADS, strict=True):
        np.testing.assert_allclose(turn.slope, slope_at(load), atol=1e-5)
    assert direction_slopes([(0.0,)], [spoilt]) == [None]


def test_where_the_misses_tell_nothing_the_plausible_slopes_remain_unknown():
    """Each of the sixteen numbers moves H by what a least-squares fit of the runs makes of it."""
    given = [ratios(slope_at(load), load, k, noise=1.0, sideways=1e-7) for k, load in enumerate(LOADS)]
    for ratio, turn in zip(given, direction_slopes([(0.0,)] * 3, given), strict=True):
        assert np.abs(turn.slope).max() < 1e-3
        expected = np.zeros((8, 8))
        for part in range(4):
            for row, column in np.ndindex(2, 2):
                s = np.zeros((4, 2, 2))
                s[part, row, column] = PLAUSIBLE[part // 2]
                push = ratio.sideways[:, None] * (ratio.shape @ slope_at(ratio.load, s).T)
                h = np.linalg.lstsq(ratio.shape, push, rcond=None)[0].T.ravel()
                own = np.concatenate([h.real, h.imag])
                expected += np.outer(own, own)
        np.testing.assert_allclose(turn.left, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


def test_the_regression_is_hubers_with_its_scale_and_a_ridge():
    """Clipped residuals balance the ridge; the scale is proposal 2, for as many numbers as are left."""
    z = integrate.quad(lambda x: min(x**2, HUBER**2) * norm.pdf(x), -np.inf, np.inf)[0]
    assert pytest.approx(z, abs=1e-4) == CLIPPED_SQUARE
    rng = np.random.default_rng(5)
    design = 0.5 * rng.standard_normal((60, 8))
    answer = design @ rng.standard_normal(8) + 0.1 * rng.standard_normal(60)
    answer[:4] += 30.0
    found, covariance = load_direction._ridge(design, answer)
    ridge = np.diag(1 / np.repeat(np.square(PLAUSIBLE), 4))
    residual = answer - design @ found

    def left(scale):
        """What proposal 2 leaves at a scale, and the covariance there."""
        weight = np.minimum(1.0, HUBER * scale / np.abs(residual)) / scale**2
        own = np.linalg.inv(design.T @ (weight[:, None] * design) + ridge)
        spent = 8 - np.trace(own @ ridge)
        clipped = np.sum(np.minimum(np.abs(residual), HUBER * scale) ** 2)
        return clipped - CLIPPED_SQUARE * (60 - spent) * scale**2, own, weight

    from scipy.optimize import brentq

    scale = brentq(lambda s: left(s)[0], 0.05, 1.0)
    np.testing.assert_allclose(covariance, left(scale)[1], rtol=1e-3)
    np.testing.assert_allclose(design.T @ (left(scale)[2] * residual), ridge @ found, rtol=2e-2, atol=1e-2)
    assert scale == pytest.approx(0.1, rel=0.35)


def test_forces_of_a_turned_load_are_taken_off():
    data = windows(H)
    miss = LoadMiss(np.zeros(4), np.array([0.01, -0.02, 0.03, 0.0]))
    turn = load_direction.DirectionSensitivity(np.array([[1.0, 2j], [3.0, 4.0]]), np.zeros((8, 8)))
    by_hand = [miss.sideways[k] * (turn.slope @ d) for k, d in zip(data.run_index, data.D, strict=True)]
    np.testing.assert_allclose(turned_back(data, miss, turn), by_hand)
    np.testing.assert_array_equal(turned_back(data, miss, None), np.zeros_like(data.F))


def test_a_direction_that_all_loads_miss_alike_turns_the_whole_film():
    """Where the runs tell no slope, H turns as a whole; else by the slope, and by what is not known of it."""
    small = 1e-3
    turned = np.array([[np.cos(small), -np.sin(small)], [np.sin(small), np.cos(small)]])
    change = turned @ H @ turned.T - H
    shift = np.concatenate([change.real.ravel(), change.imag.ravel()])
    size = np.abs(shift).max()
    np.testing.assert_allclose(load_direction.common_turn(H, None, small), np.outer(shift, shift), atol=5e-3 * size**2)
    slope = load_direction.DirectionSensitivity(np.array([[1.0, 2j], [3.0, 4.0]]), np.zeros((8, 8)), 7.0 * np.eye(8))
    own = np.array([1.0, 0, 3.0, 4.0, 0, 2.0, 0, 0])
    np.testing.assert_allclose(load_direction.common_turn(H, slope, 0.5), 0.25 * (np.outer(own, own) + 7 * np.eye(8)))
