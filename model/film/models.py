"""Models of a film that ruptures, by name. To add one: a file beside this one, and here its name and its call."""

from model.compilation import inner
from model.film.cavitation import solve_film_jfo
from model.film.mesh import FilmGrid, FilmWork, Wedge
from model.film.reynolds import FilmForces, solve_film

SWIFT_STIEBER, _JFO, TURBULENT = range(3)
#: Names, and by what compiled loops know them.
FILM_MODELS = {"swift-stieber": SWIFT_STIEBER, "jfo": _JFO, "turbulent": TURBULENT}


@inner
def solve_by(
    model: int | None,
    grid: FilmGrid,
    work: FilmWork,
    wedge: Wedge,
    speed: float,
    sharp: bool,
    supplied: float,
) -> FilmForces:
    """Pressure of one film; sharp: its derivatives once more, with the pressure that `work` holds.

    Where the model is None when a search is compiled, the search has `SWIFT_STIEBER` alone. `supplied`: oil there is at
    the leading edge [kg/s/m].
    """
    if model is None:
        return solve_film(grid, work, wedge, speed, sharp, None, sharp)
    if model == _JFO:
        return solve_film_jfo(grid, work, wedge, speed, sharp, (1.0, supplied))
    return solve_film(grid, work, wedge, speed, sharp, model == TURBULENT, sharp)
