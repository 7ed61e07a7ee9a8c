"""Heat that leaves the film: into the pads, through the journal, to the next pad."""

import math

import numpy as np
import pytest

from model.effects import Effect
from model.film.energy import solve_energy
from model.film.oil_state import Running
from model.growth import Growth, grown
from model.options import Options
from tests.model.points import SPEED, close, run


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
    assert run(rocker).face_temperature[0] is not None
    np.testing.assert_allclose(run(rocker).face_temperature[0], run(rocker).temperature[0], rtol=1e-12)


@pytest.mark.slow
def test_all_paths_together_converge_with_few_steps(rocker):
    options = Options(conduction=True, isothermal_journal=True, growth=Growth(housing=48.0))
    p = run(rocker, Effect("hot_oil_carryover", fraction=0.7), thermal="tehd", options=options)
    assert p.equilibrium.iterations < 30
    assert p.status == ()


def test_isothermal_films_exchange_nothing(rocker):
    options = Options(), Options(conduction=True, isothermal_journal=True)
    plain, all_paths = (run(rocker, thermal="isothermal", options=o) for o in options)
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
