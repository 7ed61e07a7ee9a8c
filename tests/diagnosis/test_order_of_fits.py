"""Explanations are fitted in the order of their scores, until none comes near the leader."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.effects import Effect, known_effects
from tests.diagnosis.rocker_case import noisy, rocker_setup, whole_layout
from tpjb_ident.diagnosis.comparison import search
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Linear, posterior
from tpjb_ident.diagnosis.comparison.paths import Path, lay_paths
from tpjb_ident.diagnosis.comparison.scores import Strain, scores
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.comparison.unknowns import path_changes
from tpjb_ident.diagnosis.diagnose import diagnose, pose
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError, with_coarser_mesh
from tpjb_ident.diagnosis.forward.nuisance import TOGETHER
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.planned import planned_observations

TRIED = frozenset({"oil_viscosity", "probe_gain", "loadcell_gain", "probe_rotation", "channel_delay"})


def linear_case(scales):
    """A model of five numbers beside noise and a smooth error, and three columns that a fault may take."""
    rng = np.random.default_rng(8)
    smooth = rng.normal(size=(40, 4))
    errors = ErrorModel(0.1 * np.eye(40), smooth @ smooth.T + 0.01 * np.eye(40), np.array(scales))
    jacobian, columns = rng.normal(size=(40, 5)), rng.normal(size=(40, 3))
    width, theta = np.array([1.0, 1.0, 0.5, 2.0, 1.0]), 0.1 * rng.normal(size=5)
    residual = columns[:, 1] * 1.5 + rng.normal(size=40)
    return errors, Linear(residual, theta, jacobian, width), columns


def search_with(**known):
    """A search that knows only what its step under test asks for."""
    made = object.__new__(search._Search)
    made.__dict__.update(known)
    return made


def straight(column, name="x"):
    prior = np.array([[0.0], [3.0], [-1e6], [1e6]])
    fault = SimpleNamespace(width=prior[1], prior=prior, label=name)
    return Path(fault, column[:, None])


def test_evidence_is_the_density_of_what_was_observed_with_all_numbers_integrated_out():
    errors, linear, _ = linear_case([0.3, 1.0, 4.0])
    wide = linear.jacobian * linear.width
    offset = linear.residual + linear.jacobian @ linear.theta
    logs = []
    for index in range(3):
        whole = errors.covariance(index) + wide @ wide.T
        square = offset @ np.linalg.solve(whole, offset)
        logs.append(-0.5 * (square + np.linalg.slogdet(2.0 * np.pi * whole)[1]) + errors.log_weights[index])
    assert posterior(errors, linear).promised == pytest.approx(np.logaddexp.reduce(logs), abs=1e-9)


def test_a_score_is_the_evidence_of_the_model_with_the_fault():
    errors, linear, columns = linear_case([1.0])
    nothing = Strain(np.zeros((0, 5)), np.zeros(0))
    found = scores(errors, linear, [straight(column, k) for k, column in enumerate(columns.T)], nothing)
    assert found[0].path.fault.label == 1
    for score in found:
        wider = Linear(
            linear.residual, np.append(linear.theta, 0.0), np.column_stack([linear.jacobian, score.path.columns]),
            np.append(linear.width, 3.0),
        )  # fmt: skip
        whole = posterior(errors, wider)
        assert score.total == pytest.approx(whole.promised, abs=1e-9)
        assert score.amplitudes[0] == pytest.approx(whole.mean[-1], rel=1e-9)
    assert [s.total for s in found] == sorted((s.total for s in found), reverse=True)


@pytest.fixture(scope="module")
def campaign():
    """A rig whose oil is a fifth thinner than its file says, and few effects to be told apart."""
    setup = rocker_setup(accuracy=1e-5)
    planned = planned_observations(setup, whole_layout((2500.0, 7500.0)))
    forward = Forward(setup, planned.layout, planned.elements)
    hidden = forward.fresh()([Effect("oil_viscosity", factor=0.8)])
    skipped = frozenset(known_effects()) - TRIED
    return forward, pose(noisy(planned, hidden, 3), forward, DiagnoseSettings(workers=1, skip=skipped))


def fits_of(campaign, promising=search._Search._promising, **changed):
    """Every proposal that was fitted, with the largest estimate that waited, and what came out."""
    forward, problem = campaign
    fitted_in_order, fit = [], search._Search._fit

    def recorded(self, proposal):
        waiting = [p.estimate for p in self.proposals.values()]
        fitted_in_order.append((proposal, max(waiting, default=-np.inf)))
        fit(self, proposal)

    with pytest.MonkeyPatch.context() as patch, workers(forward, problem, 1) as run:
        patch.setattr(search._Search, "_fit", recorded)
        patch.setattr(search._Search, "_promising", promising)
        for name, value in changed.items():
            patch.setattr(Deciding, name, value)
        return fitted_in_order, search.compare(run, problem)


@pytest.fixture(scope="module")
def usual(campaign):
    return fits_of(campaign)


@pytest.mark.slow
def test_a_number_of_the_whole_bearing_is_followed_as_it_bends_towards_the_gap(campaign):
    forward, problem = campaign
    with workers(forward, problem, 1) as run:
        (oil,) = (path for path in lay_paths(run, problem) if path.fault.label == "oil_viscosity")
    near, straight_on = oil.weights(np.array([[oil.nodes.min()], [1.0]])) @ oil.columns.T
    assert oil.nodes.min() < -1.5  # thinner, and not thicker
    assert np.linalg.norm(near - straight_on * oil.nodes.min()) > 0.02 * np.linalg.norm(near)


@pytest.mark.slow
def test_what_a_fault_changes_is_nearly_the_same_on_a_coarser_mesh(campaign):
    forward, problem = campaign
    oil = next(fault for fault in problem.faults if fault.name == "oil_viscosity")
    place = (), np.zeros(len(problem.nuisances))
    both = with_coarser_mesh(forward)
    assert both.coarser.setup.mesh != forward.setup.mesh == both.setup.mesh
    ((_, fine),), ((_, coarse),) = (
        path_changes(model.fresh(), problem, place, [(oil, [-4.0])], 1)[0] for model in (forward, both)
    )
    assert 0.0 < np.linalg.norm(coarse - fine) < 0.03 * np.linalg.norm(fine)


def test_a_model_whose_coarser_mesh_has_no_equilibrium_does_without():
    def refused(self, *asked):
        raise NoEquilibriumError("none")

    setup = rocker_setup(accuracy=1e-5)
    planned = planned_observations(setup, whole_layout((2500.0,)))
    forward = Forward(setup, planned.layout, planned.elements)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Forward, "__call__", refused)
        assert with_coarser_mesh(forward) is forward


@pytest.mark.slow  # seconds: the bearing model itself
def test_the_likeliest_explanation_is_fitted_first_and_no_hopeless_one_at_all(usual):
    order, comparison = usual
    assert comparison.best.names == {"oil_viscosity"}
    assert [sorted(p.labels) for p, _ in order[:2]] == [[], ["oil_viscosity"]]
    last = [p for p, _ in order[2:] if p.labels != {"oil_viscosity"}]  # no fault, from the leader, and one in its place
    assert [len(p.labels) for p in last] in ([], [0], [1], [0, 1])
    assert all(p.estimate >= waiting for p, waiting in order[1 : len(order) - len(last)] if not p.coarse)
    assert len(order) <= 4


@pytest.mark.slow
def test_what_is_left_out_would_not_have_changed_the_answer(campaign, usual):
    few, quick = usual
    many, whole = fits_of(campaign, lambda *_: True, near=1e3, most_fits=8)
    assert len(many) == 8 > len(few)
    assert whole.best.labels == quick.best.labels
    # beside the leader nothing is fitted whose estimate could not take the name's certainty from it
    spare = 1.0 - Deciding.included
    assert whole.probabilities[whole.best] == pytest.approx(quick.probabilities[quick.best], abs=spare)
    left_out = [f for f in whole.fits if f.labels not in {fit.labels for fit in quick.fits}]
    assert sum(whole.probabilities[fit] for fit in left_out) < spare


@pytest.mark.slow
def test_a_search_that_was_cut_short_counts_what_waits_as_it_promises(campaign, usual):
    _, whole = usual
    assert whole.waiting == ()
    _, short = fits_of(campaign, most_fits=1)
    assert [fit.faults for fit in short.fits] == [()]
    assert short.probabilities[short.nothing] < 0.01
    assert short.holding("oil_viscosity") > 0.95
    assert short.probabilities[short.nothing] + sum(p for _, p in short.waiting) == pytest.approx(1.0)


def test_what_a_refused_step_promised_counts_for_no_explanation_beside(monkeypatch):
    errors, linear, columns = linear_case([1.0])
    state = posterior(errors, linear)
    assert state.refused == state.promised - state.total > 0.0
    totals = []
    monkeypatch.setattr(search._Search, "_propose", lambda self, score, *_, **words: totals.append(score.total))
    for refused in (0.0, 7.0):
        problem = SimpleNamespace(errors=errors, said_by=lambda fault: {})
        fit = SimpleNamespace(
            labels=frozenset(), faults=(), linear=linear, strain=Strain(np.zeros((0, 5)), np.zeros(0)),
            posterior=SimpleNamespace(refused=refused),
        )  # fmt: skip
        search_with(paths=(straight(columns[:, 1]),), problem=problem)._propose_neighbours(fit)
    assert totals[0] - totals[1] == pytest.approx(7.0)


def test_no_fault_at_all_is_proposed_from_where_a_single_one_leads(monkeypatch):
    errors, linear, _ = linear_case([1.0])
    monkeypatch.setattr(search, "Unknowns", lambda problem, faults: SimpleNamespace(width=linear.width))
    fault, proposals = SimpleNamespace(label="own", own=2), []
    tried = search_with(
        paths=(), problem=SimpleNamespace(errors=errors), _offer=proposals.append, _log_prior=lambda faults: 0.0
    )
    tried._propose_neighbours(
        SimpleNamespace(
            labels=frozenset({"own"}), faults=(fault,), linear=linear, strain=None,
            place_of=lambda fault: slice(2, 3), posterior=posterior(errors, linear),
        )
    )  # fmt: skip
    (nothing,) = proposals
    assert nothing.faults == ()
    # where all that is left has taken over what it did, by the model that the single one has reached
    np.testing.assert_allclose(nothing.place, posterior(errors, linear).mean)


@pytest.mark.slow
def test_without_an_effect_in_the_library_none_is_below_the_floor_or_named(campaign):
    forward, problem = campaign
    settings = DiagnoseSettings(workers=1, skip=frozenset(known_effects()))
    verdict = diagnose(problem.observations, forward.setup, settings).verdict
    assert (verdict.verdict, verdict.effects, verdict.below_floor) == ("unexplained", (), ())


def test_a_fault_that_no_derivative_sizes_is_needed_where_it_alone_makes_the_difference():
    """A pad that idles without it and carries with any of it: the size says nothing, and the evidence does."""
    tried = search_with()
    whole = SimpleNamespace(
        labels=frozenset({"a", "b"}), unsized=("b",), p=0.5, on_bound=False, posterior=SimpleNamespace(total=-20.0)
    )
    for without, needed in ((None, False), (-20.0 - 2.0 * Deciding.near, True), (-21.0, False)):
        rest = SimpleNamespace(posterior=SimpleNamespace(total=without))
        tried.fits = {} if without is None else {frozenset({"a"}): rest}
        assert tried._is_tenable(whole) == needed
    whole.unsized, tried.fits = (), {}
    assert tried._is_tenable(whole)
    whole.on_bound = True
    assert not tried._is_tenable(whole)


def test_what_tolerances_say_together_is_their_derivatives_beside_a_fit(campaign):
    forward, problem = campaign
    base, step = problem.scaled(problem.base), 0.01
    for name in ("probe_gain", "loadcell_gain"):
        fault = next(fault for fault in problem.faults if fault.name == name)
        members = problem.said_by(fault)
        assert {problem.nuisances[i].effect.split()[0] for i in members} == {TOGETHER[name]}
        column = sum(share * problem.scaled(problem.columns)[:, i] for i, share in members.items())
        moved = problem.scaled(forward.fresh()([fault.candidate.effect(fault.candidate.neutral + step)])) - base
        assert np.linalg.norm(moved / step - column) < 0.05 * np.linalg.norm(column)


def stub_search(total, estimate, labels=frozenset("a")):
    """A search led by a right fit, some nats above its score."""
    leader = stub_fit(total, labels)
    known = {"estimates": {labels: estimate}, "fits": {}, "begun": {}, "run": None, "problem": None}
    return search_with(_leader=lambda: leader, _log_prior=lambda faults: 0.0, **known)


def stub_fit(total, labels=frozenset("b")):
    state = SimpleNamespace(total=total, promised=total, scale=0.1)
    faults = tuple(SimpleNamespace(name=label, is_term=False) for label in sorted(labels))
    return SimpleNamespace(labels=labels, faults=faults, posterior=state, has_terms=False)


@pytest.mark.parametrize(
    ("total", "renewed"),
    [
        (-14.0, True),  # a rival
        (-16.0, False),  # too far behind
        (0.1, True),  # it leads: intervals rest on them
    ],
)
def test_a_fit_gets_derivatives_of_its_own_near_the_leader(monkeypatch, total, renewed):
    asked = []
    tried = stub_search(total=0.0, estimate=0.0)
    monkeypatch.setattr(search, "fitted", lambda *_: stub_fit(total))
    monkeypatch.setattr(search, "refined", lambda run, fit: asked.append(fit) or fit)
    tried._reached(SimpleNamespace(coarse=False))
    assert bool(asked) == renewed


@pytest.mark.parametrize(
    ("total", "rise", "times"),
    [
        (-20.0, -5.0, 1),
        (-20.0, -0.5, 2),
        (-20.0, 5.0, 2),
        (-200.0, 5.0, 1),  # far behind, for all that is known on derivatives from before the jump
    ],
)
def test_after_a_coarse_start_derivatives_are_asked_again_unless_they_were_refused(monkeypatch, total, rise, times):
    asked = []

    def refined(run, fit):
        asked.append(fit)
        return stub_fit(fit.posterior.total + rise)

    tried = stub_search(total=0.0, estimate=0.0)
    monkeypatch.setattr(search, "fitted", lambda *_: stub_fit(total))
    monkeypatch.setattr(search, "refined", refined)
    tried._reached(SimpleNamespace(estimate=-100.0, coarse=True))
    assert len(asked) == times


@pytest.mark.parametrize(
    ("labels", "estimate", "fitted"),
    [("b", -25.0, True), ("bc", -25.0, False), ("bc", -9.0, True), ("b", -31.0, False)],
)
def test_what_a_leader_rose_by_is_allowed_to_rivals_of_as_many_faults(labels, estimate, fitted):
    tried = stub_search(total=0.0, estimate=-20.0)
    rival = stub_fit(0.0, frozenset(labels))
    proposal = SimpleNamespace(labels=rival.labels, faults=rival.faults, estimate=estimate, coarse=False, risen=False)
    assert tried._promising(proposal, tried._leader()) == fitted


@pytest.mark.parametrize(
    ("estimate", "scale", "kept"),
    [(1.0, 0.1, "plain"), (-1.0, 0.1, "coarse"), (1.0, 2.0, "coarse")],  # the last: no fit is past the jumps yet
)
def test_a_start_that_would_lead_takes_the_place_of_a_coarse_one_though_nothing_is_tenable(estimate, scale, kept):
    tried = stub_search(total=0.0, estimate=0.0)
    tried._leader = lambda: None
    tried.fits = {frozenset("ab"): stub_fit(0.0, frozenset("ab"))}
    tried.fits[frozenset("ab")].posterior.scale = scale
    labels = frozenset("a")
    coarse = SimpleNamespace(labels=labels, coarse=True, estimate=50.0)
    plain = SimpleNamespace(labels=labels, coarse=False, estimate=estimate)
    tried.proposals, tried.begun = {labels: coarse}, {}
    tried._offer(plain)
    assert tried.proposals[labels] is {"plain": plain, "coarse": coarse}[kept]


@pytest.mark.parametrize(("estimate", "fitted"), [(-3.5, True), (-4.5, False)])
def test_what_cannot_take_the_certainty_of_a_simpler_fit_is_not_fitted(estimate, fitted):
    # beside one of two that lead alike as little as beside the other
    tried = stub_search(total=0.0, estimate=0.0)
    tried._is_tenable = lambda fit: True
    tried.fits = {frozenset("b"): stub_fit(-1.0, frozenset("b"))}
    rival = stub_fit(0.0, frozenset("bc"))
    proposal = SimpleNamespace(labels=rival.labels, faults=rival.faults, estimate=estimate, coarse=False, risen=False)
    assert tried._promising(proposal, tried._leader()) == fitted


def test_another_fault_is_tried_in_the_place_of_one_with_the_tolerances_where_they_are(monkeypatch):
    # oil and inlet look alike past a jump of K and C, where neither's path from the baseline leads
    errors, linear, _ = linear_case([0.3])
    leader, rival = SimpleNamespace(label="inlet", own=2), straight(np.zeros(40), "oil")
    wide = Linear(linear.residual, np.array([0.1, 0.0, 6.0, 0.2, 0.0]), linear.jacobian, linear.width * [1, 1, 9, 1, 1])
    monkeypatch.setattr(search, "Unknowns", lambda problem, faults: SimpleNamespace(width=linear.width))
    offered = []
    monkeypatch.setattr(search._Search, "_propose", lambda self, *score, **words: offered.append((*score, words)))
    problem = SimpleNamespace(errors=errors, said_by=lambda fault: {3: 1.0})
    tried = search_with(paths=(rival,), problem=problem, _offer=lambda start: None, _log_prior=lambda faults: 0.0)
    fit = SimpleNamespace(
        labels=frozenset({"inlet"}), faults=(leader,), linear=wide, strain=Strain(np.zeros((0, 5)), np.zeros(0)),
        place_of=lambda fault: slice(2, 3), posterior=SimpleNamespace(refused=0.0),
        unknowns=SimpleNamespace(amplitudes=0),
    )  # fmt: skip
    tried._propose_neighbours(fit)
    (score, faults, at_leader, words) = offered[-1]
    assert (score.path.fault.label, faults, words) == ("oil", (), {"risen": True})
    np.testing.assert_array_equal(at_leader.theta, [0.1, 0.0, 0.0, 0.2, 0.0])
    both = np.column_stack([linear.jacobian, linear.jacobian[:, 3]])
    residual = wide.residual + linear.jacobian[:, 2] * 6.0
    model = Linear(residual, np.append(at_leader.theta, 0.0), both, np.append(linear.width, rival.fault.width))
    assert score.total == pytest.approx(posterior(errors, model).promised, abs=1e-6)
