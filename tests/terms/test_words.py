"""What terms say of a rig, and what they say where the records cannot tell."""

import numpy as np
import pytest

from tests.estimate.block_cases import Case, made, solved
from tpjb_ident.terms.shaft import not_told


def term_of(solution, name):
    (term,) = [term for term in solution.terms if term.name == name]
    return term, solution.fitted[name]


def test_a_drift_and_a_delay_are_said_with_their_figures_and_named_beyond_what_was_stated():
    warm = Case(
        noise=1e-4, drift={"D1": 5e-4}, kelvins=15.0, stated={"D1": {"temperature_coefficient_uncertainty": 1e-4}}
    )
    term, fitted = term_of(solved(*made(warm)), "temperature")
    (sentence,) = term.words(fitted)
    assert sentence.startswith("D1 reads +0.0")
    assert term.conditions(fitted) == ("probes-drift",)
    late = Case(late={"force": 6e-4}, hertz=(30.0, 90.0), stated={"force": {"delay_uncertainty": 1e-4}})
    term, fitted = term_of(solved(*made(late)), "delay")
    (sentence,) = term.words(fitted)
    assert sentence.startswith("force late by 0.")
    assert term.conditions(fitted) == ("cells-and-accelerometers-out-of-phase",)


def test_what_is_as_stated_is_not_named():
    stated = {"D1": {"temperature_coefficient_uncertainty": 1e-4}, "force": {"delay_uncertainty": 1e-4}}
    solution = solved(*made(Case(kelvins=15.0, hertz=(30.0, 90.0), stated=stated)))
    for name in ("temperature", "delay", "housing"):
        term, fitted = term_of(solution, name)
        assert term.conditions(fitted) == ()
    springs = term_of(solution, "housing")[0].words(solution.fitted["housing"])
    assert [sentence.split()[0] for sentence in springs] == ["c_xx", "c_yy", "c_xy", "loss"]


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
