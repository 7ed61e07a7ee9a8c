"""One pad with its film: mesh, arrays, geometry."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.bearing import Oil, Pad
from model.film.cross_film import CrossFilm, cross_film
from model.film.mesh import FilmGrid, FilmWork, OilConstants, Wedge, film_grid, film_works
from model.film.resting import RestingFilm
from model.film.reynolds import FilmForces
from model.pad.bending import PadDeformation, pad_deformation
from model.pad.mesh import COARSE, FINE
from model.setup import Setup
from model.statics.compiled.stack import stacked_grids
from rigdata.arrays import FloatArray


@dataclass
class PadFilm:
    """State of one pad while an equilibrium is sought."""

    number: int
    pad: Pad
    normal: FloatArray  #: (2,): Unit vectors at the pivot.
    tangent: FloatArray
    preload_distance: float
    pivot_radius: float
    grid: FilmGrid
    work: FilmWork
    inlet: float
    deformation: PadDeformation | None = None
    #: (nt + 1, nz + 1): The pad's deformation, part of `work.extra` [m]; a rigid one has none.
    bent: FloatArray | float = 0.0
    wedge: Wedge = (math.nan, math.nan, math.nan)
    tilt: float = 0.0
    deflection: float = 0.0
    idle: bool = False
    forces: FilmForces | None = None
    rupture: str = "swift-stieber"
    resting: RestingFilm | None = None
    cross: CrossFilm | None = None
    outlet: float = math.nan
    axial: float = 0.0  #: Tilt along the shaft [rad].
    supplied: float = math.inf  #: Oil there is at the leading edge [kg/s/m].

    @property
    def hottest(self) -> float:
        """Anywhere across the film [degC]."""
        fields = (self.work.temperature,) if self.cross is None else (self.cross.temperature, self.cross.face)
        return float(max(field.max() for field in fields))

    @property
    def face_temperature(self) -> FloatArray:
        """Of the pad's face [degC], (nt + 1, nz + 1); the film's own where it has one across."""
        return self.work.temperature if self.cross is None else self.cross.face

    def temperature_at(self, fraction: float) -> float:
        """Of the pad's face at mid-length [degC]."""
        angle = self.pad.leading_edge + fraction * self.pad.arc
        middle = 0 if self.grid.first == 0 else len(self.grid.z) // 2
        return float(np.interp(angle, self.grid.angle, self.face_temperature[:, middle]))


def pad_films(setup: Setup) -> tuple[list[PadFilm], FilmWork, FilmGrid, CrossFilm | None]:
    """Lay out every pad's film; all of them side by side besides."""
    bearing = setup.bearing
    angle, toward = setup.misalignment
    across, symmetric = setup.thermal == "thd", angle == 0.0
    solid = setup.flexible_pads or setup.options.conduction or across
    density = FINE if setup.mesh.fine_solid else COARSE
    films = []
    spans = tuple((p.leading_edge + setup.starvation * p.arc, p.leading_edge + p.arc) for p in bearing.pads)
    shape = (setup.mesh.along, setup.mesh.across * (1 if symmetric else 2))
    grids, stack = _grids(spans, bearing.journal_radius, bearing.length, shape, symmetric)
    works, parts = film_works(grids, setup.inlet_temperature)
    crosses = cross_film(works, setup.inlet_temperature) if across else None
    for k, (pad, grid, work) in enumerate(zip(bearing.pads, grids, parts, strict=True)):
        work.pressure[0, grid.first : -1], (x, y) = pad.leading_edge_pressure, pad.normal
        if not symmetric:
            # the axis leans by `angle` towards `toward`: at z the journal stands z * angle further that way
            work.extra[:, :] = -np.outer(np.cos(grid.angle + pad.pivot_angle - toward), grid.z * angle)
        films.append(
            PadFilm(
                number=k + 1,
                pad=pad,
                normal=np.array([x, y]),
                tangent=np.array([-y, x]),
                preload_distance=pad.pad_clearance - pad.assembled_clearance - setup.clearance_change,
                pivot_radius=bearing.pivot_radius(pad),
                grid=grid,
                work=work,
                inlet=setup.inlet_temperature,
                deformation=pad_deformation(pad, bearing, grid, setup.options.conduction, density) if solid else None,
                rupture=rupture_of(setup),
                cross=None if crosses is None else CrossFilm(crosses.edges, *(values[k] for values in crosses[1:])),
            )
        )
    return films, works, stack, crosses


@lru_cache(maxsize=64)
def _grids(
    spans: tuple[tuple[float, float], ...], radius: float, length: float, shape: tuple[int, int], symmetric: bool
) -> tuple[list[FilmGrid], FilmGrid]:
    """Meshes of films that start and end at angles from their pivots, one by one and as one."""
    grids = [film_grid(start, end, radius, length, shape, symmetric) for start, end in spans]
    return grids, stacked_grids(grids)


def rupture_of(setup: Setup) -> str:
    """Name of the model of films that rupture, see `model.film.models`."""
    return setup.options.cavitation if setup.options.turbulence == "none" else "turbulent"


def oil_constants(oil: Oil) -> OilConstants:
    """What the compiled viscosity and density need: mu_40, kappa, rho_40, alpha_v."""
    return oil.viscosity_40, oil.viscosity_exponent, oil.density_40, oil.thermal_expansion
