"""The housing's mass: as stated it stands in the interval, and several frequencies contradict it on springs."""

import numpy as np
import pytest

from tests.estimate import block_cases
from tests.estimate.block_cases import MASS, Case, away, film, made, solved
from tests.seeds import seeds
from tpjb_ident.terms.registry import learnt_rig

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
    solution = solved(rig, blocks, truth)
    return blocks, truth, learnt_rig(rig, solution)


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


@pytest.mark.parametrize(
    "changes",
    [
        {"hertz": HERTZ[1:3]},
        {"mass_error": 0.0},
        {"mass_uncertainty": 0.5},
        {"mount": "floating"},
        {"mass_error": 0.0, "gains": {"D1": 0.05, "F2": 0.03}},
    ],
    ids=["two frequencies", "as stated", "half of it stated", "floating", "gains"],
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
