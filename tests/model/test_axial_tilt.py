"""Pads on spheres that follow a shaft that tilts: exact limits, slopes of the static locus, mesh, what holds them."""

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect
from model.film.faces import conductances
from model.film.reynolds import solve_film
from model.film.slopes import shape_slopes, squeeze_slopes
from model.options import Options
from model.pad.bending import force_weights
from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Mesh
from model.statics.compiled.bending import axial_shape
from tests.model import points
from tests.model.points import DOWN, LOAD, SPEED, close

ANGLE, FOLLOWING = 6e-4, Options(axial_tilt=True)


def run(bearing: Bearing, *effects: Effect, slope: float = ANGLE, toward: float = DOWN, **said) -> Prediction:
    """The bearing with a shaft that tilts, its pads free to follow unless it says otherwise."""
    leaning = [Effect("misalignment", angle=slope, direction=toward)] if slope else []
    return points.run(bearing, *leaning, *effects, **{"thermal": "isothermal", "options": FOLLOWING} | said)


def test_an_aligned_shaft_leaves_everything_as_it_is(spherical):
    aligned, plain = run(spherical, slope=0.0).h, run(spherical, slope=0.0, options=Options()).h
    close(aligned, plain, 1e-12)
    nearly, fixed = run(spherical, slope=1e-9), run(spherical, slope=1e-9, options=Options())
    close(nearly.h, fixed.h, 1e-9)
    assert abs(nearly.axial_tilt).max() < 1e-8


def test_a_pad_towards_which_the_shaft_tilts_lies_along_it(spherical):
    p, aligned = run(spherical), run(spherical, slope=0.0, mesh=Mesh(80, 6))
    assert p.axial_tilt[0] == pytest.approx(ANGLE, rel=1e-5)
    film = p.film[0]
    np.testing.assert_allclose(film, film[:, ::-1], rtol=1e-4)
    np.testing.assert_allclose(film[:, 6:], aligned.film[0], rtol=3e-3)


def test_it_takes_most_of_what_the_lean_does_and_all_of_it_in_first_order(spherical):
    aligned = np.diag(run(spherical, slope=0.0).k)
    for toward in (DOWN, 0.4):
        fixed = np.diag(run(spherical, toward=toward, options=Options()).k) - aligned
        large, small = (np.diag(run(spherical, toward=toward, slope=a).k) - aligned for a in (ANGLE, 0.5 * ANGLE))
        assert abs(large).max() < 0.2 * abs(fixed).max()
        np.testing.assert_allclose(small, 0.25 * large, atol=0.05 * abs(large).max())


def test_pivots_that_hold_leave_todays_answer(spherical):
    held = run(spherical, toward=0.4).setup.change(rotational_stiffness=1e12)
    stiff, fixed = (predict_setup(s, LOAD, DOWN, SPEED, SPEED) for s in (held, held.change(options=Options())))
    assert stiff.converged
    assert fixed.converged
    np.testing.assert_allclose(stiff.h, fixed.h, rtol=1e-5, atol=1e-6 * abs(fixed.h).max())
    holds = {"pivot_rolling": {"factor": 1.0}, "pivot_friction": {"coefficient": 0.1}}
    holds["pivot_rotation"] = {"rotational_stiffness": 1e6}
    tilts = [abs(run(spherical, Effect(name, **said)).axial_tilt[0]) for name, said in holds.items()]
    assert all(0.0 < a < 0.999 * ANGLE for a in tilts)
    assert tilts[2] < 0.5 * ANGLE


def test_the_film_by_tilt_is_the_slope_of_its_forces_and_its_damping_is_symmetric(spherical):
    p = run(spherical, toward=0.4)
    film = p.equilibrium.films[0]
    grid, work, speed = film.grid, film.work, p.equilibrium.running.speed
    wedge, shape = film.wedge, axial_shape(film.grid)
    solve_film(grid, work, wedge, speed, False)
    shapes = shape[:, :, None] + 0j  # complex, as the dynamics ask: compiled already
    still = shape_slopes(grid, work, conductances(grid, work, wedge), shapes)[:, 0].real
    moving = squeeze_slopes(grid, work, shapes)[:, 0].real
    lever = np.vstack([force_weights(grid), (grid.area * shape)[1:-1, grid.first : -1].ravel()])
    by_tilt, back = lever[:2] @ moving, -lever[2] @ work.slopes[:, 2:4]
    np.testing.assert_allclose(by_tilt, back, rtol=5e-3)  # forces are summed by a rule of their own
    ends, step = [], 1e-7
    for sign in (1, -1):
        work.extra[:] += sign * step * shape
        solve_film(grid, work, wedge, speed, False)
        ends.append(lever @ work.unknown)
        work.extra[:] -= sign * step * shape
    np.testing.assert_allclose(lever @ still, (ends[0] - ends[1]) / (2 * step), rtol=2e-3)


@pytest.mark.slow
def test_it_hardly_hangs_on_the_mesh_and_goes_with_all_heat(spherical):
    for said in ({}, {"thermal": "adiabatic"}, {"thermal": "tehd"}, {"thermal": "thd"}):
        p, fine = (run(spherical, toward=0.4, mesh=m, **said) for m in (Mesh(24, 4), Mesh(48, 8)))
        np.testing.assert_allclose(p.axial_tilt, fine.axial_tilt, atol=0.02 * ANGLE)
        np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
