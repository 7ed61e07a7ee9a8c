"""Pads that give way: bending in the search and with the motion; pads on spheres that follow a shaft that tilts."""

import math
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import flexing_impedance
from model.effects import Effect
from model.film.faces import conductances
from model.film.reynolds import solve_film
from model.film.slopes import shape_slopes, squeeze_slopes
from model.options import Options
from model.pad.bending import force_weights
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Mesh, Setup
from model.statics.compiled.bending import axial_shape
from model.statics.search import Search
from tests.model import points
from tests.model.balance import Balance
from tests.model.points import DOWN, LOAD, SPEED, close, run
from tests.pad_responses import pad_solid


@pytest.fixture(params=["rocker", "spherical"])
def bearing(request) -> Bearing:
    return request.getfixturevalue(request.param)


@pytest.mark.slow
@pytest.mark.parametrize("load", [2500.0, 8750.0])
def test_deformation_is_what_pressure_and_heat_ask_for(bearing, load):
    p = run(bearing, load=load, thermal="tehd")
    assert p.equilibrium.iterations <= 18  # followed one step behind, it swings for ever
    films = p.equilibrium.films
    for film in films:
        solid = pad_solid(film.pad, bearing, film.grid.angle, film.grid.z)
        wanted = solid.bend(film.work.pressure) + solid.expand(film.work.temperature - 40.0)
        np.testing.assert_allclose(film.bent, wanted, atol=1e-5 * film.work.thickness.min())
    assert np.ptp(films[0].bent) > 1e-6


@pytest.mark.slow
def test_half_as_fine_a_solid_is_enough_for_coefficients(bearing):
    assert Mesh() != Mesh().coarser() == Mesh(40, 4, fine_solid=False)
    fine, coarse = (run(bearing, thermal="tehd", mesh=Mesh(fine_solid=chosen)) for chosen in (True, False))
    change = np.array([coarse.h[i, i] / fine.h[i, i] - 1.0 for i in range(2)])
    assert 0.0 < np.abs(change).max() < 2e-3


@pytest.mark.slow
def test_the_matrices_of_a_search_stand_in_one_order(bearing):
    """Another one of any of them is another signature, for which a process compiles the search for half a minute."""
    setup = Setup(bearing, pivot_laws("kirk", bearing), "tehd")
    bodies = Search(setup, np.array([0.0, -5000.0]), SPEED).bodies
    assert bodies is not None
    assert [name for name, values in bodies._asdict().items() if not values.flags.c_contiguous] == []


def test_pressure_slopes_by_shape_are_finite_differences(bearing):
    p = run(bearing, thermal="tehd")
    film = p.equilibrium.films[0]
    assert film.deformation is not None
    grid, work, wedge = film.grid, film.work, film.wedge

    def pressure(amplitudes: np.ndarray) -> np.ndarray:
        work.extra[:] = film.bent + film.deformation.shapes @ amplitudes
        assert solve_film(grid, work, wedge, SPEED * bearing.journal_radius, False).steps > 0
        return work.unknown.copy()

    size = 1e-9 / np.abs(film.deformation.shapes).max()
    pressure(np.zeros(film.deformation.shapes.shape[2]))
    shapes = film.deformation.shapes + 0j  # complex, as the dynamics ask: compiled already
    by_shape = shape_slopes(grid, work, conductances(grid, work, wedge), shapes).real
    for slope, step in zip(by_shape.T, size * np.eye(by_shape.shape[1]), strict=True):
        close(slope, (pressure(step) - pressure(-step)) / (2 * size), 0.01)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_softer_and_stiffer_pads_converge(bearing, factor):
    p = run(bearing, Effect("pad_bending", compliance_factor=factor))
    assert p.equilibrium.iterations <= 18


@pytest.mark.slow
def test_starved_and_misaligned_films_bend_too(bearing):
    for effect in (Effect("starvation", arc_fraction=0.15), Effect("misalignment", angle=1e-4, direction=-1.2)):
        assert run(bearing, effect, thermal="tehd").equilibrium.iterations <= 25


FLEXING = Options(perturbed_bending=True)


def flexing(bearing: Bearing, factor: float = 1.0, options: Options = FLEXING, **more: Any) -> Prediction:
    """An isothermal bearing with pads that bend."""
    bending = Effect("pad_bending", compliance_factor=factor)
    return points.run(bearing, bending, thermal="isothermal", options=options, **more)


@pytest.mark.slow
def test_a_stiff_pad_moves_as_a_rigid_body(rocker):
    for factor, least, most in ((1e-6, 0.0, 1e-5), (1.0, 1e-3, 1.0)):
        p, rigid = flexing(rocker, factor=factor), flexing(rocker, factor=factor, options=Options())
        change = np.abs(p.h - rigid.h).max() / np.abs(rigid.h).max()
        assert least < change < most


@pytest.mark.slow
def test_it_hardly_hangs_on_the_mesh_and_takes_from_stiffness_or_damping(rocker):
    p, fine, rigid = flexing(rocker), flexing(rocker, mesh=Mesh(160, 12)), flexing(rocker, options=Options())
    np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
    np.testing.assert_allclose(np.diag(p.c), np.diag(fine.c), rtol=0.01)
    # in series with the film the pad takes from its damping
    assert (np.diag(p.c) < np.diag(rigid.c)).all()


@pytest.mark.slow
def test_it_is_what_a_film_over_a_flexing_pad_does_by_its_own_balances(rocker):
    omega = 2 * math.pi * 50
    p = flexing(rocker, excitation=omega, mesh=Mesh(20, 4))
    film, speed = p.equilibrium.films[0], p.equilibrium.running.speed
    added = flexing_impedance(film, np.array([omega]), 1.0)[0]
    assert not film.work.ruptured[1:-1, :-1].any()
    found, rigid = (
        Balance((film.grid, film.work), film.wedge, speed, compliance=compliance).impedance(omega)
        for compliance in (film.deformation.compliance, None)
    )
    close(film.forces.stiffness + 1j * omega * film.forces.damping, rigid, 1e-4)
    close(found - rigid, added, 5e-3)
    assert np.abs(added).max() > 0.3 * np.abs(rigid).max()


ANGLE, FOLLOWING = 6e-4, Options(axial_tilt=True)


def tilted(bearing: Bearing, *effects: Effect, slope: float = ANGLE, toward: float = DOWN, **said) -> Prediction:
    """The bearing with a shaft that tilts, its pads free to follow unless it says otherwise."""
    leaning = [Effect("misalignment", angle=slope, direction=toward)] if slope else []
    return points.run(bearing, *leaning, *effects, **{"thermal": "isothermal", "options": FOLLOWING} | said)


def test_an_aligned_shaft_leaves_everything_as_it_is(spherical):
    aligned, plain = tilted(spherical, slope=0.0).h, tilted(spherical, slope=0.0, options=Options()).h
    close(aligned, plain, 1e-12)
    nearly, fixed = tilted(spherical, slope=1e-9), tilted(spherical, slope=1e-9, options=Options())
    close(nearly.h, fixed.h, 1e-9)
    assert abs(nearly.axial_tilt).max() < 1e-8


def test_a_pad_towards_which_the_shaft_tilts_lies_along_it(spherical):
    p, aligned = tilted(spherical), tilted(spherical, slope=0.0, mesh=Mesh(80, 6))
    assert p.axial_tilt[0] == pytest.approx(ANGLE, rel=1e-5)
    film = p.film[0]
    np.testing.assert_allclose(film, film[:, ::-1], rtol=1e-4)
    np.testing.assert_allclose(film[:, 6:], aligned.film[0], rtol=3e-3)


def test_it_takes_most_of_what_the_lean_does_and_all_of_it_in_first_order(spherical):
    aligned = np.diag(tilted(spherical, slope=0.0).k)
    for toward in (DOWN, 0.4):
        fixed = np.diag(tilted(spherical, toward=toward, options=Options()).k) - aligned
        large, small = (np.diag(tilted(spherical, toward=toward, slope=a).k) - aligned for a in (ANGLE, 0.5 * ANGLE))
        assert abs(large).max() < 0.2 * abs(fixed).max()
        np.testing.assert_allclose(small, 0.25 * large, atol=0.05 * abs(large).max())


def test_pivots_that_hold_leave_todays_answer(spherical):
    held = tilted(spherical, toward=0.4).setup.change(rotational_stiffness=1e12)
    stiff, fixed = (predict_setup(s, LOAD, DOWN, SPEED, SPEED) for s in (held, held.change(options=Options())))
    assert stiff.converged
    assert fixed.converged
    np.testing.assert_allclose(stiff.h, fixed.h, rtol=1e-5, atol=1e-6 * abs(fixed.h).max())
    holds = {"pivot_rolling": {"factor": 1.0}, "pivot_friction": {"coefficient": 0.1}}
    holds["pivot_rotation"] = {"rotational_stiffness": 1e6}
    tilts = [abs(tilted(spherical, Effect(name, **said)).axial_tilt[0]) for name, said in holds.items()]
    assert all(0.0 < a < 0.999 * ANGLE for a in tilts)
    assert tilts[2] < 0.5 * ANGLE


def test_the_film_by_tilt_is_the_slope_of_its_forces_and_its_damping_is_symmetric(spherical):
    p = tilted(spherical, toward=0.4)
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
        p, fine = (tilted(spherical, toward=0.4, mesh=m, **said) for m in (Mesh(24, 4), Mesh(48, 8)))
        np.testing.assert_allclose(p.axial_tilt, fine.axial_tilt, atol=0.02 * ANGLE)
        np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
