"""One pad with its film: mesh, arrays, geometry."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.bearing import Oil, Pad
from model.film.cross_film import CrossFilm, cross_film
from model.film.mesh import FilmGrid, FilmWork, OilConstants, film_grid, film_works
from model.film.resting import RestingFilm
from model.film.reynolds import FilmForces
from model.pad.bending import PadDeformation, pad_deformation
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
    bent: FloatArray  #: (nt + 1, nz + 1): The pad's deformation, part of `work.extra` [m].
    deformation: PadDeformation | None = None
    tilt: float = 0.0
    deflection: float = 0.0
    idle: bool = False
    forces: FilmForces | None = None
    rupture: str = "swift-stieber"
    resting: RestingFilm | None = None
    cross: CrossFilm | None = None
    outlet: float = math.nan
    axial_tilt: float = 0.0
    supplied: float = math.inf  #: Oil there is at the leading edge [kg/s/m].

    @property
    def heat_state(self) -> tuple[FloatArray, ...]:
        """Temperatures that the iteration finds; whoever writes to them sets the film's."""
        return (self.work.temperature,) if self.cross is None else (self.cross.temperature, self.cross.face)

    @property
    def face_temperature(self) -> FloatArray:
        """Of the pad's face [degC], (nt + 1, nz + 1); the film's own where it has one across."""
        return self.work.temperature if self.cross is None else self.cross.face

    def temperature_at(self, fraction: float) -> float:
        """Of the pad's face at mid-length [degC]."""
        angle = self.pad.leading_edge + fraction * self.pad.arc
        middle = 0 if self.grid.first == 0 else len(self.grid.z) // 2
        return float(np.interp(angle, self.grid.angle, self.face_temperature[:, middle]))

    def rigid_approach(self, position: FloatArray) -> float:
        """Approach a of the film if the pivot were rigid [m]: `position` (2,) [m]."""
        return self.preload_distance + float(self.normal @ position)

    def approach(self, position: FloatArray) -> tuple[float, float]:
        """(a, b) of the film for a journal position and the pad's present tilt and deflection [m]."""
        a = self.rigid_approach(position) - self.deflection
        b = float(self.tangent @ position) + self.pivot_radius * self.tilt
        return a, b


def pad_films(setup: Setup) -> tuple[list[PadFilm], FilmWork, FilmGrid, CrossFilm | None]:
    """Lay out every pad's film; all of them side by side besides."""
    bearing = setup.bearing
    symmetric = setup.misalignment[0] == 0.0
    across = setup.thermal == "thd"
    solid = setup.flexible_pads or setup.options.conduction or across
    angle, toward = setup.misalignment
    films = []
    spans = tuple((p.leading_edge + setup.starvation * p.arc, p.leading_edge + p.arc) for p in bearing.pads)
    shape = (setup.mesh.along, setup.mesh.across * (1 if symmetric else 2))
    grids, stack = _grids(spans, bearing.journal_radius, bearing.length, shape, symmetric)
    works, each = film_works(grids, setup.inlet_temperature)
    bent = np.zeros_like(works.extra)
    crosses = cross_film(works, setup.inlet_temperature) if across else None
    for k, (pad, grid, work) in enumerate(zip(bearing.pads, grids, each, strict=True)):
        work.pressure[0, grid.first : -1] = pad.leading_edge_pressure
        if not symmetric:
            # the axis leans by `angle` towards `toward`: at z the journal stands z * angle further that way
            work.extra[:, :] = -np.outer(np.cos(grid.angle + pad.pivot_angle - toward), grid.z * angle)
        films.append(
            PadFilm(
                number=k + 1,
                pad=pad,
                normal=np.array([math.cos(pad.pivot_angle), math.sin(pad.pivot_angle)]),
                tangent=np.array([-math.sin(pad.pivot_angle), math.cos(pad.pivot_angle)]),
                preload_distance=pad.pad_clearance - pad.assembled_clearance - setup.clearance_change,
                pivot_radius=bearing.pivot_radius(pad),
                grid=grid,
                work=work,
                inlet=setup.inlet_temperature,
                bent=bent[k],
                deformation=pad_deformation(pad, bearing, grid, setup.options.conduction) if solid else None,
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


def axial_shape(grid: FilmGrid) -> FloatArray:
    """What a unit of axial tilt adds to the film thickness, (nt + 1, nz + 1) [m/rad].

    A ball in its socket turns about any axis. Turned by psi (the pad's end at positive z outward) it adds psi z
    cos(alpha); a shaft that leans by its slope towards a pad takes just as much away there, so that a pad which
    nothing holds lies as along an aligned shaft. What is left, slope z sin(alpha), the pad would have to follow by
    turning about the line of its load: the stops that keep it in its place hold that. Its axial tilt is where the
    film's moment about the pivot, the integral of p z cos(alpha) dA, is what flexure, rolling or friction of the
    pivot hold.
    """
    return np.outer(grid.cos, grid.z)


def rupture_of(setup: Setup) -> str:
    """Name of the model of films that rupture, see `model.film.models`."""
    return setup.options.cavitation if setup.options.turbulence == "none" else "turbulent"


def oil_constants(oil: Oil) -> OilConstants:
    """What the compiled viscosity and density need: mu_40, kappa, rho_40, alpha_v."""
    return oil.viscosity_40, oil.viscosity_exponent, oil.density_40, oil.thermal_expansion
