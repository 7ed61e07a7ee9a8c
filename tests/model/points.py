"""Operating points, films and comparisons that several tests of the model share."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.effects import Effect
from model.film.cavitation import solve_film_jfo
from model.film.mesh import FilmGrid, FilmWork, film_grid, film_work
from model.film.reynolds import FilmForces, solve_film
from model.predict import predict
from model.prediction import Prediction

DOWN, SPEED, OMEGA, LOAD = -math.pi / 2, 2 * math.pi * 22.0, 2 * math.pi * 25.0, 5000.0


def run(bearing: Bearing, *effects: Effect, load: float = LOAD, direction: float = DOWN, **more: Any) -> Prediction:
    """A prediction that converges."""
    p = predict(bearing, load, direction, **{"speed": SPEED, "effects": effects} | more)
    assert p.converged, p.status
    return p


def excited(bearing: Bearing, *effects: Effect, **more: Any) -> Prediction:
    """A prediction that converges, at the excitation of 25 Hz."""
    return run(bearing, *effects, excitation=OMEGA, **more)


def close(found: np.ndarray, expected: np.ndarray, share: float) -> None:
    """Every entry is off by a share of the largest at most."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=share * np.abs(expected).max())


def slopes(values: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float) -> np.ndarray:
    """Central differences of `values` of a place (n,), a column for each direction."""
    ends = [values(at + change) - values(at - change) for change in step * np.eye(len(at))]
    return np.column_stack(ends) / (2.0 * step)


def plain_film(
    shape: tuple[int, int],
    length: float = 0.07,
    arc: float = 1.0,
    oil: tuple[float, float] = (0.03, 850.0),
    symmetric: bool = True,
) -> tuple[FilmGrid, FilmWork]:
    """A film of constant oil (viscosity, density) about its pivot, on a radius of 50 mm."""
    grid = film_grid(-0.5 * arc, 0.5 * arc, 0.05, length, shape, symmetric)
    work = film_work(grid, 40.0)
    work.viscosity[:], work.density[:] = oil
    return grid, work


def conserving(filling: float = 1.0, flow: float = np.inf) -> Callable[..., FilmForces]:
    """Solver that conserves mass, by the share of the gap that is fed and the flow that there is [kg/(s m)]."""
    return lambda *given: solve_film_jfo(*given, (filling, flow))


def solved(
    film: tuple[FilmGrid, FilmWork],
    wedge: tuple[float, float],
    sharp: bool = False,
    solver: Callable[..., FilmForces] = solve_film,
    speed: float = 7.0,
    clearance: float = 1e-4,
) -> FilmForces:
    """Solve from a full film; `wedge` is (a, b) over the clearance."""
    film[1].ruptured[:] = False
    forces = solver(*film, (clearance, wedge[0] * clearance, wedge[1] * clearance), speed, sharp)
    assert forces.steps > 0
    return forces
