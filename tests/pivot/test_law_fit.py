"""Posterior, evidence and bounds of one law: sums that can be done in closed form, and what may change nothing."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import integrate, optimize

from tpjb_ident.pivot.law_fit import CONTACT_GAP, CONTACT_LOAD_SPREAD, FitData, fit_law
from tpjb_ident.pivot.laws import BEND_SPREAD, FIXED, LAWS, NODES, SLOPE_SPREAD, TYPICAL_SLOPE

LOAD = np.linspace(250.0, 5000.0, 24)
REFERENCE = 2000.0


def data(deflection, load=LOAD, branch=None, sigma=1e-8, friction=(0.0, 1e-6)):
    whitener = np.eye(len(load)) / sigma
    return FitData(load, deflection, np.ones(len(load)) if branch is None else branch, whitener, REFERENCE, friction)


def reading(fit, load, branch):
    return fit.reading_gradient(load, branch)[0]


def posterior(law, contact, given, theta):
    """Minus twice the logarithm of likelihood and prior, from what is written about them."""
    k = len(law.parameters)
    shape = theta[3 : 3 + k]
    pushed = np.maximum(given.load * (1.0 - theta[1] * given.branch), 0.0) / REFERENCE
    reading = theta[0] + math.exp(theta[2]) * REFERENCE * law.phi(pushed, shape)[0]
    if contact:
        reading = reading - theta[-2] * np.exp(-given.load / math.exp(theta[-1]))
    misfit = given.whitener @ (given.deflection - reading)
    apart = shape - law.prior_mean
    total = misfit @ misfit + ((theta[1] - given.friction[0]) / given.friction[1]) ** 2
    total += apart @ law.prior_precision @ apart
    if contact:
        total += (theta[-2] / CONTACT_GAP) ** 2
        total += ((theta[-1] - math.log(0.1 * given.load.max())) / CONTACT_LOAD_SPREAD) ** 2
    return float(total)


def noisy(seed, law="power", shape=(0.8,), gap=0.0, sigma=1e-8):
    u = LOAD / REFERENCE
    x = 8e-6 * LAWS[law].phi(u, np.array(shape))[0] - gap * np.exp(-LOAD / 400.0) + 3e-6
    return data(x + sigma * np.random.default_rng(seed).standard_normal(len(LOAD)), sigma=sigma)


@pytest.mark.parametrize(
    ("law", "contact", "gap"),
    [("power", False, 0.0), ("hertz-line", False, 0.0), ("power", True, 3e-6), ("point-in-series", True, 2e-6)],
)
def test_the_fit_is_the_mode_of_the_stated_posterior(law, contact, gap):
    """No step in any parameter, and no simplex search from there, finds a better place."""
    given = noisy(3, gap=gap)
    given = dataclasses.replace(given, friction=(0.01, 0.02))
    fit = fit_law(LAWS[law], contact, given)
    best = posterior(LAWS[law], contact, given, fit.theta)
    errors = np.sqrt(np.diag(fit.covariance))
    for k, error in enumerate(errors):
        for side in (-0.3, 0.3):
            moved = fit.theta.copy()
            moved[k] += side * error
            assert posterior(LAWS[law], contact, given, moved) > best - 2e-3
    scaled = optimize.minimize(
        lambda z: posterior(LAWS[law], contact, given, fit.theta + z * errors),
        np.zeros(len(errors)), method="Nelder-Mead", options={"maxfev": 600, "fatol": 1e-3},
    )  # fmt: skip
    assert scaled.fun > best - 0.02
    apart = fit.theta[3] - LAWS[law].prior_mean[0]
    chi_square = best - ((fit.theta[1] - 0.01) / 0.02) ** 2 - apart**2 * LAWS[law].prior_precision[0, 0]
    if contact:
        chi_square -= (fit.theta[-2] / CONTACT_GAP) ** 2
        chi_square -= ((fit.theta[-1] - math.log(500.0)) / CONTACT_LOAD_SPREAD) ** 2
    assert fit.chi_square == pytest.approx(chi_square, rel=1e-6)
    assert fit.freedom == len(LOAD) - len(fit.theta)


def test_evidence_is_the_integral_over_the_shape():
    """Straight line of known friction: zero reading and scale integrate to a Gaussian, the shape by quadrature."""
    sigma = 3e-8
    for seed, truth in ((1, 0.75), (2, 0.95)):
        given = noisy(seed, shape=(truth,), sigma=sigma)
        law = LAWS["power"]

        def profile(p, given=given, law=law):
            """Logarithm of the likelihood with zero and ln(scale) integrated out (Laplace: it is Gaussian in them)."""
            x = law.phi(given.load / REFERENCE, np.array([p]))[0]
            design = np.column_stack([np.ones_like(x), x]) / sigma
            theta, rest = np.linalg.lstsq(design, given.deflection / sigma, rcond=None)[:2]
            hessian = design * np.array([1.0, theta[1]])
            prior = ((p - law.prior_mean[0]) ** 2) * law.prior_precision[0, 0]
            return -0.5 * (float(rest[0]) + prior + np.linalg.slogdet(hessian.T @ hessian)[1])

        grid = np.linspace(0.5, 1.2, 1401)
        logs = np.array([profile(p) for p in grid])
        peak = logs.max()
        integral = peak + math.log(integrate.simpson(np.exp(logs - peak), x=grid))
        # the prior's normalisation, and two pi of one more dimension, are what the logarithm leaves out
        by_hand = integral + 0.5 * math.log(law.prior_precision[0, 0]) - 0.5 * math.log(2 * math.pi)
        offset = -math.log(np.ptp(given.deflection))  # evidence counts the zero reading in units of the range
        fit = fit_law(law, False, given)
        assert fit.log_evidence == pytest.approx(by_hand + offset, abs=0.03)


def test_parameters_stop_at_their_bounds_and_the_others_are_still_best():
    """A law that bends more than a power of 0.3 may, and a contact gap that would be negative."""
    given = data(3e-6 + 2e-6 * LOAD**0.27, sigma=1e-8)
    fit = fit_law(LAWS["power"], False, given, start=np.array([4e-6, 0.0, -20.0, 0.32]))
    assert fit.shape == pytest.approx([0.3])
    x = LAWS["power"].phi(LOAD / REFERENCE, fit.shape)[0]
    zero, slope = np.linalg.lstsq(np.column_stack([np.ones_like(x), x]), given.deflection, rcond=None)[0]
    assert fit.theta[0] == pytest.approx(zero, rel=1e-3)
    assert math.exp(fit.theta[2]) * REFERENCE == pytest.approx(slope, rel=1e-3)
    steep = fit_law(LAWS["power"], False, data(3e-6 + 1e-15 * LOAD**2.5))
    assert steep.shape == pytest.approx([1.3])
    turned = fit_law(LAWS["linear"], True, data(3e-6 + 4e-9 * LOAD + 2e-6 * np.exp(-LOAD / 400.0)))
    assert turned.theta[-2] == 0.0
    late = fit_law(LAWS["linear"], True, data(4e-9 * LOAD - 9e-6 * np.exp(-LOAD / 9000.0)))
    assert math.exp(late.theta[-1]) <= 5000.0 * (1 + 1e-12)
    early = fit_law(LAWS["linear"], True, data(4e-9 * LOAD - 3e-5 * np.exp(-LOAD / 30.0), sigma=1e-12))
    assert math.exp(early.theta[-1]) >= 50.0 * (1 - 1e-12)


@pytest.mark.parametrize(("held", "found"), [(0.15, 0.15), (-0.15, -0.15), (0.4, 0.2), (-0.4, -0.2)])
def test_friction_is_believed_up_to_a_fifth(held, found):
    load, branch = np.r_[LOAD, LOAD[::-1]], np.r_[np.ones(24), -np.ones(24)]
    given = data(4e-9 * load * (1 - held * branch), load, branch, friction=(0.0, 10.0))
    assert fit_law(LAWS["linear"], False, given).theta[1] == pytest.approx(found, rel=1e-5)


def test_a_pad_that_is_not_pressed_gives_nothing():
    fit = fit_law(LAWS["hertz-line"], False, noisy(8))
    np.testing.assert_array_equal(fit.deflection(np.array([0.0, -50.0])), 0.0)
    np.testing.assert_array_equal(fit.compliance(np.array([0.0, -50.0])), fit.compliance(np.zeros(2)))
    np.testing.assert_array_equal(
        fit.log_softness(np.array([-50.0]), False)[1], fit.log_softness(np.zeros(1), False)[1]
    )
    assert reading(fit, np.array([-50.0]), np.ones(1))[0] == fit.theta[0]


def prior_distance(logs):
    """Squared distance of a curve of ln(compliance) from the spline's prior mean."""
    law = LAWS["spline"]
    apart = np.delete(logs, FIXED) - law.prior_mean
    return float(apart @ law.prior_precision @ apart)


def test_the_prior_of_a_spline_is_a_slope_and_its_bends():
    """Power laws differ by their slope alone; a bend at one node counts with its own spread."""
    assert prior_distance(TYPICAL_SLOPE * NODES) == pytest.approx(0.0, abs=1e-20)
    for off in (SLOPE_SPREAD, -2 * SLOPE_SPREAD):
        assert prior_distance((TYPICAL_SLOPE + off) * NODES) == pytest.approx((off / SLOPE_SPREAD) ** 2)
    for node in range(1, len(NODES) - 1):
        if node != FIXED:
            hinge = np.maximum(NODES - NODES[node], 0.0) if node > FIXED else np.minimum(NODES - NODES[node], 0.0)
            assert prior_distance(TYPICAL_SLOPE * NODES + 0.3 * hinge) == pytest.approx((0.3 / BEND_SPREAD) ** 2)
    assert NODES[FIXED] == 0.0
    assert len(LAWS["spline"].parameters) == len(LAWS["spline"].prior_mean) == len(NODES) - 1
    assert LAWS["spline"].parameters[0] == "ln psi(0.08)"


def test_between_and_beyond_its_nodes_a_spline_is_a_power():
    q = np.delete(np.array([0.5, 0.4, 0.3, 0.1, 0.0, -0.1, -0.3, -0.4]), FIXED)
    every = np.insert(q, FIXED, 0.0)
    at_nodes = LAWS["spline"].psi(np.exp(NODES), q)[0]
    np.testing.assert_allclose(np.log(at_nodes), every, atol=1e-12)
    middle = LAWS["spline"].psi(np.exp(0.5 * (NODES[1:] + NODES[:-1])), q)[0]
    np.testing.assert_allclose(np.log(middle), 0.5 * (every[1:] + every[:-1]), atol=1e-12)
    beyond = np.log(LAWS["spline"].psi(np.exp(np.array([NODES[-1] + 0.7, NODES[0] - 0.7])), q)[0])
    ends = np.diff(every)[[-1, 0]] / np.diff(NODES)[[-1, 0]]
    np.testing.assert_allclose(beyond, every[[-1, 0]] + 0.7 * np.array([1, -1]) * ends, atol=1e-12)


def test_laws_far_outside_their_range_stay_laws():
    """Line contact: the compliance stays positive where its logarithm would not let it."""
    u = np.geomspace(1e-12, 1e9, 200)
    for kappa in (0.0, 0.08, 0.45):
        value = LAWS["hertz-line"].psi(u, np.array([kappa]))[0]
        assert (value > 0.0).all()
        assert (np.diff(value) <= 1e-12).all()
    assert LAWS["hertz-line"].psi(np.array([1e9]), np.array([0.45]))[0] == pytest.approx(0.02)
    bend = LAWS["bilinear"].psi(np.array([1e-9, 1e6]), np.array([1.0, 0.0, math.log(0.1)]))[0]
    np.testing.assert_allclose(bend, [1 + (math.e - 1) / (1 + math.exp(-10.0)), 1.0], rtol=1e-9)


def test_what_the_data_do_not_tell_is_as_wide_as_its_prior():
    """A straight line in a hundred micrometres of noise says nothing of a contact gap, nor of the load it closes at."""
    fit = fit_law(LAWS["power"], True, data(4e-9 * LOAD, sigma=1e-4, friction=(0.01, 0.02)))
    assert math.sqrt(fit.covariance[1, 1]) == pytest.approx(0.02, rel=0.01)
    assert math.sqrt(fit.covariance[3, 3]) == pytest.approx(0.15, rel=0.05)
    assert math.sqrt(fit.covariance[-2, -2]) == pytest.approx(CONTACT_GAP, rel=0.01)
    assert math.sqrt(fit.covariance[-1, -1]) == pytest.approx(CONTACT_LOAD_SPREAD, rel=0.01)
    assert math.exp(fit.theta[-1]) == pytest.approx(500.0, rel=0.01)


@pytest.mark.parametrize("name", ["power", "bilinear", "spline"])
def test_readings_and_logarithms_have_the_derivatives_that_are_said(name):
    law, way = LAWS[name], np.r_[np.ones(24), -np.ones(24)]
    fit = fit_law(law, True, noisy(9, gap=1e-6))
    theta = fit.theta.copy()
    theta[1], theta[-2], theta[3 : 3 + len(law.parameters)] = 0.04, 2e-6, law.prior_mean + 0.1
    fit, both, loads = dataclasses.replace(fit, theta=theta), np.r_[LOAD, LOAD[::-1]], np.array([300.0, 1500.0, 4200.0])
    for function in (
        lambda f: f.reading_gradient(both, way),
        lambda f: f.log_softness(loads, secant=False),
        lambda f: f.log_softness(loads, secant=True),
    ):
        _, gradient = function(fit)
        for k, size in enumerate(np.maximum(np.abs(theta), 1e-6) * 1e-5):
            ends = [
                function(dataclasses.replace(fit, theta=theta + side * np.eye(len(theta))[k]))[0]
                for side in (size, -size)
            ]
            numeric = (ends[0] - ends[1]) / (2 * size)
            np.testing.assert_allclose(gradient[:, k], numeric, rtol=5e-3, atol=1e-4 * max(np.abs(numeric).max(), 1e-6))
    # contact loss is what the reading lacks of the pivot's own deflection
    lack = theta[0] + fit.deflection(LOAD) - reading(fit, LOAD, np.zeros(24))
    np.testing.assert_allclose(lack, theta[-2] * np.exp(-LOAD / np.exp(theta[-1])), rtol=1e-9)
