"""The default method on windows alone: exact limits, symmetry of cause and effect, directions that stand apart."""

import dataclasses

import numpy as np
import pytest

from tests.phasors.phasor_cases import NOISE, H, complex_normal, hermitian, windows
from tests.seeds import first_quick
from tpjb_ident.estimate.window_means import LOCKED, aligned, attenuation
from tpjb_ident.estimators.estimate import estimate_table, solved_windows
from tpjb_ident.estimators.r_matrix import complex_to_real_covariance, displacement_condition, phasor_table


def solved(table, weights=None):
    start = np.linalg.lstsq(table.D, table.F, rcond=None)[0].T
    return solved_windows(table, start, np.ones(len(table)) if weights is None else weights)


def means(table):
    """Displacements and forces of the directions, (g, 2) each."""
    rows = [table.direction == g for g in range(table.n_directions)]
    return tuple(np.array([z[row].mean(axis=0) for row in rows]) for z in (table.D, table.F))


def test_without_noise_on_displacements_it_is_least_squares_of_the_means():
    table = windows(2, noise=np.diag([1e-14, 1e-14, 1e-2, 1e-2]).astype(complex))
    result = solved(table)
    # windows are judged one by one: the mean of those that count
    weight = result.weights[:, None] / np.bincount(table.direction, weights=result.weights)[table.direction][:, None]
    D, F = (np.array([(weight * z)[table.direction == g].sum(axis=0) for g in range(6)]) for z in (table.D, table.F))
    plain = np.linalg.lstsq(D, F, rcond=None)[0].T
    width = np.sqrt(np.diag(result.covariance)).reshape(2, 2, 2)
    assert (np.abs(result.h - plain).reshape(2, 2) < 0.7 * np.hypot(*width)).all()


def test_exchanging_cause_and_effect_inverts_h():
    table = windows(5)
    turned = dataclasses.replace(table, D=table.F, F=table.D)
    result, back = solved(table), solved(turned)
    width = np.sqrt(np.diag(result.covariance)).max()
    # but for the scatter from run to run, which is the force's
    assert np.abs(np.linalg.inv(back.h) - result.h).max() < 0.5 * width


@pytest.mark.slow
def test_noise_of_the_displacements_does_not_pull_h_towards_zero():
    noise = np.diag([0.15, 0.15, 1e-4, 1e-4]).astype(complex)
    errors, pulls = [], []
    for seed in range(12):
        table = windows(seed, n=60, noise=noise)
        errors.append(solved(table).h * table.h_scale - H)
        pulls.append(np.linalg.lstsq(table.D, table.F, rcond=None)[0].T * table.h_scale - H)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.25 * np.abs(np.mean(pulls, axis=0)).max()


def test_attenuation_is_noise_over_noise_and_signal():
    """Unit signal in both directions, noise power p on one window: a regression loses p / (1 + p) of it."""
    D = np.array([[1, 0], [0, 1], [1, 0], [0, 1]], dtype=complex) * np.sqrt(2)
    power = 0.25
    found = attenuation(D, np.full(4, 1e9), power * np.eye(2, dtype=complex))
    np.testing.assert_allclose(found, power / (1 + power), rtol=1e-6)


@pytest.mark.slow
def test_where_directions_agree_the_interval_is_that_of_generalised_least_squares():
    """Covariance (sum V^-1 (x) D* D)^-1, V of F - H D, by the noise that was put in."""
    noise = 1e-4 * hermitian(np.random.default_rng(27), 4)
    ratios = []
    for seed in range(10):
        table = windows(seed, n=40, noise=noise)
        scales = np.diag(1 / np.array([table.d_scale, table.d_scale, table.f_scale, table.f_scale]))
        result = solved(table)
        A = np.concatenate([-result.h, np.eye(2)], axis=1) @ scales
        V = A @ noise @ A.conj().T / 40
        D = means(table)[0]
        expected = complex_to_real_covariance(np.kron(V, np.linalg.inv(D.conj().T @ D)))
        ratios.append(np.diag(result.covariance) / np.diag(expected))
    # a scatter is never negative: where runs agree by chance it adds a little
    np.testing.assert_allclose(np.median(ratios, axis=0), 1.2, atol=0.3)


@pytest.mark.parametrize(("g", "n", "told"), [(2, 5, True), (2, 4, False), (8, 2, True), (7, 2, False)])
def test_eight_spare_repeats_make_a_noise_of_four_components(g, n, told):
    assert (solved(windows(14, g, n)) is not None) is told


def apart(directions, off):
    """Windows of some directions, the fourth of which is off; which windows are its."""
    table = windows(19, g=directions, n=12, noise=0.05 * NOISE)
    mine = table.direction == 3
    return dataclasses.replace(table, F=table.F + off * mine[:, None]), mine


@pytest.mark.parametrize("directions", [7, 9])
def test_one_direction_of_many_that_stands_apart_has_no_weight(directions):
    table, mine = apart(directions, 0.5)
    result = solved(table)
    np.testing.assert_allclose(result.weights[mine], 0.0, atol=1e-3)
    assert result.weights[~mine].mean() > 0.8
    np.testing.assert_allclose(result.h * table.h_scale, H, atol=0.05)


def test_of_four_directions_nobody_can_say_which_is_wrong():
    (table, mine), (quiet, _) = apart(4, 0.3), apart(4, 0.0)
    result, calm = solved(table), solved(quiet)
    assert result.weights[mine].mean() > 0.5
    assert np.trace(result.covariance) > 30 * np.trace(calm.covariance)


def stiffer_runs(seed, g, size):
    """Windows of runs whose bearing is stiffer or softer by `size`, relative, its damping the same."""
    rng = np.random.default_rng([3, seed])
    angle = np.pi * np.arange(g) / g
    F = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.exp(2j * np.pi * rng.random(g))[:, None]
    D = np.array([np.linalg.solve(H + size * rng.standard_normal() * H.real, f) for f in F])
    z = np.repeat(np.concatenate([D, F], axis=1), 8, axis=0)
    z = z + 1e-4 * complex_normal(rng, *z.shape)
    return phasor_table(z[:, :2], z[:, 2:], np.repeat(np.arange(g), 8))


@pytest.mark.slow
def test_runs_that_differ_in_stiffness_widen_its_interval_and_hardly_that_of_damping():
    inside, widths = [], []
    truth = np.concatenate([H.real.ravel(), H.imag.ravel()])
    for seed in range(60):
        table = stiffer_runs(seed, 8, 0.01)
        result = solved(table)
        h = np.concatenate([result.h.real.ravel(), result.h.imag.ravel()]) * table.h_scale
        width = 1.96 * np.sqrt(np.diag(result.covariance)) * table.h_scale
        inside.append(np.abs(h - truth) < width)
        widths.append(width)
    inside, widths = np.array(inside), np.median(widths, axis=0)
    assert inside[:, [0, 3]].mean() > 0.9
    assert (widths[[4, 7]] < 0.5 * widths[[0, 3]]).all()


@pytest.mark.parametrize(("beyond", "wandering"), [(0.01, 0), (-0.01, 6)])
def test_a_drive_wanders_below_a_limit_of_its_mean_phase(beyond, wandering):
    table = windows(15, noise=1e-6 * np.eye(4))
    z = np.concatenate([table.D, table.F], axis=1)
    turn = np.exp(1j * np.arccos(LOCKED + beyond) * np.where(np.arange(240) % 2, 1, -1))
    assert aligned(z * turn[:, None], table.direction, np.ones(240))[1] == wandering


def test_condition_is_the_ratio_of_the_axes():
    assert displacement_condition(np.array([[3.0, 0.0], [0.0, 1.0j]])) == pytest.approx(3.0)
    assert displacement_condition(np.array([[3.0, 0.0], [0.0, 1.0j]]), np.array([1.0, 9.0])) == pytest.approx(1.0)
    assert displacement_condition(np.array([[3.0, 1.0]])) == np.inf
    assert displacement_condition(np.array([[3.0, 1.0], [6.0, 2.0]])) == np.inf


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
    np.testing.assert_allclose(est.covariance, est.covariance.T)
    assert np.linalg.eigvalsh(est.covariance / est.covariance.max())[0] > 0
    assert est.standard_error.min() > 0.05 * np.abs(H).min()  # as far as the directions differ
