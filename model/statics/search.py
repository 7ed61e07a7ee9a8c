"""One search for an equilibrium: from a set-up to the arrays that compiled loops iterate on, and back to its films."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from model.conditions import named
from model.film.attitudes import BETWEEN, attitudes
from model.film.cross_film import CrossOperator, set_cross_viscosity
from model.film.following_heat import heat_impedance
from model.film.oil_state import set_viscosity
from model.film.resting import RestingFilm
from model.film.reynolds import FilmForces, solve_film
from model.growth import grown
from model.pad.bending import SHAPES
from model.pad.pivot import OTHER
from model.pivots import ask_laws, encoded
from model.setup import Setup
from model.statics.compiled.case import ALONE, COUPLED, ISOTHERMAL, Problem
from model.statics.compiled.iteration import (
    ASKS_HEAT,
    ASKS_LAWS,
    ASKS_OIL,
    ASKS_STABLE,
    BOUNDLESS_HEAT,
    FILM_LOST,
    HEAT,
    ITERATION,
    RELAXED,
    RESIDUAL,
    SETTLED,
    SINGULAR,
    STABLE,
    Memory,
    fresh_memory,
    iterate,
    vector_size,
)
from model.statics.compiled.place import is_doubtful, is_stable, let_idle, place, rescue
from model.statics.compiled.stack import BACKFLOW, GROWN, JOURNAL, PadStack, PadState
from model.statics.compiled.start import first_position, pivot_curve
from model.statics.conditions import status_of
from model.statics.cross_heat import settle_cross_temperatures
from model.statics.equilibrium import Begun, Equilibrium
from model.statics.pad_film import axial_shape, pad_films
from model.statics.pad_flow import through_flow
from model.statics.physics import bodies_of, case_of, couples_heat, running_of
from rigdata.arrays import BoolArray, FloatArray
from rigdata.problem import Condition

_FAILURES = {FILM_LOST: "film lost", BOUNDLESS_HEAT: "heat without bounds", SINGULAR: "singular"}
#: A pad that tilts by this share of the largest tilt in the last step swings, too.
_SWINGING = 0.3
#: Share of the clearance that tells a place from a fold.
_EVEN = 1e-6
#: Share to which a film whose heat follows is known, where only the sign of a determinant is asked for.
_TOLD = 1e-4
#: Rows of a pad's loaded attitudes at most.
_ROWS = 400


class Search:
    """A journal, pads and films at one operating point; `heat` is the share of the heat that the films keep."""

    def __init__(self, setup: Setup, load: FloatArray, speed: float, heat: float = 1.0) -> None:
        self.setup, self.load, self.speed, self.heat = setup, load, speed, heat
        cold, supply = setup, setup.inlet_temperature
        if setup.growth is not None:  # the clearances of a journal as warm as the supply
            cold = setup.change(bearing=grown(setup.bearing, setup.growth, supply, supply))
        self.films, self.works, self.grids, self.crosses = pad_films(cold)
        self.other: BoolArray = np.zeros(len(self.films), dtype=np.bool_)  #: Pads of another equilibrium.
        #: Of every pad its curve's first point that counts, and the temperatures along the curve.
        self.rises: list[tuple[int, FloatArray]] = []
        #: What every film runs with for itself.
        self.running = running_of(setup, speed * setup.bearing.journal_radius, heat)
        self.case = case_of(setup, self.load, self.running, heat)
        self.bodies = bodies_of(setup, self.case, self.films)
        self.pads = self._pads()
        self.state = self._state()

    def _pads(self) -> PadStack:
        films, count = self.films, len(self.films)
        frame = np.array([(f.normal, f.tangent) for f in films])
        numbers = [(f.preload_distance, f.pivot_radius, f.pad.pad_clearance) for f in films]
        preload, radius, clearance = np.array(numbers, dtype=float).T.copy()
        angles = [f.pad.pivot_angle % (2.0 * math.pi) for f in films]
        flattest = np.array([-math.inf if f.pad.leading_edge_pressure else 0.0 for f in films])
        laws, curves = encoded(self.setup.pivots)
        return PadStack(
            frame, preload, radius, clearance, np.argsort(angles, kind="stable"), laws, curves,
            np.zeros((count, 4, _ROWS)), flattest, np.zeros(count, dtype=np.int64),
        )  # fmt: skip

    def _state(self) -> PadState:
        n = len(self.films)
        works, crosses = self.works, self.crosses
        bends = self.setup.flexible_pads or self.case.axial
        shape = works.extra.shape
        faces, warmth = (works.temperature,) * 2 if crosses is None else (crosses.face, crosses.temperature)
        bent = np.zeros(shape if bends else (n, 0, 0))
        axial = np.zeros(n)
        if self.case.axial:
            if not any(self.case.hold):  # nothing holds it: that is nearly there
                lean, toward = self.setup.misalignment
                axial[:] = [lean * math.cos(f.pad.pivot_angle - toward) for f in self.films]  # along the shaft
            for film, tilt in zip(self.films, axial.tolist(), strict=True):
                film.work.extra[:] += tilt * axial_shape(film.grid)
        zeros: dict[str, Any] = {name: np.zeros(n) for name in ("tilt", "deflection", "passed", "least")}
        zeros |= {name: np.zeros((n, 2)) for name in ("wedge", "force", "corrected", "felt", "moves")}
        zeros |= {name: np.zeros((n, 2, 2)) for name in ("stiffness", "damping", "felt_stiffness")}
        return PadState(
            **zeros,
            position=np.zeros(2),
            axial=axial,
            supplied=np.full(n, math.inf),
            idle=np.zeros(n, dtype=np.bool_),
            solved=np.zeros(n, dtype=np.bool_),
            rescues=np.zeros(n, dtype=np.int64),
            inlet=np.full(n, self.case.supply),
            resting=np.full((n, 4), math.nan),
            steps=np.zeros(n, dtype=np.int64),
            heating=np.full(n, math.inf),
            shift=np.zeros_like(works.unknown),
            bent=bent,
            mismatch=np.zeros_like(bent),
            amplitude=np.zeros((n, SHAPES, 3)),
            axial_step=np.zeros((n, 3)),
            faces=faces,
            warmth=warmth.reshape(n, -1),
            figures=np.array([math.nan, self.case.supply, 0.0, 0.0]),
        )

    def _find_curves(self) -> None:
        """Find the curve of every pad's loaded attitudes; pads that are alike share it."""
        load = max(float(np.hypot(*self.load)), 1.0)
        bearing, running, supply = self.setup.bearing, self.running, self.case.supply
        size = bearing.journal_radius**2 * bearing.length
        viscosity = float(bearing.oil.viscosity(supply))
        pads, alike = self.pads, dict[tuple[int, float, int], int]()
        for m, film in enumerate(self.films):
            clearance, law = float(pads.clearance[m]), self.setup.pivots[m]
            first = alike.setdefault((id(film.grid), clearance, id(law)), m)
            if first < m:
                pads.rows[m], pads.attitudes[m] = pads.rows[first], pads.attitudes[first]
                self.rises.append(self.rises[first])
                continue
            curve = attitudes(film.grid, clearance, running, supply, load)
            unit = viscosity * running.speed * size / clearance**2
            gives = np.empty(0)
            if pads.laws[m, 0] == OTHER:
                gives = np.array([law.deflection(w) for w in (curve.load * unit).tolist()])
            pads.rows[m] = pivot_curve(
                curve[:3], (clearance, unit), pads.laws[m], pads.curves[m], gives, pads.attitudes[m]
            )
            self.rises.append((len(curve.load) - int(pads.rows[m]), curve.rise))

    def stand(self) -> Search:
        """Put journal and pads where the curves carry the load, and films as warm as they are there; returns itself."""
        self._find_curves()
        pads, state = self.pads, self.state
        state.position[:], loaded, self.other = first_position(self.case.load, pads)
        state.idle[:] = ~loaded & (self.case.hold.flexure == 0.0)  # a pad that is held in its tilt has a film anywhere
        self.idle_by_curves = int(state.idle.sum())
        self.load_pads(loaded)
        begun = (state.position, state.tilt, state.deflection, self.works.temperature)
        self.begun = Begun(*(values.copy() for values in begun))
        for values in self.begun[1:]:
            values[~loaded] = math.nan
        if np.any(pads.rows < 2):  # the place is of none that carries without a curve
            self.begun.position[:] = math.nan
        return self

    def load_pads(self, loaded: BoolArray) -> None:
        """Put pads on their loaded attitudes for the journal's position, their films as warm as they are there."""
        pads, state = self.pads, self.state
        reach = pads.preload + pads.frame[:, 0] @ state.position
        for m in np.flatnonzero(loaded).tolist():
            place(pads, self.works, state, m)
            if self.case.thermal == ISOTHERMAL:
                continue
            curve = pads.attitudes[m, 0, : pads.rows[m]]
            (low, rises), film, temperature = self.rises[m], self.films[m], self.works.temperature[m]
            point = np.interp(reach[m], curve, np.arange(len(curve)))
            if np.isnan(point):  # a search that has run away: its status says so
                continue
            row = min(int((low + point) / BETWEEN), len(rises) - 2)
            part = (low + point) / BETWEEN - row
            along, across = _spread(rises.shape[1:], temperature.shape, film.grid.first == 1)
            temperature[:] = state.inlet[m] + along @ ((1.0 - part) * rises[row] + part * rises[row + 1]) @ across
            if film.cross is not None:
                film.cross.temperature[:] = temperature[:, :, None]
                film.cross.face[:] = temperature

    def margins(self) -> FloatArray:
        """How far pads are above the folds of their curves, as shares of their clearances, (n,)."""
        pads = self.pads
        reach = pads.preload + pads.frame[:, 0] @ self.state.position
        folds = np.where(pads.rows >= 2, pads.attitudes[:, 0, 0], math.inf)
        return np.asarray((reach - folds) / pads.clearance)

    def let_idle(self, numbers: list[int]) -> None:
        """Let pads (from 0) carry nothing."""
        self.state.idle[numbers] = True
        self.state.tilt[numbers] = self.state.deflection[numbers] = 0.0

    def even_films(self) -> list[int]:
        """Numbers of idle pads that stand at a fold without load, concentric: their films count, as they are there.

        Neither loaded nor loose, such a film has no pressure, and answers a small motion like one that is full.
        """
        pads, even = self.pads, []
        for m in np.flatnonzero(self.state.idle & (np.abs(self.margins()) < _EVEN)).tolist():
            film = self.films[m]
            if film.rupture == "swift-stieber" and self.case.thermal == ISOTHERMAL and pads.attitudes[m, 3, 0] == 0.0:
                film.work.ruptured[:] = False
                wedge = (float(pads.clearance[m]), float(pads.attitudes[m, 1, 0]), 0.0)
                set_viscosity(film.work, self.case.running.oil)
                film.forces = solve_film(film.grid, film.work, wedge, self.running.speed, False)
                even.append(film.number)
        return even

    def start_from(self, start: Equilibrium) -> bool:
        """Take over a neighbour's state, moved as the curves are; False if it has none or its mesh does not fit."""
        coupled, state = couples_heat(self.setup), self.state
        mesh = self.works.pressure.shape
        if not start.converged or mesh != (len(start.films), *start.films[0].work.pressure.shape):
            return False
        self.stand()
        # where a pad has no curve, here or there, nothing is moved; pads that friction holds stay where they are held
        known = not np.isnan(self.begun.position - start.begun.position).any()
        moved = self.begun if known and not self.setup.friction else start.begun
        shift = Begun(*(np.nan_to_num(new - old) for new, old in zip(moved, start.begun, strict=True)))
        for m, (film, other) in enumerate(zip(self.films, start.films, strict=True)):
            if self.case.mixing and math.isfinite(self.case.fresh):
                state.passed[m] = through_flow(other)[1]
            as_curves_say = other.idle == math.isnan(start.begun.tilt[m])
            if known and as_curves_say and state.idle[m] != other.idle:
                continue  # the neighbour's pad does as its curve says: so does this one
            state.idle[m] = other.idle
            state.tilt[m] = other.tilt + shift.tilt[m]
            state.deflection[m] = other.deflection + shift.deflection[m]
            if coupled:  # elsewhere the inlet is the supply of this set-up, whatever the neighbour drank
                state.inlet[m] = other.inlet
            if self.case.thermal != ISOTHERMAL:
                film.work.temperature[:] = other.work.temperature + shift.temperature[m]
            if film.cross is not None and other.cross is not None:
                film.cross.temperature[:] = other.cross.temperature + shift.temperature[m, :, :, None]
                film.cross.face[:] = other.cross.face + shift.temperature[m]
            film.work.ruptured[:] = other.work.ruptured
            film.work.pressure[1:] = other.work.pressure[1:]
            if self.setup.flexible_pads:
                state.bent[m] = other.bent
                film.work.extra[:] += other.bent
            if self.case.axial:
                film.work.extra[:] += (other.axial_tilt - state.axial[m]) * axial_shape(film.grid)
                state.axial[m] = other.axial_tilt
        state.position[:] = start.position + shift.position
        if coupled:
            state.figures[JOURNAL] = start.journal_temperature
        if self.setup.growth is not None:
            hotter = start.mean_journal_temperature - state.figures[GROWN]
            state.figures[GROWN] += hotter
            self.pads.clearance[:] -= self.case.closing * hotter
        return True

    def run(self) -> Equilibrium:
        """Iterate from where the search stands."""
        memory = fresh_memory(vector_size(self.state, self.case))
        problem = Problem(self.grids, self.bodies, self.pads, self.works, self.state, self.case)
        operator = None if self.crosses is None else CrossOperator.place(*self.crosses.temperature.shape[1:])
        code = ASKS_OIL
        while code in (ASKS_OIL, ASKS_HEAT, ASKS_LAWS, ASKS_STABLE):
            code = iterate(problem, memory)
            if code == ASKS_OIL:
                running = self.case.running
                turbulent = (running.speed, running.heat[0] / max(running.heat[1], 1e-9))
                for m, film in enumerate(self.films):
                    if not self.state.idle[m] and film.cross is not None:
                        eddies = turbulent if film.rupture == "turbulent" else (0.0, 0.0)
                        set_cross_viscosity(film.cross, film.work, running.oil, eddies)
            elif code == ASKS_HEAT:
                assert operator is not None
                relaxed = float(memory.trail[RELAXED])
                change = settle_cross_temperatures(self.films, self.pads, self.state, self.case, relaxed, operator)
                memory.trail[HEAT] = change
            elif code == ASKS_LAWS:
                ask_laws(self.setup.pivots, self.pads.laws, self.state.felt[:, 0])
            elif code == ASKS_STABLE:
                memory.trail[STABLE] = float(not self._leave_unstable())
        self._take_over()
        return self._ended(code, memory)

    def _leave_unstable(self) -> bool:
        """Move pads off attitudes that nothing holds, the part of a curve that comes back from its fold."""
        pads, state, moved = self.pads, self.state, False
        for m in np.flatnonzero(state.solved).tolist():
            if not is_doubtful(self.case, pads, state, m):
                continue
            stiffness = state.stiffness[m]
            if self.case.thermal in (ALONE, COUPLED):  # the temperature follows, and that is known
                film, wedge = self.films[m], (float(pads.clearance[m]), *state.wedge[m].tolist())
                stiffness = stiffness + heat_impedance(film.grid, film.work, wedge, self.running, 0.0, _TOLD).real
            if not is_stable(self.case, pads, state, m, stiffness):
                moved = True
                if not rescue(pads, self.works, state, m):
                    let_idle(state, m)
        return moved

    def _take_over(self) -> None:
        """Leave the films where the arrays stand."""
        state = self.state
        for m, film in enumerate(self.films):
            film.tilt = float(state.tilt[m])
            film.deflection = float(state.deflection[m])
            film.idle = bool(state.idle[m])
            film.axial_tilt = float(state.axial[m])
            film.inlet = float(state.inlet[m])
            film.supplied = float(state.supplied[m])
            if self.setup.flexible_pads:
                film.bent = state.bent[m]
            forces = state.force[m], state.stiffness[m], state.damping[m], float(state.least[m]), int(state.steps[m])
            film.forces = FilmForces(*forces) if state.solved[m] else None
            film.resting = None if state.solved[m] else RestingFilm(*state.resting[m].tolist())
            if self.setup.growth is not None:
                clearance = float(self.pads.clearance[m])
                assembled = film.pad.assembled_clearance + clearance - film.pad.pad_clearance
                film.pad = replace(film.pad, pad_clearance=clearance, assembled_clearance=assembled)

    def _ended(self, code: int, memory: Memory) -> Equilibrium:
        """The state as an answer."""
        films, figures, trail = self.films, self.state.figures, memory.trail
        names: list[Condition] = []
        if code in _FAILURES:
            names.append(named(_FAILURES[code]))
        elif code != SETTLED and self.setup.friction:  # those that the last step moved most swing
            tilts = np.abs(self.state.moves[:, 0])
            largest = np.flatnonzero(tilts >= _SWINGING * tilts.max()) + 1
            names.append(named("pads {pads} neither stick nor slide at rest", largest.tolist()))
        if code != SETTLED:
            names.append(named("not converged"))
        status = status_of(self.setup, self.load, films, self.running.speed, float(figures[BACKFLOW]), names)
        return Equilibrium(
            self.state.position.copy(), tuple(films), int(trail[ITERATION]), float(trail[RESIDUAL]), float(trail[HEAT]),
            float(figures[JOURNAL]), status, self.running, self.begun,
        )  # fmt: skip


@lru_cache(maxsize=16)
def _spread(coarse: tuple[int, int], fine: tuple[int, int], whole: bool) -> tuple[FloatArray, FloatArray]:
    """From a curve's mesh to a film's, along and across, where either is graded alike; a whole film is symmetric."""
    z = np.linspace(0.0, 1.0, fine[1])
    places = np.linspace(0.0, 1.0, fine[0]), np.abs(2.0 * z - 1.0) if whole else z
    hats = [
        np.array([np.interp(x, np.linspace(0.0, 1.0, count), hat) for hat in np.eye(count)])
        for x, count in zip(places, coarse, strict=True)
    ]
    return hats[0].T, hats[1]
