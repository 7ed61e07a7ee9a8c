"""The film's heat: balance, order, limits, carry-over, power."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.film.energy import dissipated, solve_energy
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import Running
from model.options import Options
from model.statics.pad_flow import outlet_temperature
from tests.model.points import plain_film, run, solved

MU, RHO, HEAT, CONDUCTIVITY, SURFACE, CLEARANCE = 0.03, 850.0, 2000.0, 0.13, 7.0, 1e-4
TURBULENT = {"load": 2000.0, "speed": 2 * math.pi * 150.0, "options": Options(turbulence="ng-pan")}


def full_film(
    shape: tuple[int, int],
    wedge: tuple[float, float] = (0.0, 0.5),
) -> tuple[FilmGrid, FilmWork, np.ndarray]:
    """A film that converges over its whole arc (no rupture), and its temperature for constant oil."""
    grid, work = plain_film(shape)
    solved((grid, work), wedge)
    temperature = np.empty_like(work.temperature)
    running = Running(SURFACE, (MU, 0.0, RHO, 0.0), (HEAT, CONDUCTIVITY))
    assert solve_energy(grid, work, 40.0, running, temperature) == 0.0
    return grid, work, temperature


def enthalpy_out(grid: FilmGrid, work: FilmWork, temperature: np.ndarray) -> float:
    """Heat carried out over the edges of the half film above the inlet temperature [W]."""
    along = HEAT * work.flow_x[-1] @ (temperature[-1] - 40.0)
    return float(along + HEAT * side_flow(work) @ (temperature[:, -1] - 40.0))


def side_flow(work: FilmWork) -> np.ndarray:
    """Mass flow over the side edge per station [kg/s]: what enters the half volumes there and does not go on."""
    out = work.flow_z[:, -1].copy()
    out[1:-1] += work.flow_x[:-1, -1] - work.flow_x[1:, -1]
    out[[0, -1]] *= 0.5  # the first and last stations stand for half a step
    return out


def heat_made(grid: FilmGrid, work: FilmWork) -> float:
    """Integral of mu U^2 / h + h^3 / (12 mu) |grad p|^2 over the half film [W], in plain numpy."""
    px = np.gradient(work.pressure, grid.dx, axis=0, edge_order=2)
    pz = np.gradient(work.pressure, grid.z, axis=1, edge_order=2)
    h = work.thickness
    density = MU * SURFACE**2 / h + h**3 / (12 * MU) * (px**2 + pz**2)
    return float((density * grid.area).sum() / 2.0)


def test_heat_made_leaves_with_the_oil():
    errors = []
    for scale in (1, 2, 4):
        grid, work, temperature = full_film((40 * scale, 4 * scale))
        made = heat_made(grid, work)
        errors.append(abs(enthalpy_out(grid, work, temperature) / made - 1.0))
        stations = dissipated(grid, work, SURFACE).sum(axis=0)
        stations[[0, -1]] *= 0.5  # half stations at both ends
        assert enthalpy_out(grid, work, temperature) == pytest.approx(stations.sum(), rel=2e-5)
    assert errors[1] < 1e-3
    assert errors[2] < errors[0] / 8.0  # second order: a sixteenth


def test_dissipation_is_the_journals_work():
    # with p = 0 on all edges, U (mu U/h + h/2 dp/dx) and mu U^2/h + h^3/12mu |grad p|^2 have one integral
    grid, work, _ = full_film((160, 12))
    px = np.gradient(work.pressure, grid.dx, axis=0, edge_order=2)
    friction = MU * SURFACE / work.thickness + 0.5 * work.thickness * px
    work_done = SURFACE * float((friction * grid.area).sum()) / 2.0
    assert heat_made(grid, work) == pytest.approx(work_done, rel=2e-3)


def test_couette_flow_heats_linearly():
    # no wedge: no pressure; rho c h U/2 T' = mu U^2 / h
    grid, _, temperature = full_film((40, 4), wedge=(0.0, 0.0))
    rise = 2 * MU * SURFACE / (RHO * HEAT * CLEARANCE**2) * 0.05 * (grid.angle - grid.angle[0])
    np.testing.assert_allclose(temperature - 40.0, np.repeat(rise[:, None], 5, axis=1), rtol=1e-9, atol=1e-9)


def test_isothermal_is_isothermal(rocker):
    p = run(rocker, thermal="isothermal")
    assert all((t == 40.0).all() for t in p.temperature)
    assert p.max_temperature == 40.0


def test_no_viscosity_exponent_leaves_only_the_density(rocker):
    oil = replace(rocker.oil, viscosity_exponent=0.0, thermal_expansion=0.0)
    hot, cold = (run(replace(rocker, oil=oil), thermal=thermal) for thermal in ("adiabatic", "isothermal"))
    assert hot.max_temperature > 44.0
    np.testing.assert_allclose(hot.k, cold.k, atol=1e-7 * cold.kyy)


@pytest.mark.parametrize(("share", "more", "limit"), [(1.0, {"load": 3000.0}, 0.005), (0.05, TURBULENT, 0.01)])
def test_power_loss_is_what_heats_the_oil(rocker, share, more, limit):
    oil = replace(rocker.oil, viscosity_40=share * rocker.oil.viscosity_40)
    p = run(replace(rocker, oil=oil), **more)
    total = 0.0
    for film in p.equilibrium.films:
        work, rise = film.work, film.work.temperature - 40.0
        assert not work.ruptured.any()  # then flows are those of a full film everywhere
        total += 2.0 * oil.specific_heat * float(work.flow_x[-1] @ rise[-1] + side_flow(work) @ rise[:, -1])
    assert p.power_loss == pytest.approx(total, rel=limit)
    if "options" in more:
        assert p.power_loss > 1.5 * run(replace(rocker, oil=oil), **more | {"options": Options()}).power_loss


def test_outlet_temperature_is_weighted_with_the_flow(rocker):
    film = run(rocker).equilibrium.films[0]
    flow, t = film.work.flow_x[-1], film.work.temperature[-1]
    assert outlet_temperature(film) == pytest.approx(float(np.average(t, weights=flow)), rel=1e-12)
    assert t.min() < outlet_temperature(film) < t.max()
