"""Tests that could follow: the other sense of rotation, hot polygon, hotter oil, and trials of next tests."""

from dataclasses import replace

import numpy as np
import pytest

from model.effects import Effect
from tests.diagnosis.rocker_case import LINE, SPEED, points, rocker_setup
from tpjb_ident.diagnosis.next_test import Design, designs, reversible
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import dynamic

#: Without thermometers thin oil and warm oil are alike.
ALIKE = ("oil_viscosity", "supply_temperature")


@pytest.fixture(scope="module")
def setup():
    return rocker_setup(accuracy=1e-5)


@pytest.fixture(scope="module")
def found(setup):
    return designs(setup, Layout(points([3000.0, 5000.0, 7000.0], 5)))


def by_words(found, words):
    (one,) = (d for d in found if words in d.words)
    return one


def predicted(design, setup, *effects):
    seen = design.planned(setup)
    return design.forward(setup, seen)(effects)


def test_the_other_sense_of_rotation_swaps_what_is_left_and_right(setup, found):
    reverse = by_words(found, "turning the other way")
    straight = Design("as it was", Layout(points([3000.0, 5000.0, 7000.0])))
    names = [e.observable for e in reverse.planned(setup).elements]
    h = np.array([n[0] in "kc" for n in names])
    sign = np.array([-1.0 if n[1:] in ("xy", "yx") else 1.0 for n in names])[h]
    five = sign * predicted(reverse, setup, Effect("soft_pivot", pad=5, stiffness_factor=0.5))[h]
    two = predicted(straight, setup, Effect("soft_pivot", pad=2, stiffness_factor=0.5))
    assert five == pytest.approx(two, rel=1e-4, abs=2e-4 * np.abs(two).max())
    assert np.abs(five - predicted(straight, setup)).max() > 1e-2 * np.abs(two).max()


def test_a_sensor_error_does_not_turn_with_the_shaft(setup, found):
    reverse = by_words(found, "turning the other way")
    crossed = Effect("loadcell_crosstalk", fraction=0.01)
    change = predicted(reverse, setup, crossed) - predicted(reverse, setup)
    tests = tuple(replace(t, speed=-t.speed) for t in reverse.layout.dynamic)
    straight = Design("as it was", replace(reverse.layout, dynamic=tests))
    same = predicted(straight, setup, crossed) - predicted(straight, setup)
    names = np.array([e.observable for e in reverse.planned(setup).elements])
    assert change[names == "kxy"] == pytest.approx(same[names == "kxy"], rel=1e-3)


def test_pads_that_carry_one_way_only_are_not_reversed(setup):
    offset = setup.change_pads(lambda k, pad: replace(pad, pivot_offset=0.6))
    assert reversible(setup)
    assert not reversible(offset)
    assert not any("other way" in d.words for d in designs(offset, Layout(dynamic([5e3], [LINE], SPEED, 0.0, 0))))


def test_growth_shows_in_a_hot_polygon_only(setup, found):
    growth = Effect("thermal_growth", clearance_change=7e-6)
    for words, wanted in (("still hot", 7e-6), ("200 N, cold", 0.0)):
        design = by_words(found, words)
        change = predicted(design, setup, growth) - predicted(design, setup)
        assert change[:5] == pytest.approx(np.full(5, wanted), abs=1e-12)


def test_hotter_oil_is_hotter_and_thinner(setup, found):
    hot = predicted(by_words(found, "10 K hotter"), setup)
    cold = predicted(by_words(found, "turning the other way"), setup)  # a symmetric bearing: as it was
    names = [e.observable for e in by_words(found, "10 K hotter").planned(setup).elements]
    warmer = np.array([h - c for h, c, n in zip(hot, cold, names, strict=True) if n == "pad_temperature"])
    assert np.median(warmer) == pytest.approx(9.0, abs=3.0)


def test_plenty_of_oil_ends_starvation_and_is_no_test_for_carry_over(setup, found):
    plenty = by_words(found, "so much oil")
    starved, carried = [Effect("starvation", arc_fraction=0.1)], [Effect("hot_oil_carryover", fraction=0.4)]
    assert not plenty.acting(starved)
    assert plenty.fits(starved, [])
    assert not plenty.fits(starved, carried)
