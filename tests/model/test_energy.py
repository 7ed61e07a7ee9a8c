"""The film's heat: balance, order, limits, power; what leaves it into pads, through the journal, to the next pad."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.effects import Effect
from model.film.energy import dissipated, solve_energy
from model.film.mesh import FilmGrid, FilmWork
from model.film.oil_state import Running
from model.growth import Growth, grown
from model.options import Options
from model.statics.pad_flow import outlet_temperature
from tests.model.points import SPEED, close, plain_film, run, solved

MU, RHO, HEAT, CONDUCTIVITY, SURFACE, CLEARANCE = 0.03, 850.0, 2000.0, 0.13, 7.0, 1e-4
TURBULENT = {"load": 2000.0, "speed": 2 * math.pi * 150.0, "options": Options(turbulence="ng-pan")}


def full_film(shape: tuple[int, int], wedge: tuple[float, float] = (0.0, 0.5)) -> tuple[FilmGrid, FilmWork, np.ndarray]:
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


def test_couette_flow_heats_linearly():
    # no wedge: no pressure; rho c h U/2 T' = mu U^2 / h
    grid, _, temperature = full_film((40, 4), wedge=(0.0, 0.0))
    rise = 2 * MU * SURFACE / (RHO * HEAT * CLEARANCE**2) * 0.05 * (grid.angle - grid.angle[0])
    np.testing.assert_allclose(temperature - 40.0, np.repeat(rise[:, None], 5, axis=1), rtol=1e-9, atol=1e-9)


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


def test_a_journal_of_one_temperature_keeps_no_heat(rocker):
    p = run(rocker, options=Options(isothermal_journal=True))
    taken = given = 0.0
    for film in p.equilibrium.films:
        exchange = 3.0 * rocker.oil.conductivity / film.work.thickness * film.grid.dx * film.grid.height
        exchange[[0, -1]] *= 0.5
        heat = exchange * (film.work.temperature - p.equilibrium.journal_temperature)
        taken, given = taken + heat[heat > 0].sum(), given - heat[heat < 0].sum()
    assert taken == pytest.approx(given, rel=1e-5)
    assert taken > 10.0  # W: not nothing
    assert p.max_temperature < run(rocker).max_temperature - 0.5
    temperatures = [f.work.temperature for f in p.equilibrium.films]
    assert min(t.min() for t in temperatures) < p.equilibrium.journal_temperature < p.max_temperature


def test_the_pad_s_face_is_hotter_than_the_film_by_the_parabola(rocker):
    p = run(rocker, options=Options(isothermal_journal=True))
    journal = p.equilibrium.journal_temperature
    # T(y) = Tj + 1.5 (T - Tj) (1 - (1 - y/h)^2): flat at the pad, mean T, wall gradient 3 (T - Tj) / h
    y = (np.arange(1000) + 0.5) / 1000.0
    for film, face in zip(p.equilibrium.films, p.face_temperature, strict=True):
        mean = film.work.temperature
        profile = journal + (face - journal)[..., None] * (1.0 - (1.0 - y) ** 2)
        np.testing.assert_allclose(profile.mean(axis=-1), mean, rtol=1e-6)
    alone = run(rocker)
    np.testing.assert_allclose(alone.face_temperature[0], alone.temperature[0], rtol=1e-12)


@pytest.mark.slow
def test_all_paths_together_converge_with_few_steps(rocker):
    options = Options(conduction=True, isothermal_journal=True, growth=Growth(housing=48.0))
    p = run(rocker, Effect("hot_oil_carryover", fraction=0.7), thermal="tehd", options=options)
    assert p.equilibrium.iterations < 30
    assert p.status == ()


def test_isothermal_films_are_as_warm_as_their_oil_and_exchange_nothing(rocker):
    options = Options(), Options(conduction=True, isothermal_journal=True)
    plain, all_paths = (run(rocker, thermal="isothermal", options=o) for o in options)
    assert all((t == 40.0).all() for t in plain.temperature)
    assert plain.max_temperature == 40.0
    # to rounding: where arrays lie in memory decides the order of a library's sums
    close(all_paths.h, plain.h, 1e-12)


def test_what_pads_conduct_is_what_films_lose(rocker):
    # the temperatures at rest fulfil the energy equation with the heat that the face's own temperature drives in
    p = run(rocker, options=Options(conduction=True))
    oil, surface = rocker.oil, SPEED * rocker.journal_radius
    for film in p.equilibrium.films:
        pad, work, grid = film.deformation, film.work, film.grid
        rise = (work.temperature - p.setup.inlet_temperature).ravel()
        heat = (pad.flux @ (pad.to_coarse @ rise)).reshape(work.temperature.shape) * grid.dx * grid.height
        assert np.abs(heat).sum() > 1.0  # W: not nothing
        work.gained[:] = -heat
        fresh = np.empty_like(work.temperature)
        running = Running(surface, (oil.viscosity_40, 0.0, 0.0, 0.0), (oil.specific_heat, oil.conductivity))
        solve_energy(grid, work, film.inlet, running, fresh)
        np.testing.assert_allclose(fresh, work.temperature, atol=1e-3)


def test_grown_clearances_by_hand(rocker):
    growth = Growth(reference=20.0, housing=48.0, expansion=(11e-6, 12e-6))
    pad, new = rocker.pads[0], grown(rocker, growth, 40.0, 50.0).pads[0]
    seat = rocker.journal_radius + pad.pad_clearance + pad.thickness
    journal = 11e-6 * rocker.journal_radius * 30
    thicker = pad.backing.thermal_expansion * pad.thickness * 20
    wider = pad.backing.thermal_expansion * (rocker.journal_radius + pad.pad_clearance) * 20
    assert new.assembled_clearance - pad.assembled_clearance == pytest.approx(
        12e-6 * seat * 28 - thicker - journal, rel=1e-9
    )
    assert new.pad_clearance - pad.pad_clearance == pytest.approx(wider - journal, rel=1e-9)


def test_the_journal_settles_at_its_own_temperature(rocker):
    growth = Growth()
    p = run(rocker, options=Options(growth=growth))
    by_hand = grown(rocker, growth, 40.0, p.equilibrium.grown)
    again = run(by_hand)
    np.testing.assert_allclose(again.h, p.h, rtol=1e-4)
    # it is as warm as its films, in the mean over their area
    area = [film.grid.area for film in p.equilibrium.films]
    assert p.equilibrium.grown == pytest.approx(np.average(p.temperature, weights=area), abs=1e-4)
    assert p.setup.bearing.pads[0].assembled_clearance < rocker.pads[0].assembled_clearance
    assert p.mesh_error < 0.01  # the coarser mesh does not grow once more


def test_no_clearance_left_is_said(rocker):
    with pytest.raises(ValueError, match="no clearance left"):
        run(rocker, options=Options(growth=Growth(journal=250.0)))


@pytest.mark.parametrize("wrong", [{"reference": math.nan}, {"housing": 900.0}, {"expansion": (1.0, 1e-5)}])
def test_nonsense_growth_is_refused(wrong):
    with pytest.raises(ValueError):
        Growth(**wrong)
