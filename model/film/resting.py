"""The film of a pad that idles: no pressure, but oil that the journal drags along and shears.

An idle pad floats aligned with the journal, which is how a loaded pad leaves when its load goes to zero: with
h = Cp - a cos(alpha), a the journal's approach, and the oil that enters at the leading edge. Where the gap is wider
than there the film is striated and keeps its flow. Along the arc a full film without pressure and its streaks heat by

    rho c dT/dx = 2 mu(T) U / h^2,

which has a closed solution for the exponential mu(T) of Eq. (4); the density is that of the oil that enters.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from model.bearing import Oil
from model.film.mesh import FilmGrid


class RestingFilm(NamedTuple):
    """What an idle pad's film does."""

    power: float
    flow: float
    outlet: float
    reynolds: float


def resting_film(
    grid: FilmGrid, wedge: tuple[float, float], surface_speed: float, oil: Oil, inlet: float, retained: float
) -> RestingFilm:
    """Film of an idle pad."""
    thickness = wedge[0] - wedge[1] * grid.cos
    if not thickness.min() > 0.0:
        return RestingFilm(math.nan, math.nan, math.nan, math.nan)
    share = np.minimum(1.0, thickness[0] / thickness)
    density = float(oil.density(inlet))
    slope = 2.0 * retained * surface_speed / (density * oil.specific_heat * thickness**2)
    along = np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1])) * grid.dx])
    entering, exponent = float(oil.viscosity(inlet)), oil.viscosity_exponent
    rise = entering * along if exponent == 0.0 else np.log1p(exponent * entering * along) / exponent
    viscosity = oil.viscosity(inlet + rise)
    length = float(grid.z[-1] - grid.z[0]) * (2.0 if grid.first == 0 else 1.0)  # the grid may hold one half
    shear = viscosity * surface_speed**2 / thickness * share
    power = float((0.5 * (shear[1:] + shear[:-1])).sum()) * grid.dx * length
    flow = 0.5 * density * surface_speed * float(thickness[0]) * length
    reynolds = float((oil.density(inlet + rise) * surface_speed * thickness / viscosity).max())
    return RestingFilm(power, flow, inlet + float(rise[-1]), reynolds)
