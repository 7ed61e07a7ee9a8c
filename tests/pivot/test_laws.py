"""Pivot laws: derivatives, monotony, and the printed formulas as special cases."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tpjb_ident.pivot.laws import LAWS

LOADS = np.geomspace(0.03, 4.5, 60)


def some_shape(law, share):
    """A shape inside the law's bounds, `share` standard deviations off its prior mean."""
    low, high = law.bounds
    spread = np.sqrt(np.diag(np.linalg.inv(law.prior_precision))) if len(low) else np.zeros(0)
    return np.clip(law.prior_mean + share * spread, low, high)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=12)
@given(share=st.floats(-1.5, 1.5))
def test_compliance_is_the_derivative_of_the_deflection(name, share):
    law = LAWS[name]
    q = some_shape(law, share)
    step = 1e-5
    up, down = law.phi(LOADS * (1 + step), q)[0], law.phi(LOADS * (1 - step), q)[0]
    slope = (up - down) / (2 * step * LOADS)
    tolerance = 0.02 if name == "spline" else 1e-5  # the spline bends at its nodes
    assert slope == pytest.approx(law.psi(LOADS, q)[0], rel=tolerance)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=12)
@given(share=st.floats(-1.2, 1.2))
def test_derivatives_with_respect_to_the_shape(name, share):
    law = LAWS[name]
    q = some_shape(law, share)
    for function, loads in ((law.phi, LOADS), (law.psi, LOADS)):
        _, analytic = function(loads, q)
        for j in range(len(q)):
            step = np.zeros(len(q))
            step[j] = 1e-6
            numeric = (function(loads, q + step)[0] - function(loads, q - step)[0]) / 2e-6
            assert analytic[:, j] == pytest.approx(numeric, rel=2e-3, abs=2e-3 * np.max(np.abs(numeric)) + 1e-9)


def test_line_contact_is_the_printed_rocker_formula():
    # Eq. (17) of the paper, its rocker: E 206 GPa, nu 0.3, L 39.6 mm, D_H 132 mm, D_P 119.6 mm
    front = math.pi * 206e9 * 0.0396 / (1 - 0.3**2)
    load = np.linspace(100.0, 9000.0, 50)
    logarithm = np.log(front * 0.0124 / (4.0 * load))
    printed = load * (2.0 / 3.0 + logarithm) * 2.0 / front
    reference = 2000.0
    bracket = 2.0 / 3.0 + math.log(front * 0.0124 / (4.0 * reference)) - 1.0
    kappa, scale = 1.0 / bracket, 2.0 / front * bracket
    law = LAWS["hertz-line"]
    ours = scale * reference * law.phi(load / reference, np.array([kappa]))[0]
    assert ours == pytest.approx(printed, rel=1e-12)
    tangent = front / 2.0 / (logarithm - 1.0 / 3.0)
    assert 1.0 / (scale * law.psi(load / reference, np.array([kappa]))[0]) == pytest.approx(tangent, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "values", "other"),
    [
        ("hertz-line", (0.0,), "linear"),
        ("power", (1.0,), "linear"),
        ("point-in-series", (1.0,), "linear"),
        ("point-in-series", (0.0,), "hertz-point"),
        ("power", (2 / 3,), "hertz-point"),
        ("bilinear", (0.0, 0.3, -2.5), "linear"),
    ],
)
def test_laws_turn_into_one_another(name, values, other):
    """At these shapes they are the same law, deflection and compliance."""
    u, q = np.geomspace(0.05, 4.0, 30), np.array(values)
    for kind in ("phi", "psi"):
        np.testing.assert_allclose(getattr(LAWS[name], kind)(u, q)[0], getattr(LAWS[other], kind)(u, ())[0], rtol=1e-12)


def test_a_bilinear_law_has_its_two_compliances_far_from_the_bend():
    u, q = np.array([1e-3, 0.2, 3.0, 50.0]), np.array([np.log(3.0), 0.0, np.log(0.1)])
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
