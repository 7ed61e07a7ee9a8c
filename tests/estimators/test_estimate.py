"""The estimators and their parts: exact answers, invariances, named conditions, refusals, published values."""

import tracemalloc

import numpy as np
import pytest
from statsmodels.robust import norms
from statsmodels.robust.robust_linear_model import RLM
from statsmodels.robust.scale import HuberScale

from tests.phasors.phasor_cases import FILM_H as H
from tests.phasors.phasor_cases import OMEGA, complex_normal
from tests.phasors.phasor_cases import H as H_UNIT
from tests.rigs import estimator_cases
from tpjb_ident.estimate.scatter import mixed_dof
from tpjb_ident.estimate.statistics import (
    bisquare_weight,
    efficiency_constant,
    half_shrinkage,
    trimming_limits,
    trimming_weight,
)
from tpjb_ident.estimators.estimate import (
    METHODS,
    NORMS,
    SOLVERS,
    ComplexInputError,
    RlmSettings,
    estimate_dynamic_stiffness,
    rlm_fit,
    solve_rlm,
)
from tpjb_ident.estimators.r_matrix import r_matrix, real_rows


def sample(seed: int, directions: int = 6, windows: int = 10, noise: float = 0.02, bad: float = 0.0):
    rng = np.random.default_rng(seed)
    angle = np.arange(directions) * np.pi / directions
    phase = np.exp(2j * np.pi * rng.random(directions))[:, None]
    command = 500 * np.stack([np.cos(angle), np.sin(angle)], axis=1) * phase
    label = np.repeat(np.arange(directions), windows)
    F = command[label]
    D = np.linalg.solve(H, F.T).T
    size = np.sqrt(np.mean(np.abs(D) ** 2))
    n = len(label)
    wobble = rng.standard_normal((n, 4)) + 1j * rng.standard_normal((n, 4))
    D = D + noise * size * wobble[:, :2]
    F = F + noise * 200 * wobble[:, 2:]
    D[rng.random(n) < bad] *= 5.0j
    return D, F, label, command[label]


def run(method: str, D, F, label, command, omega: float = OMEGA):
    reference = command if method == "iv" else None
    return estimate_dynamic_stiffness(D, F, omega, label, method=method, reference=reference)


@pytest.mark.parametrize("method", METHODS)
def test_noise_free_phasors_give_h_exactly(method: str):
    est = run(method, *sample(1, noise=0.0))
    np.testing.assert_allclose(est.h, H, rtol=1e-9, atol=1e-9 * np.abs(H).max())
    np.testing.assert_allclose(est.k, H.real, rtol=1e-6, atol=10)
    np.testing.assert_allclose(est.c, H.imag / OMEGA, rtol=1e-6, atol=0.1)


@pytest.mark.parametrize("method", ["mm", "mm-eiv", "iv"])
def test_exact_windows_outvote_wrong_ones(method: str):
    est = run(method, *sample(2, noise=0.0, bad=0.2))
    np.testing.assert_allclose(est.h, H, rtol=1e-9, atol=1e-9 * np.abs(H).max())
    assert "zero-scale" in est.status


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bad", [0.0, 0.15])
def test_h_follows_axes_phase_and_units_exactly(method: str, bad: float):
    D, F, label, command = sample(3, bad=bad)
    base = run(method, D, F, label, command)
    size = np.abs(base.h).max()
    tolerance = 1e-9 * size
    turn = np.exp(0.63j)
    if method not in ("rlm",):  # RLM weights Re and Im apart: its answer depends on the phase reference
        turned = run(method, D * turn, F * turn, label, command * turn)
        np.testing.assert_allclose(turned.h, base.h, rtol=0, atol=tolerance)
        np.testing.assert_allclose(turned.standard_error, base.standard_error, rtol=1e-6)
        a = 0.4
        R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        rotated = run(method, D @ R.T, F @ R.T, label, command @ R.T)
        np.testing.assert_allclose(rotated.h, R @ base.h @ R.T, rtol=0, atol=tolerance)
    scaled = run(method, D * 1e6, F * 1e-3, label, command)
    np.testing.assert_allclose(scaled.h * 1e9, base.h, rtol=0, atol=tolerance)


def test_order_of_windows_and_names_of_directions_do_not_matter():
    D, F, label, command = sample(4)
    names = np.array([f"run-{9 - i}" for i in label])
    first = run("mm-eiv", D, F, names, command)
    order = np.random.default_rng(0).permutation(len(D))
    second = run("mm-eiv", D[order], F[order], names[order], command[order])
    np.testing.assert_allclose(second.h, first.h, rtol=0, atol=1e-6 * np.abs(H).max())
    np.testing.assert_allclose(second.weights, first.weights[order], atol=1e-4)


def test_r_matrix_is_eq_14_row_by_row():
    D = np.array([[1 + 1j, 2.0], [3.0, 4j]])
    F = D @ H.T
    R, f = r_matrix(D, F)
    assert R.shape == (4, 4)
    np.testing.assert_array_equal(R[0], [1 + 1j, 2, 0, 0])
    np.testing.assert_array_equal(R[3], [0, 0, 3, 4j])
    np.testing.assert_allclose(R @ H.ravel(), f)
    real, response = real_rows(R, f)
    unknown = np.concatenate([H.ravel().real, H.ravel().imag])
    np.testing.assert_allclose(real @ unknown, response)
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        r_matrix(D, F[:1])


def test_conditions_are_named():
    D, F, label, command = sample(6)
    one = run("mm-eiv", D[:10], F[:10], label[:10], command[:10])
    assert "fewer-than-two-directions" in one.status
    assert np.isnan(one.h).all()
    collinear = D.copy()
    collinear[:, 1] = 2 * collinear[:, 0]
    assert "fewer-than-two-directions" in run("ols", collinear, F, label, command).status
    single = estimate_dynamic_stiffness(D, F, OMEGA)  # every window a direction of its own
    assert "no-repeats" in single.status
    few = run("mm", *sample(7, directions=3, windows=1))
    assert "no-robust-start" in few.status
    assert run("mm-eiv", *sample(9)).status == ()


def test_missing_windows_keep_their_place_in_the_weights():
    D, F, label, command = sample(10)
    D[7] = np.nan
    F[20, 1] = np.inf
    est = run("mm-eiv", D, F, label, command)
    assert est.weights.shape == (60, 2)
    assert est.weights[[7, 20]].max() == 0
    np.testing.assert_allclose(est.h, H, atol=0.03 * np.abs(H).max())


def test_arguments_are_checked():
    D, F, label, _ = sample(11)
    assert set(SOLVERS) == set(METHODS)
    with pytest.raises(ValueError, match="Did you mean 'mm-eiv'"):
        estimate_dynamic_stiffness(D, F, OMEGA, label, method="mm-eif")
    with pytest.raises(ValueError, match="Did you mean 'huber'"):
        estimate_dynamic_stiffness(D, F, OMEGA, label, method="rlm", norm="hubert")
    with pytest.raises(ValueError, match="belongs to"):
        estimate_dynamic_stiffness(D, F, OMEGA, label, norm="huber")
    for wrong in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="omega must be a positive number"):
            estimate_dynamic_stiffness(D, F, wrong, label)
    with pytest.raises(ValueError, match="needs reference"):
        estimate_dynamic_stiffness(D, F, OMEGA, label, method="iv")


def test_pint_quantities_are_converted_and_wrong_ones_named():
    import pint

    ureg = pint.UnitRegistry()
    D, F, label, _ = sample(12)
    plain = estimate_dynamic_stiffness(D, F, OMEGA, label)
    est = estimate_dynamic_stiffness(D * 1e6 * ureg.um, F / 1e3 * ureg.kN, 60 * OMEGA * ureg.rad / ureg.min, label)
    np.testing.assert_allclose(est.h, plain.h, rtol=1e-9)
    assert est.omega == pytest.approx(OMEGA, rel=1e-12)
    by_cycles = estimate_dynamic_stiffness(D, F, OMEGA / (2 * np.pi) * ureg.Hz, label)
    assert by_cycles.omega == pytest.approx(OMEGA, rel=1e-12)
    with pytest.raises(ValueError, match=r"F: .* is not a force"):
        estimate_dynamic_stiffness(D, F * ureg.m, OMEGA, label)


@pytest.mark.parametrize("norm", sorted(set(NORMS) - {"bisquare"}))
def test_rlm_is_what_statsmodels_says(norm: str):
    D, F, label, _ = sample(14, noise=0.05, bad=0.05)
    est = estimate_dynamic_stiffness(D, F, OMEGA, label, method="rlm", norm=norm)
    d, f = np.median(np.linalg.norm(D, axis=1)), np.median(np.linalg.norm(F, axis=1))
    own_norm = {
        "student": lambda: norms.StudentT(c=1.0, df=4.0),
        "mquantile": lambda: norms.MQuantileNorm(0.5, norms.HuberT()),
    }.get(norm, getattr(norms, NORMS[norm]))
    for axis in range(2):
        design, response = real_rows(D / d, F[:, axis] / f)
        own = RLM(response, design, M=own_norm()).fit(maxiter=200, tol=1e-10, conv="coefs")
        h = (own.params[:2] + 1j * own.params[2:]) * f / d
        np.testing.assert_allclose(est.h[axis], h, rtol=1e-12)
        np.testing.assert_allclose(est.standard_error[[2 * axis, 2 * axis + 1]], own.bse[:2] * f / d, rtol=1e-10)


@pytest.mark.parametrize(("norm", "name"), [("huber", "HuberT"), ("tukey", "TukeyBiweight")])
def test_without_statsmodels_it_is_statsmodels_to_the_last_bit(norm: str, name: str):
    rng = np.random.default_rng(4)
    for n, noise, bad in ((6, 1e-3, 0.0), (40, 0.1, 0.1), (161, 1.0, 0.2)):
        design = rng.standard_normal((n, 4))
        response = design @ rng.standard_normal(4) + noise * rng.standard_normal(n) * (1 + 20 * (rng.random(n) < bad))
        found = solve_rlm(design, response, RlmSettings(norm, quick=True))
        own = RLM(response, design, M=getattr(norms, name)()).fit(maxiter=200, tol=1e-10, conv="coefs")
        for what, value in (("params", own.params), ("weights", own.weights)):
            np.testing.assert_array_equal(getattr(found, what), value)
        assert (found.scale, found.iterations) == (own.scale, own.fit_history["iteration"])


def test_rlm_traps_are_guarded():
    D, F, _, _ = sample(15, noise=0.05)
    d, f = np.abs(D).max(), np.abs(F).max()
    short = rlm_fit(D / d, F / f, RlmSettings(max_iterations=2))
    assert "iteration-limit" in short.conditions
    D, F, _, _ = sample(16, noise=0.0)
    assert "zero-scale" in rlm_fit(D / np.abs(D).max(), F / np.abs(F).max()).conditions


@pytest.mark.slow
def test_thousands_of_windows_start_from_a_share_of_them():
    """Two robust answers from 2400 windows, 30 % of them bad: within 0.3 %, and memory for hundreds, not thousands."""
    sample = estimator_cases.draw(estimator_cases.Case("lev", 0.3, windows=300), 4, 1)
    for method in ("mm-eiv", "iv"):
        reference = sample.command if method == "iv" else None
        tracemalloc.start()
        given = sample.D, sample.F, estimator_cases.OMEGA, sample.direction
        est = estimate_dynamic_stiffness(*given, method=method, reference=reference)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        true = estimator_cases.H_TRUE
        assert np.linalg.norm(est.h - true) < 3e-3 * np.linalg.norm(true)
        assert peak < 35e6


def test_bisquare_constant_is_the_published_one():
    """4.685 for 95 % efficiency of a real residual (Holland and Welsch 1977); 3.444 for 85 %."""
    assert efficiency_constant(1) == pytest.approx(4.685, abs=5e-4)
    assert efficiency_constant(1, 0.85) == pytest.approx(3.444, abs=1e-3)


def test_bisquare_weight_at_its_edges():
    np.testing.assert_allclose(bisquare_weight(np.array([0.0, 1.0, 2.0, 3.0]), 2.0), [1.0, 0.5625, 0.0, 0.0])


def test_half_of_two_dimensions_is_one_less_ln_two():
    """Chi-square with two degrees of freedom is exponential: 1 - ln 2 for the inner half; all of it is one."""
    assert half_shrinkage(2, 0.5) == pytest.approx(1 - np.log(2), rel=1e-12)
    assert half_shrinkage(4, 1 - 1e-12) == pytest.approx(1.0, abs=1e-9)


def test_trimming_limits_are_quantiles_and_the_shrinkage_that_of_draws():
    lower, upper, shrinkage = trimming_limits(2)
    assert lower == pytest.approx(-2 * np.log(0.01))
    assert upper == pytest.approx(-2 * np.log(1e-4))
    u2 = np.random.default_rng(1).chisquare(2, 400_000)
    w = trimming_weight(u2, lower, upper)
    assert shrinkage == pytest.approx((w * u2).sum() / (2 * w.sum()), rel=5e-3)
    assert 0.93 < shrinkage < 1.0


def test_trimming_weight_is_symmetric_about_the_middle():
    at = np.array([0.0, 2.0, 2.5, 3.0, 3.5, 4.0, 9.0])
    weight = trimming_weight(at, 2.0, 4.0)
    np.testing.assert_allclose(weight[[0, 1, 3, 5, 6]], [1.0, 1.0, 0.5, 0.0, 0.0])
    assert weight[2] + weight[4] == pytest.approx(1.0)


def test_degrees_of_freedom_in_the_limits():
    between, one = np.full(8, 4.0), np.ones(8)
    np.testing.assert_allclose(mixed_dof(one, one, 30.0, between), 30.0)
    np.testing.assert_allclose(mixed_dof(one, 0 * one, 30.0, between), 4.0)
    np.testing.assert_allclose(mixed_dof(2 * one, one, 4.0, between), 8.0)
    np.testing.assert_allclose(mixed_dof(0 * one, 0 * one, 30.0, between), 30.0)
    np.testing.assert_allclose(mixed_dof(one, one, 0.2, between), 1.0)


def test_either_complex_argument_is_refused_by_rlm():
    design, response = np.eye(4)[:, :2], np.arange(4.0)
    for a, b in ((design + 0j, response), (design, response + 0j)):
        with pytest.raises(ComplexInputError, match="Stack real and imaginary"):
            solve_rlm(a, b)


def test_rlm_scales_are_those_of_the_normal_law():
    """Both estimate the standard deviation of normal errors."""
    rng = np.random.default_rng(13)
    design = np.column_stack([np.ones(2000), rng.standard_normal(2000)])
    response = design @ [1.0, 2.0] + 0.5 * rng.standard_normal(2000)
    found = {str(s): solve_rlm(design, response, RlmSettings(scale=s)).scale for s in ("mad", HuberScale())}
    for scale in found.values():
        assert scale == pytest.approx(0.5, rel=0.05)
    assert len(set(found.values())) == 2


def test_rlm_of_two_axes_keeps_places_weights_and_freedom():
    rng = np.random.default_rng(14)
    D = complex_normal(rng, 9, 2)
    F = D @ H_UNIT.T + 0.05 * complex_normal(rng, 9, 2)
    F[4, 0] += 3j
    fit = rlm_fit(D, F)
    assert fit.weights[4, 0] < 0.3
    assert fit.weights[4, 1] > 0.5
    np.testing.assert_array_equal(fit.dof, 14.0)
    design, response = real_rows(D, F[:, 1])
    own = solve_rlm(design, response)
    rows = np.array([2, 3, 6, 7])
    np.testing.assert_array_equal(fit.covariance[np.ix_(rows, rows)], own.covariance)
    np.testing.assert_array_equal(fit.covariance[np.ix_(rows, [0, 1, 4, 5])], 0.0)
    np.testing.assert_array_equal(fit.h[1], own.params[:2] + 1j * own.params[2:])
