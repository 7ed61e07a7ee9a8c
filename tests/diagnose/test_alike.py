"""Pads of one effect that a campaign cannot tell apart: a group is named, not a pad."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.surrogate import EffectTable, Surrogate
from tests.studies.evidence.outcome import outcome
from tpjb_ident.diagnose.diagnose import solve
from tpjb_ident.diagnose.forward.candidates import candidates
from tpjb_ident.diagnose.forward.nuisance import Nuisances
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.plan.planned import dynamic, planned_observations
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.decide import close_rivals

BEARINGS = Path(__file__).parents[2] / "model" / "bearings"
SPEED = 2 * math.pi * 22


@pytest.fixture(scope="module")
def posed():
    bearing = load_bearing(BEARINGS / "rocker.toml")
    setup = Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(24, 4))
    lines = [2 * math.pi * f for f in (10.0, 20.0, 30.0, 40.0, 50.0)]
    observations = planned_observations(setup, Layout(dynamic([2500.0, 5000.0], lines, SPEED, -math.pi / 2, 0)))
    wanted = ("soft_pivot pad 1", "soft_pivot pad 2", "oil_viscosity")
    pool = tuple(c for label in wanted for c in candidates(bearing) if c.label == label)
    nothing = Nuisances((), np.zeros((len(observations), 0)))
    return Problem(observations, observations.value, nothing, pool)


def linear(posed, apart):
    """A model in which the two pads differ by a share `apart` of what they do, twenty sigma at their typical sizes."""
    rng = np.random.default_rng(4)
    sigma = np.sqrt(np.diag(posed.covariance))
    one, other, third = (sigma * rng.standard_normal(len(sigma)) for _ in range(3))
    columns = (one, (1.0 - apart) * one + apart * other, third)
    tables = []
    for candidate, column in zip(posed.pool, columns, strict=True):
        low, high = candidate.bounds
        at = np.array([low, candidate.neutral, high])
        unit = 20.0 * column / np.linalg.norm(column / sigma) / candidate.step
        tables.append(EffectTable(at, np.outer(at - candidate.neutral, unit)))
    return Surrogate(posed.observations.elements, posed.base, posed.pool, tuple(tables))


def said(posed, model):
    hidden = (Effect("soft_pivot", pad=1, stiffness_factor=0.6),)
    problem = replace(posed, observations=replace(posed.observations, value=model(hidden)))
    return solve(problem, model, DiagnoseSettings())


def test_another_pad_that_would_do_makes_the_verdict_ambiguous(posed):
    verdict, found = said(posed, linear(posed, 0.05))
    assert verdict.verdict == "ambiguous"
    assert verdict.indistinguishable == (("soft_pivot", "soft_pivot pad 2"),)
    assert verdict.alternatives == (("soft_pivot pad 1", "soft_pivot pad 2"),)
    assert "soft_pivot pad 1 or soft_pivot pad 2" in verdict.reasons[0]
    assert [r.label for r in close_rivals(found, DiagnoseSettings())] == ["soft_pivot pad 2"]
    assert verdict.to_dict()["alternatives"] == [["soft_pivot pad 1", "soft_pivot pad 2"]]


def test_a_pad_that_differs_enough_is_named(posed):
    verdict, found = said(posed, linear(posed, 1.0))
    assert verdict.verdict == "named"
    assert [e.label for e in verdict.effects] == ["soft_pivot pad 1"]
    assert not verdict.alternatives
    assert close_rivals(found, DiagnoseSettings()) == ()


@pytest.mark.parametrize(
    ("row", "wanted"),
    [
        ({"verdict": "named", "labels": ("a pad 1",)}, "named right"),
        ({"verdict": "named", "labels": ("a pad 2",)}, "named wrong"),
        ({"verdict": "ambiguous", "labels": ("a pad 2",), "alternatives": (("a pad 2", "a pad 1"),)}, "group right"),
        ({"verdict": "ambiguous", "labels": ("a pad 2",), "alternatives": (("a pad 2", "b"),)}, "group wrong"),
    ],
)
def test_a_wrong_pad_counts_as_wrong(row, wanted):
    full = {"kind": "hidden", "names": ("a",), "truth": ("a pad 1",), "found": ("a",), "groups": (),
            "alternatives": (), "size": 6.0, "noise": 1.0, **row}  # fmt: skip
    assert outcome(full) == wanted
