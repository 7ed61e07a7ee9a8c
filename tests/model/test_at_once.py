"""The search in one compiled call against the same search step by step: same iterations, same numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

import model.statics.solve
from model.measured_pivot import MeasuredPivot
from model.options import Options
from model.pivots import ConstantPivot, RigidPivot, ScaledPivot, formula_pivot
from model.predict import predict_setup
from model.setup import Mesh, Setup
from model.statics.acceleration import Anderson
from model.statics.at_once import able
from model.statics.compiled.anderson import DEPTH, mixed
from model.statics.compiled.laws import compliance, deflection, encoded

CURVE = MeasuredPivot(np.array([0.0, 500.0, 2000.0, 6000.0]), np.array([0.0, 2e-6, 5e-6, 1e-5]))


def laws(bearing):
    kirk = formula_pivot(bearing.pivot)
    return [kirk, RigidPivot(), ConstantPivot(5e8), CURVE, ScaledPivot(ScaledPivot(CURVE, 2.0), 0.4)]


@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_laws_as_numbers_say_what_the_laws_say(request, name):
    given = laws(request.getfixturevalue(name))
    rows, curves = encoded(given)
    for law, row, curve in zip(given, rows, curves, strict=True):
        for load in (-5.0, 0.0, 1e-6, 3.0, 500.0, 5900.0, 6000.0, 9000.0, 1e7):
            assert deflection(row, curve, load) == pytest.approx(law.deflection(max(load, 0.0)), rel=1e-13, abs=1e-30)
            if load > 0.0:
                assert compliance(row, curve, load) == pytest.approx(1.0 / law.stiffness(load), rel=1e-13)


def test_a_law_of_ones_own_is_searched_step_by_step(rocker):
    class Own(ConstantPivot):
        pass

    assert encoded([Own(5e8)] * 5) is None
    assert not able(Setup(rocker, (Own(5e8),) * 5))


def test_physics_that_the_compiled_search_does_not_know_is_searched_step_by_step(rocker):
    plain = Setup(rocker, (RigidPivot(),) * 5)
    assert able(plain)
    for other in ({"thermal": "thd"}, {"carryover": 0.5}, {"friction": 0.1},
                  {"options": Options(cavitation="jfo")}, {"options": Options(conduction=True)}):  # fmt: skip
        assert not able(plain.change(**other))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rocker", "spherical"])
@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic", "tehd"])
@pytest.mark.parametrize(
    "change",
    [{}, {"misalignment": (2e-4, 0.3)}, {"starvation": 0.1, "rolling": 0.5}, {"rotational_stiffness": 1e4},
     {"heat_loss": 0.2, "supply_change": 3.0}],
)  # fmt: skip
def test_same_search_same_numbers(request, monkeypatch, name, thermal, change):
    bearing = request.getfixturevalue(name)
    setup = Setup(bearing, tuple(laws(bearing)), thermal, Mesh(48, 4), **change)
    for load in (0.0, 300.0, 9000.0):
        at = load, -math.pi / 2 + 0.2, 138.23, np.array([157.0])
        once = predict_setup(setup, *at)
        with monkeypatch.context() as patch:
            patch.setattr(model.statics.solve, "able", lambda setup: False)
            stepwise = predict_setup(setup, *at)
        assert once.status == stepwise.status
        assert once.equilibrium.iterations == stepwise.equilibrium.iterations
        share = 1e-9 if thermal != "tehd" else 1e-6  # the pads' matrices are kept in single precision
        np.testing.assert_allclose(once.h, stepwise.h, rtol=share, atol=share * np.abs(stepwise.h).max())
        np.testing.assert_allclose(once.position, stepwise.position, rtol=share, atol=1e-15)


def test_mixing_is_that_of_the_iteration_step_by_step():
    rng = np.random.default_rng(4)
    memory, images, residuals = Anderson(), np.empty((DEPTH + 1, 30)), np.empty((DEPTH + 1, 30))
    for count in range(1, DEPTH + 2):
        state, image = rng.normal(size=(2, 30))
        images[count - 1], residuals[count - 1] = image, image - state
        np.testing.assert_allclose(mixed(images, residuals, count), memory.next(state, image), rtol=1e-9)
