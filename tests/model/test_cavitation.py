"""The bearing with mass-conserving cavitation: bearings of pads that tilt freely do not notice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import bearing_impedance
from model.effects import Effect
from model.options import CAVITATION, Options
from model.predict import predict
from model.prediction import Prediction
from tests.fillings import fluid_fraction

SPEED, DOWN = 2 * math.pi * 22.0, -math.pi / 2
EXCITATION = 2 * math.pi * np.array([10.0, 25.0, 50.0])


def run(bearing: Bearing, load: float = 5000.0, direction: float = DOWN, **more: object) -> Prediction:
    options = Options(cavitation="jfo")
    return predict(bearing, load, direction, SPEED, EXCITATION, options=options, **({"mesh": (40, 4)} | more))


@pytest.mark.parametrize("load", [2500.0, 8750.0])
@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
def test_the_papers_bearings_do_not_notice(rocker, spherical, thermal, load):
    # their films rupture towards the trailing edge, if at all, and do not form again
    for bearing in (rocker, spherical):
        with_mass = run(bearing, load, thermal=thermal)
        without = predict(bearing, load, DOWN, SPEED, EXCITATION, thermal=thermal, mesh=(40, 4))
        np.testing.assert_allclose(with_mass.h, without.h, rtol=1e-9, atol=1e-9 * np.abs(without.h).max())
    assert any(f.work.ruptured[1:].any() for f in with_mass.equilibrium.films) is (load > 5000.0)


def test_pads_that_are_held_notice(rocker):
    """Pads on stiff flexures or stuck rockers open towards the flow: Swift-Stieber fills that gap from nowhere."""
    held = [Effect("pivot_rotation", rotational_stiffness=5e4)]
    slow = {"load": 5000.0, "load_direction": DOWN, "speed": 2 * math.pi * 10.0, "excitation": 2 * math.pi * 25.0}
    without, conserved = (
        predict(rocker, **slow, effects=held, mesh=(40, 4), options=Options(cavitation=name)) for name in CAVITATION
    )
    assert conserved.cxx == pytest.approx(0.9 * without.cxx, rel=0.01)
    assert conserved.kxx == pytest.approx(0.991 * without.kxx, rel=0.002)


def test_what_lies_behind_the_rupture_is_known(spherical):
    p = run(spherical, 8750.0)
    film = p.equilibrium.films[0]
    wedge = film.wedge
    theta = fluid_fraction(film.grid, film.work, wedge, SPEED * spherical.journal_radius)
    ruptured = film.work.ruptured.copy()
    ruptured[0] = False
    assert ruptured.any()
    assert (theta[~ruptured] == 1.0).all()
    assert 0.5 < theta[ruptured].min() < theta[ruptured].max() < 1.0


def test_slope_of_the_static_locus_is_the_stiffness_at_rest(spherical):
    # isothermal: viscosity does not change along the locus
    def at(load: float) -> Prediction:
        return run(spherical, load, thermal="isothermal", mesh=(80, 6))

    step = 100.0
    slope = 2 * step / (at(8750.0 - step).position[1] - at(8750.0 + step).position[1])
    point = at(8750.0)
    stiffness = bearing_impedance(point.setup, point.equilibrium, np.array([0.0]))[0].real
    assert slope == pytest.approx(1.0 / np.linalg.inv(stiffness)[1, 1], rel=2e-3)


def test_bending_pads_and_warm_starts(rocker):
    first = run(rocker, 8000.0, thermal="tehd", mesh=(32, 4))
    warm = run(rocker, 8750.0, thermal="tehd", mesh=(32, 4), start=first)
    cold = run(rocker, 8750.0, thermal="tehd", mesh=(32, 4))
    assert warm.converged
    assert cold.converged
    np.testing.assert_allclose(warm.h, cold.h, rtol=1e-4, atol=1e-4 * np.abs(cold.h).max())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"cavitation": "elrod"}, "swift-stieber, jfo"),
        ({"cavitation": None}, "swift-stieber, jfo"),
        ({"cavitation": "jfoo"}, "Did you mean 'jfo'?"),
    ],
)
def test_impossible_options_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Options(**arguments)
