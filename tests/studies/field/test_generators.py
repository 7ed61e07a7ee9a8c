"""The generators of the second field battery against closed forms, finer steps and the balance of power."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.rigs import closed_form as cf
from tests.studies.field import marched as mr

PLAN = cf.Rig(load_scatter=0.0, frequencies=(25.0,), directions=(0.0, 70.0), seconds=2.0, runout=0.0, speed=97.0)
HEAVY = replace(PLAN, shaft_mass=200.0, mass=120.0, unbalance=0.001)
LINEAR = mr.CubicFilm()


def stiffness(rig, signals, begin=0.0):
    """H at 25 Hz by plain least squares on what noise-free sensors see (2, 2)."""
    t = np.arange(round(begin * 2000), round(rig.seconds * 2000)) / 2000
    lines = [f(2 * np.pi * n * t) for n in (25.0, rig.speed) for f in (np.cos, np.sin)]
    design = np.column_stack([np.ones_like(t), *lines])

    def phasor(signal, quantity):
        part = np.linalg.lstsq(design, signal(quantity, t).T, rcond=None)[0]
        return part[1] - 1j * part[2]

    d = np.array([phasor(s, "displacement") for s in signals])
    force = np.array([phasor(s, "force") + rig.mass * phasor(s, "acceleration") for s in signals])
    return np.linalg.solve(d, force).T


@pytest.mark.parametrize(
    ("changes", "begin", "tolerance"),
    [
        ({}, 0.0, 1e-9),
        ({"film": cf.HEAVY, "mount": "floating", "mass": 60.0}, 0.0, 1e-9),
        ({"film": cf.NEGATIVE, "springs": (3e7, 4e7), "shaft_mass": 300.0}, 0.0, 1e-9),
        ({"share": (0.3, 1.0)}, 0.8, 1e-4),
        ({"share": (0.3, 1.0), "mount": "floating"}, 0.8, 1e-4),
    ],
)
def test_h_is_recovered_from_signals_without_noise(changes, begin, tolerance):
    rig = replace(PLAN, **changes)
    signals = [cf.signal(rig, cf.Test(5000.0, 25.0, a), np.random.default_rng(1)) for a in rig.directions]
    h = rig.film.h(25.0, 5000.0)
    np.testing.assert_allclose(stiffness(rig, signals, begin), h, atol=tolerance * np.abs(h).max())


@pytest.mark.slow
@pytest.mark.parametrize(("law", "tolerance"), [(LINEAR, 1e-5), (mr.ShortBearing(), 2e-3)])
@pytest.mark.parametrize("mount", ["cells", "floating"])
def test_a_march_has_the_stiffness_of_its_linearised_film(law, tolerance, mount):
    rig = replace(HEAVY, mount=mount, amplitude=0.005, seconds=0.4)  # without noise ten periods are as good as fifty
    linear, signals = mr.records(law, rig)
    h = linear.film.h(25.0, 5000.0)
    np.testing.assert_allclose(stiffness(rig, signals), h, atol=tolerance * np.abs(h).max())


@pytest.mark.parametrize("e", [0.1, 0.6])
def test_short_bearing_carries_as_ocvirk_says(e):
    law = mr.ShortBearing()
    radial, aside = law.force(np.array([[e * law.clearance], [0.0]]), np.zeros((2, 1)))[:, 0] / law.scale
    assert radial == pytest.approx(4 * e**2 / (1 - e**2) ** 2)
    assert aside == pytest.approx(-math.pi * e / (1 - e**2) ** 1.5)
