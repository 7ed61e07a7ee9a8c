"""What static tests would show: dry curves, the clearance polygon, loci and sweeps with warm starts."""

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect, apply_effects
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Mesh, Setup
from model.static_tests import dry_curve, polygon_sides
from tests.model.points import DOWN, OMEGA, SPEED, close
from tests.rigs.sweeps import sweep

LINE = np.array([OMEGA])
LOADS = np.linspace(2500.0, 8750.0, 6)


def setup(bearing: Bearing, *effects: Effect, pivots: object = "kirk") -> Setup:
    return apply_effects(Setup(bearing, pivot_laws(pivots, bearing), mesh=Mesh(40, 4)), effects)


def test_dry_curve_is_the_law_through_structure_and_instruments(rocker):
    load = np.linspace(0.0, 5000.0, 11)
    plain = dry_curve(setup(rocker), 1, load)
    law = pivot_laws("kirk", rocker)[0]
    np.testing.assert_allclose(plain[1], [law.deflection(w) for w in load])
    np.testing.assert_allclose(plain[0], load)
    gains = Effect("probe_gain", factor=1.1), Effect("loadcell_gain", factor=0.9)
    read = dry_curve(setup(rocker, Effect("housing_flexibility", stiffness=1e9), *gains), 1, load)
    np.testing.assert_allclose(read[1], 1.1 * (plain[1] + load / 1e9), atol=1e-15)
    np.testing.assert_allclose(read[0], 0.9 * load)


def test_polygon_of_equal_pads_is_regular(rocker):
    distance, angle = polygon_sides(setup(rocker), 0.0)
    np.testing.assert_allclose(distance, rocker.pads[0].assembled_clearance)
    np.testing.assert_allclose(np.diff(np.unwrap(angle)), 2 * math.pi / 5)


def test_push_load_enlarges_the_polygon_by_what_pivots_and_housing_give(rocker):
    soft = Effect("housing_flexibility", stiffness=4e8), Effect("soft_pivot", pad=3, stiffness_factor=0.3)
    spring = setup(rocker, *soft)
    pushed, clearance = polygon_sides(spring, 200.0)[0], polygon_sides(spring, 0.0)[0]
    give = [law.deflection(200.0) for law in spring.pivots]
    np.testing.assert_allclose(pushed - clearance, np.array(give) + 200.0 / 4e8)
    assert np.argmax(pushed) == 2
    # running conditions do not change what is measured cold
    warm = polygon_sides(setup(rocker, Effect("thermal_growth", clearance_change=1e-5)), 0.0)
    np.testing.assert_allclose(warm[0], rocker.pads[0].assembled_clearance)
    moved = polygon_sides(setup(rocker, Effect("pad_offset", pad=3, radial_offset=1e-5)), 0.0)
    assert moved[0][2] == pytest.approx(rocker.pads[2].assembled_clearance + 1e-5)


def test_sweeps_up_and_down_meet_cold_starts(rocker):
    one = setup(rocker)
    points = [(load, DOWN, SPEED, LINE) for load in LOADS]
    up, down = sweep(one, points), sweep(one, points[::-1])[::-1]
    for load, a, b in zip(LOADS, up, down, strict=True):
        cold = predict_setup(one, load, DOWN, SPEED, LINE)
        for warm in (a, b):
            assert warm.converged
            close(warm.h, cold.h, 2e-5)
            np.testing.assert_allclose(warm.position, cold.position, atol=1e-10)
    near = [(load, DOWN, SPEED, LINE) for load in LOADS[0] + 50.0 * np.arange(5)]
    one = one.change(thermal="tehd")  # adiabatic films begin as near from the curves of their pads
    carried, alone = sweep(one, near), [predict_setup(one, *point) for point in near]
    assert sum(p.equilibrium.iterations for p in carried) < sum(p.equilibrium.iterations for p in alone)


def test_locus_of_equal_pads_repeats_every_pad(rocker):
    directions = np.linspace(-math.pi, math.pi, 20, endpoint=False)
    turning = 2 * math.pi * 20.0
    found = sweep(setup(rocker), [(5000.0, d, turning, np.array([turning])) for d in directions.tolist()])
    points = np.array([p.position for p in found])
    assert points.shape == (20, 2)
    turned = points[4:8]  # 72 deg further
    c, s = math.cos(2 * math.pi / 5), math.sin(2 * math.pi / 5)
    np.testing.assert_allclose(turned, points[:4] @ np.array([[c, s], [-s, c]]), atol=2e-9)
    # inside the clearance polygon
    pushed, angle = polygon_sides(setup(rocker), 5000.0)
    assert (points @ np.array([np.cos(angle), np.sin(angle)]) < pushed).all()


def test_a_point_that_fails_does_not_spoil_the_next(rocker):
    one = setup(rocker.with_pads(rocker.pads[:1]))
    points = [(5000.0, d, SPEED, LINE) for d in (DOWN, 1.5, DOWN)]
    found = sweep(one, points)
    assert [p.converged for p in found] == [True, False, True]
    np.testing.assert_allclose(found[2].h, found[0].h, rtol=1e-6)
    assert "not converged" in "; ".join(found[1].status)
