"""The robust joint regression and its start: units, noise of any size, cores, and directions looked at once more."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import f as fisher_f

from tests.dynamic.phasor_cases import H, complex_normal, rejected
from tpjb_ident.dynamic.estimators import least_trimmed
from tpjb_ident.dynamic.estimators.errors_in_variables import eiv_fit, repeats, windows_used_again
from tpjb_ident.dynamic.estimators.least_trimmed import Regression, distance2, robust_start
from tpjb_ident.dynamic.estimators.mm import MANY_WINDOWS, mm_fit
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.estimate.robust_constants import bisquare_weight, efficiency_constant


def windows(seed, n=60, g=6, noise=0.1, bad=10):
    rng = np.random.default_rng(seed)
    X = complex_normal(rng, n, 2)
    Y = X @ H.T + noise * complex_normal(rng, n, 2)
    Y[:bad] += 3.0 * complex_normal(rng, bad, 2)
    return X, Y, np.arange(n) % g


@pytest.mark.parametrize("unit", [2.0**-40, 2.0**30])
def test_units_of_the_forces_change_no_step(unit):
    X, Y, label = windows(1)
    a, b = mm_fit(X, Y, label, tolerance=1e-3), mm_fit(X, unit * Y, label, tolerance=1e-3)
    np.testing.assert_allclose(b.coefficients, unit * a.coefficients, rtol=1e-9)
    np.testing.assert_allclose(b.scatter, unit**2 * a.scatter, rtol=1e-9)
    np.testing.assert_allclose(b.weights, a.weights, atol=1e-9)
    assert a.iterations == b.iterations > 1
    moved = mm_fit(unit * X, Y, label, tolerance=1e-3)
    np.testing.assert_allclose(unit * moved.coefficients, a.coefficients, rtol=1e-9)
    exact = unit * X @ H.T
    exact[:9] *= 1.5
    fit = mm_fit(X, exact, label)
    np.testing.assert_array_equal(fit.weights, np.arange(60) >= 9)
    np.testing.assert_allclose(fit.coefficients, unit * H, rtol=1e-9)


@pytest.mark.parametrize("scale", [1.0, 1e-5])
def test_no_entry_is_left_to_move_by_more_than_the_tolerance(scale):
    """The change counts against the largest entry, however small another is, and every entry counts."""
    for seed in range(4):
        X, Y, label = windows(seed)
        X = X * [1.0, 1 / scale]
        fit = mm_fit(X, Y, label, tolerance=1e-4)
        regression = Regression(X, Y)
        distance = distance2(regression.terms(fit.coefficients), fit.scatter)
        again = regression.fit(bisquare_weight(np.sqrt(distance), efficiency_constant(4)))
        assert np.abs(again - fit.coefficients).max() < 1e-4 * np.abs(fit.coefficients).max()
    assert fit.iterations < 12


@pytest.mark.parametrize("n", [3, 7])
def test_few_windows_are_plain_least_squares_with_its_scatter(n):
    X, Y, _ = windows(2, n=n, bad=0)
    fit = mm_fit(X, Y, np.arange(n))
    plain = np.linalg.lstsq(X, Y, rcond=None)[0]
    residual = Y - X @ plain
    assert "no-robust-start" in fit.conditions
    np.testing.assert_allclose(fit.coefficients, plain.T)
    np.testing.assert_allclose(fit.scatter, residual.T @ residual.conj() / (n - 2), rtol=1e-9)
    np.testing.assert_array_equal(fit.weights, 1.0)


def test_more_windows_than_the_start_looks_at_are_all_fitted():
    X, Y, label = windows(3, n=MANY_WINDOWS + 61, bad=150)
    fit = mm_fit(X, Y, label)
    assert len(fit.weights) == len(X)
    assert (fit.weights[:150] > 0.3).mean() < 0.1
    equation = (fit.weights[:, None] * (Y - X @ fit.coefficients.T)).T @ X.conj()
    np.testing.assert_allclose(equation, 0.0, atol=1e-8)


@pytest.mark.slow
def test_the_first_scatter_is_that_of_the_noise():
    """Mean over draws: trimming, core and fitted parameters are allowed for, for two components and for one."""
    noise = np.array([[1.0, 0.3j], [-0.3j, 0.5]])
    root = np.linalg.cholesky(noise)
    both, single, share, n = [], [], [], 24
    for seed in range(25):
        rng = np.random.default_rng([6, seed])
        X, E = complex_normal(rng, n, 2), complex_normal(rng, n, 2) @ root.T
        Y = X @ H.T + E
        start = robust_start(Regression(X, Y), np.arange(n) % 6, 1)
        both.append(start.scatter)
        single.append(robust_start(Regression(X, Y[:, :1]), np.arange(n) % 6, 1).scatter[0, 0].real)
        share.append(np.mean(distance2(Regression(X, Y).terms(start.coefficients), start.scatter) < chi2.ppf(0.99, 4)))
    found = np.mean(both, axis=0)
    # a core of few windows is picked for lying close together: some per cent less
    assert 0.88 < np.trace(found).real / 1.5 < 1.03
    assert 0.88 < np.mean(single) < 1.03
    np.testing.assert_allclose(found / np.trace(found), noise / 1.5, atol=0.03)
    assert 0.96 < np.mean(share) < 1.0


def test_noise_of_any_size_gives_the_same_start():
    """Errors of the coefficients go with the noise, the scatter with its square, down to what is no noise any more."""
    rng = np.random.default_rng(7)
    X, E, label = complex_normal(rng, 60, 2), complex_normal(rng, 60, 2), np.arange(60) % 6
    E[:20] *= 30.0
    base = robust_start(Regression(X, X @ H.T + 1e-2 * E), label, 1)
    for size in (1e-4, 1e-6):
        start = robust_start(Regression(X, X @ H.T + size * E), label, 1)
        np.testing.assert_allclose((start.coefficients - H) / size, (base.coefficients - H) / 1e-2, atol=1e-3)
        np.testing.assert_allclose(start.scatter / size**2, base.scatter / 1e-4, atol=1e-3)


def two_opinions(tightness, seed=3):
    """Three windows of five in every direction say H, two of five 2 H with `tightness` times less power of noise."""
    rng = np.random.default_rng(seed)
    label = np.repeat(np.arange(6), 20)
    X = complex_normal(rng, 6, 2)[label] + 0.05 * complex_normal(rng, 120, 2)
    few = np.arange(120) % 5 < 2
    E = 0.05 * complex_normal(rng, 120, 2) / np.sqrt(np.where(few, tightness, 1.0))[:, None]
    return X, X @ H.T * np.where(few, 2.0, 1.0)[:, None] + E, label


@pytest.mark.parametrize(("tightness", "answer"), [(1.0, 1.0), (3.0, 1.0), (6.0, 2.0), (50.0, 2.0)])
def test_a_smaller_core_must_be_several_times_tighter(tightness, answer):
    X, Y, label = two_opinions(tightness)
    start = robust_start(Regression(X, Y), label, 1)
    np.testing.assert_allclose(start.coefficients, answer * H, atol=0.05)


def test_one_start_that_fits_exactly_is_the_answer():
    """The others hang on windows that are larger, and would stay with them."""
    rng = np.random.default_rng(8)
    X = complex_normal(rng, 40, 2)
    X[:15] *= 8.0
    Y = X @ H.T
    Y[:15] += 8.0 * complex_normal(rng, 15, 2)
    regression = Regression(X, Y)
    pairs = np.array([[0, k] for k in range(1, 12)] + [[20, 30]])
    for order in (pairs, pairs[::-1]):
        seeds = least_trimmed._first_fits(regression, order)
        found, exact = least_trimmed._concentrated(regression, seeds, 0.5)
        assert exact
        np.testing.assert_allclose(found, H, atol=1e-9)


def test_windows_that_fit_exactly_but_are_few_do_not_win():
    """Two of five, computed by another H: what they leave is nothing, and no noise that others could be held to."""
    X, Y, label = two_opinions(1e40)
    start = robust_start(Regression(X, Y), label, 1)
    assert not start.exact
    np.testing.assert_allclose(start.coefficients, H, atol=0.05)
    assert np.trace(start.scatter).real == pytest.approx(2 * 0.05**2, rel=0.4)


def test_two_runs_that_fit_by_themselves_are_no_core():
    """Runs differ by thirty times the noise within them: any two are fitted to the noise, by an H of their own.

    Half of the windows, three runs, are not.
    """
    rng = np.random.default_rng(12)
    label = np.repeat(np.arange(6), 20)
    X = complex_normal(rng, 6, 2)[label] + 0.005 * complex_normal(rng, 120, 2)
    Y = X @ H.T + 0.3 * complex_normal(rng, 6, 2)[label] + 0.01 * complex_normal(rng, 120, 2)
    start = robust_start(Regression(X, Y), label, 1)
    accepted = distance2(Regression(X, Y).terms(start.coefficients), start.scatter) < chi2.ppf(0.99, 4)
    assert len(np.unique(label[accepted])) >= 3
    assert np.trace(start.scatter).real > 5 * 2 * 0.01**2


def test_a_displacement_that_is_nothing_is_no_division_by_nothing():
    X, Y, _ = windows(10)
    X[:, 1] = 0.0
    assert np.isfinite(Regression(X, Y).fit(np.ones(60))).all()


def test_a_component_without_noise_is_found_exactly_beside_one_with_noise():
    rng = np.random.default_rng(9)
    X, label = complex_normal(rng, 60, 2), np.arange(60) % 6
    Y = X @ H.T
    Y[:, 0] += 0.1 * complex_normal(rng, 60)
    Y[:20] += 3.0 * complex_normal(rng, 20, 2)
    start = robust_start(Regression(X, Y), label, 1)
    np.testing.assert_allclose(start.coefficients[1], H[1], atol=1e-9)
    np.testing.assert_allclose(start.coefficients[0], H[0], atol=0.1)
    assert not start.exact


def test_starts_are_pairs_of_windows_that_differ_in_direction_and_cores_the_nearest_windows():
    label = np.repeat(np.arange(4), [30, 5, 3, 2])
    pairs = least_trimmed._start_pairs(label, 1)
    assert pairs.shape == (least_trimmed.STARTS, 2)
    assert (label[pairs[:, 0]] != label[pairs[:, 1]]).all()
    alone = least_trimmed._start_pairs(np.zeros(40, dtype=int), 1)
    assert (alone[:, 0] != alone[:, 1]).all()
    assert len(alone) == least_trimmed.STARTS
    distance = np.random.default_rng(2).random((20, 300))
    nearest = least_trimmed._nearest(distance, 150)
    np.testing.assert_array_equal(nearest, np.argsort(np.argsort(distance)) < 150)


SCATTER = 0.02 * np.array([[0.5, 0, 0, 0], [0, 0.4, 0, 0], [0.9, 0.4j, 0.3, 0], [-0.4j, 0.6, 0.1, 0.3]])


def directions(seed, sizes, noise=SCATTER, discord=0.0):
    """Windows whose noise is one of forces and displacements together; means lie exactly on F = H D but for discord."""
    rng = np.random.default_rng(seed)
    D, parts = complex_normal(rng, len(sizes), 2), []
    F = D @ H.T + discord * complex_normal(rng, len(sizes), 2)
    for k, n in enumerate(sizes):
        e = complex_normal(rng, n, 4) @ np.asarray(noise).T
        parts.append(np.concatenate([D[k], F[k]]) + e - e.mean(axis=0))
    z = np.concatenate(parts)
    return phasor_table(z[:, :2], z[:, 2:], np.repeat(np.arange(len(sizes)), sizes))


@pytest.mark.parametrize("sizes", [(12,) * 7, (12, 12, 12, 6, 12, 12, 12), (8, 8, 8, 24, 8, 24, 10)])
@pytest.mark.parametrize("discord", [0.0, 0.02])
@pytest.mark.parametrize(("factor", "heard"), [(0.97, True), (1.03, False)])
def test_how_far_off_a_direction_may_lie_whatever_the_noise(sizes, discord, factor, heard):
    """The noise of F - H D, not of the two apart; of a mean over as many windows as it has, or the others have."""
    table = directions(1, sizes, discord=discord)
    weights = rejected(table)
    others = repeats(table, weights)
    fit = eiv_fit(others)
    mine = table.direction == 3
    combine = np.hstack([-fit.h, np.eye(2)])
    noise = combine @ others.noise @ combine.conj().T
    assert (fit.chi_square > 1.5) is (discord > 0)
    spread = 2.0 * max(fit.chi_square, 1.0) * noise / min(mine.sum(), others.means.count.mean())
    limit = float(fisher_f.isf(1e-4, 4, 4.0 * (6 - 2)))
    aim = np.array([1.0, 0.5j])
    reach = np.sqrt(2.0 * limit / (aim.conj() @ np.linalg.solve(spread, aim)).real)
    exact = fit.h @ table.D[mine].mean(axis=0) - table.F[mine].mean(axis=0)
    placed = dataclasses.replace(table, F=table.F + np.outer(mine, exact + factor * reach * aim))
    assert bool(windows_used_again(placed, weights)[mine].sum() > 0.6 * mine.sum()) is heard


@pytest.mark.parametrize(("factor", "heard"), [(0.93, True), (1.07, False)])
def test_a_window_belongs_to_its_direction_up_to_twice_the_distance_of_one_in_ten_thousand(factor, heard):
    table = directions(2, (15,) * 7)
    others = repeats(table, rejected(table))
    z = np.concatenate([table.D, table.F], axis=1)
    mine = np.flatnonzero(table.direction == 3)
    z[mine] = np.median(z[mine].real, axis=0) + 1j * np.median(z[mine].imag, axis=0)
    aim = np.array([1.0, -1.0j, 0.3, 0.5])
    reach = np.sqrt(2.0 * chi2.ppf(0.9999, 8) / (2.0 * aim.conj() @ np.linalg.solve(others.noise, aim)).real)
    z[mine[:3]] += factor * reach * aim
    placed = dataclasses.replace(table, D=z[:, :2], F=z[:, 2:])
    found = windows_used_again(placed, rejected(placed))[mine]
    np.testing.assert_array_equal(found[:3], float(heard))
    np.testing.assert_array_equal(found[3:], 1.0)


@pytest.mark.parametrize("way", [4.0, -4.0j])
def test_windows_struck_alike_do_not_draw_the_others_along(way):
    table = directions(3, (10,) * 7, noise=0.002 * np.eye(4))
    odd = np.flatnonzero(table.direction == 3)[:4]
    F = table.F.copy()
    F[odd] += way
    found = windows_used_again(dataclasses.replace(table, F=F), rejected(table))[table.direction == 3]
    np.testing.assert_array_equal(found, np.arange(10) >= 4)


@pytest.mark.parametrize(("n", "looked_at"), [(2, False), (3, True)])
def test_three_windows_are_enough_to_be_looked_at(n, looked_at):
    table = directions(4, (12, 12, 12, n, 12, 12, 12))
    found = windows_used_again(table, rejected(table))
    np.testing.assert_array_equal(found[table.direction == 3], float(looked_at))
    np.testing.assert_array_equal(found[table.direction != 3], 1.0)


def test_a_direction_heard_by_less_than_a_fifth_is_doubtful():
    table = directions(5, (12,) * 7)
    weights = rejected(table)
    weights[np.flatnonzero(table.direction == 3)[:2]] = 1.0
    assert (windows_used_again(table, weights)[table.direction == 3] == 1.0).all()


def test_where_the_others_have_too_few_repeats_nothing_is_changed():
    table = directions(6, (3, 3, 3))
    weights = rejected(table, 1)
    np.testing.assert_array_equal(windows_used_again(table, weights), weights)
