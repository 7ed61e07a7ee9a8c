"""Where the interval of H comes from, and who is heard: exact limits of covariances, and starts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from tests.dynamic.phasor_cases import H, complex_normal, hermitian, windows
from tpjb_ident.dynamic.estimators.least_trimmed import (
    Regression,
    distance2,
    evenly_chosen,
    products,
    robust_start,
    scatter,
)
from tpjb_ident.dynamic.estimators.mm import mm_fit
from tpjb_ident.dynamic.estimators.r_matrix import displacement_condition, phasor_table
from tpjb_ident.dynamic.estimators.uncertainty import (
    VarianceByDirection,
    complex_to_real_covariance,
    spread_of,
    with_repeats,
)
from tpjb_ident.estimate.window_means import LOCKED, aligned


def balanced_scores(g):
    """Scores of g directions, all eight parts of one size, that sum to zero: signs of a Hadamard matrix."""
    signs = np.array([[1]])
    while len(signs) < g:
        signs = np.block([[signs, signs], [signs, -signs]])
    columns = signs[:, 1:9].astype(float)
    return columns[:, :4] + 1j * columns[:, 4:]


def test_leaving_directions_out_gives_the_variance_of_a_mean():
    """Equal parts of the equations: H is a mean over directions, its variance the sample's over g."""
    g = 16
    score = 0.01 * balanced_scores(g)
    parts = np.broadcast_to(np.eye(4, dtype=complex), (g, 4, 4))
    repeat = 1e-14 * np.eye(4, dtype=complex)
    covariance, dof = spread_of(VarianceByDirection(score, parts, repeat, 100.0), 1e6)
    expected = 0.01**2 / (g * (g - 1)) * g * np.eye(8)
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-12)
    # all directions say the same of the variance: as many degrees of freedom as a mean has
    np.testing.assert_allclose(dof, g - 1, rtol=1e-6)


def test_repeat_noise_is_what_remains_where_directions_agree_better_than_it():
    g = 16
    parts = np.broadcast_to(np.eye(4, dtype=complex), (g, 4, 4))
    repeat = hermitian(np.random.default_rng(1), 4)
    known = complex_to_real_covariance(repeat)
    covariance, dof = spread_of(VarianceByDirection(1e-6 * balanced_scores(g), parts, repeat, 40.0), 1e6)
    np.testing.assert_allclose(covariance, known, rtol=1e-9)
    np.testing.assert_allclose(dof, 40.0, rtol=1e-6)
    for chi_square in (0.3, 1.0, np.nan):
        covariance, dof = spread_of(VarianceByDirection(100 * balanced_scores(g), parts, repeat, 40.0), chi_square)
        np.testing.assert_array_equal(covariance, known)
        np.testing.assert_array_equal(dof, 40.0)
    two = VarianceByDirection(balanced_scores(16)[:2], parts[:2], repeat, 0.2)
    covariance, dof = spread_of(two, 9.0)
    np.testing.assert_array_equal(covariance, known)
    np.testing.assert_array_equal(dof, 1.0)


def test_what_directions_add_grows_with_the_doubt_and_is_whole_at_its_95_per_cent():
    g = 16
    parts = np.broadcast_to(np.eye(4, dtype=complex), (g, 4, 4))
    repeat = 1e-5 * hermitian(np.random.default_rng(2), 4)
    known = complex_to_real_covariance(repeat)
    sure = chi2.ppf(0.95, 4 * (g - 2)) / (4 * (g - 2))

    def added(chi_square):
        shares = VarianceByDirection(0.3 * balanced_scores(g), parts, repeat, 40.0)
        return spread_of(shares, chi_square)[0] - known

    whole = added(sure)
    np.testing.assert_allclose(added(1 + 0.25 * (sure - 1)), 0.25 * whole, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(added(3 * sure), whole, rtol=1e-9)
    assert np.linalg.eigvalsh(whole).min() > -1e-12


def exact_repeats(seed, g=6, n=10, scale=0.05):
    """Windows whose direction means lie exactly on F = H D: all scatter is repeat noise."""
    rng = np.random.default_rng(seed)
    D = complex_normal(rng, g, 2)
    off = scale * complex_normal(rng, g, n, 2)
    off = off - off.mean(axis=1, keepdims=True)
    F = (D @ H.T)[:, None, :] + off
    return phasor_table(np.repeat(D, n, axis=0), F.reshape(-1, 2), np.repeat(np.arange(g), n))


def test_covariance_of_equal_repeats_is_noise_times_inverse_gram():
    table = exact_repeats(3)
    h = H / table.h_scale
    residual = table.F - table.D @ h.T
    noise = residual.T @ residual.conj() / (60 - 6)
    inverse = np.linalg.inv(table.D.conj().T @ table.D)
    covariance, dof, chi_square = with_repeats(table, h, np.ones(60))
    np.testing.assert_allclose(covariance, complex_to_real_covariance(np.kron(noise, inverse)), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(dof, 2 * 54)
    assert chi_square < 1e-20
    doubled = with_repeats(table, h, np.ones(60), correction=2.0)
    np.testing.assert_allclose(doubled[0], 2 * covariance, rtol=1e-12)
    # a weight of one half on every window: half as many windows
    half = with_repeats(table, h, np.full(60, 0.5))
    np.testing.assert_allclose(half[0], 2 * covariance * 54 / 60 * (0.5 * 60) / (30 - 6), rtol=1e-9)
    np.testing.assert_allclose(half[1], 2 * (30 - 6))


def test_windows_without_weight_and_their_direction_count_for_nothing():
    table = exact_repeats(4)
    h = H / table.h_scale
    weights = (table.direction != 2).astype(float)
    some = table.direction != 2
    spoilt = dataclasses.replace(table, F=table.F + 50.0 * ~some[:, None])
    left = with_repeats(spoilt, h, weights)
    direction = np.unique(table.direction[some], return_inverse=True)[1]
    without = dataclasses.replace(table, D=table.D[some], F=table.F[some], direction=direction)
    for a, b in zip(left[:2], with_repeats(without, h, np.ones(50))[:2], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)


@pytest.mark.parametrize(("n", "told"), [(1, False), (2, False), (3, True)])
def test_four_spare_repeats_are_needed(n, told):
    """Three directions with 1, 2 and 3 windows: 0, 3 and 6 beyond one per direction."""
    table = exact_repeats(5, g=3, n=n)
    assert (with_repeats(table, H / table.h_scale, np.ones(3 * n)) is not None) is told


def test_a_drive_wanders_below_a_limit_of_its_mean_phase():
    table = windows(15, noise=1e-6 * np.eye(4))
    z = np.concatenate([table.D, table.F], axis=1)
    locked = np.exp(1j * np.arccos(LOCKED + 0.01) * np.where(np.arange(240) % 2, 1, -1))
    assert aligned(z * locked[:, None], table.direction, np.ones(240))[1] == 0
    loose = np.exp(1j * np.arccos(LOCKED - 0.01) * np.where(np.arange(240) % 2, 1, -1))
    assert aligned(z * loose[:, None], table.direction, np.ones(240))[1] == 6


def test_condition_is_the_ratio_of_the_axes():
    assert displacement_condition(np.array([[3.0, 0.0], [0.0, 1.0j]])) == pytest.approx(3.0)
    assert displacement_condition(np.array([[3.0, 0.0], [0.0, 1.0j]]), np.array([1.0, 9.0])) == pytest.approx(1.0)
    assert displacement_condition(np.array([[3.0, 1.0]])) == np.inf
    assert displacement_condition(np.array([[3.0, 1.0], [6.0, 2.0]])) == np.inf


@pytest.mark.parametrize("q", [1, 2, 3])
def test_sums_over_windows_are_those_of_matrices(q):
    """Fits, scatters and distances of many weightings at once, each as a plain formula says."""
    rng = np.random.default_rng(q)
    X, Y = complex_normal(rng, 20, 2), complex_normal(rng, 20, q)
    weights = rng.uniform(0, 1, (3, 20))
    regression = Regression(X, Y)
    fits = regression.fit(weights)
    terms = regression.terms(fits)
    found = scatter(terms, weights, q)
    far = distance2(terms, found)
    for k in range(3):
        root = np.sqrt(weights[k])[:, None]
        np.testing.assert_allclose(fits[k], np.linalg.lstsq(root * X, root * Y, rcond=None)[0].T, rtol=1e-9)
        residual = Y - X @ fits[k].T
        np.testing.assert_allclose(regression.residual(fits[k]), residual)
        own = (weights[k][:, None] * residual).T @ residual.conj() / weights[k].sum()
        np.testing.assert_allclose(found[k], own, rtol=1e-9, atol=1e-14)
        by_hand = 2 * np.einsum("na,ab,nb->n", residual.conj(), np.linalg.inv(own), residual).real
        np.testing.assert_allclose(far[k], by_hand, rtol=1e-7)
    np.testing.assert_allclose(scatter(products(Y.T), np.ones(20), q), Y.T @ Y.conj() / 20, atol=1e-14)


def test_a_share_of_every_direction_is_looked_at():
    direction = np.random.default_rng(2).permutation(np.repeat(np.arange(5), [400, 200, 100, 50, 50]))
    chosen = evenly_chosen(direction, 80)
    assert len(np.unique(chosen)) == 80
    assert (np.diff(chosen) > 0).all()
    np.testing.assert_allclose(np.bincount(direction[chosen]), [40, 20, 10, 5, 5], atol=1)
    for d in range(5):
        places = np.flatnonzero(direction == d)
        rank = np.searchsorted(places, chosen[direction[chosen] == d]) / len(places)
        assert np.ptp(rank) > 0.7
    np.testing.assert_array_equal(evenly_chosen(direction[:80], 80), np.arange(80))


@pytest.mark.parametrize("share", [0.3, 0.45])
def test_bad_windows_with_one_and_the_same_disturbance_do_not_win(share):
    rng = np.random.default_rng(17)
    label = np.repeat(np.arange(8), 15)
    X = complex_normal(rng, 8, 2)[label] + 0.02 * complex_normal(rng, 120, 2)
    Y = X @ H.T + 0.02 * complex_normal(rng, 120, 2)
    bad = rng.permutation(120) < share * 120
    Y[bad] += 3.0 - 2.0j
    fit = mm_fit(X, Y, label)
    np.testing.assert_allclose(fit.coefficients, H, atol=0.04)
    assert (fit.weights[bad] == 0.0).all()
    assert np.mean(fit.weights[~bad] > 0.3) > 0.95
    start = robust_start(Regression(X, Y), label, 1)
    assert not start.exact
    good = (Y - X @ H.T)[~bad]
    np.testing.assert_allclose(np.trace(start.scatter).real, np.mean(np.abs(good) ** 2) * 2, rtol=0.35)


def test_other_starts_lead_to_the_same_answer():
    rng = np.random.default_rng(18)
    label = np.repeat(np.arange(6), 12)
    X = complex_normal(rng, 72, 2)
    Y = X @ H.T + 0.05 * complex_normal(rng, 72, 2)
    Y[:20] += complex_normal(rng, 20, 2) * 4
    fits = [mm_fit(X, Y, label, seed).coefficients for seed in range(5)]
    for fit in fits[1:]:
        np.testing.assert_allclose(fit, fits[0], atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("q", "enough"), [(1, 8), (2, 8), (3, 10), (4, 12)])
def test_a_robust_fit_takes_two_windows_more_than_twice_what_a_core_must_hold(q, enough):
    rng = np.random.default_rng(q)
    X = complex_normal(rng, enough, 2)
    Y = X @ complex_normal(rng, q, 2).T + 0.05 * complex_normal(rng, enough, q)
    label = np.arange(enough) % 4
    few = mm_fit(X[:-1], Y[:-1], label[:-1])
    assert few.conditions == ("no-robust-start",)
    assert few.iterations == 0
    assert "no-robust-start" not in mm_fit(X, Y, label).conditions
    two = mm_fit(X[:2], Y[:2], label[:2])
    np.testing.assert_allclose(two.scatter, 0.0, atol=1e-20)


def test_exact_windows_are_told_by_the_usual_force_not_by_the_wildest():
    rng = np.random.default_rng(21)
    X = complex_normal(rng, 40, 2)
    Y = X @ H.T
    Y[:10] += 2.6e-9
    Y[10] *= 30.0
    fit = mm_fit(X, Y, np.arange(40) % 5)
    np.testing.assert_array_equal(fit.weights, np.arange(40) > 10)
    np.testing.assert_allclose(fit.coefficients, H, atol=1e-9)
    assert fit.conditions == ("zero-scale",)
    assert "29 of 40 windows" in fit.conditions[0].detail
    assert fit.iterations == 0


def test_a_fit_that_is_not_left_to_settle_says_so():
    rng = np.random.default_rng(22)
    X = complex_normal(rng, 40, 2)
    Y = X @ H.T + 0.1 * complex_normal(rng, 40, 2)
    label = np.arange(40) % 5
    endless = mm_fit(X, Y, label, tolerance=-1.0)
    assert endless.iterations == 200
    assert mm_fit(X, Y, label, tolerance=1e9).iterations == 1
    assert endless.conditions == ("iteration-limit",)
    fine, rough = mm_fit(X, Y, label), mm_fit(X, Y, label, tolerance=1e-3)
    assert 1 <= rough.iterations < fine.iterations < 100
    np.testing.assert_allclose(rough.coefficients, fine.coefficients, atol=2e-3)
    np.testing.assert_allclose(endless.coefficients, fine.coefficients, atol=1e-11)
    assert fine.conditions == ()


def test_chi_square_of_directions_is_against_the_noise_within_them():
    table = exact_repeats(25)
    h = H / table.h_scale
    off = 0.02 * complex_normal(np.random.default_rng(26), 6, 2)
    moved_table = dataclasses.replace(table, F=table.F + off[table.direction])
    within = table.F - table.D @ h.T
    noise = within.T @ within.conj() / 54
    by_hand = 10 * np.einsum("ga,ab,gb->", off.conj(), np.linalg.inv(noise), off).real / (2 * 4)
    assert with_repeats(moved_table, h, np.ones(60))[2] == pytest.approx(by_hand, rel=1e-9)


def test_a_tight_core_in_every_direction_is_heard_against_a_scattered_majority():
    rng = np.random.default_rng(28)
    label = np.repeat(np.arange(6), 20)
    X = complex_normal(rng, 6, 2)[label] + 0.02 * complex_normal(rng, 120, 2)
    Y = X @ H.T + 0.01 * complex_normal(rng, 120, 2)
    bad = np.arange(120) % 20 >= 9  # eleven of twenty in every direction
    Y[bad] += 5.0 * complex_normal(rng, bad.sum(), 2)
    start = robust_start(Regression(X, Y), label, 1)
    np.testing.assert_allclose(start.coefficients, H, atol=0.03)
    assert np.trace(start.scatter).real < 10 * 2 * 0.01**2


def test_directions_that_contradict_one_another_a_million_times_have_wide_intervals():
    """Noise of 1e-6 beside forces that no h explains: rounding made the covariance of repeats indefinite."""
    rng = np.random.default_rng(3)
    score, parts = complex_normal(rng, 6, 4), np.tile(np.eye(4, dtype=complex), (6, 1, 1))
    repeat = np.diag([1e-7, 1e-7, 1e-7, -1e-9]).astype(complex)
    covariance, _ = spread_of(VarianceByDirection(score, parts, repeat, 200.0), 1e6)
    assert np.linalg.eigvalsh(covariance)[0] > 0
    assert np.sqrt(np.diag(covariance)).min() > 0.05  # as far as the directions differ
