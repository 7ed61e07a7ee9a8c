"""Next tests: checks of single parameters, tests on the rig, effects that a test does not see, two tests together."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.effects import Effect, kind_of
from tests.diagnosis.rocker_case import LINE, SPEED, points, rocker_setup
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.next_test import (
    CHECKS,
    Check,
    Design,
    Separation,
    designs,
    options_for,
    ranked,
    reversible,
    say,
    separated,
    suggested,
    together,
)
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import dynamic


@pytest.fixture(scope="module")
def setup():
    return rocker_setup(accuracy=1e-5)


def by_effect(name):
    return next(c for c in CHECKS if c.effect == name)


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.effect)
def test_every_check_reads_a_parameter_that_its_effect_has(check):
    assert check.parameter in {p.name for p in kind_of(check.effect).parameters}
    assert check.sigma > 0


def test_a_check_counts_the_difference_of_its_own_parameter_only():
    slow, heavy = [Effect("channel_delay", delay=8e-6)], [Effect("fluid_inertia", added_mass=20.0)]
    assert by_effect("channel_delay").separation(slow, heavy) == pytest.approx(8.0)
    assert by_effect("channel_delay").separation(slow, slow) == 0.0
    assert by_effect("oil_viscosity").separation(slow, heavy) == 0.0


def test_a_check_tells_pads_apart():
    one, five = (Effect("pad_offset", pad=k, radial_offset=3e-6) for k in (1, 5))
    assert by_effect("pad_offset").separation([one], [five]) == pytest.approx(math.hypot(3.0, 3.0))
    assert by_effect("pad_offset").separation([one, five], [five]) == pytest.approx(3.0)


def test_probes_on_the_housing_do_not_see_its_spring(setup):
    spring = [Effect("housing_flexibility", stiffness=3e9)]
    point = Layout(dynamic([5000.0], [SPEED], SPEED, -math.pi / 2, 0))
    (blind,) = (d for d in designs(setup, point) if "housing_flexibility" in d.blind)
    seeing, not_seeing = Design("from the frame", point), Design("from the housing", point, blind.blind)
    tests = ranked([separated(setup, d, spring, [[]], Tolerances()) for d in (seeing, not_seeing)])
    assert [s.design.words for s in tests] == ["from the frame", "from the housing"]
    assert tests[0].expected > 3.0
    assert tests[1].expected == 0.0


def test_checks_are_ranked_beside_tests_on_the_rig(setup):
    slow, heavy = [Effect("channel_delay", delay=2e-5)], [Effect("fluid_inertia", added_mass=40.0)]
    options = [o for o in options_for(setup, Layout(())) if isinstance(o, Check)]
    assert len(options) == len(CHECKS)
    tests = ranked([separated(setup, o, slow, [heavy], Tolerances()) for o in options])
    assert tests[0].design is by_effect("channel_delay")


@pytest.mark.parametrize(
    ("expected", "count", "apart"), [((6.0, 5.0), 1, 6.0), ((4.0, 3.0), 2, 5.0), ((1.0, 0.5), 2, math.hypot(1.0, 0.5))]
)
def test_a_second_test_is_suggested_where_one_is_not_enough(expected, count, apart):
    tests = [Separation(CHECKS[i], (d,)) for i, d in enumerate(expected)]
    chosen = suggested(tests)
    assert len(chosen) == count
    assert together(chosen) == pytest.approx(apart)
    words = say(chosen, "a", "b")
    assert ("nothing on the list" in words) == (apart < 3.0)
    assert all(s.design.words in words for s in chosen)


def test_the_nearest_rival_counts_and_two_tests_may_be_chosen_for_what_each_tells():
    # the best two alone see the first rival only; the third sees the second
    tests = [Separation(CHECKS[i], each) for i, each in enumerate([(9.0, 1.0), (8.0, 1.0), (0.5, 7.0)])]
    chosen = suggested(tests)
    assert {s.design for s in chosen} == {CHECKS[0], CHECKS[2]}
    assert together(chosen) == pytest.approx(math.hypot(1.0, 7.0))
    assert "from b and c by at least 7 standard deviations" in say(chosen, "a", "b", "c")


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
