"""One pad with its film: mesh, arrays, geometry; one step of its pressure, heat and deformation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from model.bearing import Oil, Pad
from model.film.cross_film import CrossFilm, cross_film, cross_pressure_change, set_cross_viscosity
from model.film.energy import heat_step
from model.film.loaded_attitude import Branch
from model.film.mesh import FilmGrid, FilmWork, film_grid
from model.film.models import FilmSolver, film_solver
from model.film.oil_state import Running, set_viscosity
from model.film.resting import RestingFilm, resting_film
from model.film.reynolds import FilmForces
from model.film.slopes import pressure_change
from model.film.turbulence import solve_turbulent_film
from model.pad.bending import BendingStep, PadDeformation, pad_deformation
from model.setup import Setup
from model.statics.compiled.stack import film_works
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
    pressure_change: FloatArray  #: (unknowns,): The change of pressure from the one to the other [Pa].
    deformation: PadDeformation | None = None
    step: BendingStep | None = None
    tilt: float = 0.0
    deflection: float = 0.0
    idle: bool = False
    forces: FilmForces | None = None
    corrected: FilmForces | None = None
    branch: Branch | None = None
    load_changes: int = 0
    temperature_change: float = field(default=math.inf)
    kept: float = 1.0
    rupture: str = "swift-stieber"
    resting: RestingFilm | None = None
    cross: CrossFilm | None = None
    outlet: float = math.nan
    axial_tilt: float = 0.0
    closing: float = 0.0

    @property
    def solver(self) -> FilmSolver:
        """Solves the film's pressure, with or without its mass conserved."""
        return solve_turbulent_film if self.rupture == "turbulent" else film_solver(self.rupture)

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

    @property
    def lost(self) -> bool:
        """Whether the film closed, so that it has no pressure."""
        return not self.idle and self.forces is not None and self.forces.steps < 0

    @property
    def bulge(self) -> float:
        """How far the face of a pad that bends stands inward at its pivot [m]."""
        return 0.0 if self.deformation is None else -float(np.interp(0.0, self.grid.angle, self.bent[:, 0]))

    def rigid_approach(self, position: FloatArray) -> float:
        """Approach a of the film if the pivot were rigid [m]: `position` (2,) [m]."""
        return self.preload_distance + float(self.normal @ position)

    def approach(self, position: FloatArray) -> tuple[float, float]:
        """(a, b) of the film for a journal position and the pad's present tilt and deflection [m]."""
        a = self.rigid_approach(position) - self.deflection
        b = float(self.tangent @ position) + self.pivot_radius * self.tilt
        return a, b

    def solve(self, position: FloatArray, surface_speed: float, oil: Oil) -> None:
        """Solve the film's pressure for a journal position, at its present temperature and shape."""
        a, b = self.approach(position)
        if self.cross is None:
            set_viscosity(self.work, oil_constants(oil))
        else:
            set_cross_viscosity(self.cross, self.work, oil_constants(oil))
        wedge = (self.pad.pad_clearance, a, b)
        self.forces = self.corrected = self.solver(self.grid, self.work, wedge, surface_speed, False)

    def rest(self, position: FloatArray, surface_speed: float, oil: Oil) -> None:
        """Say what the film of an idle pad does; nothing for one that carries: `position` (2,) [m]."""
        wedge = (self.pad.pad_clearance, self.rigid_approach(position))
        idle = self.idle or self.forces is None
        self.resting = resting_film(self.grid, wedge, surface_speed, oil, self.inlet, self.kept) if idle else None

    def running(self, surface_speed: float, oil: Oil) -> Running:
        """What the film runs with.

        What a share of the heat does, all of it does to oil that takes up more per kelvin.
        """
        return Running(surface_speed, oil_constants(oil), (oil.specific_heat / self.kept, oil.conductivity / self.kept))

    def heat(self, surface_speed: float, oil: Oil, limits: tuple[float, float]) -> float:
        """Move the temperature towards what the pressure makes it, by `limits`: relaxation, and largest step [K]."""
        assert self.forces is not None
        running = self.running(surface_speed, oil)
        change, limited, radial, tangential = heat_step(
            self.grid, self.work, running, (self.inlet, *limits), self.pressure_change
        )
        self.temperature_change = change
        self.corrected = self.forces._replace(force=self.forces.force + np.array([radial, tangential]))
        return limited

    def correct(self, surface_speed: float, oil: Oil) -> None:
        """Say what a temperature that was found otherwise will do to the pressure; see `corrected`."""
        assert self.forces is not None
        given = oil_constants(oil)
        if self.cross is None:
            change = pressure_change(self.grid, self.work, surface_speed, given, self.pressure_change)
        else:
            change = cross_pressure_change(self.grid, self.work, self.cross, surface_speed, given, self.pressure_change)
        self.corrected = self.forces._replace(force=self.forces.force + change)

    def corrected_pressure(self) -> FloatArray:
        """Pressure at the new temperature, (nt + 1, nz + 1) [Pa]."""
        pressure = self.work.pressure.copy()
        inner = pressure[1:-1, self.grid.first : -1]
        inner += self.pressure_change.reshape(inner.shape)
        return pressure


def pad_films(setup: Setup) -> tuple[list[PadFilm], FilmWork, FloatArray]:
    """Lay out every pad's film: gives shifts (n, unknowns)."""
    bearing = setup.bearing
    symmetric = setup.misalignment[0] == 0.0
    across = setup.thermal == "thd"
    solid = setup.flexible_pads or setup.options.conduction or across
    angle, toward = setup.misalignment
    films = []
    laminar = setup.options.turbulence == "none"
    rupture = setup.options.cavitation if laminar else "turbulent"
    grids = [_grid(setup, pad, symmetric) for pad in bearing.pads]
    works, each = film_works(grids, setup.inlet_temperature)
    shifts = np.zeros_like(works.unknown)
    bent = np.zeros_like(works.extra)
    for k, (pad, grid, work) in enumerate(zip(bearing.pads, grids, each, strict=True)):
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
                pressure_change=shifts[k],
                deformation=pad_deformation(pad, bearing, grid, setup.options.conduction) if solid else None,
                kept=1.0 - setup.heat_loss,
                rupture=rupture,
                cross=cross_film(work, setup.inlet_temperature) if across else None,
            )
        )
    return films, works, shifts


def _grid(setup: Setup, pad: Pad, symmetric: bool) -> FilmGrid:
    bearing = setup.bearing
    start = pad.leading_edge + setup.starvation * pad.arc
    shape = (setup.mesh.along, setup.mesh.across * (1 if symmetric else 2))
    return film_grid(start, pad.leading_edge + pad.arc, bearing.journal_radius, bearing.length, shape, symmetric)


def oil_constants(oil: Oil) -> tuple[float, float, float, float]:
    """What the compiled viscosity and density need: mu_40, kappa, rho_40, alpha_v."""
    return oil.viscosity_40, oil.viscosity_exponent, oil.density_40, oil.thermal_expansion
