"""Temperatures across the film: Dowson's integrals, Nahme's exact solution, the well-mixed limit, derivatives, heat."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from model.bearing import Oil
from model.effects import Effect
from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossFilm, CrossOperator, cross_film, cross_pressure_change, set_cross_viscosity
from model.film.cross_march import conduct, face_temperature, march_cross, station_heat
from model.film.energy import solve_energy
from model.film.mesh import FilmGrid, FilmWork, film_grid, film_work
from model.film.oil_state import Running
from model.growth import Growth, grown
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Mesh, Setup
from model.statics.pad_film import oil_constants
from tests.model.points import DOWN, LOAD, SPEED, close, plain_film, run, slopes, solved
from tests.rigs.bearings import changed_oil
from tests.studies.random_bearings import heat_lost

OIL = Oil(0.04, 0.034, 860.0, 0.0, 2000.0, 0.13, 40.0)
SURFACE, CLEARANCE, WEDGE = 7.0, 1.2e-4, (1 / 3, 1 / 4)
FROZEN = Options(growth=Growth(reference=40.0, expansion=(0.0, 0.0)))


def profiled(cells: int, profile=None, wedge: tuple[float, float] = WEDGE) -> tuple[FilmGrid, FilmWork, CrossFilm]:
    """A film whose temperature across is given."""
    grid, work = plain_film((80, 6))
    cross = cross_film(work, 40.0, cells)
    if profile is not None:
        middle = 0.5 * (cross.edges[1:] + cross.edges[:-1])
        cross.temperature[:] = profile(middle)
    set_cross_viscosity(cross, work, oil_constants(OIL))
    solved((grid, work), wedge, clearance=CLEARANCE)
    return grid, work, cross


def test_integrals_are_those_of_the_profile():
    def temperature(eta):
        return 40.0 + 30.0 * (1.0 - eta) ** 2

    _, work, cross = profiled(80, temperature)

    def light(eta: float) -> float:
        return 1.0 / OIL.viscosity(temperature(eta))

    f0 = quad(light, 0, 1)[0]
    e = quad(lambda y: y * light(y), 0, 1)[0] / f0
    f2 = quad(lambda y: (y - e) ** 2 * light(y), 0, 1)[0]
    assert cross.shear[3, 2] == pytest.approx(1.0 / f0, rel=1e-4)
    assert work.drag[3, 2] == pytest.approx(2.0 * (1.0 - e), rel=1e-4)
    assert work.viscosity[3, 2] == pytest.approx(1.0 / (12.0 * f2), rel=1e-4)
    assert work.drag[3, 2] > 1.05  # thin oil at the pad: the rest goes with the journal


@pytest.mark.parametrize("steep", [0.0, 25.0])
def test_stiffness_is_the_slope_of_the_force_with_a_profile(steep):
    grid, work, _ = profiled(6, lambda eta: 40.0 + steep * (1.0 - eta))

    def forces(wedge):
        return solved((grid, work), tuple(wedge), clearance=CLEARANCE)

    slope = slopes(lambda w: forces(w).force, np.array(WEDGE), 1e-10 / CLEARANCE)
    close(CLEARANCE * forces(WEDGE).stiffness, slope, 1e-3)


def test_the_change_of_pressure_by_heat_is_its_slope():
    grid, work, cross = profiled(6, lambda eta: 50.0 - 10.0 * eta)
    given = oil_constants(OIL)
    force = solved((grid, work), WEDGE, clearance=CLEARANCE).force.copy()
    middle = 0.5 * (cross.edges[1:] + cross.edges[:-1])
    cross.temperature[:] += 1e-3 * (1.0 - middle)
    told = cross_pressure_change(grid, work, cross, SURFACE, given, np.zeros_like(work.unknown))
    set_cross_viscosity(cross, work, given)
    found = solved((grid, work), WEDGE, clearance=CLEARANCE).force - force
    np.testing.assert_allclose(told, found, rtol=1e-3)


def couette(nahme: float, cells: int) -> tuple[float, float]:
    """Rise of an insulated pad's face over the journal, and the viscosity that shears, where a parallel film ends."""
    oil = replace(OIL, viscosity_exponent=0.04)
    h, speed = 1e-5, math.sqrt(nahme * 0.13 / (0.04 * 0.04))
    grid = film_grid(-0.8, 0.8, 0.05 * speed, 0.07, (40, 2), True)  # long: the profile is that of the end
    work = film_work(grid, 40.0)
    cross = cross_film(work, 40.0, cells)
    work.thickness[:] = h
    face = np.zeros_like(work.thickness)
    for _ in range(60):
        set_cross_viscosity(cross, work, oil_constants(oil))
        dragged = 0.5 * speed * h * work.density * work.drag * grid.height
        work.flow_x[:] = 0.5 * (dragged[1:] + dragged[:-1])
        operator = CrossOperator.place(*cross.temperature.shape)
        assert cross_operator(grid, work, cross, speed, (2000.0, 0.13, 1.0, 1.0, 0.0), operator) == 0.0
        field = marched(operator)[0] @ np.array([1.0, 40.0, 40.0])
        cross.temperature[:] += 0.5 * (field.reshape(cross.temperature.shape) - cross.temperature)
    face_temperature(work, cross.edges, 0.13, field, np.zeros_like(face), face)
    return float(face[-1, 0]) - 40.0, float(cross.shear[-1, 0])


@pytest.mark.slow
@pytest.mark.parametrize("nahme", [0.1, 2.0, 8.0])
def test_shear_heating_is_nahme_s_exact_solution(nahme):
    # k T'' = -tau^2 / mu, mu = mu_0 exp(-beta (T - T_0)); journal at T_0, insulated pad. With sinh a = sqrt(Na / 2):
    # beta (T_face - T_0) = 2 ln cosh a = ln(1 + Na / 2), tau h / (mu_0 U) = a / (sinh a cosh a)
    a = math.asinh(math.sqrt(nahme / 2.0))
    rise, shear = math.log(1.0 + nahme / 2.0) / 0.04, a / (math.sinh(a) * math.cosh(a)) * 0.04
    errors = []
    for cells in (6, 12, 24):
        found = couette(nahme, cells)
        errors.append(abs(found[0] / rise - 1.0))
        assert found[1] == pytest.approx(shear, rel=0.6 / cells**2 * (1.0 + nahme))
    assert errors[0] < 0.01
    assert errors[2] < errors[0] / 8.0  # second order


def test_a_well_mixed_film_between_insulated_walls_is_the_adiabatic_one():
    grid, work, cross = profiled(6)
    heat, mixing = 2000.0, 1e4
    operator = CrossOperator.place(*cross.temperature.shape)
    cross_operator(grid, work, cross, SURFACE, (heat, mixing, 1.0, 0.0, 0.0), operator)
    across = (marched(operator)[0] @ np.array([1.0, 40.0, 0.0])).reshape(cross.temperature.shape)
    assert np.ptp(across, axis=2).max() < 0.01
    adiabatic = np.empty_like(work.temperature)
    solve_energy(grid, work, 40.0, Running(SURFACE, (OIL.viscosity_40, 0.0, 860.0, 0.0), (heat, mixing)), adiabatic)
    assert np.ptp(adiabatic) > 2.0
    np.testing.assert_allclose(across.mean(axis=2), adiabatic, atol=1e-3)


@pytest.mark.slow
def test_oil_that_takes_up_any_heat_is_isothermal(rocker):
    cool = changed_oil(rocker, specific_heat=1e12)
    p = run(cool, thermal="thd", options=FROZEN)
    assert max(abs(t - 40.0).max() for t in p.temperature) < 1e-6
    close(p.h, run(cool, Effect("pad_bending", compliance_factor=1.0), thermal="isothermal").h, 1e-5)


def test_what_a_pad_conducts_is_that_of_its_face_s_new_temperature():
    # a pad of our own: its coarser nodes are the face's mean at every fourth station, heat flows to its ends
    grid, work, cross = profiled(6)
    operator, rng = balanced(), np.random.default_rng(7)
    to_coarse = np.kron(np.eye(21)[:, np.arange(81) // 4], np.full((1, 7), 1.0 / 28.0))
    flux = np.kron(np.eye(21)[np.arange(81) // 4], np.ones((7, 1))) @ (3e3 * np.eye(21) - 1e3 * np.eye(21, k=1))
    alone, field = rng.standard_normal((81, 7)), np.zeros((81, 42))
    face = alone.copy()
    pad = (flux, to_coarse, np.eye(21))
    more = conduct((grid, work, cross.edges, 0.13), operator, pad, alone, 1e-9, (field, face))
    heat = (flux @ (to_coarse @ face.ravel())).reshape(face.shape)
    fields, sources, answer = np.zeros((81, 42, 3)), np.zeros((80, 42)), np.empty((81, 7))
    sources[:, ::6] = -station_heat(grid, heat)
    assert more == pytest.approx(march_cross(operator, fields, sources)[0], rel=1e-6)
    face_temperature(work, cross.edges, 0.13, fields[:, :, 0], heat, answer)
    assert abs(answer).max() > 0.1
    np.testing.assert_allclose(face, alone + answer, atol=1e-6)
    np.testing.assert_allclose(field, fields[:, :, 0], atol=1e-6)


def balanced() -> CrossOperator:
    """Heat balances of a film of one temperature."""
    grid, work, cross = profiled(6)
    operator = CrossOperator.place(*cross.temperature.shape)
    cross_operator(grid, work, cross, SURFACE, (2000.0, 0.13, 1.0, 1.0, 0.0), operator)
    return operator


def marched(operator: CrossOperator) -> tuple[np.ndarray, np.ndarray]:
    """Its three fields, and what the journal takes."""
    fields = np.zeros((operator.dissipation.shape[0] + 1, operator.dissipation.shape[1], 3))
    fields[0, :, 1] = 1.0
    return fields, march_cross(operator, fields, operator.dissipation)


@pytest.mark.slow
def test_what_is_made_leaves_with_oil_and_pads_and_not_with_the_journal(rocker):
    assert abs(heat_lost(run(rocker, thermal="thd", options=FROZEN))) < 0.03


@pytest.mark.slow
def test_temperatures_and_coefficients_hardly_hang_on_the_mesh(rocker):
    p, fine = (run(rocker, thermal="thd", mesh=mesh) for mesh in (None, Mesh(160, 12)))
    assert abs(p.max_temperature - fine.max_temperature) < 0.15
    np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
    np.testing.assert_allclose(np.diag(p.c), np.diag(fine.c), rtol=0.01)


@pytest.mark.slow
def test_a_neighbour_is_a_start(rocker):
    p = run(rocker, thermal="thd")
    again = run(rocker, thermal="thd", start=p)
    assert again.equilibrium.iterations < p.equilibrium.iterations
    close(again.h, p.h, 1e-5)


@pytest.mark.slow
def test_the_clearances_found_are_those_of_the_journal_found(rocker):
    setup = Setup(rocker, pivot_laws("kirk", rocker), "thd", accuracy=1e-8)  # at 1e-7 the journal is left 3e-5 K away
    p = predict_setup(setup, LOAD, DOWN, SPEED, SPEED)
    felt = p.equilibrium.journal_temperature
    found = grown(rocker, Growth(), rocker.oil.supply_temperature, felt)
    for pad, same in zip(p.setup.bearing.pads, found.pads, strict=True):
        assert pad.pad_clearance == pytest.approx(same.pad_clearance, abs=1e-11)
        assert pad.assembled_clearance == pytest.approx(same.assembled_clearance, abs=1e-11)
    given = run(rocker, thermal="thd", options=Options(growth=Growth(journal=felt)))
    close(given.h, p.h, 1e-5)
    assert given.equilibrium.journal_temperature == pytest.approx(felt, abs=1e-3)
