"""Pads on spheres that follow a shaft that leans: one more tilt per pad, about the axis across it through its pivot.

A ball in its socket turns about any axis. Turned by psi (the pad's end at positive z outward) it adds

    psi z cos(alpha)

to the film thickness; a shaft that leans by its slope towards a pad takes just as much away there, so that a pad which
nothing holds lies as along an aligned shaft. What is left, slope z sin(alpha), the pad would have to follow by turning
about the line of its load: the stops that keep it in its place hold that. Its axial tilt is where the film's moment
about the pivot,

    integral of p z cos(alpha) dA,

is what flexure, rolling or friction of the pivot (`model.tilt_hold`, alike about all axes of a sphere) hold.
"""

from __future__ import annotations

import math

import numpy as np

from model.film.mesh import FilmGrid
from model.film.reynolds import FilmForces
from model.pad.bending import AxialTilt
from model.setup import Setup
from model.statics.pad_film import PadFilm
from model.tilt_hold import tilt_hold
from rigdata.arrays import FloatArray


def axial_shape(grid: FilmGrid) -> FloatArray:
    """What a unit of axial tilt adds to the film thickness, (nt + 1, nz + 1) [m/rad]."""
    return np.outer(grid.cos, grid.z)


def aligned_tilt(setup: Setup, pivot_angle: float) -> float:
    """AxialTilt at which a pad lies along the shaft [rad]."""
    angle, toward = setup.misalignment
    return angle * math.cos(pivot_angle - toward)


def axial_tilt_of(setup: Setup, film: PadFilm, pressure: FloatArray, forces: FilmForces) -> AxialTilt:
    """A pad's freedom to tilt along the shaft, and the moment that is not balanced.

    `pressure` (nt + 1, nz + 1) [Pa].
    """
    grid, shape = film.grid, axial_shape(film.grid)
    hold = tilt_hold(setup, film.axial_tilt, float(forces.force[0]))
    moment = float((grid.area * shape * pressure).sum()) - hold.moment
    lever = grid.area * (shape - hold.arm * grid.cos[:, None])
    return AxialTilt(shape, lever[1:-1, grid.first : -1].ravel(), hold.stiffness, moment)
