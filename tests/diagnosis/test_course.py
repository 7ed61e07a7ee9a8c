"""What one amplitude does over its whole range, and fits that start far from the answer."""

from types import SimpleNamespace

import numpy as np
import pytest

from model.effects import Effect, known_effects
from model.setup import Mesh
from tests.diagnosis.rocker_case import SPEED, noisy, rocker_setup, whole_layout
from tpjb_ident.diagnosis.comparison.evidence import ErrorModel, Linear, posterior
from tpjb_ident.diagnosis.comparison.fit import Fit, Start, fitted, refined
from tpjb_ident.diagnosis.comparison.paths import lengthened, path_through
from tpjb_ident.diagnosis.comparison.search import compare
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.comparison.unknowns import Unknowns, prediction
from tpjb_ident.diagnosis.diagnose import pose
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.forward.workers import workers
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import dynamic, planned_observations

NODES = (0.8, -0.8, 1.6, -1.6, 3.0, -3.0)


def path(function):
    return path_through(None, [(x, np.atleast_1d(function(x) - function(0.0))) for x in NODES])


@pytest.mark.parametrize(
    ("bounds", "size", "wanted"),
    [
        ((-9e-9, 9e-9), 1e-12, [5e-10, -5e-10]),  # small in its unit: no node is another for that
        ((-4e-10, 9e-9), -3e-10, [5e-10, -4e-10]),  # up to the bound that lies before a typical size
        ((0.0, 9e-9), 1.2e-9, [5e-10, 1e-9, 1.5e-9]),  # and the middle before an end
        ((-4e-10, 9e-9), -1.2e-9, [5e-10, -4e-10]),
    ],
)
def test_a_course_is_asked_on_both_sides_as_far_as_bounds_allow(bounds, size, wanted):
    prior = np.array([[0.0], [1.5e-9], *([end] for end in bounds)])
    fault, asked = SimpleNamespace(width=prior[1], prior=prior), []

    def run(task, jobs):
        asked.extend(nodes for _, part, _ in jobs for _, nodes in part)
        return [[[(node, np.array([node])) for node in nodes] for _, nodes in part] for _, part, _ in jobs]

    run.opened = SimpleNamespace(count=2)

    near = 1.5e-9 * (1.0 / 3.0)
    start = path_through(fault, [(near, np.array([near]))])
    (longer,) = lengthened(run, ((), None), (start,), [size])
    assert longer.nodes == pytest.approx(sorted([0.0, *wanted]), rel=1e-9)
    assert asked == [pytest.approx(wanted[1:])]
    (elsewhere,) = lengthened(run, ((fault,), None), (start,), [size])  # what was known counts from another place
    assert [sorted(nodes) for nodes in asked[1:]] == [pytest.approx(sorted(wanted))]
    np.testing.assert_array_equal(elsewhere.nodes, longer.nodes)


def values(known, at):
    return known.weights(np.asarray(at)[:, None]) @ known.columns.T


def test_course_passes_through_what_was_asked():
    known = path(lambda x: np.array([np.sin(x), np.exp(-x)]))
    told = values(known, NODES)
    assert told == pytest.approx(np.array([[np.sin(x), np.exp(-x) - 1] for x in NODES]), abs=1e-12)


def test_course_follows_a_smooth_one_between():
    known = path(np.tanh)
    x = np.linspace(-2.5, 2.5, 41)
    assert values(known, x)[:, 0] == pytest.approx(np.tanh(x), abs=0.02)


def test_a_jump_is_not_overshot():
    known = path(lambda x: np.where(x > 1.0, 5.0, 0.0))
    told = values(known, np.linspace(-3.0, 3.0, 241))
    assert told.min() >= -1e-9
    assert told.max() <= 5.0 + 1e-9


def test_course_goes_on_straight_beyond_its_ends():
    known = path(lambda x: x**2)
    a, b, c = values(known, [3.0, 3.5, 4.0])[:, 0]
    assert c - b == pytest.approx(b - a)
    assert values(known, [-3.5])[0, 0] == pytest.approx(b)


def test_slopes_are_those_of_the_course():
    known = path(lambda x: np.array([x**3, np.cos(x)]))
    x, step = np.array([-2.0, -0.3, 0.5, 2.2]), 1e-6
    numeric = (values(known, x + step) - values(known, x - step)) / (2 * step)
    assert known.columns @ known.slopes(x[:, None])[:, :, 0].T == pytest.approx(numeric.T, abs=1e-6)


@pytest.mark.slow  # seconds: the bearing model itself
def test_a_comparison_finds_its_way_past_pads_that_come_out_of_contact():
    """Upper pads leave the shaft at another clearance for every load: K and C jump on the way."""
    setup = rocker_setup(Mesh(48, 4, fine_solid=False), accuracy=1e-5)  # as a diagnosis has it
    layout = whole_layout(np.arange(2500.0, 8751.0, 1250.0), (10.0, 20.0, 30.0, 40.0, 50.0), sweep_first=False)
    planned = planned_observations(setup, layout)
    forward = Forward(setup, planned.layout, planned.elements)
    hidden = forward.fresh()([Effect("preload_error", pad_clearance_change=-3.4e-5)])
    settings = DiagnoseSettings(workers=1)
    problem = pose(noisy(planned, hidden, 7), forward, settings)
    with workers(forward, problem, 1) as run:
        best = compare(run, problem).best
    assert best.label == "preload_error"
    assert best.effects[0].parameters["pad_clearance_change"] == pytest.approx(-3.4e-5, rel=0.03)


class Narrow(Forward):
    """A bearing that has no equilibrium where an effect turns the probes by more than a degree."""

    def __call__(self, effects=(), change=None):
        if any(abs(effect.parameters["angle"]) > np.radians(1.0) for effect in effects):
            raise NoEquilibriumError("beyond a degree")
        return super().__call__(effects, change)

    def fresh(self, near=False):
        return self


def test_a_start_without_an_equilibrium_is_taken_nearer_to_what_is_stated():
    setup = rocker_setup(Mesh(24, 4), accuracy=1e-5)
    planned = planned_observations(setup, Layout(dynamic([5000.0], [SPEED], SPEED, -np.pi / 2, 0)))
    forward = Narrow(setup, planned.layout, planned.elements)
    skipped = frozenset(known_effects()) - {"probe_rotation"}
    problem = pose(planned, forward, DiagnoseSettings(skip=skipped, workers=1))
    (fault,) = problem.faults
    theta = np.zeros(1 + len(problem.nuisances))
    theta[0] = np.radians(2.0)
    jacobian = np.column_stack([np.zeros(len(planned)), problem.scaled(problem.columns)])
    with workers(forward, problem, 1) as run:
        assert next(iter(run(prediction, [((fault,), theta)]))) is None
        start = Start((fault,), theta, jacobian)
        fit = fitted(run, problem, start)
    assert abs(fit.linear.theta[0]) <= np.radians(1.0)


def test_a_fit_goes_on_while_its_steps_pay():
    """Numbers that bend what they do: four steps on the first derivatives do not come near where they lead."""
    rng = np.random.default_rng(3)
    straight, bent = rng.normal(size=(40, 6)), 0.6 * rng.normal(size=(40, 6))
    errors = ErrorModel(0.02**2 * np.eye(40), 1e-4 * np.eye(40), np.ones(1))
    nuisances = tuple(SimpleNamespace(column=None) for _ in range(6))
    truth = np.array([1.5, -1.0, 2.0, -1.5, 1.0, -2.0])

    def shown(theta):
        return straight @ theta + bent @ theta**2

    problem = SimpleNamespace(measured=shown(truth), errors=errors, nuisances=nuisances)
    start = Start((), np.zeros(6), straight)
    run = predicts(shown)
    fit = fitted(run, problem, start)
    assert fit.linear.theta == pytest.approx(truth, abs=0.05)
    assert fit.posterior.refused < 1.0


@pytest.mark.parametrize("wrong", [0.0, 2.0])
def test_derivatives_stay_where_they_foretell_a_step_there_and_back_however_it_bends(wrong):
    rng = np.random.default_rng(4)
    straight, bent, other = rng.normal(size=(3, 40, 6))
    errors = ErrorModel(0.1**2 * np.eye(40), 1e-4 * np.eye(40), np.array([0.1]))
    problem = SimpleNamespace(
        measured=np.zeros(40), errors=errors, nuisances=tuple(SimpleNamespace(column=None) for _ in range(6))
    )
    theta = np.full(6, 0.01)
    slopes, unknowns = straight + 2.0 * bent * theta, Unknowns(problem, ())
    linear = Linear(-straight @ theta - bent @ theta**2, theta, slopes + wrong * other, unknowns.width)
    fit = Fit(unknowns, linear, posterior(errors, linear))
    again = refined(predicts(lambda theta: straight @ theta + bent @ theta**2, slopes), fit)
    assert (again is fit) == (wrong == 0.0)


def test_a_number_that_does_nothing_at_the_start_is_asked_again_where_its_effect_has_a_size():
    """An effect of a size and a direction, far from the one where its fit begins: of no size none does anything."""
    rng = np.random.default_rng(6)
    along, across = rng.normal(size=(2, 40))
    errors = ErrorModel(0.02**2 * np.eye(40), 1e-4 * np.eye(40), np.ones(1))
    truth = np.array([2.0, 0.6])

    def shown(theta):
        return theta[0] * (along * np.cos(theta[1]) + across * np.sin(theta[1]))

    def run(task, jobs):
        if task is prediction:
            return [shown(theta) for _, theta in jobs]
        ((_, theta, indices),) = jobs
        steps = 1e-6 * np.eye(2)
        return [[(shown(theta + steps[i]) - shown(theta)) / 1e-6 for i in indices]]

    run.opened = SimpleNamespace(count=1)
    problem = SimpleNamespace(measured=shown(truth), errors=errors, nuisances=())
    prior = np.array([[0.0, 0.0], [1.0, 1.0], [-9.0, -9.0], [9.0, 9.0]])
    fault = SimpleNamespace(name="x", own=-1, prior=prior, width=prior[1])
    linear = Linear(problem.measured, np.zeros(2), np.column_stack([along, np.zeros(40)]), np.ones(2))
    fit = fitted(run, problem, Start((fault,), np.zeros(2), linear.jacobian))
    assert fit.linear.theta == pytest.approx(truth, abs=0.01)


def predicts(shown, slopes=None):
    """Predictions and derivatives of a model of numbers alone."""

    def run(task, jobs):
        return [shown(job[1]) if task is prediction else [slopes[:, i] for i in job[2]] for job in jobs]

    run.opened = SimpleNamespace(count=1)
    return run
