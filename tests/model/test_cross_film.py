"""Temperatures across the film: Dowson's integrals, Nahme's exact solution, the well-mixed limit, derivatives, heat."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from model.bearing import Bearing, Oil
from model.effects import Effect
from model.errors import OptionError
from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossFilm, CrossOperator, cross_film, cross_pressure_change, set_cross_viscosity
from model.film.cross_march import conduct, face_temperature, march_cross, station_heat
from model.film.energy import solve_energy
from model.film.mesh import FilmGrid, FilmWork, film_grid, film_work
from model.film.oil_state import Running
from model.film.reynolds import solve_film
from model.growth import Growth, grown
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict, predict_setup
from model.prediction import Prediction
from model.setup import Mesh, Setup
from model.statics.pad_film import oil_constants

DOWN, SPEED = -math.pi / 2, 2 * math.pi * 22
OIL = Oil(0.04, 0.034, 860.0, 0.0, 2000.0, 0.13, 40.0)
SURFACE = 7.0


def run(bearing: Bearing, thermal: str = "thd", mesh: Mesh | None = None, options: Options | None = None) -> Prediction:
    p = predict(bearing, 5000.0, DOWN, SPEED, thermal=thermal, mesh=mesh, options=options)
    assert p.converged, p.status
    return p


def solved(cells: int, profile=None, shape=(80, 6)) -> tuple[FilmGrid, FilmWork, CrossFilm]:
    """A film whose temperature across is given."""
    grid = film_grid(-0.5, 0.5, 0.05, 0.07, shape, True)
    work = film_work(grid, 40.0)
    cross = cross_film(work, 40.0, cells)
    if profile is not None:
        middle = 0.5 * (cross.edges[1:] + cross.edges[:-1])
        cross.temperature[:] = profile(middle)
    set_cross_viscosity(cross, work, oil_constants(OIL))
    assert solve_film(grid, work, (1.2e-4, 4e-5, 3e-5), SURFACE, False).steps > 0
    return grid, work, cross


def test_integrals_are_those_of_the_profile():
    def temperature(eta):
        return 40.0 + 30.0 * (1.0 - eta) ** 2

    _, work, cross = solved(80, temperature)

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
    grid, work, _ = solved(6, lambda eta: 40.0 + steep * (1.0 - eta))
    wedge, step = (1.2e-4, 4e-5, 3e-5), 1e-10
    there = solve_film(grid, work, wedge, SURFACE, False)
    for axis in range(2):
        ends = []
        for s in (1, -1):
            moved = (wedge[0], wedge[1] + s * step * (axis == 0), wedge[2] + s * step * (axis == 1))
            ends.append(solve_film(grid, work, moved, SURFACE, False).force)
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(there.stiffness[:, axis], slope, rtol=2e-3, atol=1e-4 * abs(slope).max())


def test_the_change_of_pressure_by_heat_is_its_slope():
    grid, work, cross = solved(6, lambda eta: 50.0 - 10.0 * eta)
    wedge, given = (1.2e-4, 4e-5, 3e-5), oil_constants(OIL)
    force = solve_film(grid, work, wedge, SURFACE, False).force.copy()
    middle = 0.5 * (cross.edges[1:] + cross.edges[:-1])
    cross.temperature[:] += 1e-3 * (1.0 - middle)
    told = cross_pressure_change(grid, work, cross, SURFACE, given, np.zeros_like(work.unknown))
    set_cross_viscosity(cross, work, given)
    found = solve_film(grid, work, wedge, SURFACE, False).force - force
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
    grid, work, cross = solved(6)
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
    cool = replace(rocker, oil=replace(rocker.oil, specific_heat=1e12))
    frozen = Options(growth=Growth(reference=40.0, expansion=(0.0, 0.0)))
    p = run(cool, options=frozen)
    assert max(abs(t - 40.0).max() for t in p.temperature) < 1e-6
    same = predict(
        cool, 5000.0, DOWN, SPEED, thermal="isothermal", effects=[Effect("pad_bending", compliance_factor=1.0)]
    )
    np.testing.assert_allclose(p.h, same.h, rtol=1e-5, atol=1e-5 * np.abs(same.h).max())


def test_what_a_pad_conducts_is_that_of_its_face_s_new_temperature():
    # a pad of our own: its coarser nodes are the face's mean at every fourth station, heat flows to its ends
    grid, work, cross = solved(6)
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
    grid, work, cross = solved(6)
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
    p = run(rocker, options=Options(growth=Growth(reference=40.0, expansion=(0.0, 0.0))))
    oil = rocker.oil
    gone = 0.0
    for film, flow in zip(p.equilibrium.films, p.pad_flow, strict=True):
        heat = oil.density(flow.outlet) * oil.specific_heat
        gone += heat * (flow.outflow * (flow.outlet - flow.inlet))
        sides = film.work.flow_z[:, -1] * (film.work.temperature[:, -1] - flow.inlet) * oil.specific_heat
        gone += 2.0 * float(sides.sum())
        assert film.deformation is not None
        face, around = film.face_temperature, np.mean([f.inlet for f in p.equilibrium.films])
        flux = film.deformation.flux @ (film.deformation.to_coarse @ (face - around).ravel())
        gone += float(film.grid.area.ravel() @ flux)
    assert gone == pytest.approx(p.power_loss, rel=0.03)


@pytest.mark.slow
def test_temperatures_and_coefficients_hardly_hang_on_the_mesh(rocker):
    p, fine = run(rocker), run(rocker, mesh=Mesh(160, 12))
    assert abs(p.max_temperature - fine.max_temperature) < 0.15
    np.testing.assert_allclose(np.diag(p.k), np.diag(fine.k), rtol=0.01)
    np.testing.assert_allclose(np.diag(p.c), np.diag(fine.c), rtol=0.01)


def test_it_is_for_films_that_rupture_by_swift_stieber(rocker):
    with pytest.raises(OptionError, match="rupture by swift-stieber"):
        predict(rocker, 5000.0, DOWN, SPEED, thermal="thd", options=Options(cavitation="jfo"))


@pytest.mark.slow
def test_a_neighbour_is_a_start(rocker):
    p = run(rocker)
    again = predict(rocker, 5000.0, DOWN, SPEED, thermal="thd", start=p)
    assert again.equilibrium.iterations < p.equilibrium.iterations
    np.testing.assert_allclose(again.h, p.h, rtol=1e-5, atol=1e-5 * np.abs(p.h).max())


@pytest.mark.slow
def test_the_clearances_found_are_those_of_the_journal_found(rocker):
    setup = Setup(rocker, pivot_laws("kirk", rocker), "thd", accuracy=1e-8)  # at 1e-7 the journal is left 3e-5 K away
    p = predict_setup(setup, 5000.0, DOWN, SPEED, SPEED)
    felt = p.equilibrium.journal_temperature
    found = grown(rocker, Growth(), rocker.oil.supply_temperature, felt)
    for pad, same in zip(p.setup.bearing.pads, found.pads, strict=True):
        assert pad.pad_clearance == pytest.approx(same.pad_clearance, abs=1e-11)
        assert pad.assembled_clearance == pytest.approx(same.assembled_clearance, abs=1e-11)
    given = run(rocker, options=Options(growth=Growth(journal=felt)))
    np.testing.assert_allclose(given.h, p.h, rtol=1e-5, atol=1e-5 * np.abs(p.h).max())
    assert given.equilibrium.journal_temperature == pytest.approx(felt, abs=1e-3)
