"""The robust joint regression and its start: units, noise of any size, cores."""

import numpy as np
import pytest
from scipy.stats import chi2

from tests.phasors.phasor_cases import H, complex_normal
from tests.seeds import first_quick
from tpjb_ident.estimate.statistics import bisquare_weight, efficiency_constant
from tpjb_ident.estimators import least_trimmed
from tpjb_ident.estimators.least_trimmed import MANY_WINDOWS, Regression, distance2, evenly_chosen, mm_fit, robust_start


def windows(seed, n=60, g=6, noise=0.1, bad=10):
    rng = np.random.default_rng(seed)
    X = complex_normal(rng, n, 2)
    Y = X @ H.T + noise * complex_normal(rng, n, 2)
    Y[:bad] += 3.0 * complex_normal(rng, bad, 2)
    return X, Y, np.arange(n) % g


def runs(seed, g=6, n=20, wobble=0.02, noise=0.01):
    """Windows of g runs, n each, about a motion of their own; and the generator."""
    rng = np.random.default_rng(seed)
    label = np.repeat(np.arange(g), n)
    X = complex_normal(rng, g, 2)[label] + wobble * complex_normal(rng, g * n, 2)
    return X, X @ H.T + noise * complex_normal(rng, g * n, 2), label, rng


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
        distance = distance2(regression.residual(fit.coefficients), fit.scatter)
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
        share.append(
            np.mean(distance2(Regression(X, Y).residual(start.coefficients), start.scatter) < chi2.ppf(0.99, 4))
        )
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
    X, _, label, rng = runs(seed, wobble=0.05)
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
        found, exact = least_trimmed._concentrated(regression, seeds, 0.5, 1.0)
        assert exact
        np.testing.assert_allclose(regression.fit(found), H, atol=1e-9)


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
    X, Y, label, rng = runs(12, wobble=0.005)
    Y += 0.3 * complex_normal(rng, 6, 2)[label]
    start = robust_start(Regression(X, Y), label, 1)
    accepted = distance2(Regression(X, Y).residual(start.coefficients), start.scatter) < chi2.ppf(0.99, 4)
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


@pytest.mark.parametrize(("noise", "between"), first_quick((0.01, 0.02), (0.0, 0.0), (0.02, 0.0)))
def test_windows_of_a_direction_that_few_runs_have_are_no_outliers(noise, between):
    """Twelve runs along one line, two along another: without those two, H is fitted to what runs differ by."""
    label = np.repeat(np.arange(14), 20)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        along = np.array([[1.0, 0.1j], [0.2, 0.8 - 0.3j]])[(label >= 12).astype(int)]
        X = along + 0.05 * complex_normal(rng, 14, 2)[label]
        Y = X @ H.T + between * complex_normal(rng, 14, 2)[label] + noise * complex_normal(rng, 280, 2)
        fit = mm_fit(X, Y, label)
        np.testing.assert_allclose(fit.coefficients, H, atol=max(noise + 2 * between, 1e-9))
        assert (fit.weights[label >= 12] > 0.3).mean() > 0.9


@pytest.mark.parametrize("share", [0.3, 0.45])
def test_bad_windows_with_one_and_the_same_disturbance_do_not_win(share):
    X, Y, label, rng = runs(17, 8, 15, noise=0.02)
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
    X, Y, label = windows(18, n=72, noise=0.05, bad=20)
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
    X, Y, label = windows(21, 40, 5, noise=0.0, bad=0)
    Y[:10] += 2.6e-9
    Y[10] *= 30.0
    fit = mm_fit(X, Y, label)
    np.testing.assert_array_equal(fit.weights, np.arange(40) > 10)
    np.testing.assert_allclose(fit.coefficients, H, atol=1e-9)
    assert fit.conditions == ("zero-scale",)
    assert "29 of 40 windows" in fit.conditions[0].detail
    assert fit.iterations == 0


def test_a_fit_that_is_not_left_to_settle_says_so():
    X, Y, label = windows(22, 40, 5, bad=0)
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
    X, Y, label, rng = runs(28)
    bad = np.arange(120) % 20 >= 9  # eleven of twenty in every direction
    Y[bad] += 5.0 * complex_normal(rng, bad.sum(), 2)
    start = robust_start(Regression(X, Y), label, 1)
    np.testing.assert_allclose(start.coefficients, H, atol=0.03)
    assert np.trace(start.scatter).real < 10 * 2 * 0.01**2


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
