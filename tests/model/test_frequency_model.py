"""K-C-M, reduced coefficients, the full set: against the impedance they stand for; stability against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.dynamics.reduction import bearing_impedance
from model.effects import Effect
from model.frequency_model import FullSet, fit_kcm, full_set, kcm, reduced
from model.predict import Prediction, predict
from model.rotor_stability import rotor_modes, threshold_mass

SPEED, DOWN = 2 * math.pi * 22.0, -math.pi / 2
BAND = 2 * math.pi * np.array([10.0, 20.0, 25.0, 30.0, 40.0, 50.0])


@pytest.fixture(scope="module")
def rocker(rocker_file) -> Bearing:
    return load_bearing(rocker_file)


def run(bearing: Bearing, load: float = 5000.0, **more: object) -> Prediction:
    return predict(bearing, load, DOWN, SPEED, BAND, mesh=(40, 4), **more)


@pytest.fixture(scope="module")
def base(rocker) -> Prediction:
    return run(rocker)


def test_kcm_gives_its_own_constants_back():
    rng = np.random.default_rng(5)
    k, c, m = rng.normal(size=(3, 2, 2)) * np.array([1e8, 1e5, 50.0])[:, None, None]
    w = BAND[:, None, None]
    model = fit_kcm(BAND, k - w**2 * m + 1j * w * c)
    np.testing.assert_allclose(model.stiffness, k, rtol=1e-9)
    np.testing.assert_allclose(model.damping, c, rtol=1e-9)
    np.testing.assert_allclose(model.mass, m, rtol=1e-7)
    assert model.misfit < 1e-9


def test_kcm_of_a_tilting_pad_bearing_says_what_it_costs(base):
    model = kcm(base)
    worst = max(np.linalg.norm(model.h(w) - h) / np.linalg.norm(h) for w, h in zip(BAND, base.h, strict=True))
    assert model.misfit == pytest.approx(worst)
    assert 0.005 < model.misfit < 0.2  # pads owe no K-C-M
    narrow = fit_kcm(BAND[1:4], base.h[1:4])
    assert narrow.misfit < 0.5 * model.misfit
    assert "misfit" in str(model)
    assert "10 to 50 Hz" in str(model)


@pytest.mark.parametrize(
    ("omega", "h", "message"),
    [
        ([1.0], np.ones((1, 2, 2)), "two different frequencies"),
        ([1.0, 1.0], np.ones((2, 2, 2)), "two different frequencies"),
        ([1.0, 2.0], np.ones((2, 2)), "shape"),
        ([1.0, 2.0], np.full((2, 2, 2), math.nan), "without equilibrium"),
    ],
)
def test_what_cannot_be_fitted_is_refused(omega, h, message):
    with pytest.raises(ValueError, match=message):
        fit_kcm(omega, h)


def test_one_frequency_is_no_kcm(rocker):
    with pytest.raises(ValueError, match="two different frequencies"):
        kcm(predict(rocker, 5000.0, DOWN, SPEED, mesh=(24, 4)))


def test_reduced_coefficients_are_the_impedance(base):
    k, c = reduced(base, BAND)
    np.testing.assert_allclose(k, base.k, rtol=1e-12)
    np.testing.assert_allclose(c, base.c, rtol=1e-12)
    one_k, one_c = reduced(base, BAND[2])
    assert one_k.shape == one_c.shape == (2, 2)
    np.testing.assert_allclose(one_k, k[2])
    rest_k, rest_c = reduced(base, 0.0)
    slow = bearing_impedance(base.setup, base.equilibrium, np.array([0.5]))[0]
    np.testing.assert_allclose(rest_k, slow.real, rtol=1e-4, atol=1e-4 * rest_k[1, 1])
    np.testing.assert_allclose(rest_c, slow.imag / 0.5, rtol=1e-3, atol=1e-3 * rest_c[1, 1])


CHANGES = {
    "kirk": {},
    "rigid": {"pivots": "rigid"},
    "damped, held, added mass": {
        "effects": [
            Effect("pivot_damping", damping=2e4),
            Effect("pivot_rotation", rotational_stiffness=5e3),
            Effect("fluid_inertia", added_mass=12.0),
        ]
    },
    "housing spring": {"effects": [Effect("housing_flexibility", stiffness=6e8)]},
    "idle pads": {"load": 8750.0, "pivots": 2e8},
}


@pytest.mark.parametrize("name", CHANGES)
def test_full_set_reduces_to_the_impedance(rocker, name):
    p = run(rocker, **CHANGES[name])
    full = full_set(p)
    for omega, h in zip(BAND, p.bearing_h, strict=True):
        np.testing.assert_allclose(full.reduce(1j * omega), h, rtol=1e-9, atol=1e-9 * np.abs(h).max())
    assert np.allclose(full.mass, full.mass.T)
    pads = [f"tilt {k}" for k in range(1, 6) if k not in p.idle_pads]
    assert [n for n in full.names if n.startswith("tilt")] == pads
    gives = [n for n in full.names if n.startswith("give")]
    assert len(gives) == (0 if name == "rigid" else len(pads))
    assert ("inner x" in full.names) is (name == "housing spring")


def test_no_equilibrium_no_coefficients(rocker):
    p = predict(rocker.with_pads(rocker.pads[:1]), 5000.0, 1.5, SPEED, mesh=(24, 4))  # away from its only pad
    assert not p.converged
    for action in (full_set, lambda p: reduced(p, 100.0)):
        with pytest.raises(ValueError, match="no equilibrium"):
            action(p)


def plain(k: float, q: float, c: float) -> FullSet:
    """A bearing with cross-coupling and no pads."""
    return FullSet(("x", "y"), np.zeros((2, 2)), c * np.eye(2), np.array([[k, q], [-q, k]]))


def test_threshold_of_a_cross_coupled_bearing():
    # on the threshold m omega^2 = k and c omega = q
    k, q, c = 2e8, 5e7, 4e5
    bearing = plain(k, q, c)
    mass = k * c**2 / q**2
    assert threshold_mass(bearing) == pytest.approx(mass, rel=1e-9)
    assert rotor_modes(bearing, 0.99 * mass).stable
    heavy = rotor_modes(bearing, 1.01 * mass)
    assert not heavy.stable
    assert heavy.log_decrement[0] < 0.0
    assert heavy.frequency[0] == pytest.approx(q / c, rel=0.01)


def test_modes_of_a_damped_oscillator():
    k, c, mass = 2e8, 3e4, 400.0
    modes = rotor_modes(plain(k, 0.0, c), mass)
    decay = c / (2 * mass)
    np.testing.assert_allclose(modes.eigenvalues, -decay + 1j * math.sqrt(k / mass - decay**2), rtol=1e-6)
    assert modes.stable
    assert math.isinf(threshold_mass(plain(k, 0.0, c)))


def test_eigenvalues_satisfy_the_reduced_equation(base):
    full, mass = full_set(base), 510.0
    for value in rotor_modes(full, mass).eigenvalues:
        z = full.reduce(value) + mass * value**2 * np.eye(2)
        smallest = np.linalg.svd(z, compute_uv=False)[-1]
        assert smallest < 1e-6 * np.linalg.norm(z)


def test_tilting_pads_hold_any_rotor_and_fixed_pads_do_not(rocker, base):
    assert rotor_modes(full_set(base), 510.0).stable
    assert math.isinf(threshold_mass(full_set(base), 1e5))
    fixed = run(rocker, 500.0, effects=[Effect("pivot_rotation", rotational_stiffness=1e6)], pivots="rigid")
    assert fixed.converged
    assert 1.0 < threshold_mass(full_set(fixed)) < 1e6


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf])
def test_rotors_have_mass(base, mass):
    with pytest.raises(ValueError, match="positive"):
        rotor_modes(full_set(base), mass)
