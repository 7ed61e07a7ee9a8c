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
from typing import NamedTuple

import numpy as np

from model.film.mesh import FilmGrid
from model.setup import Setup
from rigdata.arrays import FloatArray


class AxialTilt(NamedTuple):
    """A pad that is free to tilt along the shaft, about the axis across it through its pivot."""

    shape: FloatArray  #: (nt + 1, nz + 1): What a unit of axial tilt adds to h [m/rad].
    #: (unknowns,): Moment by the pressure at the film's unknown nodes, less what grows with the pad's load [m^3].
    weights: FloatArray
    stiffness: float  #: [N m/rad]
    inertia: float  #: [kg m^2]


def axial_shape(grid: FilmGrid) -> FloatArray:
    """What a unit of axial tilt adds to the film thickness, (nt + 1, nz + 1) [m/rad]."""
    return np.outer(grid.cos, grid.z)


def aligned_tilt(setup: Setup, pivot_angle: float) -> float:
    """Axial tilt at which a pad lies along the shaft [rad]."""
    angle, toward = setup.misalignment
    return angle * math.cos(pivot_angle - toward)
