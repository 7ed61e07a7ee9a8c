"""Pads that differ: one value per pad in the bearing file, and what the model makes of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import BearingError
from model.bearing_file import parse_bearing
from model.effects import Effect, EffectError
from model.pad.bending import pad_deformation
from model.pivots import pivot_laws
from model.predict import predict
from model.setup import Setup
from model.statics.pad_film import pad_films
from tests.model.points import OMEGA, SPEED, close

POINT = {"load": 5000.0, "speed": SPEED, "excitation": OMEGA, "mesh": (24, 4)}
LISTS = {
    'arc = "63.5 deg"': 'arc = ["63.5 deg", "58 deg", "60 deg", "63.5 deg", "60 deg"]',
    "pivot_offset = 0.5": "pivot_offset = [0.5, 0.55, 0.5, 0.45, 0.5]",
    'assembled_clearance = "0.080 mm"': 'assembled_clearance = ["70 um", "75 um", "80 um", "90 um", "95 um"]',
    'pad_clearance = "0.130 mm"': 'pad_clearance = ["0.130 mm", "0.125 mm", "0.130 mm", "0.14 mm", "0.130 mm"]',
    'thickness = "16 mm"': 'thickness = ["16 mm", "15 mm", "16 mm", "14 mm", "16 mm"]',
    'mass = "0.540 kg"': 'mass = ["0.54 kg", "0.50 kg", "0.54 kg", "0.52 kg", "0.54 kg"]',
    'pivot_diameter = "119.6 mm"': 'pivot_diameter = ["119.6 mm", "119.6 mm", "115 mm", "119.6 mm", "119.6 mm"]',
}


@pytest.fixture(scope="module")
def text(rocker_file):
    text = rocker_file.read_text(encoding="utf-8")
    for before, after in LISTS.items():
        assert text.count(f"\n{before}") == 1
        text = text.replace(f"\n{before}", f"\n{after}")
    return text


@pytest.fixture(scope="module")
def different(text):
    return parse_bearing(text, "different.toml")


def test_every_pad_has_its_own_sizes(different, rocker):
    assert [round(1e6 * p.assembled_clearance) for p in different.pads] == [70, 75, 80, 90, 95]
    assert [round(1e3 * p.thickness) for p in different.pads] == [16, 15, 16, 14, 16]
    assert [round(1e3 * p.elastic_thickness) for p in different.pads] == [16, 15, 16, 14, 16]
    assert [p.pivot_offset for p in different.pads] == [0.5, 0.55, 0.5, 0.45, 0.5]
    assert different.pivot_of(different.pads[2]).pivot_diameter == pytest.approx(0.115)
    assert different.pivot_of(different.pads[3]).pivot_diameter == pytest.approx(0.1196)
    assert (different.like_pivots, rocker.like_pivots) == (False, True)
    assert all(pad.pivot is None for pad in rocker.pads)


def test_a_lining_thicker_than_its_pad_is_refused(text):
    with pytest.raises(BearingError, match="babbitt_thickness < elastic_thickness <= thickness"):
        parse_bearing(text.replace('"14 mm", "16 mm"]', '"2 mm", "16 mm"]'), "different.toml")


def test_each_pivot_has_the_formula_of_its_own_radii(different):
    laws = pivot_laws("kirk", different)
    assert laws[0] == laws[1] == laws[3]
    assert laws[2].deflection(4000.0) > laws[0].deflection(4000.0)


@pytest.mark.slow
def test_one_mesh_per_different_pad(different):
    films = pad_films(Setup(different, pivot_laws("kirk", different), "tehd"))[0]
    bodies = [pad_deformation(pad, different, film.grid) for pad, film in zip(different.pads, films, strict=True)]
    assert len({id(body) for body in bodies}) == 4
    assert bodies[2] is bodies[4]  # they differ in what the solid does not see
    again = [pad_deformation(pad, different, film.grid) for pad, film in zip(different.pads, films, strict=True)]
    assert all(a is b for a, b in zip(bodies, again, strict=True))


@pytest.mark.parametrize("angle", [2 * math.pi / 5, 1.0, math.pi])
def test_a_ring_of_different_pads_and_its_load_turned_as_a_whole_turn_the_answer(different, angle):
    pads = different.pads
    turned = different.with_pads(tuple(replace(p, pivot_angle=p.pivot_angle + angle) for p in pads))
    hot = [Effect("hot_oil_carryover", fraction=0.8)]
    first = predict(different, load_direction=-1.3, effects=hot, **POINT)
    second = predict(turned, load_direction=-1.3 + angle, effects=hot, **POINT)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    close(turn.T @ second.h @ turn, first.h, 1e-6)
    np.testing.assert_allclose(second.position, turn @ first.position, atol=1e-10)
    np.testing.assert_allclose(second.pad_load, first.pad_load, rtol=0, atol=0.01)
    assert len({round(flow.inflow, 12) for flow in first.pad_flow}) == 5


def test_effects_on_the_tilt_of_all_pads_need_pivots_alike(different):
    with pytest.raises(EffectError, match="its pivots differ from pad to pad"):
        predict(different, effects=[Effect("pivot_rolling", factor=1.0)], **POINT)
