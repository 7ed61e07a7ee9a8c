"""Pivot laws and mixing as the compiled search has them, against the laws and against numpy; laws of one's own."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.film.dense import DEPTH, mixed
from model.measured_pivot import FormulaPivot, MeasuredPivot
from model.pad.pivot import OTHER, compliance, deflection
from model.pivots import RIGID_PIVOT, ScaledPivot, ask_laws, constant_pivot, encoded, formula_pivot
from model.predict import predict
from model.statics import search
from tests.model.points import close, run
from tests.rigs.bearings import changed_pads, ring

CURVE = MeasuredPivot(np.array([0.0, 500.0, 2000.0, 6000.0]), np.array([0.0, 2e-6, 5e-6, 1e-5]))


class Own(FormulaPivot):
    """A law of somebody's own, which happens to be known otherwise."""


OWN = Own(constant_pivot(5e8).numbers, "own")


def laws(bearing):
    kirk = formula_pivot(bearing.pivot)
    return [kirk, RIGID_PIVOT, constant_pivot(5e8), CURVE, ScaledPivot(ScaledPivot(CURVE, 2.0), 0.4)]


@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_laws_as_numbers_say_what_the_laws_say(request, name):
    given = laws(request.getfixturevalue(name))
    rows, curves = encoded(given)
    for law, row, curve in zip(given, rows, curves, strict=True):
        for load in (-5.0, 0.0, 1e-6, 3.0, 500.0, 5900.0, 6000.0, 9000.0, 1e7):
            assert deflection(row, curve, load) == pytest.approx(law.deflection(max(load, 0.0)), rel=1e-13, abs=1e-30)
            if load > 0.0:
                assert compliance(row, curve, load) == pytest.approx(1.0 / law.stiffness(load), rel=1e-13)


def test_a_law_of_ones_own_is_asked_step_by_step(rocker):
    rows, _ = encoded([OWN, constant_pivot(5e8)])
    assert rows[0, 0] == OTHER != rows[1, 0]
    ask_laws([OWN, constant_pivot(5e8)], rows, np.array([3000.0, 10.0]))
    np.testing.assert_allclose(rows[0, 1:3], [3000.0 / 5e8, 1.0 / 5e8])
    assert encoded([OWN])[0][0, 1] == 0.0  # what was asked stays where it was asked for
    for thermal in ("isothermal", "adiabatic", "tehd"):
        own, known = (run(rocker, direction=-1.3, pivots=laws, thermal=thermal) for laws in ([OWN] * 5, 5e8))
        close(own.h, known.h, 1e-6)


def anderson(states: np.ndarray, images: np.ndarray) -> np.ndarray:
    """Type II mixing by numpy: the image whose residual, mixed with the earlier ones, is least."""
    residuals = images - states
    changes = (residuals[-1] - residuals[:-1]).T
    mix = np.linalg.lstsq(changes, residuals[-1], rcond=None)[0]
    return images[-1] - mix @ (images[-1] - images[:-1])


def test_mixing_is_andersons():
    rng = np.random.default_rng(4)
    states, images = rng.normal(size=(2, DEPTH + 1, 30))
    for count in range(2, DEPTH + 2):
        expected = anderson(states[:count], images[:count])
        np.testing.assert_allclose(mixed(images, images - states, count), expected, rtol=1e-6)
    np.testing.assert_array_equal(mixed(images, images - states, 1), images[0])


def test_two_side_pads_that_only_carry_together_are_found_from_a_neighbour_without_them():
    # hot films of no preload: each pad alone would push the journal to where it loses its load
    angles = np.radians([-90.0, 0.0, 90.0, 180.0])
    bearing = ring(angles.tolist(), (0.1, 0.06), math.radians(70.0), (1e-4, 1e-4), (0.03, 45.0))
    point = {"load": 2000.0, "speed": 600.0, "pivots": "rigid"}
    turned = predict(bearing, load_direction=-math.pi / 2 + 0.4, **point)
    assert turned.idle_pads == (3, 4)
    cold = predict(bearing, load_direction=-math.pi / 2, **point)
    warm = predict(bearing, load_direction=-math.pi / 2, start=turned, **point)
    assert cold.idle_pads == warm.idle_pads == (3,)
    close(warm.h, cold.h, 1e-5)


@pytest.mark.parametrize(("preload", "load", "direction"), [(0.1, 8750.0, -0.5), (0.05, 5000.0, -0.3)])
def test_a_pad_near_its_fold_that_only_a_frozen_film_calls_unstable_carries(spherical, preload, load, direction):
    pads = (replace(p, pad_clearance=p.assembled_clearance / (1.0 - preload)) for p in spherical.pads)
    bearing = spherical.with_pads(tuple(pads))
    point = {"direction": direction * math.pi, "speed": 2 * math.pi * 500.0}
    p = run(bearing, load=load, **point)
    assert p.idle_pads == ()
    # the heated film holds it: a little more load moves the journal a little further, along the same branch
    near = [run(bearing, load=s * load, **point).position for s in (0.998, 1.002)]
    np.testing.assert_allclose(0.5 * (near[0] + near[1]), p.position, rtol=2e-3, atol=1e-12)
    assert 0.0 < float(np.hypot(*(near[1] - near[0]))) < 1e-6


def test_a_loaded_pad_whose_pivot_is_behind_the_middle_is_in_no_doubt(rocker, monkeypatch):
    # its wedge is flatter than that of its fold, as is what comes back from there; but that carries less than the fold
    def asked(*arguments):
        raise AssertionError("asked whether a pad is stable that carries many times the load at its fold")

    monkeypatch.setattr(search, "heat_impedance", asked)
    behind = changed_pads(rocker, pivot_offset=0.6)
    assert run(behind, load=8000.0, speed=2 * math.pi * 60, pivots="rigid").idle_pads == ()
