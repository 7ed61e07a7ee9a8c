"""Dynamic coefficients: Eq. (9)-(12) against a dense solution of the whole system, and what each pad entry does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.dynamics import mass_centre_offset, pad_matrices, reduce_pads
from model.effects import Effect
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict, predict_setup
from model.prediction import Prediction
from model.setup import Setup
from tests.rigs.bearings import changed_pads

SPEED = 2 * math.pi * 22.0
DOWN = -math.pi / 2


def dense(p: Prediction, omega: float) -> np.ndarray:
    """Housing force per journal displacement from the equations of motion of every pad, one system for all.

    Unknowns (tilt, outward deflection) per pad. Film forces follow from (a, b); Newton per pad: film moment and force
    against inertia, k_theta, c_eta, and the pivot.
    """
    setup, films = p.setup, [f for f in p.equilibrium.films if f.forces is not None]
    n = len(films)
    a = np.zeros((2 + 2 * n, 2 + 2 * n), complex)
    for m, film in enumerate(films):
        z = film.forces.stiffness + 1j * omega * film.forces.damping
        pad, arm = film.pad, setup.bearing.pivot_radius(film.pad)
        # columns: x, y, tilt, eta -> a, b, by the film thickness formula of docs/theory.md
        chain = np.array([[*film.normal, 0.0, -1.0], [*film.tangent, arm, 0.0]])
        force = z @ chain  # radial (outward on the pad) and tangential film force per unknown
        columns = [0, 1, 2 + 2 * m, 3 + 2 * m]
        a[0:2, columns] += np.column_stack([film.normal, film.tangent]) @ force
        # the mass centre lies b ahead of the pivot and moves outward by eta - b tilt
        b = mass_centre_offset(setup, film)
        radial = np.array([0.0, 0.0, -b, 1.0]) * pad.mass * -(omega**2)
        law = setup.pivots[film.number - 1]
        pivot = law.vibration_stiffness(float(film.forces.force[0])) + 1j * omega * setup.pivot_damping
        a[3 + 2 * m, columns] = -force[0] + radial + np.array([0.0, 0.0, 0.0, pivot])
        inertia = np.array([0.0, 0.0, -(omega**2) * pad.moment_of_inertia + setup.rotational_stiffness, 0.0])
        inertia[3] = -(omega**2) * pad.mass * -b
        a[2 + 2 * m, columns] = arm * force[1] + inertia
    inner = np.linalg.solve(a[2:, 2:], a[2:, :2])
    return a[:2, :2] - a[:2, 2:] @ inner


@pytest.mark.parametrize("hz", [5.0, 25.0, 120.0])
@pytest.mark.parametrize("offset", [0.5, 0.6])
def test_reduction_is_the_dense_solution(rocker, hz, offset):
    heavy = changed_pads(rocker, pivot_offset=offset, mass=5.0, moment_of_inertia=2e-2)
    effects = [Effect("pivot_damping", damping=4e5), Effect("pivot_rotation", rotational_stiffness=3e4)]
    p = predict(heavy, 5000.0, -1.2, SPEED, 2 * math.pi * hz, effects=effects)
    expected = dense(p, 2 * math.pi * hz)
    np.testing.assert_allclose(p.h, expected, atol=1e-9 * np.abs(expected).max())


def test_coupling_of_an_offset_mass_lowers_what_moves_together(rocker):
    # kinetic energy 1/2 m (eta' - b t')^2 + 1/2 (I - m b^2) t'^2 with tilt and b counter-clockwise, eta outward
    p = predict(changed_pads(rocker, pivot_offset=0.6), 5000.0, DOWN, SPEED)
    film = p.equilibrium.films[0]
    b = mass_centre_offset(p.setup, film)
    assert b < 0.0  # the pivot stands behind the middle, so that the centre is upstream (clockwise)
    mass = p.pad_matrices[0].pad_mass
    for tilt, eta in ((1.0, 0.3), (-2.0, 1.0)):
        energy = film.pad.mass * (eta - b * tilt) ** 2 + (film.pad.moment_of_inertia - film.pad.mass * b**2) * tilt**2
        assert np.array([tilt, eta]) @ mass @ np.array([tilt, eta]) == pytest.approx(energy, rel=1e-12)


def test_central_pivot_has_its_mass_on_the_pivot_line(rocker):
    p = predict(rocker, 5000.0, DOWN, SPEED)
    assert mass_centre_offset(p.setup, p.equilibrium.films[0]) == 0.0


def test_rigid_pivots_leave_out_the_radial_motion(rocker):
    p = predict(rocker, 5000.0, DOWN, SPEED, pivots="rigid")
    pads, omega = pad_matrices(p.setup, p.equilibrium.films), np.array([100.0])
    stiff = pads._replace(pad_stiffness=np.minimum(pads.pad_stiffness, 1e16))
    np.testing.assert_allclose(reduce_pads(stiff, omega), reduce_pads(pads, omega), rtol=1e-5, atol=1.0)


def test_massless_pads_lose_nothing_below_50_hz(rocker):
    light = changed_pads(rocker, mass=0.0, moment_of_inertia=0.0)
    excitation = 2 * math.pi * np.array([10.0, 50.0])
    p, q = (predict(b, 5000.0, DOWN, SPEED, excitation) for b in (rocker, light))
    np.testing.assert_allclose(p.kyy, q.kyy, rtol=2e-3)


def test_frequency_zero_and_infinity(rocker):
    # pads follow quasi-statically at 0, stand still at high frequency (heavy inertia): then h is the film's own
    heavy = changed_pads(rocker, mass=1e9, moment_of_inertia=1e9)
    p = predict(heavy, 5000.0, DOWN, SPEED, 100.0)
    film = sum(m.stiffness[:2, :2] + 100j * m.damping[:2, :2] for m in p.pad_matrices)
    np.testing.assert_allclose(p.h, film, atol=1e-3 * np.abs(film).max())


def test_one_static_solution_serves_all_frequencies(rocker):
    excitation = 2 * math.pi * np.array([10.0, 25.0, 50.0])
    p = predict(rocker, 5000.0, DOWN, SPEED, excitation)
    assert p.h.shape == (3, 2, 2)
    for k, omega in enumerate(excitation):
        h = predict(rocker, 5000.0, DOWN, SPEED, float(omega)).h
        np.testing.assert_allclose(p.h[k], h, rtol=0.0, atol=1e-12 * np.abs(h).max())


def test_default_excitation_is_synchronous(rocker):
    p = predict(rocker, 5000.0, DOWN, SPEED)
    assert p.excitation == SPEED
    assert p.cyy == pytest.approx(p.h[1, 1].imag / SPEED)


@pytest.mark.slow
class TestPerturbedHeat:
    def test_the_slope_of_a_hot_film_s_locus_is_its_stiffness(self, rocker):
        # frozen viscosity is 3 to 7 % off it
        for load, close in ((5000.0, 2e-4), (8750.0, 3e-3)):
            setup = Setup(rocker, pivot_laws("rigid", rocker), "adiabatic", accuracy=1e-11)
            setup = setup.change(options=Options(perturbed_heat=True))
            points = [predict_setup(setup, w, -math.pi / 2, 138.0, 1e-4) for w in (load, 0.999 * load, 1.001 * load)]
            slope = (points[2].position - points[1].position) / (0.002 * load)
            moved = np.linalg.solve(points[0].h.real, [0.0, -1.0])
            assert moved[1] == pytest.approx(slope[1], rel=close)
            frozen = predict_setup(setup.change(options=Options()), load, -math.pi / 2, 138.0, 1e-4)
            assert abs(np.linalg.solve(frozen.h.real, [0.0, -1.0])[1] / slope[1] - 1.0) > 0.02

    def test_far_above_the_oil_s_passage_it_is_frozen(self, rocker):
        # 5 kHz: a hundred times faster than oil passes a pad
        fast = np.array([2 * math.pi * 5e3])
        both = [
            predict(rocker, 5000.0, speed=138.0, excitation=fast, pivots="rigid", options=Options(perturbed_heat=on)).h
            for on in (False, True)
        ]
        assert np.abs(both[1] - both[0]).max() < 2e-3 * np.abs(both[0]).max()

    def test_isothermal_films_have_nothing_to_follow(self, rocker):
        both = [
            predict(rocker, 5000.0, speed=138.0, thermal="isothermal", options=Options(perturbed_heat=on)).h
            for on in (False, True)
        ]
        np.testing.assert_array_equal(both[0], both[1])
