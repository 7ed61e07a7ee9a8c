"""Exact limits of the pivot code: holds of noise-free programmes, laws at their special shapes, readings and fits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tpjb_ident.pivot.law_fit import CONTACT_GAP, FitData, ShapePrior, fit_law
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.steps import find_holds

RATE = 500.0
U = np.geomspace(0.05, 4.0, 30)


def staircase(levels, hold=1.0, ramp=0.5, start=0.0):
    """Time and load: a ramp to every level and a hold there, no noise."""
    knots, values = [0.0], [start]
    for level in levels:
        knots += [knots[-1] + ramp, knots[-1] + ramp + hold]
        values += [level, level]
    time = np.arange(int(knots[-1] * RATE)) / RATE
    return time, np.interp(time, knots, values)


def test_holds_without_noise_have_their_exact_level_branch_and_length():
    levels = (1000.0, 2000.0, 3000.0, 2000.0, 1000.0)
    holds = find_holds(*staircase(levels))
    assert [hold.level for hold in holds] == pytest.approx(levels)
    assert [hold.branch for hold in holds] == [1, 1, 1, -1, -1]
    for k, hold in enumerate(holds):
        begin = 0.5 + 1.5 * k
        assert begin - 1e-9 <= hold.start < begin + 0.1
        assert begin + 0.9 < hold.stop <= begin + 1.0 + 0.021
        assert hold.duration == hold.stop - hold.start
        assert 0.8 < hold.duration < 1.02


def test_time_and_load_may_be_counted_from_anywhere_and_in_any_unit():
    time, load = staircase((1000.0, 2500.0, 4000.0))
    load = load + 2.0 * np.random.default_rng(1).standard_normal(len(load))
    base = find_holds(time, load)
    later = find_holds(time + 32.0, load * 1024.0)
    assert len(base) == 3
    for a, b in zip(base, later, strict=True):
        assert (b.start - 32.0, b.stop - 32.0) == pytest.approx((a.start, a.stop), abs=1e-9)
        assert b.level == pytest.approx(1024.0 * a.level)
        assert b.branch == a.branch


def shape(name, *values):
    law = LAWS[name]
    q = np.array(values)
    return law.phi(U, q)[0], law.psi(U, q)[0]


@pytest.mark.parametrize(
    ("name", "values", "other"),
    [
        ("hertz-line", (0.0,), "linear"),
        ("power", (1.0,), "linear"),
        ("point-in-series", (1.0,), "linear"),
        ("point-in-series", (0.0,), "hertz-point"),
        ("power", (2 / 3,), "hertz-point"),
        ("bilinear", (0.0, 0.3), "linear"),
    ],
)
def test_laws_turn_into_one_another(name, values, other):
    """At these shapes they are the same law, deflection and compliance."""
    for a, b in zip(shape(name, *values), shape(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def test_a_bilinear_law_has_its_two_compliances_far_from_the_bend():
    u, q = np.array([1e-3, 0.2, 3.0, 50.0]), np.array([np.log(3.0), 0.0])
    np.testing.assert_allclose(LAWS["bilinear"].psi(u, q)[0], [3, 3, 1, 1], rtol=2e-3)
    # after the bend the deflection is behind by what the soft part has given: (r - 1) b
    np.testing.assert_allclose(LAWS["bilinear"].phi(u, q)[0][2:] - u[2:], 2.0, rtol=1e-4)
    assert LAWS["bilinear"].psi(np.array([1.0]), q)[0] == pytest.approx(2.0)


def test_every_prior_lies_inside_its_bounds_and_is_proper():
    for law in LAWS.values():
        low, high = law.bounds
        spread = 1 / np.sqrt(np.diag(law.prior_precision)) if len(low) else np.zeros(0)
        assert len(law.parameters) == len(low) == len(high) == len(law.prior_mean)
        assert ((low <= law.prior_mean) & (law.prior_mean <= high)).all()
        # a prior wider than its bounds would say nothing; one much narrower would decide for the data
        assert (spread < high - low).all()
        assert (spread > 0.05 * (high - low)).all() or law.name == "spline"


def data(load, deflection, branch=None, sigma=1e-9, friction=(0.0, 0.02)):
    whitener = np.eye(len(load)) / sigma
    return FitData(load, deflection, np.ones(len(load)) if branch is None else branch, whitener, 2000.0, friction)


LOAD = np.linspace(250.0, 5000.0, 24)
BOTH = np.r_[LOAD, LOAD[::-1]]
WAY = np.r_[np.ones(24), -np.ones(24)]


def test_a_straight_line_is_found_with_the_error_of_a_straight_line():
    fit = fit_law(LAWS["linear"], False, data(LOAD, 3e-6 + 4e-9 * LOAD, friction=(0.0, 1e-9)))
    assert fit.theta[0] == pytest.approx(3e-6, abs=1e-12)
    assert np.exp(fit.theta[2]) == pytest.approx(4e-9, rel=1e-6)
    design = np.column_stack([np.ones(24), LOAD])
    own = 1e-18 * np.linalg.inv(design.T @ design)
    assert fit.covariance[0, 0] == pytest.approx(own[0, 0], rel=1e-4)
    assert fit.covariance[2, 2] * (4e-9) ** 2 == pytest.approx(own[1, 1], rel=1e-3)
    assert fit.chi_square == pytest.approx(0.0, abs=1e-3)
    assert fit.freedom == 24 - 3


def test_readings_have_the_derivatives_that_are_said():
    given = data(BOTH, 1e-6 + 4e-9 * BOTH**0.95, WAY)
    fit = fit_law(LAWS["power"], True, given)
    theta = fit.theta.copy()
    theta[1], theta[-2] = 0.04, 2e-6
    fit = dataclasses.replace(fit, theta=theta)
    value, jacobian = fit.reading_gradient(BOTH, WAY)
    np.testing.assert_array_equal(value, fit.reading(BOTH, WAY))
    for j, size in enumerate(np.maximum(np.abs(theta), 1e-6) * 1e-5):
        up, down = theta.copy(), theta.copy()
        up[j] += size
        down[j] -= size
        ends = [dataclasses.replace(fit, theta=t).reading(BOTH, WAY) for t in (up, down)]
        numeric = (ends[0] - ends[1]) / (2 * size)
        np.testing.assert_allclose(jacobian[:, j], numeric, rtol=1e-4, atol=1e-6 * np.abs(numeric).max())
    # contact loss is what the reading lacks of the pivot's own deflection, and its slope is the compliance it adds
    lack = theta[0] + fit.deflection(LOAD) - dataclasses.replace(fit, theta=theta).reading(LOAD, np.zeros(24))
    np.testing.assert_allclose(lack, theta[-2] * np.exp(-LOAD / np.exp(theta[-1])), rtol=1e-9)
    np.testing.assert_allclose(fit.missing_compliance(LOAD), lack / np.exp(theta[-1]), rtol=1e-9)


def test_contact_loss_that_is_there_is_found():
    gap, load_0 = 4e-6, 400.0
    given = data(LOAD, 1e-6 + 4e-9 * LOAD - gap * np.exp(-LOAD / load_0))
    fit = fit_law(LAWS["linear"], True, given)
    assert fit.theta[-2] == pytest.approx(gap, rel=0.01)
    assert np.exp(fit.theta[-1]) == pytest.approx(load_0, rel=0.01)
    assert fit.names[-2:] == ("contact gap [m]", "ln contact load")
    none = fit_law(LAWS["linear"], True, data(LOAD, 1e-6 + 4e-9 * LOAD))
    assert abs(none.theta[-2]) < 1e-2 * CONTACT_GAP
    assert (fit_law(LAWS["linear"], False, given).missing_compliance(LOAD) == 0).all()


def test_a_sure_prior_is_the_answer():
    known = ShapePrior(np.array([0.7]), np.array([[1e16]]))
    fit = fit_law(LAWS["power"], False, data(LOAD, 4e-9 * LOAD), known)
    assert fit.shape == pytest.approx([0.7], abs=1e-4)
    assert fit.covariance[3, 3] == pytest.approx(1e-16, rel=1e-3)
