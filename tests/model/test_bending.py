"""Pads that give way: the Newton step knows how the film answers, and ends where the solid says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect
from model.film.faces import conductances
from model.film.reynolds import solve_film
from model.film.slopes import shape_slopes
from model.pivots import pivot_laws
from model.predict import predict
from model.setup import Setup
from model.statics.search import Search
from tests.pad_responses import pad_solid

SPEED = 2 * math.pi * 22


@pytest.fixture(scope="module", params=["rocker", "spherical"])
def bearing(request) -> Bearing:
    return load_bearing(f"model/bearings/{request.param}.toml")


@pytest.mark.slow
@pytest.mark.parametrize("load", [2500.0, 8750.0])
def test_deformation_is_what_pressure_and_heat_ask_for(bearing, load):
    p = predict(bearing, load, speed=SPEED, thermal="tehd")
    assert p.converged
    assert p.equilibrium.iterations <= 18  # followed one step behind, it swings for ever
    films = p.equilibrium.films
    for film in films:
        solid = pad_solid(film.pad, bearing, film.grid.angle, film.grid.z)
        wanted = solid.bend(film.work.pressure) + solid.expand(film.work.temperature - 40.0)
        np.testing.assert_allclose(film.bent, wanted, atol=1e-5 * film.work.thickness.min())
    assert np.ptp(films[0].bent) > 1e-6


def test_pads_of_one_shape_share_their_matrices(bearing):
    films = predict(bearing, 5000.0, speed=SPEED, thermal="tehd").equilibrium.films
    assert len({id(f.deformation) for f in films}) == 1


@pytest.mark.slow
def test_the_matrices_of_a_search_stand_in_one_order(bearing):
    """Another one of any of them is another signature, for which a process compiles the search for half a minute."""
    setup = Setup(bearing, pivot_laws("kirk", bearing), "tehd")
    bodies = Search(setup, np.array([0.0, -5000.0]), SPEED).bodies
    assert bodies is not None
    assert [name for name, values in bodies._asdict().items() if not values.flags.c_contiguous] == []


def test_pressure_slopes_by_shape_are_finite_differences(bearing):
    p = predict(bearing, 5000.0, speed=SPEED, thermal="tehd")
    film = p.equilibrium.films[0]
    assert film.deformation is not None
    grid, work = film.grid, film.work
    wedge = film.wedge
    surface = SPEED * bearing.journal_radius

    def pressure(amplitudes: np.ndarray) -> np.ndarray:
        work.extra[:] = film.bent + film.deformation.shapes @ amplitudes
        assert solve_film(grid, work, wedge, surface, False).steps > 0
        return work.unknown.copy()

    size = 1e-9 / np.abs(film.deformation.shapes).max()
    pressure(np.zeros(film.deformation.shapes.shape[2]))
    shapes = film.deformation.shapes + 0j  # complex, as the dynamics ask: compiled already
    slopes = shape_slopes(grid, work, conductances(grid, work, wedge), shapes).real
    for m in range(slopes.shape[1]):
        step = np.zeros(slopes.shape[1])
        step[m] = size
        differences = (pressure(step) - pressure(-step)) / (2 * size)
        np.testing.assert_allclose(slopes[:, m], differences, atol=0.01 * np.abs(differences).max())


def test_shapes_are_orthonormal_by_area(bearing):
    film = predict(bearing, 5000.0, speed=SPEED, thermal="tehd").equilibrium.films[0]
    assert film.deformation is not None
    count = film.deformation.shapes.shape[2]
    np.testing.assert_allclose(
        film.deformation.amplitudes @ film.deformation.shapes.reshape(-1, count), np.eye(count), atol=1e-10
    )


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_softer_and_stiffer_pads_converge(bearing, factor):
    p = predict(bearing, 5000.0, speed=SPEED, effects=[Effect("pad_bending", compliance_factor=factor)])
    assert p.converged
    assert p.equilibrium.iterations <= 18


@pytest.mark.slow
def test_starved_and_misaligned_films_bend_too(bearing):
    for effect in (Effect("starvation", arc_fraction=0.15), Effect("misalignment", angle=1e-4, direction=-1.2)):
        p = predict(bearing, 5000.0, speed=SPEED, thermal="tehd", effects=[effect])
        assert p.converged, (effect, p.status)
        assert p.equilibrium.iterations <= 25
