"""Where the interval of H comes from, and who is heard: exact limits of covariances, and starts."""

import dataclasses

import numpy as np
import pytest

from tests.phasors.phasor_cases import H, complex_normal, windows
from tests.seeds import first_quick
from tpjb_ident.estimate.window_means import LOCKED, aligned
from tpjb_ident.estimators.estimate import estimate_table
from tpjb_ident.estimators.least_trimmed import Regression, evenly_chosen, mm_fit, robust_start
from tpjb_ident.estimators.r_matrix import complex_to_real_covariance, displacement_condition


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


@pytest.mark.parametrize("method", first_quick("ols", "mm"))
def test_where_windows_agree_but_for_noise_every_method_has_the_interval_of_its_scatter(method):
    """Noise of the forces alone, over the inverse Gram matrix of all windows; a scatter of runs is never negative."""
    noise = np.diag([1e-14, 1e-14, 2.5e-3, 2.5e-3]).astype(complex)
    ratios = []
    for seed in range(10):
        table = windows(seed, n=40, noise=noise)
        est = estimate_table(table, 160.0, method)
        gram = np.linalg.inv(table.D.conj().T @ table.D)
        known = 2.5e-3 * complex_to_real_covariance(np.kron(np.eye(2), gram)) / table.d_scale**2
        ratios.append(np.diag(est.covariance) / np.diag(known))
    np.testing.assert_allclose(np.median(ratios, axis=0), 1.7, atol=0.5)


@pytest.mark.parametrize("method", ["ols", "mm", "mm-eiv"])
def test_directions_that_contradict_one_another_a_million_times_have_wide_intervals(method):
    """Noise of 1e-6 beside forces that no h explains."""
    rng = np.random.default_rng(4)
    table = windows(3, n=8, noise=1e-12 * np.eye(4))
    off = complex_normal(rng, 6, 2)[table.direction]
    est = estimate_table(dataclasses.replace(table, F=table.F + off), 160.0, method)
    assert np.linalg.eigvalsh(est.covariance / est.covariance.max())[0] > 0
    assert est.standard_error.min() > 0.05 * np.abs(H).min()  # as far as the directions differ
