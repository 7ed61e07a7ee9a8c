"""The parts that decide: structure of residuals, sensor maps, laws, closure, surrogate, trials."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.bench import Bench, seed
from tests.studies.diagnosis.surrogate import Surrogate, load_tables, tabulate
from tests.studies.diagnosis.trials import Plan, Trial, run_trial, trials
from tpjb_ident.diagnose.diagnose import pose, solve
from tpjb_ident.diagnose.forward.forward import Forward
from tpjb_ident.diagnose.forward.nuisance import whitener
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.plan.planned import around, dry, dynamic, planned_observations
from tpjb_ident.diagnose.search.fit import Fit, Start, fit
from tpjb_ident.diagnose.search.laws import frequency_laws, sensor_map_test
from tpjb_ident.diagnose.search.pairs import best_pairs
from tpjb_ident.diagnose.search.sensor_map import MAP_NAMES, sensor_map_columns
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.search.structure import patterns, residual_structure
from tpjb_ident.diagnose.verdict.closure import closure

pytestmark = pytest.mark.slow

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
SPEED = 2 * math.pi * 22
#: A part of the library, so that tables take seconds.
TRIED = {"oil_viscosity", "soft_pivot", "probe_gain", "loadcell_crosstalk", "channel_delay"}


@pytest.fixture(scope="module")
def setup():
    bearing = load_bearing(BEARINGS / "rocker.toml")
    return Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(24, 4), accuracy=1e-5)


@pytest.fixture(scope="module")
def bench(setup):
    lines = [2 * math.pi * f for f in (15.0, 25.0, 35.0, 45.0)]
    sweep = dynamic([5000.0], lines, SPEED, -math.pi / 2, 5)
    loads = dynamic([2500.0, 7500.0, 8750.0], lines[1:2], SPEED, -math.pi / 2, 5)
    layout = Layout((*sweep, *loads), around(5000.0, 5, SPEED), dry(range(1, 6)), 200.0)
    planned = planned_observations(setup, layout)
    forward = Forward(setup, layout, planned.elements)
    posed = pose(planned, forward, DiagnoseSettings())
    posed = replace(posed, pool=tuple(c for c in posed.pool if c.name in TRIED and c.fixed.get("pad", 5) == 5))
    factor = whitener(posed.observations, posed.nuisances.columns)
    tables = tuple(tabulate(forward, posed.base, c, factor, 25.0) for c in posed.pool)
    surrogate = Surrogate(planned.elements, posed.base, posed.pool, tables)
    return Bench(planned, posed, surrogate, np.zeros_like(posed.base))


def drawn(bench, effects, number):
    return bench.problem(effects, np.random.default_rng(number), 1.0)


def test_surrogate_answers_as_the_model_does(bench, setup):
    forward = Forward(setup, bench.observations.layout, bench.observations.elements)
    effect = Effect("oil_viscosity", factor=1.08)
    exact = forward((effect,)) - bench.surrogate.base
    assert np.linalg.norm(bench.surrogate((effect,)) - bench.surrogate.base - exact) < 0.01 * np.linalg.norm(exact)


def test_surrogate_survives_its_file(bench, tmp_path):
    path = tmp_path / "tables.npz"
    assert load_tables(path, bench.observations.elements, bench.pool) is None
    bench.surrogate.save(path)
    again = load_tables(path, bench.observations.elements, bench.pool)
    effect = Effect("probe_gain", factor=1.02)
    assert np.array_equal(again((effect,)), bench.surrogate((effect,)))
    assert load_tables(path, bench.observations.elements, bench.pool[:-1]) is None


def test_sensor_map_columns_are_what_the_instruments_do(bench, setup):
    elements, base = bench.observations.elements, bench.surrogate.base
    small = Effect("loadcell_crosstalk", fraction=1e-4)
    stiff = setup.change(instruments=replace(setup.instruments, cell_stiffness=(1e14, 1e14)))
    change = Forward(stiff, bench.observations.layout, elements)((small,)) - base
    columns = sensor_map_columns(elements, base)
    expected = 1e-4 * (columns[:, MAP_NAMES.index("force xy")] + columns[:, MAP_NAMES.index("force yx")])
    mine = np.isin(bench.observations.families, ["h", "load"])
    assert change[mine] == pytest.approx(expected[mine], abs=2e-3 * np.abs(expected[mine]).max())


def test_a_sensor_error_is_called_a_constant_map_and_physics_is_not(bench):
    sensors = sensor_map_test(drawn(bench, (Effect("loadcell_crosstalk", fraction=0.02),), 1))
    assert sensors.share > 0.95
    assert "constant map of the sensors explains" in sensors.words
    assert sensors.entries["force xy"][0] == pytest.approx(0.02, abs=0.004)
    physics = sensor_map_test(drawn(bench, (Effect("soft_pivot", pad=5, stiffness_factor=0.5),), 1))
    assert physics.words.startswith("physics")
    assert "no gap" in sensor_map_test(drawn(bench, (), 1)).words


def test_a_delay_shows_its_law_in_frequency(bench):
    (law,) = frequency_laws(drawn(bench, (Effect("channel_delay", delay=6e-5),), 2))
    assert law.shares["i w h (a delay)"] > 0.7
    assert law.shares["i w h (a delay)"] > law.shares["1 (a stiffness)"] + 0.2
    assert law.shares["i w h (a delay)"] > law.shares["i w (a damping)"] + 0.4


def test_p_values_of_pure_noise_are_uniform(bench):
    problem = bench.posed
    jacobian = np.zeros((len(problem.base), 0))
    spans = patterns(problem.misfit.factor, problem.misfit.train, problem.groups, (), jacobian)
    rng = np.random.default_rng(11)
    noise = rng.standard_normal((60, int(problem.misfit.train.sum())))
    p = np.array([residual_structure(spans, z, (1.0, 4.0)).p for z in noise])
    assert np.mean(p < 0.1) < 0.25
    assert 0.3 < np.median(p) < 0.75
    assert p.min() > 1e-3


def test_structure_below_the_scatter_of_single_elements_is_found_and_placed(bench):
    problem = bench.posed
    spans = patterns(
        problem.misfit.factor, problem.misfit.train, problem.groups, (), np.zeros((len(problem.base), 0))
    )  # fmt: skip
    names = [e.observable for e in problem.observations.elements]
    load = np.array([e.place("load") for e in problem.observations.elements])
    bump = np.where(np.array(names) == "kxy", (load - 5000.0) / 3750.0, 0.0)
    bump *= 8.0 / np.linalg.norm(problem.misfit.whiten(bump))
    rest = problem.misfit.whiten(bump) + np.random.default_rng(4).standard_normal(int(problem.misfit.train.sum()))
    found = residual_structure(spans, rest, (1.0, 4.0))
    assert found.p < 1e-3
    assert found.words == "kxy"


def test_scatter_above_the_stated_is_no_structure(bench):
    problem = bench.posed
    spans = patterns(
        problem.misfit.factor, problem.misfit.train, problem.groups, (), np.zeros((len(problem.base), 0))
    )  # fmt: skip
    found = residual_structure(
        spans, 1.6 * np.random.default_rng(8).standard_normal(int(problem.misfit.train.sum())), (1.0, 4.0)
    )
    assert found.scale == pytest.approx(1.6**2, rel=0.3)
    assert found.p > 0.01


def test_fit_needs_no_new_derivatives_to_reach_the_minimum(bench):
    hidden = Effect("oil_viscosity", factor=1.12)
    problem = drawn(bench, (hidden,), 3)
    candidate = next(c for c in bench.pool if c.name == "oil_viscosity")
    column = (bench.surrogate((candidate.effect(1.3),)) - problem.base) / 0.3  # a secant from far off
    found = fit(bench.surrogate, problem.misfit, [candidate], Start(np.array([1.0]), column[:, None]))
    costs = [problem.misfit.chi_square(bench.surrogate((candidate.effect(a),))) for a in np.linspace(1.0, 1.3, 301)]
    assert found.chi_square <= min(costs) + 0.1
    assert found.amplitudes[0] == pytest.approx(1.12, abs=4 * math.sqrt(found.covariance[0, 0]))


def test_pairs_find_two_effects_that_a_single_one_would_blur(bench):
    effects = (Effect("probe_gain", factor=1.08), Effect("soft_pivot", pad=5, stiffness_factor=0.8))
    problem = drawn(bench, effects, 5)
    columns = {c: t.at(c.neutral + 0.1 * c.step) / (0.1 * c.step) for c, t in zip(bench.pool, bench.surrogate.tables)}
    empty: Fit = problem.empty
    (first, *_) = best_pairs(problem.misfit, empty, (), columns)
    assert {c.name for c in first[0]} == {"probe_gain", "soft_pivot"}


def test_hidden_effect_is_named_and_closes_the_gap_as_far_as_can_be(bench):
    hidden = (Effect("loadcell_crosstalk", fraction=0.006),)
    problem = drawn(bench, hidden, 6)
    verdict, found = solve(problem, bench.surrogate, DiagnoseSettings())
    assert verdict.verdict == "named"
    assert [e.name for e in verdict.effects] == ["loadcell_crosstalk"]
    measured = closure(problem, found)
    assert measured.closed > 0.8
    assert measured.closed > measured.wrong or math.isnan(measured.wrong)
    assert abs(measured.placebo[1]) < 0.1


def test_the_true_effect_left_out_is_not_replaced_by_another(bench):
    hidden = (Effect("loadcell_crosstalk", fraction=0.006),)
    problem = drawn(bench, hidden, 6)
    lacking = replace(problem, pool=tuple(c for c in problem.pool if c.name != "loadcell_crosstalk"))
    verdict, _ = solve(lacking, bench.surrogate, DiagnoseSettings())
    assert verdict.verdict == "unexplained"
    assert not verdict.effects


def test_trials_do_not_depend_on_who_runs_them_or_when(bench):
    todo = list(trials([c.label for c in bench.pool], Plan((6.0,), (1.0,), 1, 2, 1, 1)))
    assert {t.kind for t in todo} == {"none", "hidden", "left out", "two"}
    last = run_trial(bench, todo[-1])
    run_trial(bench, todo[0])
    assert run_trial(bench, todo[-1]) == last
    assert seed("a", 1).random() != seed("a", 2).random()


def test_an_effect_that_its_bounds_keep_small_is_unreachable(bench):
    label = bench.pool[0].label
    assert run_trial(bench, Trial("hidden", (label,), 1e6))["verdict"] == "unreachable"
