"""The bearing with mass-conserving cavitation: bearings of pads that tilt freely do not notice."""

import math
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect
from model.options import CAVITATION, Options
from model.prediction import Prediction
from tests.fillings import fluid_fraction
from tests.model import points
from tests.model.points import LOAD, SPEED, close

EXCITATION = 2 * math.pi * np.array([10.0, 25.0, 50.0])


def run(bearing: Bearing, load: float = LOAD, cavitation: str = "jfo", **more: Any) -> Prediction:
    given = {"excitation": EXCITATION, "mesh": (40, 4), "options": Options(cavitation=cavitation)}
    return points.run(bearing, load=load, **given | more)


@pytest.mark.parametrize("load", [2500.0, 8750.0])
@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
def test_the_papers_bearings_do_not_notice(rocker, spherical, thermal, load):
    # their films rupture towards the trailing edge, if at all, and do not form again
    for bearing in (rocker, spherical):
        with_mass = run(bearing, load, thermal=thermal)
        close(with_mass.h, run(bearing, load, "swift-stieber", thermal=thermal).h, 1e-9)
    assert any(f.work.ruptured[1:].any() for f in with_mass.equilibrium.films) is (load > 5000.0)


def test_pads_that_are_held_notice(rocker):
    """Pads on stiff flexures or stuck rockers open towards the flow: Swift-Stieber fills that gap from nowhere."""
    held = [Effect("pivot_rotation", rotational_stiffness=5e4)]
    slow = {"speed": 2 * math.pi * 10.0, "excitation": 2 * math.pi * 25.0, "effects": held}
    without, conserved = (run(rocker, cavitation=name, **slow) for name in CAVITATION)
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


def test_bending_pads_and_warm_starts(rocker):
    bending = {"thermal": "tehd", "mesh": (32, 4)}
    cold, warm = (run(rocker, 8750.0, start=start, **bending) for start in (None, run(rocker, 8000.0, **bending)))
    close(warm.h, cold.h, 1e-4)
