"""The state of a search for an equilibrium: journal, pads and films, how it starts, and all of it as one vector."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from model.film.cross_film import CrossOperator
from model.film.energy import heat_by_drag
from model.film.mesh import FilmWork
from model.growth import grown
from model.setup import Setup
from model.statics.axial_tilt import aligned_tilt, axial_shape
from model.statics.carrying import find_branch, set_loaded
from model.statics.compiled.constants import FIRST_HEATING, HEATING_STEP, MICROMETRE
from model.statics.compiled.first_position import first_position
from model.statics.equilibrium import Equilibrium, mean_temperature
from model.statics.heat_paths import couples_heat
from model.statics.pad_film import PadFilm, pad_films
from rigdata.arrays import FloatArray

#: A change of the clearance by more than this share asks for the table of a pad's loaded attitudes anew.
_NEW_TABLE = 1e-3


@dataclass
class Search:
    """What an iteration carries along."""

    setup: Setup
    load: FloatArray  #: (2,), N
    speed: float
    films: list[PadFilm] = field(init=False)
    position: FloatArray = field(default_factory=lambda: np.zeros(2))  #: (2,): Journal [m].
    limited: float = 0.0
    journal: float = math.nan
    relaxation: float = 1.0
    warm: bool = False
    heat: float = 1.0
    warmth: float = field(init=False)
    warming: float = 0.0
    held: set[int] = field(default_factory=set)
    works: FilmWork = field(init=False)
    shifts: FloatArray = field(init=False)  #: (n, unknowns): Their changes of pressure.

    def __post_init__(self) -> None:
        self.lay_out()

    @property
    def surface_speed(self) -> float:
        """Of the journal [m/s]."""
        return self.speed * self.setup.bearing.journal_radius

    @cached_property
    def heat_balances(self) -> CrossOperator:
        """Room for the balances of one film with temperatures across after the other."""
        cross = self.films[0].cross
        assert cross is not None
        return CrossOperator.place(*cross.temperature.shape)

    @property
    def carrying(self) -> list[PadFilm]:
        """Films that were solved and are not lost."""
        return [f for f in self.films if f.forces is not None and f.forces.steps > 0]

    def lay_out(self) -> None:
        """Make all films anew, their clearances those of a journal as warm as the supply."""
        setup, growth = self.setup, self.setup.growth
        self.warmth = setup.inlet_temperature
        if growth is not None:
            setup = setup.change(bearing=grown(setup.bearing, growth, self.warmth, self.warmth))
        self.films, self.works, self.shifts = pad_films(setup)
        for film in self.films:
            film.kept *= self.heat
            if setup.pads_follow and not (setup.rotational_stiffness or setup.rolling or setup.friction):
                film.axial_tilt = aligned_tilt(setup, film.pad.pivot_angle)  # nothing holds it: that is nearly there
                film.work.extra[:] += film.axial_tilt * axial_shape(film.grid)
        self.warm = False

    def warm_up(self) -> float:
        """Say what the journal's temperature will take from the clearances; returns the change asked for [K]."""
        growth = self.setup.growth
        if growth is None:
            return 0.0
        felt = self.journal if math.isfinite(self.journal) else mean_temperature(self.films)
        asked = felt - self.warmth
        self.warming = self.relaxation * math.copysign(min(abs(asked), HEATING_STEP), asked)
        for film in self.films:
            film.closing = growth.closing(self.setup.bearing) * self.warming
        return abs(asked)

    def grow(self, share: float) -> None:
        """Let the journal grow by a share of what `warm_up` said."""
        if self.warming:
            self._set_warmth(self.warmth + share * self.warming)

    def _set_warmth(self, warmth: float) -> None:
        """Give the clearances that belong to a journal of this temperature [degC]."""
        growth = self.setup.growth
        assert growth is not None
        taken = growth.closing(self.setup.bearing) * (warmth - self.warmth)
        self.warmth, self.warming = warmth, 0.0
        for film in self.films:
            pad = film.pad
            film.pad = replace(
                pad,
                pad_clearance=pad.pad_clearance - taken,
                assembled_clearance=pad.assembled_clearance - taken,
            )
            film.closing = 0.0
            if film.branch is not None and abs(taken) > _NEW_TABLE * pad.pad_clearance:
                film.branch = None

    def start_from(self, start: Equilibrium) -> bool:
        """Take over a neighbour's state; False if it has none or its mesh does not fit."""
        if len(start.films) != len(self.films) or not start.converged:
            return False
        coupled = couples_heat(self.setup)
        for film, other in zip(self.films, start.films, strict=True):
            if film.work.pressure.shape != other.work.pressure.shape:
                return False
            film.tilt, film.deflection, film.idle = other.tilt, other.deflection, other.idle
            film.work.temperature[:] = other.work.temperature
            if coupled:  # elsewhere the inlet is the supply of this set-up, whatever the neighbour drank
                film.inlet = other.inlet
            for state, known in zip(film.heat_state, other.heat_state, strict=False):
                state[:] = known
            film.work.ruptured[:] = other.work.ruptured
            film.work.pressure[:] = other.work.pressure
            if self.setup.flexible_pads:
                film.bent[:] = other.bent
                film.work.extra[:] += other.bent
            if self.setup.pads_follow:
                film.work.extra[:] += (other.axial_tilt - film.axial_tilt) * axial_shape(film.grid)
                film.axial_tilt = other.axial_tilt
        self.position, self.warm = start.position.copy(), True
        if coupled:
            self.journal = start.journal_temperature
        if self.setup.growth is not None:
            self._set_warmth(start.mean_journal_temperature)
        return True

    def start_cold(self) -> None:
        """See `model.statics.compiled.iteration.start_cold`."""
        for film in self.films:
            for state in (film.work.temperature, *film.heat_state):
                state[:] = film.inlet
        isothermal, oil = self.setup.thermal == "isothermal", self.setup.bearing.oil
        self._balance_films(0.0 if isothermal else FIRST_HEATING)
        if isothermal or self.setup.thermal == "thd":
            return
        for film in self.films:
            if not film.idle:
                wedge = (film.pad.pad_clearance, *film.approach(self.position))
                heat_by_drag(film.grid, film.work, wedge, film.running(self.surface_speed, oil), film.inlet)
        self._balance_films(0.0)

    def _balance_films(self, hotter: float) -> None:
        """Put journal and pads where tabulated films, as warm as these or `hotter` [K] than that, carry the load."""
        branches = []
        for film in self.films:
            film.branch = find_branch(self.setup, film, self.surface_speed, hotter)
            branches.append(film.branch)
        normals = np.array([f.normal for f in self.films])
        distances = np.array([f.preload_distance for f in self.films])
        self.position = first_position(self.load, normals, distances, branches)
        for film in self.films:
            set_loaded(film, self.position)

    def vector(self) -> FloatArray:
        """Journal, pads and film temperatures as one vector, in micrometres and kelvins."""
        parts = [self.position / MICROMETRE, np.array([self.warmth])]
        for film in self.films:
            parts.append(np.array([film.tilt * film.pivot_radius, film.deflection]) / MICROMETRE)
            if self.setup.pads_follow:
                parts.append(np.array([film.axial_tilt * film.pivot_radius / MICROMETRE]))
            parts += [state.ravel() * (0.0 if film.idle else 1.0) for state in film.heat_state]
            if self.setup.flexible_pads:
                parts.append(film.bent.ravel() / MICROMETRE)
        return np.concatenate(parts)

    def set_vector(self, state: FloatArray) -> None:
        """Undo `vector`: `state` (n,)."""
        self.position = state[:2] * MICROMETRE
        if self.setup.growth is not None:
            self._set_warmth(float(state[2]))
        at = 3
        for film in self.films:
            film.tilt = float(state[at]) * MICROMETRE / film.pivot_radius
            film.deflection = float(state[at + 1]) * MICROMETRE
            at += 2
            if self.setup.pads_follow:
                axial = float(state[at]) * MICROMETRE / film.pivot_radius
                film.work.extra[:] += (axial - film.axial_tilt) * axial_shape(film.grid)
                film.axial_tilt = axial
                at += 1
            for part in film.heat_state:
                if not film.idle:
                    part.ravel()[:] = state[at : at + part.size]
                at += part.size
            size = film.bent.size
            if self.setup.flexible_pads:
                bent = state[at : at + size].reshape(film.bent.shape) * MICROMETRE
                film.work.extra[:] += bent - film.bent
                film.bent[:] = bent
                at += size
