"""Mirror symmetry: pads that tilt freely about their middle push along their pivots, whichever way the shaft turns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.effects import Effect
from model.predict import predict
from tests.rigs.bearings import changed_pads

SPEED, DOWN = 2 * math.pi * 22.0, -math.pi / 2
EXCITATION = 2 * math.pi * np.array([10.0, 25.0, 50.0])
MIRRORED_PADS = [0, 4, 3, 2, 1]


@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
@pytest.mark.parametrize("aside", [0.2, 0.9, 2.0])
def test_mirrored_load_mirrors_the_bearing(rocker, thermal, aside):
    # a pad's inertia resists its tilt: then the shaft's rotation tells left from right, by 0.1 % at 25 Hz
    light = changed_pads(rocker, mass=1e-9, moment_of_inertia=1e-12)
    left, right = (
        predict(light, 5000.0, DOWN + side * aside, SPEED, EXCITATION, thermal=thermal, mesh=(40, 4))
        for side in (-1, 1)
    )
    np.testing.assert_allclose(left.pad_load, right.pad_load[MIRRORED_PADS], rtol=1e-5, atol=0.1)
    np.testing.assert_allclose(left.position, right.position * [-1.0, 1.0], atol=1e-10)
    mirror = np.diag([-1.0, 1.0])
    np.testing.assert_allclose(left.h, mirror @ right.h @ mirror, atol=1e-4 * np.abs(left.h).max())
    assert left.min_film == pytest.approx(right.min_film, rel=1e-5)
    assert left.power_loss == pytest.approx(right.power_loss, rel=1e-5)


def test_what_tells_left_from_right_is_not_symmetric(rocker):
    # hot oil goes from pad to pad with the rotation; a held pad leans with it
    for effect in (Effect("hot_oil_carryover", fraction=0.8), Effect("pivot_rotation", rotational_stiffness=3e4)):
        p = predict(rocker, 5000.0, DOWN, SPEED, mesh=(40, 4), effects=[effect])
        assert abs(p.pad_load[1] / p.pad_load[4] - 1.0) > 1e-3


def test_mirrored_halves_of_a_film(rocker):
    # the half film that is solved, against the whole one that a shaft almost exactly in line asks for
    half = predict(rocker, 5000.0, DOWN, SPEED, EXCITATION, mesh=(40, 4))
    whole = predict(
        rocker, 5000.0, DOWN, SPEED, EXCITATION, mesh=(40, 4),
        effects=[Effect("misalignment", angle=1e-9, direction=0.3)],
    )  # fmt: skip
    assert whole.pressure[0].shape[1] == 2 * half.pressure[0].shape[1] - 1
    np.testing.assert_allclose(whole.h, half.h, rtol=1e-6, atol=1e-6 * np.abs(half.h).max())
    np.testing.assert_allclose(whole.pressure[0][:, ::-1], whole.pressure[0], rtol=1e-4, atol=1.0)
