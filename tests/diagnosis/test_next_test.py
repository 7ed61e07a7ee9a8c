"""Next tests: checks of single parameters, effects that a test does not see, two tests together."""

import math

import pytest

from model.effects import Effect, kind_of
from tests.diagnosis.rocker_case import SPEED, rocker_setup
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.next_test import (
    CHECKS,
    Check,
    Design,
    Separation,
    designs,
    options_for,
    ranked,
    say,
    separated,
    suggested,
    together,
)
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import dynamic


@pytest.fixture(scope="module")
def setup():
    return rocker_setup()


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
