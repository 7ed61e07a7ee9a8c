"""Exact limits and published values of the estimators' parts: constants, covariance, RLM, MM."""

import numpy as np
import pytest
from statsmodels.robust.scale import HuberScale

from tests.phasors.phasor_cases import H, complex_normal
from tpjb_ident.estimate.scatter import mixed_dof
from tpjb_ident.estimate.statistics import (
    bisquare_weight,
    efficiency_constant,
    half_shrinkage,
    trimming_limits,
    trimming_weight,
)
from tpjb_ident.estimators.estimate import ComplexInputError, RlmSettings, rlm_fit, solve_rlm
from tpjb_ident.estimators.r_matrix import real_rows


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
    F = D @ H.T + 0.05 * complex_normal(rng, 9, 2)
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
