"""What terms say of a rig and where records cannot tell; the mass, which several frequencies contradict."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.estimate import block_cases
from tests.estimate.block_cases import MASS, Case, away, film, made, solved
from tests.seeds import seeds
from tpjb_ident.terms.registry import learnt_rig, solved_as_learnt
from tpjb_ident.terms.shaft import not_told


def term_of(solution, name):
    (term,) = [term for term in solution.terms if term.name == name]
    return term, solution.fitted[name]


def learnt(case):
    """The solve with the rig as its records show it."""
    rig, blocks, truth = made(case)
    return solved_as_learnt(rig, lambda rig: solved(rig, blocks, truth))


def test_a_drift_and_a_delay_are_said_with_their_figures_and_named_beyond_what_was_stated():
    warm = Case(
        noise=1e-4, drift={"D1": 5e-4}, kelvins=15.0, stated={"D1": {"temperature_coefficient_uncertainty": 1e-4}}
    )
    term, fitted = term_of(learnt(warm), "temperature")
    (sentence,) = term.words(fitted)
    assert sentence.startswith("D1 reads +0.0")
    assert term.conditions(fitted) == ("probes-drift",)
    late = Case(late={"force": 6e-4}, hertz=(30.0, 90.0), stated={"force": {"delay_uncertainty": 1e-4}})
    term, fitted = term_of(learnt(late), "delay")
    first, second = term.words(fitted)
    assert first.startswith("F1 late by 0.")
    assert second.startswith("F2 late by 0.")
    assert term.conditions(fitted) == ("cells-and-accelerometers-out-of-phase",)


def test_what_is_as_stated_is_not_named():
    stated = {"D1": {"temperature_coefficient_uncertainty": 1e-4}, "force": {"delay_uncertainty": 1e-4}}
    solution = solved(*made(Case(kelvins=15.0, hertz=(30.0, 90.0), stated=stated)))
    for name in ("temperature", "delay", "housing"):
        term, fitted = term_of(solution, name)
        assert term.conditions(fitted) == ()
    springs = term_of(solution, "housing")[0].words(solution.fitted["housing"])
    assert [sentence.split()[0] for sentence in springs] == ["c_xx", "c_yy", "c_xy", "loss_x", "loss_y"]


def test_points_run_at_several_amplitudes_say_so():
    rig, blocks, truth = made(Case(sizes=(0.3, 1.0), bent=0.05, bent_told=0.08))
    solution = solved(rig, blocks, truth)
    term, fitted = term_of(solution, "amplitude")
    assert term.point_conditions(0, fitted, solution.h[0]) == ("zero amplitude",)
    rig, blocks, truth = made(Case(bent=0.05, bent_told=0.08))
    solution = solved(rig, blocks, truth)
    term, fitted = term_of(solution, "amplitude")
    assert term.point_conditions(0, fitted, solution.h[0]) == ()
    assert term.point_conditions(7, fitted, solution.h[0]) == ()


@pytest.mark.parametrize(
    ("order", "phases", "reason"),
    [
        (1, [np.nan, 1, 1, 1], "no keyphasor"),
        (2, [np.nan, 1, 1, 1], "neither a keyphasor"),
        (1, [1, 1j], "3 directions at least"),
        (1, [1, 1j, -1], "a run has no usable window"),
    ],
)
def test_why_runs_do_not_tell_what_turns_with_the_shaft(order, phases, reason):
    motion = np.full((len(phases), 2), np.nan + 0j)
    assert reason in not_told(order, np.array(phases, dtype=complex), motion)


def test_motions_that_follow_the_shaft_are_told_from_those_that_do_not():
    phases = np.exp(2j * np.pi * np.array([0.1, 0.4, 0.6, 0.9]))
    angles = np.arange(4) * np.pi / 4
    motion = np.stack([np.cos(angles), np.sin(angles)], axis=1) + 0j
    assert not_told(1, phases, motion) == ""
    following = phases[:, None] * np.array([[1.0, 0.3]]) + angles[:, None] * np.array([[0.5, 1.0]])
    assert "follow the shaft's phase alike" in not_told(1, phases, following)


HERTZ = (30.0, 55.0, 80.0, 110.0)
SOFT = np.diag([3.0e-8, 2.4e-8]) * (1 - 0.01j)
HEAVIER = {"mass_error": 0.5, "noise": 3e-4}


@pytest.fixture
def soft(monkeypatch):
    """Springs of 3e7 to 4e7 N/m under the housing."""
    monkeypatch.setattr(block_cases, "COMPLIANCE", SOFT)


def doubted(case, seed=0):
    """Rig, its blocks, the truth, and the rig as its frequencies show it."""
    rig, blocks, truth = made(case, seed)
    return blocks, truth, learnt_rig(rig, solved(rig, blocks, truth))


@pytest.mark.parametrize("seed", seeds(3))
def test_what_is_stated_of_the_mass_stands_in_the_interval_of_soft_springs(soft, seed):
    rig, blocks, truth = made(Case(hertz=(60.0, 90.0), mass_error=0.1, mass_uncertainty=0.1), seed)
    solution = solved(rig, blocks, truth)
    assert not solution.fitted["mass"].estimated.any()
    assert np.abs(solution.h - truth).max() > 0.02 * np.abs(truth).max()
    assert np.abs(away(solution, truth)).max() < 3.5


@pytest.mark.parametrize("seed", seeds(3))
def test_a_mass_of_half_as_much_again_is_told_and_allowed_for(soft, seed):
    blocks, truth, rig = doubted(Case(hertz=HERTZ, **HEAVIER), seed)
    again = solved(rig, blocks, truth)
    (condition,) = again.conditions()
    assert condition == "housing-mass-doubtful"
    assert "the inertia of 45 kg" in condition.detail
    assert 0.5 * MASS / 1.96 < rig.mass_uncertainty < 0.5 * MASS
    assert np.abs(away(again, truth)).max() < 3.5


@pytest.mark.parametrize("seed", seeds(3))
def test_a_floating_stator_of_less_than_its_mass_is_told_and_allowed_for(seed):
    case = Case(mount="floating", hertz=HERTZ[:3], mass_error=-0.4, noise=3e-4)
    blocks, truth, rig = doubted(case, seed)
    again = solved(rig, blocks, truth)
    assert again.conditions() == ("housing-mass-doubtful",)
    assert re.search("the inertia of 1[78](.\\d)? kg", again.conditions()[0].detail)
    assert np.abs(away(again, truth)).max() < 3.5
    assert not doubted(replace(case, mass_error=0.4), seed)[2].contradicted  # the film's own may be that


@pytest.mark.parametrize(
    "changes",
    [
        {"hertz": HERTZ[1:3]},
        {"mass_error": 0.0},
        {"mass_uncertainty": 0.5},
        {"mount": "floating"},
        {"mass_error": 0.0, "gains": {"D1": 0.05, "F2": 0.03}},
        {"stated": {"acceleration": {"uncertainty": 0.2}}},
    ],
    ids=["two frequencies", "as stated", "half of it stated", "floating", "gains", "accelerometers as uncertain"],
)
def test_the_mass_is_not_doubted(soft, changes):
    case = Case(**{"hertz": HERTZ, **HEAVIER, **changes})
    rig = doubted(case)[2]
    assert not rig.contradicted
    assert rig.mass_uncertainty == case.mass_uncertainty * MASS


@pytest.mark.parametrize("bend", ["added mass", "pivots"])
def test_no_film_passes_for_an_inertia_of_the_housing(soft, bend, monkeypatch):
    """An added mass is K-C-M's own; pads on springs of 6e8 N/m bend stiffness and damping each its own way."""

    def bent(load, omega):
        h = film(load, omega)
        if bend == "pivots":
            return np.linalg.inv(np.linalg.inv(h) + np.eye(2) / 6e8)
        return h - omega**2 * np.diag([250.0, 200.0])

    monkeypatch.setattr(block_cases, "film", bent)
    assert not doubted(Case(hertz=HERTZ, loads=(5000.0,), noise=3e-4))[2].contradicted
