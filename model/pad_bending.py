"""Pads that bend: the solid's deformation follows the film's pressure and temperature, one step behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.pad_film import PadFilm
from model.pad_solid import PadSolid, pad_solid
from model.setup import Setup

FloatArray = NDArray[np.float64]

#: A film may lose or gain this share of its least thickness by one step of its pad's deformation.
LARGEST_STEP = 0.3
#: Stations on the dry arc ahead of a film that starts late.
DRY_STATIONS = 8


def solid_of(setup: Setup, film: PadFilm) -> tuple[PadSolid, int]:
    """Solid of a pad for its film's mesh, and how many stations lie ahead of the film (starvation)."""
    angle, leading = film.grid.angle, film.pad.leading_edge
    ahead = 0
    if angle[0] - leading > 1e-9:
        ahead = DRY_STATIONS
        angle = np.concatenate([np.linspace(leading, angle[0], ahead + 1)[:-1], angle])
    return pad_solid(film.pad, setup.bearing, angle, film.grid.z), ahead


def bend(setup: Setup, film: PadFilm) -> float:
    """Let the pad follow its film; returns the change asked for, as a share of the least film thickness.

    Eq. (6)-(8): deformation by pressure and by the rise of temperature above the oil supply, times the bending factor.
    """
    solid, ahead = solid_of(setup, film)
    pressure, rise = film.work.pressure, film.work.temperature - setup.inlet_temperature
    if ahead:
        dry = np.zeros((ahead, pressure.shape[1]))
        pressure, rise = np.vstack([dry, pressure]), np.vstack([dry, rise])
    shape = solid.compliance @ pressure.ravel() + solid.thermal @ rise.ravel()
    wanted = setup.bending_factor * shape.reshape(pressure.shape)[ahead:]
    change = wanted - film.bent
    share = float(np.max(np.abs(change))) / float(film.work.thickness.min())
    step = change * min(1.0, LARGEST_STEP / max(share, 1e-30))
    film.bent += step
    film.work.extra[:] += step
    return share
