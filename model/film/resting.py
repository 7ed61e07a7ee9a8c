"""The film of a pad that idles: no pressure, but oil that the journal drags along and shears.

An idle pad floats aligned with the journal, which is how a loaded pad leaves when its load goes to zero: with
h = Cp - a cos(alpha), a the journal's approach, and the oil that enters at the leading edge. Where the gap is wider
than there the film is striated and keeps its flow. Along the arc a full film without pressure and its streaks heat by

    rho c dT/dx = 2 mu(T) U / h^2,

which has a closed solution for the exponential mu(T) of Eq. (4); the density is that of the oil that enters.
"""

import math
from typing import NamedTuple

import numpy as np

from model.compilation import compiled
from model.film.mesh import FilmGrid
from model.film.oil_state import Running


class RestingFilm(NamedTuple):
    """What an idle pad's film does; NaN where the journal touches it."""

    power: float
    flow: float
    outlet: float
    reynolds: float


@compiled
def resting_film(grid: FilmGrid, wedge: tuple[float, float], running: Running, inlet: float) -> RestingFilm:
    """Film of an idle pad for (Cp, a); infinite heat capacity: as cold as its inlet."""
    oil, speed = running.oil, running.speed
    density = oil[2] * (1.0 + oil[3] * (40.0 - inlet))
    entering = oil[0] * np.exp(oil[1] * (40.0 - inlet))
    # the grid may hold one half
    length = (grid.z[-1] - grid.z[0]) * (2.0 if grid.first == 0 else 1.0)
    leading = wedge[0] - wedge[1] * grid.cos[0]
    along, rise, power, reynolds = 0.0, 0.0, 0.0, 0.0
    before = 0.0
    for i in range(len(grid.cos)):
        thickness = wedge[0] - wedge[1] * grid.cos[i]
        if not thickness > 0.0:
            return RestingFilm(math.nan, math.nan, math.nan, math.nan)
        heating = 2.0 * speed / (density * running.heat[0] * thickness**2)
        if i > 0:
            along += 0.5 * (heating + before) * grid.dx
        rise = entering * along if oil[1] == 0.0 else np.log1p(oil[1] * entering * along) / oil[1]
        viscosity = entering * np.exp(-oil[1] * rise)
        shear = viscosity * speed**2 / thickness * min(1.0, leading / thickness)
        for area in grid.area[i]:
            power += shear * area
        lighter = oil[2] * (1.0 + oil[3] * (40.0 - inlet - rise))
        reynolds = max(reynolds, lighter * speed * thickness / viscosity)
        before = heating
    return RestingFilm(power, 0.5 * density * speed * leading * length, inlet + rise, reynolds)
