"""Verdicts: intervals of effects by their limits, and what a held-out gap says of a name: shares above noise."""

import math
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Linear, posterior
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.unknowns import Unknowns
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import Element, Layout, Observations
from tpjb_ident.diagnosis.verdict import rules
from tpjb_ident.diagnosis.verdict.behaviour import _words
from tpjb_ident.diagnosis.verdict.decide import parameters_of
from tpjb_ident.diagnosis.verdict.held_out import HeldOut, Touched, held_out_gap
from tpjb_ident.diagnosis.verdict.interval import errors_each_way
from tpjb_ident.diagnosis.verdict.rules import _named, _of_model, _places, _without_effects, look_alikes


class Ordered:
    """Pairs as a mapping has them, of what has no hash."""

    def __init__(self, pairs):
        self.pairs = list(pairs)

    def items(self):
        return self.pairs


def fit(values, amplitudes, errors, names, basis=()):
    free = [SimpleNamespace(name=name, unit="m") for name in names]
    candidate = SimpleNamespace(free=free, basis=basis, fixed={})
    fault = SimpleNamespace(name="x", candidate=candidate, values=values)
    return SimpleNamespace(faults=[fault], amplitudes=[np.array(amplitudes)], errors=[np.array(errors)])


def test_a_size_has_a_limit_on_either_side():
    (size,) = parameters_of(fit(lambda a: {"s": a[0]}, [3.0], [0.5], ["s"]), 0).values()
    assert (size.value, size.unit) == (3.0, "m")
    assert (size.lo, size.hi) == pytest.approx((3.0 - 0.98, 3.0 + 0.98))


@pytest.mark.parametrize("sign", [1.0, -1.0])  # of a parameter that falls where its amplitude rises
def test_a_factor_has_its_limits_on_its_own_scale(sign):
    (factor,) = parameters_of(fit(lambda a: {"f": math.exp(sign * a[0])}, [0.0], [0.1], ["f"]), 0).values()
    assert (factor.lo, factor.hi) == pytest.approx((math.exp(-0.196), math.exp(0.196)))


def test_sizes_by_pad_that_share_amplitudes_have_theirs():
    basis = ((1.0, 0.0), (0.0, 2.0))

    def values(amplitudes):
        return dict(zip(("p1", "p2"), np.asarray(basis).T @ amplitudes, strict=True))

    found = parameters_of(fit(values, [1.0, 2.0], [0.1, 0.1], ["p1", "p2"], basis), 0)
    assert (found["p1"].lo, found["p1"].hi) == pytest.approx((1.0 - 0.196, 1.0 + 0.196))
    assert (found["p2"].lo, found["p2"].hi) == pytest.approx((4.0 - 0.392, 4.0 + 0.392))


def held_out(before):
    """Two elements whose noise leaves 0.3 sigma, and a baseline with a gap."""
    elements = tuple(Element("h", name, ()) for name in ("kxx", "kyy"))
    observations = Observations(Layout(()), np.zeros(2), 0.09 * np.eye(2), np.full(2, math.sqrt(0.91)), elements)
    problem = SimpleNamespace(observations=observations, base=np.full(2, before), held=np.ones(2, dtype=bool))
    return HeldOut(SimpleNamespace(problem=problem, needs_more=lambda scale: False, has_terms=False), None)


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (0.36, 0.24, 0.0),  # a third less, and nothing but noise is left
        (0.36, 0.36, 1.0),
        (5.0, 2.5, (2.5**2 - 0.09) / (25.0 - 0.09)),
        (1.0, 2.0, (4.0 - 0.09) / 0.91),
        (0.36, math.inf, math.inf),
        (0.2, 0.25, 0.0),
    ],
)
def test_what_is_left_of_a_gap_is_counted_above_noise(before, after, share):
    held = held_out(before)
    assert held.before == pytest.approx(before)
    assert held.remaining(after) == pytest.approx(share)


def test_a_gap_that_grows_out_of_the_noise_is_no_gap_closed():
    assert held_out(0.2).remaining(0.5) > 1e3


@pytest.mark.parametrize(
    ("after", "along", "shrunk"),
    [
        (2.0, ((8.0, 0.5),), True),  # one thermometer: the gap over everything stays
        (2.002, ((8.0, 0.5),), True),  # to the accuracy of a prediction
        (2.1, ((8.0, 0.5),), False),  # a name does not let the gap over everything grow
        (1.0, ((8.0, 0.5), (4.0, 3.0)), False),  # each name halves its own
        (1.0, ((3.0, 1.8),), False),
        (1.0, (), False),  # without it there is no equilibrium
    ],
)
def test_each_effect_halves_the_gap_along_what_it_moves(after, along, shrunk):
    held = held_out(2.0)
    touched = sorted((Touched("x", *ends, True) for ends in along), key=lambda one: -one.remaining)
    assert HeldOut(held.fit, np.full(2, after), tuple(touched)).is_shrunk == shrunk


@pytest.mark.parametrize(("unseen", "shrunk"), [(True, False), (False, True)])
def test_points_left_out_that_do_not_show_an_effect_do_not_judge_it(unseen, shrunk):
    held = held_out(2.0)
    held.fit.problem.held = np.array([True, False])
    held = HeldOut(held.fit, np.array([2.1, 0.5]), (Touched("x", 8.0, 0.5, unseen),))
    assert held.is_shrunk == shrunk


@pytest.mark.parametrize(
    ("along", "verdict"),
    [
        (((8.0, 0.5), (4.0, 3.0)), "partly-explained"),
        (((8.0, 0.5), (4.0, 4.1)), "unexplained"),  # by the second the gap grows
        ((), "unexplained"),
    ],
)
def test_an_effect_by_which_the_gap_grows_is_no_part_of_a_story(along, verdict):
    held = held_out(5.0)
    touched = sorted((Touched("x", *ends, True) for ends in along), key=lambda one: -one.remaining)
    held = HeldOut(held.fit, np.full(2, 2.0), tuple(touched))
    vars(held)["free"] = 0.3  # with tolerances free all of it is closed
    assert _named(held, (), ()).name == verdict


@pytest.mark.parametrize(
    ("scale", "without", "with_names"),
    [(0.1, "consistent", "named"), (0.5, "consistent", "partly-explained"), (1.5, "unexplained", "unexplained")],
)
def test_a_model_may_be_wrong_by_what_it_is_trusted_to(scale, without, with_names):
    # a rig that the model misses by half of its stated error is not unexplained, but a name is not the whole story
    held = held_out(5.0)
    held.fit.needs_more = lambda limit: scale > limit
    held.fit.p, held.fit.leftover, held.fit.label = 0.5, "something", "x"
    held.fit.faults, held.fit.names = (SimpleNamespace(is_term=False, label="x", candidate=None),), frozenset({"x"})
    assert _without_effects(held).name == without
    held = HeldOut(held.fit, np.full(2, 1.0), (Touched("x", 8.0, 0.5, True),))
    vars(held)["free"] = 0.3
    comparison = SimpleNamespace(tenable=[held.fit], probabilities={}, shares={})
    with mock.patch.object(rules, "_places", return_value=()):
        judgement = _of_model(comparison, held.fit.names, held, ())
    assert judgement.name == with_names
    assert ("the model may be trusted to that" in judgement.reasons[0]) == (with_names == "partly-explained")


def bent_case(contradicted, jump=0.0):
    """A fit of one effect beside a tolerance 1.5 deviations out, which bends along what the effect moves.

    Just short of that place K and C jump.
    """
    effect, tolerance = np.random.default_rng(4).normal(size=(2, 12))
    held, there = np.arange(12) >= 4, np.array([1.0, 1.5])

    def solved(theta):
        smooth = effect * theta[0] + tolerance * theta[1] + 0.4 * effect * theta[1] ** 2
        return smooth + jump * (theta[1] < 1.5)

    measured = solved(there) + 2.0 * contradicted * held * effect
    elements = tuple(Element("h", "kxx", (("load", float(k)),)) for k in range(12))
    noise, prior = 0.0025 * np.eye(12), np.array([[0.0], [9.0], [-9.0], [9.0]])
    problem = SimpleNamespace(
        observations=Observations(Layout(()), measured, noise, np.full(12, 0.05), elements), base=np.zeros(12),
        measured=measured, sigma=np.ones(12), nuisances=(None,), held=held,
        errors=SimpleNamespace(covariance=lambda level: noise),
    )  # fmt: skip
    fault = SimpleNamespace(label="x", own=-1, is_term=False, width=prior[1], prior=prior)
    unknowns = Unknowns(problem, (fault,))
    jacobian = np.column_stack([effect, tolerance + 0.8 * effect * there[1]])
    linear = SimpleNamespace(residual=measured - solved(there), theta=there, jacobian=jacobian, width=unknowns.width)
    fit = SimpleNamespace(
        problem=problem, faults=(fault,), unknowns=unknowns, linear=linear, posterior=SimpleNamespace(leading=0)
    )
    return fit, lambda task, jobs: [solved(theta) for _, theta in jobs]


@pytest.mark.parametrize("contradicted", [False, True])
def test_how_a_tolerance_bends_is_no_gap_of_an_effect(contradicted):
    fit, run = bent_case(contradicted)
    (touched,) = held_out_gap(run, fit).touched
    assert touched.unseen
    assert (touched.remaining > Deciding.halved**2) == contradicted


def test_a_jump_of_k_and_c_beside_the_fit_is_no_gap_of_an_effect():
    (expected,), (touched,) = (held_out_gap(run, fit).touched for fit, run in (bent_case(False), bent_case(False, 1.0)))
    assert (touched.before, touched.after) == pytest.approx((expected.before, expected.after))


def test_a_fault_without_which_there_is_no_equilibrium_acts_as_where_all_is_stated():
    fit, solved = bent_case(False)

    def run(task, jobs):
        return [None if theta[1] and not theta[0] else answer for (_, theta), answer in zip(jobs, solved(task, jobs))]

    (expected,), (touched,) = held_out_gap(solved, fit).touched, held_out_gap(run, fit).touched
    assert (touched.before, touched.after) == pytest.approx((expected.before, expected.after))


def kinked_case(slope):
    """A fit of one effect whose work grows by another slope on either side of a place near the fit."""
    effect, tolerance = np.random.default_rng(4).normal(size=(2, 12))
    there = np.array([1.0, 0.0])

    def solved(theta):
        return effect * (1.0 + slope * (theta[0] - 1.0)) + tolerance * theta[1]

    noise, prior = 0.0025 * np.eye(12), np.array([[0.0], [9.0], [-9.0], [9.0]])
    nuisance = SimpleNamespace(column=None)
    errors = ErrorModel(noise, 1e-9 * np.eye(12), np.array([1.0]))
    problem = SimpleNamespace(measured=solved(there), sigma=np.ones(12), nuisances=(nuisance,), errors=errors)
    fault = SimpleNamespace(name="x", label="x", own=-1, is_term=False, width=prior[1], prior=prior)
    unknowns = Unknowns(problem, (fault,))
    linear = Linear(np.zeros(12), there, np.column_stack([effect, tolerance]), unknowns.width)
    return Fit(unknowns, linear, posterior(errors, linear)), lambda task, jobs: [solved(theta) for _, theta in jobs]


@pytest.mark.parametrize(
    ("slope", "times"),
    [
        (1.0, 1.0),
        (0.4, 2.5),  # beside the fit the effect does less than its derivative says: its size is less sure
        (0.1, 4.0),  # no more than that is asked for
        (2.0, 1.0),  # no nearer than derivatives say
    ],
)
def test_an_interval_ends_where_the_profile_does_and_no_nearer_than_derivatives_say(slope, times):
    fit, run = kinked_case(slope)
    ((below, above),) = errors_each_way(run, fit)
    assert below / fit.errors[0] == pytest.approx(times, rel=0.01)
    assert above / fit.errors[0] == pytest.approx(times, rel=0.01)


@pytest.mark.parametrize(
    ("answer", "times"),
    [
        (lambda y, far: None if far else y, 1.0),  # no equilibrium: the interval is that of derivatives
        (lambda y, far: y if far else y + 1.0, 2.5),  # a rise on the way is no end
    ],
)
def test_an_interval_beyond_what_is_solved_or_jumps(answer, times):
    fit, run = kinked_case(0.4)
    limit = 1.5 * 1.96 * fit.errors[0][0]

    def changed(task, jobs):
        return [answer(y, abs(theta[0] - 1.0) > limit) for (_, theta), y in zip(jobs, run(task, jobs), strict=True)]

    ((below, above),) = errors_each_way(changed, fit)
    assert [*below / fit.errors[0], *above / fit.errors[0]] == pytest.approx([times, times], rel=0.01)


@pytest.mark.parametrize(
    ("ends", "unit", "words"),
    [
        ([-2e-6, 0.0], "m", "changes from -2 to 0 µm over the static load"),  # at its bound
        ([0.0, 1.0], "K", "changes from 0 to 1 K"),
        ([-1.0, 1.0], "1", "changes from -100 to 100 %"),
        ([math.inf, 1e9], "N/m", "changes from inf to 1e+03 MN/m"),  # a spring that gives at one end alone
        ([1.0, 2.0], "K", "grows in proportion"),
        ([-4.0, -1.0], "K", "falls"),
    ],
)
def test_a_drift_has_words_whatever_its_ends(ends, unit, words):
    assert _words(ends, [1000.0, 2000.0], "static_load", unit).startswith(words)


def test_a_group_of_look_alikes_begins_with_the_effect_that_is_listed():
    # the most probable model need not hold the likeliest name: others stand beside that
    held = held_out(2.0)
    held.fit.names, held.fit.has_terms = frozenset({"oil_viscosity"}), False
    judgement = look_alikes(held, ("supply_temperature", "oil_viscosity", "viscosity_law"), {})
    assert judgement.name == "ambiguous"
    assert judgement.family == ("oil_viscosity", "supply_temperature", "viscosity_law")


def test_where_no_group_can_be_named_the_likeliest_names_are_said():
    # pads 8 deviations too short are as well oil, inlet, arc: several effects close the gap, and no name is due
    shares = {"pad_arc_error": 0.3, "oil_viscosity": 0.4, "pad_length_error": 0.2}
    judgement = look_alikes(held_out(2.0), (), shares)
    assert judgement.name == "unexplained"
    assert judgement.reasons[0].endswith("(likeliest: oil_viscosity, pad_arc_error, pad_length_error)")


@pytest.mark.parametrize(
    ("probabilities", "listed"),
    [
        ((0.5, 0.3, 0.1, 0.06), ("soft_pivot pad 1", "soft_pivot pad 2", "soft_pivot pad 3")),
        ((0.93, 0.01, 0.01, 0.01), ()),
        ((0.6, 0.0, 0.0, 0.38), ()),  # the other name is no place
    ],
)
def test_a_pad_is_named_where_it_is_as_sure_as_a_name(probabilities, listed):
    names = ("soft_pivot", "soft_pivot", "soft_pivot", "pad_bore")
    fits = []
    for pad, name in enumerate(names, start=1):
        fault = SimpleNamespace(name=name, label=f"{name} pad {pad}", candidate=SimpleNamespace(fixed={"pad": pad}))
        fits.append(SimpleNamespace(names=frozenset({name}), faults=(fault,)))
    comparison = SimpleNamespace(probabilities=Ordered(zip(fits, probabilities, strict=True)), tenable=fits)
    assert _places(comparison, fits[0]) == listed


def test_a_direction_is_no_place():
    """Every start of the grid leads to the same direction, which is free beside it."""
    fits = []
    for angle in (0.0, 0.785):
        candidate = SimpleNamespace(fixed={})
        fault = SimpleNamespace(name="misalignment", label=f"misalignment direction {angle}", candidate=candidate)
        fits.append(SimpleNamespace(names=frozenset({"misalignment"}), faults=(fault,)))
    comparison = SimpleNamespace(probabilities=Ordered(zip(fits, (0.6, 0.4), strict=True)), tenable=fits)
    assert _places(comparison, fits[0]) == ()
