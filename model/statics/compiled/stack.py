"""All pads of a bearing side by side: the same arrays as one film has, with a leading axis for the pad."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from model.compilation import inner
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import BoolArray, FloatArray, IntArray


class BodyStack(NamedTuple):
    """The matrices of k different pads and which of them the films have; n = (nt + 1)(nz + 1) film nodes.

    Those of pads that do not bend, or do not conduct, are empty.
    """

    which: IntArray  #: (pads,) of int: Body of every film.
    #: (k, n, unknowns + c) of float32: Deformation by the pressure at the unknown nodes [m/Pa] and by the
    #: temperatures of the pad's coarser nodes [m/K]: half the memory, which is what the product waits for, at a
    #: ten-millionth of a deformation.
    answer: np.ndarray
    lighter: np.ndarray  #: (k, c, n) of float32: Those temperatures by the film's.
    shapes: FloatArray  #: (k, nt + 1, nz + 1, m)
    amplitudes: FloatArray  #: (k, m, n)
    response: FloatArray  #: (k, m, unknowns): With the factor on the deformation, as `answer`.
    flux: FloatArray  #: (k, n, c), (k, c, n): Of pads that conduct, as `PadDeformation`.
    to_coarse: FloatArray


class PadStack(NamedTuple):
    """What a search is told of the pads; of it only clearances grow, and laws of somebody's own are asked anew."""

    frame: FloatArray  #: (n, 2, 2): Rows: unit vectors along the pivot (normal) and across it (tangent).
    preload: FloatArray  #: (n,): Cp - Cb, plus running changes [m].
    pivot_radius: FloatArray  #: (n,): R_P and Cp [m].
    clearance: FloatArray
    order: IntArray  #: (n,) of int: The pads in the order in which oil passes them.
    laws: FloatArray  #: (n, 4): The pivots, see `model.pad.pivot`.
    curves: FloatArray  #: (n, 5, m): Measured ones.
    attitudes: FloatArray  #: (n, 4, r): Loaded attitudes: r = a + eta, a and b [m], load [N]; the first is the fold.
    flattest: FloatArray  #: (n,): Wedges b up to here are none of a pad that is stable in tilt [m].
    rows: IntArray  #: (n,) of int: How many of the r there are; 0 where they were not asked for.


class PadState(NamedTuple):
    """What a search changes besides the films' arrays."""

    position: FloatArray  #: (2,): Journal [m].
    tilt: FloatArray  #: (n,): t [rad], eta [m], tilt along the shaft [rad].
    deflection: FloatArray
    axial: FloatArray
    supplied: (
        FloatArray  #: (n,): What there is of oil at the leading edge [kg/s/m], and leaves the trailing one [kg/s].
    )
    passed: FloatArray
    idle: BoolArray  #: (n,) of bool: Carries nothing; has a pressure.
    solved: BoolArray
    rescues: IntArray  #: (n,) of int: How often the pad was put back on its loaded attitude.
    inlet: FloatArray  #: (n,): Of the oil that enters [degC].
    resting: FloatArray  #: (n, 4): Films of idle pads, see `model.film.resting.RestingFilm`.
    wedge: FloatArray  #: (n, 2): (a, b) that the pressure was solved with [m].
    force: FloatArray  #: (n, 2): As the pressure was solved, and at the temperature found since [N].
    corrected: FloatArray
    stiffness: FloatArray  #: (n, 2, 2): [N/m], [N s/m]
    damping: FloatArray
    least: FloatArray  #: (n,): Thinnest film [m].
    steps: IntArray  #: (n,) of int: See `model.film.reynolds.FilmForces`.
    heating: FloatArray  #: (n,): Largest change of temperature that the last step asked for [K].
    shift: FloatArray  #: (n, unknowns): See `model.film.slopes.pressure_change`.
    felt: FloatArray  #: (n, 2): `corrected`, and ...
    felt_stiffness: FloatArray  #: (n, 2, 2): ... `stiffness` with the pad giving way: what journal and pivot feel.
    #: (n, nt + 1, nz + 1): Deformation; what is missing of it besides the shapes of the Newton step [m]. Empty
    #: for rigid pads.
    bent: FloatArray
    mismatch: FloatArray
    amplitude: FloatArray  #: (n, shapes, 3): Change of their amplitudes at rest, and per metre of a and b.
    axial_step: FloatArray  #: (n, 3): The same of the tilt along the shaft [rad, rad/m].
    moves: FloatArray  #: (n, 2): Last step's tilt and deflection.
    faces: FloatArray  #: (n, nt + 1, nz + 1): Temperature of the pads' faces [degC].
    warmth: FloatArray  #: (n, q): All temperatures that the iteration finds; whoever writes to them sets the films'.
    figures: FloatArray  #: See `JOURNAL` and those after it.


#: Places in `PadState.figures`: temperature of a journal that takes heat, of one that grows, and what that will change
#: by in this step [degC]; share of the oil that runs back at a leading edge.
JOURNAL, GROWN, GROWING, BACKFLOW = range(4)


def stacked_grids(grids: Sequence[FilmGrid]) -> FilmGrid:
    """The meshes of several pads as one: arrays as of one, the pad first; `first` is the same for all."""
    parts: Any = [np.array(values) for values in zip(*grids, strict=True)]
    return FilmGrid(*parts)._replace(first=grids[0].first)


@inner
def grid_of(grids: FilmGrid, m: int) -> FilmGrid:
    """One pad's mesh."""
    return FilmGrid(
        grids.angle[m], grids.z[m], grids.cos[m], grids.sin[m], grids.cos_face[m], grids.sin_face[m],
        grids.conducts[m], grids.drags[m], grids.node[m], grids.dx[m], grids.dz[m], grids.height[m], grids.area[m],
        grids.steps[m], grids.first,
    )  # fmt: skip


@inner
def work_of(works: FilmWork, m: int) -> FilmWork:
    """One film's arrays."""
    return FilmWork(
        works.pressure[m], works.ruptured[m], works.temperature[m], works.viscosity[m], works.density[m],
        works.drag[m], works.exchange[m], works.gained[m], works.thickness[m], works.extra[m], works.flow[m],
        works.band[m], works.unknown[m], works.slopes[m],
    )  # fmt: skip
