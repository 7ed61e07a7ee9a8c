"""What a held-out gap says of a name: shares above what noise alone leaves."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.observations.observe import Element, Layout, Observations
from tpjb_ident.diagnosis.verdict.held_out import HeldOut, Touched


def held_out(before):
    """Two elements whose noise leaves 0.3 sigma, and a baseline with a gap."""
    elements = tuple(Element("h", name, ()) for name in ("kxx", "kyy"))
    observations = Observations(Layout(()), np.zeros(2), 0.09 * np.eye(2), np.full(2, math.sqrt(0.91)), elements)
    problem = SimpleNamespace(observations=observations, base=np.full(2, before), held=np.ones(2, dtype=bool))
    return HeldOut(SimpleNamespace(problem=problem), None)


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
        (2.1, ((8.0, 0.5),), False),  # a name does not let the gap over everything grow
        (1.0, ((8.0, 0.5), (4.0, 3.0)), False),  # each name halves its own
        (1.0, ((3.0, 1.8),), False),
        (1.0, (), False),  # without it there is no equilibrium
    ],
)
def test_each_effect_halves_the_gap_along_what_it_moves(after, along, shrunk):
    held = held_out(2.0)
    touched = sorted((Touched("x", *ends, True) for ends in along), key=lambda one: -one.remaining)
    assert HeldOut(held.fit, np.full(2, after), tuple(touched)).is_shrunk(DiagnoseSettings()) == shrunk
