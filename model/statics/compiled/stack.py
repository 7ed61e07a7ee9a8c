"""All pads of a bearing side by side: the same arrays as one film has, with a leading axis for the pad."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from model.compilation import inner
from model.film.mesh import FilmGrid, FilmWork
from model.pad.bending import SHAPES
from rigdata.arrays import FloatArray, IntArray


class BodyStack(NamedTuple):
    """The matrices of k different pads and which of them the films have; n = (nt + 1)(nz + 1) film nodes.

    Those of pads that do not bend, or do not conduct, are empty.
    """

    kind: IntArray  #: (pads,) of int: Body of every film.
    #: (k, lines, loads + temperatures): Deformation of the solid's lines by both [m/Pa, m/K], and what maps between
    #: them and the film, see `PadDeformation`.
    answer: FloatArray
    gather: FloatArray  #: (k, a, nt - 1): Of the unknown pressures.
    corners: FloatArray  #: (k, b, nt + 1)
    spread: FloatArray  #: (k, nt + 1, a)
    shapes: FloatArray  #: (k, nt + 1, nz + 1, m)
    amplitudes: FloatArray  #: (k, m, n)
    response: FloatArray  #: (k, m, unknowns): With the factor on the deformation, as `answer`.
    flux: FloatArray  #: (k, n, c), (k, c, n): Of pads that conduct, as `PadDeformation`.
    to_coarse: FloatArray


#: Points of a pad's loaded attitudes at most.
ROWS = 400
#: The numbers of one pad, of which a search is told the first eight.
PAD = np.dtype(
    [
        ("frame", float, (2, 2)),  # Rows: unit vectors along the pivot (normal) and across it (tangent).
        ("preload", float),  # Cp - Cb, plus running changes [m].
        ("pivot_radius", float),  # R_P and Cp [m]; of all that is told only clearances grow.
        ("clearance", float),
        ("law", float, 4),  # The pivot, see `model.pad.pivot`; laws of somebody's own are asked anew.
        ("attitudes", float, (4, ROWS)),  # Loaded: r = a + eta, a and b [m], load [N]; the first is the fold.
        ("rows", int),  # How many of them there are; 0 where they were not asked for.
        ("flattest", float),  # Wedges b up to here are none of a pad that is stable in tilt [m].
        ("tilt", float),  # t [rad], eta [m], tilt along the shaft [rad].
        ("deflection", float),
        ("axial", float),
        ("supplied", float),  # What there is of oil at the leading edge [kg/s/m], and leaves the trailing one [kg/s].
        ("passed", float),
        ("idle", bool),  # Carries nothing; has a pressure.
        ("solved", bool),
        ("rescues", int),  # How often the pad was put back on its loaded attitude.
        ("inlet", float),  # Of the oil that enters [degC].
        ("resting", float, 4),  # The film of an idle pad, see `model.film.resting.RestingFilm`.
        ("wedge", float, 2),  # (a, b) that the pressure was solved with [m].
        ("force", float, 2),  # As the pressure was solved, and at the temperature found since [N].
        ("corrected", float, 2),
        ("stiffness", float, (2, 2)),  # [N/m], [N s/m]
        ("damping", float, (2, 2)),
        ("least", float),  # Thinnest film [m].
        ("steps", int),  # See `model.film.reynolds.FilmForces`.
        ("heating", float),  # Largest change of temperature that the last step asked for [K].
        ("felt", float, 2),  # `corrected` and `stiffness` with the pad giving way: what journal and pivot feel.
        ("felt_stiffness", float, (2, 2)),
        ("amplitude", float, (SHAPES, 3)),  # Change of the shapes' amplitudes at rest, and per metre of a and b.
        ("axial_step", float, 3),  # The same of the tilt along the shaft [rad, rad/m].
        ("moves", float, 2),  # Last step's tilt and deflection.
    ],
    align=True,
)


class PadStack(NamedTuple):
    """The pads of a search."""

    table: np.ndarray  #: (n,) of `PAD`.
    order: IntArray  #: (n,) of int: The pads in the order in which oil passes them.
    curves: FloatArray  #: (n, 5, m): Measured curves of their pivots.


class SearchState(NamedTuple):
    """What a search changes besides the pads' numbers and the films' arrays."""

    position: FloatArray  #: (2,): Journal [m].
    shift: FloatArray  #: (n, unknowns): See `model.film.slopes.pressure_change`.
    #: (n, nt + 1, nz + 1): Deformation; what is missing of it besides the shapes of the Newton step [m]. Empty
    #: for rigid pads.
    bent: FloatArray
    mismatch: FloatArray
    faces: FloatArray  #: (n, nt + 1, nz + 1): Temperature of the pads' faces [degC].
    warmth: FloatArray  #: (n, q): All temperatures that the iteration finds; whoever writes to them sets the films'.
    figures: FloatArray  #: See `JOURNAL` and those after it.


#: Places in `SearchState.figures`: temperature of a journal that takes heat, of one that grows, and what that will
#: change by in this step [degC]; share of the oil that runs back at a leading edge.
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


@inner
def rigid_approach(pad: np.record, position: FloatArray) -> float:
    """Approach of a film if its pivot were rigid [m]."""
    return pad.preload + towards(pad, position)


@inner
def towards(pad: np.record, move: FloatArray) -> float:
    """A move of the journal along the pivot line [m]."""
    return pad.frame[0, 0] * move[0] + pad.frame[0, 1] * move[1]


@inner
def along(pad: np.record, move: FloatArray) -> float:
    """A move of the journal across the pivot line [m]."""
    return pad.frame[1, 0] * move[0] + pad.frame[1, 1] * move[1]
