"""Power lost to the shear of the films, of those that carry and of those that idle."""

from __future__ import annotations

import math

from model.film.turbulence import shear_factor
from model.statics.equilibrium import Equilibrium
from model.statics.pad_flow import striation


def power_loss(equilibrium: Equilibrium, surface_speed: float, turbulent: bool = False) -> float:
    """Work the journal does on all films [W]: wall shear mu U / h + h/2 dp/dx, times U, over the full film.

    Where the film is ruptured only its striated share shears; that share is h_rupture / h, taken from the film
    thickness at the line's rupture. NaN where a film is lost.
    """
    total = 0.0
    for film in equilibrium.films:
        if film.idle:
            total += film.resting.power if film.resting is not None else 0.0
            continue
        work, grid = film.work, film.grid
        if not work.thickness.min() > 0:  # a lost film, of a prediction that did not converge
            return math.nan
        shearing = work.viscosity if film.cross is None else film.cross.shear
        couette = shearing * surface_speed**2 / work.thickness
        if turbulent and film.cross is None:
            couette = couette * shear_factor(work, surface_speed)
        total += float((grid.area * couette * striation(work)).sum())
        slope = (work.pressure[1:] - work.pressure[:-1]) / grid.dx
        dragged = work.thickness * work.drag
        middle = 0.5 * (dragged[1:] + dragged[:-1])
        weight = 0.5 * (grid.area[1:] + grid.area[:-1])
        total += float((0.5 * surface_speed * middle * slope * weight).sum())
    return total
