"""Mirror symmetry: pads that tilt freely about their middle push along their pivots, whichever way the shaft turns."""

import math

import numpy as np
import pytest

from model.effects import Effect
from tests.model.points import DOWN, close, run
from tests.rigs.bearings import changed_pads

COARSE = {"excitation": 2 * math.pi * np.array([10.0, 25.0, 50.0]), "mesh": (40, 4)}
MIRRORED_PADS = [0, 4, 3, 2, 1]


@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
@pytest.mark.parametrize("aside", [0.2, 0.9, 2.0])
def test_mirrored_load_mirrors_the_bearing(rocker, thermal, aside):
    # a pad's inertia resists its tilt: then the shaft's rotation tells left from right, by 0.1 % at 25 Hz
    light = changed_pads(rocker, mass=1e-9, moment_of_inertia=1e-12)
    left, right = (run(light, direction=DOWN + side * aside, thermal=thermal, **COARSE) for side in (-1, 1))
    np.testing.assert_allclose(left.pad_load, right.pad_load[MIRRORED_PADS], rtol=1e-5, atol=0.1)
    np.testing.assert_allclose(left.position, right.position * [-1.0, 1.0], atol=1e-10)
    mirror = np.diag([-1.0, 1.0])
    close(mirror @ right.h @ mirror, left.h, 1e-4)
    assert left.min_film == pytest.approx(right.min_film, rel=1e-5)
    assert left.power_loss == pytest.approx(right.power_loss, rel=1e-5)


def test_what_tells_left_from_right_is_not_symmetric(rocker):
    # hot oil goes from pad to pad with the rotation; a held pad leans with it
    for effect in (Effect("hot_oil_carryover", fraction=0.8), Effect("pivot_rotation", rotational_stiffness=3e4)):
        p = run(rocker, effect, **COARSE)
        assert abs(p.pad_load[1] / p.pad_load[4] - 1.0) > 1e-3


def test_mirrored_halves_of_a_film(rocker):
    # the half film that is solved, against the whole one that a shaft almost exactly in line asks for
    half, whole = run(rocker, **COARSE), run(rocker, Effect("misalignment", angle=1e-9, direction=0.3), **COARSE)
    assert whole.pressure[0].shape[1] == 2 * half.pressure[0].shape[1] - 1
    close(whole.h, half.h, 1e-6)
    np.testing.assert_allclose(whole.pressure[0][:, ::-1], whole.pressure[0], rtol=1e-4, atol=1.0)
