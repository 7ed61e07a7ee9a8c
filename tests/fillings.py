"""How full the gap of a film is where it is ruptured, from what `solve_film_jfo` leaves."""

import numpy as np

from model.film.cavitation import fed_film
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray


def fluid_fraction(
    grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], speed: float, filling: float = 1.0
) -> FloatArray:
    """Filling theta of a film that `solve_film_jfo` has solved; (nt + 1, nz + 1), 1 where it is full."""
    film = fed_film(grid, work, wedge, speed, (filling, np.inf))
    p, ruptured = work.pressure, work.ruptured
    couette, along = film.faces.couette[0].reshape(p.shape), film.faces.conductance[0].reshape(p.shape)
    across = film.faces.conductance[1].reshape(p.shape)[:, :-1]
    theta = np.ones_like(p)
    theta[0] = np.where(ruptured[0], filling, 1.0)
    into = np.minimum(film.supply, couette[0] - along[0] * p[1])
    for i in range(1, p.shape[0] - 1):
        into = into + along[i] * p[i + 1]
        into[:-1] += across[i] * p[i, 1:]
        into[1:] += across[i] * p[i, :-1]
        theta[i] = np.where(ruptured[i], into / couette[i], 1.0)
        into = couette[i] * theta[i] + along[i] * p[i]
    return theta
