"""Accelerometers against load cells: what a housing on springs does, and what no housing can do."""

from __future__ import annotations

import numpy as np
import pytest

from tpjb_ident.dynamic.instruments.housing_balance import BalanceRun, balances

MASS, HZ = 30.0, 60.0
SPRINGS = np.array([6e8, 9e8])


def runs(see, noise=1e-5, n=4, hz=HZ):
    """Runs in directions all around; `see` turns the true acceleration into what is recorded."""
    rng = np.random.default_rng(3)
    omega = 2 * np.pi * hz
    made = []
    for angle in np.linspace(0.3, 0.3 + np.pi, n, endpoint=False):
        cells = 500.0 * np.array([np.cos(angle), np.sin(angle)]) * np.exp(1j * angle)
        acceleration = see(-(omega**2) * cells / SPRINGS)
        acceleration = acceleration + noise * (rng.standard_normal(2) + 1j * rng.standard_normal(2))
        made.append(BalanceRun(hz, cells, acceleration, 0.01, MASS))
    return made


def named(see, **how):
    (verdict,) = balances(runs(see, **how)).values()
    return list(verdict.conditions)


def test_a_housing_on_springs_is_believed():
    assert named(lambda a: a) == []


@pytest.mark.parametrize(
    "see", [lambda a: 0 * a, lambda a: a * [0, 1], lambda a: a * [1, 0]], ids=["both dead", "X dead", "Y dead"]
)
def test_accelerometers_that_show_nothing_are_named(see):
    assert named(see) == ["accelerometers-contradict-cells"]


def test_where_inertia_is_next_to_nothing_it_is_a_doubt_only():
    assert named(lambda a: 0 * a, noise=1e-7, hz=5.0) == ["accelerometers-doubtful"]


def test_accelerometers_too_coarse_to_tell_are_not_called_dead():
    assert named(lambda a: 0 * a, noise=0.05) == []


@pytest.mark.parametrize("see", [lambda a: -a, lambda a: a[::-1], lambda a: a * np.exp(-0.3j)])
def test_wrong_sign_exchanged_and_late_are_named(see):
    assert named(see) != []
