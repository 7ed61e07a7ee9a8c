"""A prior that is tight and wrong is found by the records that contradict it; priors that are right are left alone."""

from dataclasses import replace

import numpy as np
import pytest

from tests.estimate.block_cases import Case, away, deviations, made, sensors_of, solved
from tests.seeds import seeds
from tpjb_ident.terms.registry import solved_as_learnt

SEEDS = seeds(3)
COEFFICIENT = {"temperature_coefficient_uncertainty": 5e-5}
SURE = {f"D{k}": {"uncertainty": 1e-3} for k in (1, 2, 3)}
#: What is stated far too well, and the condition that says so.
WRONG = {
    "a coefficient": (Case(kelvins=15.0, drift={"D1": 1e-3}, stated={"D1": COEFFICIENT}), "probes-drift"),
    "both coefficients, which pass for scatter": (
        Case(kelvins=12.0, noise=2e-4, drift={"D1": 1e-3, "D2": 1e-3}, stated={"displacement": COEFFICIENT}),
        "probes-drift",
    ),
    "a gain of three": (Case(probes=3, gains={"D3": 0.02}, stated=SURE), "probe-gains-differ"),
    "an axis of three": (Case(probes=3, turned={"D2": 0.05}, stated=SURE), "probe-gains-differ"),
    "a delay of three": (Case(probes=3, late={"D1": 3e-4}, stated=SURE), "probe-gains-differ"),
}


def answer(case, seed, order=None):
    """The solve as the records show the rig, and the first one; `order` of the runs by their places."""
    rig, blocks, truth = made(case, seed)
    if order is not None:
        rig = replace(rig, runs=tuple(blocks.runs[place] for place in order))
    solves = []

    def solve(rig):
        solves.append(solved(rig, blocks, truth))
        return solves[-1]

    return solved_as_learnt(rig, solve), solves[0], truth


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", WRONG)
def test_what_is_stated_too_well_is_found_and_h_is_right(name, seed):
    case, condition = WRONG[name]
    solution, first, truth = answer(case, seed)
    assert condition not in first.conditions()
    assert condition in solution.conditions()
    assert "beyond the uncertainty stated of" in solution.conditions()[0].detail
    assert np.abs(away(solution, truth)).max() < 4.0
    # what passes for scatter has the first solve's intervals wide; gains that are sure have them beside the truth
    nearer = np.linalg.norm(solution.h - truth) < np.linalg.norm(first.h - truth)
    assert nearer or np.abs(away(first, truth)).max() > 4.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_probe_that_drifts_from_run_to_run_is_said_and_the_interval_holds_both_ends(seed):
    case = Case(loads=(5000.0,), directions=4, sizes=(1.0, 1.0, 1.0), noise=2e-4)
    rig, blocks, truth = made(case, seed)
    rig = replace(rig, runs=blocks.runs)
    order = np.linspace(0.0, -0.16, len(blocks))
    for right in (0, -1):
        z = blocks.z.copy()
        z[:, 0] *= np.exp(order - order[right])
        drifting = replace(blocks, z=z)
        solution = solved_as_learnt(rig, lambda rig, drifting=drifting: solved(rig, drifting, truth))
        assert solution.conditions() == ("probes-drift",)
        assert np.abs(away(solution, truth)).max() < 2.5


def test_a_film_that_warms_is_no_drift_of_probes():
    case = Case(loads=(5000.0,), directions=4, sizes=(1.0, 1.0, 1.0), noise=2e-4)
    rig, blocks, truth = made(case)
    rig = replace(rig, runs=blocks.runs)
    z = blocks.z.copy()
    z[:, :2] *= np.exp(np.linspace(-0.01, 0.01, len(blocks)))[:, None]
    solution = solved_as_learnt(rig, lambda rig: solved(rig, replace(blocks, z=z), truth))
    assert solution.conditions() == ()
    assert np.abs(away(solution, truth)).max() < 4.0


GOOD = {
    "three probes": Case(probes=3, scatter=0.003, stated={"displacement": {"uncertainty": 0.005}}),
    "temperatures": Case(
        loads=(5000.0,), directions=6, scatter=0.002, kelvins=15.0, stated={"displacement": COEFFICIENT}
    ),
}


def drawn(case, rng):
    """The case with errors drawn from what is stated."""
    sensors = sensors_of(case)
    gains = {s.name: s.uncertainty * rng.standard_normal() for s in sensors if s.uncertainty}
    drift = {s.name: s.temperature_coefficient_uncertainty * rng.standard_normal() for s in sensors}
    return replace(case, gains=gains, drift=drift)


@pytest.mark.slow
@pytest.mark.parametrize("name", GOOD)
def test_what_is_stated_rightly_is_not_contradicted(name):
    alarms, outside = 0, []
    for seed in range(100):
        rng = np.random.default_rng([41, seed])
        case = drawn(GOOD[name], rng)
        solution, _, truth = answer(case, seed, rng.permutation(len(case.loads) * case.directions))
        alarms += bool(solution.rig.widened)
        assert (deviations(solution) > 0).all()
        outside.append(np.abs(away(solution, truth)[:, [0, 3, 4, 7]]) > 1.96)
    assert alarms <= 1
    assert np.mean(outside) < 0.08
