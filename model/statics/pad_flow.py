"""What enters and leaves the film of a pad: flows, side leakage, temperatures; what its shear costs."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from model.bearing import Oil
from model.film.mesh import FilmWork
from model.film.oil_state import edge_flows
from model.film.reynolds import THINNEST
from model.film.turbulence import shear_factor
from model.statics.pad_film import PadFilm
from rigdata.arrays import FloatArray

#: Share by which a film may ask for more than there is: what a mesh does not tell.
_PLENTY = 1e-3


class PadFlow(NamedTuple):
    """One pad's oil."""

    inflow: float
    outflow: float
    leakage: float
    inlet: float
    outlet: float


def pad_flow(film: PadFilm, oil: Oil) -> PadFlow:
    """Oil of a pad where a search has ended; NaN where it has no film."""
    entering, leaving = through_flow(film)
    outlet = outlet_temperature(film)
    work = film.work
    sides = film.inlet if film.idle else _mixed(work.temperature[:, -1], work.flow_z[:, -1], film.inlet)
    return PadFlow(
        entering / float(oil.density(film.inlet)),
        leaving / float(oil.density(outlet)),
        (entering - leaving) / float(oil.density(sides)),
        film.inlet,
        outlet,
    )


def through_flow(film: PadFilm) -> tuple[float, float]:
    """What passes the leading edge and the trailing edge [kg/s]; see `edge_flows`."""
    if film.resting is not None:
        return film.resting.flow, film.resting.flow
    # films that do not conserve mass take what they ask for
    entering, sides = edge_flows(film.grid, film.work, film.supplied if film.rupture == "jfo" else math.inf)
    return entering, entering - sides


def starved(films: Sequence[PadFilm]) -> list[int]:
    """Numbers of the pads that ask for more oil than their grooves give: that carry, or cannot for want of it."""
    short = []
    for film in films:
        if math.isinf(film.supplied):
            continue
        if film.forces is not None:
            demand = edge_flows(film.grid, film.work, math.inf)[0]
        else:
            demand = through_flow(film)[0] if film.rupture == "jfo" else 0.0
        length = float(film.grid.z[-1] - film.grid.z[0]) * (2.0 if film.grid.first == 0 else 1.0)
        if demand > (1.0 + _PLENTY) * film.supplied * length:
            short.append(film.number)
    return short


def _mixed(temperature: FloatArray, flow: FloatArray, otherwise: float) -> float:
    """Temperature of oil that leaves along an edge [degC]."""
    return float(temperature @ flow / flow.sum()) if flow.sum() > 0.0 else otherwise


def outlet_temperature(film: PadFilm) -> float:
    """Flow-weighted temperature at the trailing edge [degC]; an idle pad's film heats up by shear alone."""
    if film.resting is not None:
        return film.resting.outlet
    return film.outlet if film.cross is not None else _mixed(film.work.temperature[-1], film.work.flow_x[-1], math.nan)


def striation(work: FilmWork) -> FloatArray:
    """Share of the gap that oil fills: 1, or h_rupture / h downstream of where a line's film ruptured."""
    share, h, ruptured = np.ones_like(work.thickness), work.thickness, work.ruptured.copy()
    ruptured[-1] = ruptured[-2]  # at the edges p = 0 says nothing: they are as the nodes beside them
    ruptured[:, -1] = ruptured[:, -2]
    lines = len(work.unknown) // (len(ruptured) - 2)
    if lines < ruptured.shape[1] - 1:  # z = -L/2 is an edge, not a line of symmetry
        ruptured[:, 0] = ruptured[:, 1]
    for i in np.flatnonzero(ruptured.any(axis=1)):
        if i > 0:
            behind = share[i - 1] * np.minimum(1.0, h[i - 1] / h[i])
            share[i] = np.where(ruptured[i], behind, 1.0)
    return share


def power_loss(films: Sequence[PadFilm], surface_speed: float, turbulent: bool = False) -> float:
    """Work the journal does on all films [W]: wall shear mu U / h + h/2 dp/dx, times U, over the full film.

    Where the film is ruptured only its striated share shears; that share is h_rupture / h, taken from the film
    thickness at the line's rupture. NaN where a film is lost.
    """
    total = 0.0
    for film in films:
        if film.idle:
            total += film.resting.power if film.resting is not None else 0.0
            continue
        work, grid = film.work, film.grid
        if not work.thickness.min() > THINNEST * film.pad.pad_clearance:  # lost, of a prediction that did not converge
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
