"""A shaft that turns clockwise is the mirror image of one that turns counter-clockwise, and so is a mirrored load."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import ROTATIONS, BearingError
from model.bearing_file import parse_bearing
from model.effects import Effect
from model.errors import OptionError
from model.mirror import as_it_turns
from model.predict import predict
from rigdata import operating_point
from tests.model.points import DOWN, OMEGA, SPEED, close, run
from tests.rigs.bearings import changed_pads

POINT = {"load": 5000.0, "speed": SPEED, "excitation": OMEGA, "mesh": (24, 4)}
MIRROR = np.diag([-1.0, 1.0])


def with_offset(bearing, offset, rotation=""):
    return replace(changed_pads(bearing, pivot_offset=offset), rotation=rotation)


def effects(mirrored):
    """Effects that tell left from right, in the rig's frame or in the mirror."""
    sign = -1.0 if mirrored else 1.0
    pad, direction = (4, math.pi - 0.4) if mirrored else (2, 0.4)
    return [
        Effect("hot_oil_carryover", fraction=0.8),
        Effect("pad_offset", pad=pad, radial_offset=5e-6),
        Effect("structure_compliance", stiffness=4e8, direction=direction),
        Effect("parallel_stiffness", xx=1e6, xy=sign * 2e6, yx=sign * 3e6, yy=0.0),
        Effect("misalignment", angle=1e-4, direction=direction),
        Effect("probe_rotation", angle=sign * 0.03),
    ]


def test_a_clockwise_shaft_is_the_mirror_image(rocker):
    bearing = with_offset(rocker, 0.6)
    pads = tuple(replace(p, pivot_angle=math.pi - p.pivot_angle) for p in reversed(bearing.pads))
    right = predict(bearing, load_direction=-1.4, effects=effects(False), **POINT)
    left = predict(
        bearing.with_pads(pads), load_direction=math.pi + 1.4, effects=effects(True), rotation="clockwise", **POINT
    )
    np.testing.assert_allclose(MIRROR @ left.h @ MIRROR, right.h, rtol=1e-9)
    np.testing.assert_allclose(MIRROR @ left.bearing_h @ MIRROR, right.bearing_h, rtol=1e-9)
    np.testing.assert_allclose(MIRROR @ left.position, right.position, rtol=1e-9)
    np.testing.assert_allclose(-left.tilt[::-1], right.tilt, rtol=1e-9)
    np.testing.assert_allclose(left.pad_load[::-1], right.pad_load, rtol=1e-9)
    np.testing.assert_allclose(left.pad_temperature()[::-1], right.pad_temperature(), rtol=1e-9)
    assert left.attitude_angle == pytest.approx(right.attitude_angle)
    assert (left.speed, left.rotation, right.rotation) == (SPEED, *reversed(ROTATIONS))


def test_a_shaft_against_the_stated_sense_enters_at_the_other_edge(rocker):
    stated = with_offset(rocker, 0.6, "counter-clockwise")
    backward = predict(stated, rotation="clockwise", **POINT)
    other_edge = predict(with_offset(rocker, 0.4), rotation="clockwise", **POINT)
    # entries that vanish by symmetry are rounding
    close(backward.h, other_edge.h, 1e-12)
    assert backward.kxx < 0.2 * predict(stated, **POINT).kxx


def test_the_sense_of_the_bearing_is_the_default(rocker):
    assert predict(with_offset(rocker, 0.6, "clockwise"), **POINT).rotation == "clockwise"
    assert predict(rocker, **POINT).rotation == "counter-clockwise"


def test_leading_edges_belong_to_the_stated_sense_else_to_that_of_the_runs(rocker):
    right, left = ROTATIONS
    assert as_it_turns(with_offset(rocker, 0.6), {left}, right).rotation == left
    assert as_it_turns(with_offset(rocker, 0.6, left), {*ROTATIONS}, right).rotation == left
    assert as_it_turns(rocker, {*ROTATIONS}, left).rotation == left
    assert as_it_turns(rocker, set(), left).rotation == left
    with pytest.raises(BearingError, match=r"\[bearing\] rotation: the shaft turns both ways"):
        as_it_turns(with_offset(rocker, 0.6), {*ROTATIONS})


def test_a_sense_that_there_is_not_is_refused(rocker, rocker_file):
    with pytest.raises(OptionError, match="Did you mean 'clockwise'"):
        predict(rocker, rotation="clokwise", **POINT)
    text = rocker_file.read_text().replace("[bearing]", '[bearing]\nrotation = "left"')
    with pytest.raises(BearingError, match=r"\[bearing\] rotation: 'left' is no sense of turning"):
        parse_bearing(text, "b.toml")


def test_arcs_are_laid_out_from_the_leading_edge_of_the_stated_sense(rocker_file):
    # two pads 60 deg apart that meet only if each reaches 0.75 of its arc towards the other
    text = rocker_file.read_text().replace("pivot_offset = 0.5", "pivot_offset = [0.75, 0.5, 0.5, 0.5, 0.5]")
    text = text.replace('arc = "63.5 deg"', 'arc = ["80 deg", "60 deg", "60 deg", "60 deg", "60 deg"]')
    with pytest.raises(BearingError, match="pad #5 overlaps pad #1"):
        parse_bearing(text, "b.toml")
    with pytest.raises(BearingError, match="pad #1 overlaps pad #2"):
        parse_bearing(text.replace("[bearing]", '[bearing]\nrotation = "clockwise"'), "b.toml")


def test_model_and_rig_have_the_same_words():
    assert operating_point.ROTATIONS == ROTATIONS


LINES = {"excitation": 2 * math.pi * np.array([10.0, 25.0, 50.0]), "mesh": (40, 4)}
MIRRORED_PADS = [0, 4, 3, 2, 1]


@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
@pytest.mark.parametrize("aside", [0.2, 0.9, 2.0])
def test_mirrored_load_mirrors_the_bearing(rocker, thermal, aside):
    # a pad's inertia resists its tilt: then the shaft's rotation tells left from right, by 0.1 % at 25 Hz
    light = changed_pads(rocker, mass=1e-9, moment_of_inertia=1e-12)
    left, right = (run(light, direction=DOWN + side * aside, thermal=thermal, **LINES) for side in (-1, 1))
    np.testing.assert_allclose(left.pad_load, right.pad_load[MIRRORED_PADS], rtol=1e-5, atol=0.1)
    np.testing.assert_allclose(left.position, right.position * [-1.0, 1.0], atol=1e-10)
    close(MIRROR @ right.h @ MIRROR, left.h, 1e-4)
    assert left.min_film == pytest.approx(right.min_film, rel=1e-5)
    assert left.power_loss == pytest.approx(right.power_loss, rel=1e-5)


def test_what_tells_left_from_right_is_not_symmetric(rocker):
    # hot oil goes from pad to pad with the rotation; a held pad leans with it
    for effect in (Effect("hot_oil_carryover", fraction=0.8), Effect("pivot_rotation", rotational_stiffness=3e4)):
        p = run(rocker, effect, **LINES)
        assert abs(p.pad_load[1] / p.pad_load[4] - 1.0) > 1e-3


def test_mirrored_halves_of_a_film(rocker):
    # the half film that is solved, against the whole one that a shaft almost exactly in line asks for
    half, whole = run(rocker, **LINES), run(rocker, Effect("misalignment", angle=1e-9, direction=0.3), **LINES)
    assert whole.pressure[0].shape[1] == 2 * half.pressure[0].shape[1] - 1
    close(whole.h, half.h, 1e-6)
    np.testing.assert_allclose(whole.pressure[0][:, ::-1], whole.pressure[0], rtol=1e-4, atol=1.0)
