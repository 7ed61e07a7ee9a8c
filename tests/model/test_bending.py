"""Pads that give way: the Newton step knows how the film answers, and ends where the solid says."""

import numpy as np
import pytest

from model.bearing import Bearing
from model.effects import Effect
from model.film.faces import conductances
from model.film.reynolds import solve_film
from model.film.slopes import shape_slopes
from model.pivots import pivot_laws
from model.setup import Setup
from model.statics.search import Search
from tests.model.points import SPEED, close, run
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
