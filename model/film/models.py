"""Which models of a rupturing film there are, by name. To add one: a file beside this one, and a line here."""

from __future__ import annotations

from collections.abc import Callable

from model.film.cavitation import solve_flooded_film
from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import FilmForces, solve_film

#: Grid, work, (Cp, a, b), surface speed, sharp: pressure and derivatives of one film, see `solve_film`.
FilmSolver = Callable[[FilmGrid, FilmWork, tuple[float, float, float], float, bool], FilmForces]

FILM_MODELS: dict[str, FilmSolver] = {"swift-stieber": solve_film, "jfo": solve_flooded_film}
