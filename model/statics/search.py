"""One search for an equilibrium: from a set-up to the arrays that compiled loops iterate on, and back to its films."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from model.conditions import named
from model.film.attitudes import attitudes
from model.film.following_heat import heat_impedance
from model.film.oil_state import set_viscosity
from model.film.resting import RestingFilm
from model.film.reynolds import FilmForces, solve_film
from model.growth import grown
from model.pad.pivot import OTHER
from model.pivots import ask_laws, encoded
from model.setup import Setup
from model.statics.compiled import iteration
from model.statics.compiled.bending import axial_shape
from model.statics.compiled.case import ACROSS, ALONE, COUPLED, ISOTHERMAL, Problem
from model.statics.compiled.cross_heat import across_of, set_cross_viscosities, settle_cross_temperatures
from model.statics.compiled.place import is_doubtful, is_stable, let_idle, place_pads, rescue
from model.statics.compiled.stack import BACKFLOW, GROWN, JOURNAL, PAD, PadStack, SearchState
from model.statics.compiled.start import first_position, pivot_curve
from model.statics.conditions import status_of
from model.statics.equilibrium import Begun, Equilibrium
from model.statics.pad_film import pad_films
from model.statics.pad_flow import through_flow
from model.statics.physics import bodies_of, case_of, running_of
from rigdata.arrays import BoolArray, FloatArray

_FAILURES = {
    iteration.FILM_LOST: "film lost",
    iteration.BOUNDLESS_HEAT: "heat without bounds",
    iteration.SINGULAR: "singular",
}
#: A pad that tilts by this share of the largest tilt in the last step swings, too.
_SWINGING = 0.3
#: Share of the clearance that tells a place from a fold.
_EVEN = 1e-6
#: Share to which a film whose heat follows is known, where only the sign of a determinant is asked for.
_TOLD = 1e-4
#: So many times the load at its fold no attitude carries that comes back from there: those carry less than the fold. A
#: curve is of a coarse mesh and of oil that enters fresh.
_BEYOND_FOLD = 2.0


class Search:
    """A journal, pads and films at one operating point; `heat` is the share of the heat that the films keep."""

    def __init__(self, setup: Setup, load: FloatArray, speed: float, heat: float = 1.0) -> None:
        self.setup, self.load, self.speed, self.heat = setup, load, speed, heat
        cold, supply = setup, setup.inlet_temperature
        if setup.growth is not None:  # the clearances of a journal as warm as the supply
            cold = setup.change(bearing=grown(setup.bearing, setup.growth, supply, supply))
        self.films, self.works, self.grids, self.crosses = pad_films(cold)
        #: Of every pad its curve's first point that counts, and the temperatures along the curve.
        self.rises: list[tuple[int, FloatArray]] = []
        #: What every film runs with for itself.
        self.running = running_of(setup, speed * setup.bearing.journal_radius, heat)
        self.case = case_of(setup, self.load, self.running, heat)
        self.bodies = bodies_of(setup, self.case, self.films)
        self.stack = self._pads()
        self.pads = self.stack.table
        self.across = None
        if self.crosses is not None:
            bodies = [f.deformation for f in self.films if f.deformation is not None]
            self.across = across_of(self.crosses, bodies, self.pads["clearance"], setup.bearing.oil.conductivity)
        self.state = self._state()

    def _pads(self) -> PadStack:
        films = self.films
        table = np.zeros(len(films), PAD)
        laws, curves = encoded(self.setup.pivots)
        table["frame"] = [(f.normal, f.tangent) for f in films]
        table["preload"] = [f.preload_distance for f in films]
        table["pivot_radius"] = [f.pivot_radius for f in films]
        table["clearance"] = [f.pad.pad_clearance for f in films]
        table["law"] = laws
        table["flattest"] = [-math.inf if f.pad.leading_edge_pressure else 0.0 for f in films]
        table["supplied"] = table["heating"] = math.inf
        table["inlet"] = self.case.supply
        table["resting"] = math.nan
        return PadStack(table, np.argsort([f.pad.pivot_angle % math.tau for f in films], kind="stable"), curves)

    def _state(self) -> SearchState:
        works, crosses = self.works, self.crosses
        faces, warmth = (works.temperature,) * 2 if crosses is None else (crosses.face, crosses.temperature)
        bends = self.setup.flexible_pads or self.case.axial
        bent = np.zeros(works.extra.shape if bends else (len(self.films), 0, 0))
        if self.case.axial and not any(self.case.hold):  # nothing holds it: along the shaft is nearly there
            lean, toward = self.setup.misalignment
            for m, film in enumerate(self.films):
                self._lean(m, lean * math.cos(film.pad.pivot_angle - toward))
        return SearchState(
            position=np.zeros(2),
            shift=np.zeros_like(works.unknown),
            bent=bent,
            mismatch=np.zeros_like(bent),
            faces=faces,
            warmth=warmth.reshape(len(self.films), -1),
            figures=np.array([math.nan, self.case.supply, 0.0, 0.0]),
        )

    def _lean(self, m: int, tilt: float) -> None:
        """Tilt a pad along the shaft, and its film with it [rad]."""
        film = self.films[m]
        film.work.extra[:] += (tilt - self.pads["axial"][m]) * axial_shape(film.grid)
        self.pads["axial"][m] = tilt

    def _find_curves(self) -> None:
        """Find the curve of every pad's loaded attitudes; pads that are alike share it."""
        load = max(float(np.hypot(*self.load)), 1.0)
        pads, alike = self.pads, dict[tuple[int, float, int], int]()
        for m, film in enumerate(self.films):
            clearance, law = float(pads["clearance"][m]), self.setup.pivots[m]
            first = alike.setdefault((id(film.grid), clearance, id(law)), m)
            if first < m:
                pads["rows"][m], pads["attitudes"][m] = pads["rows"][first], pads["attitudes"][first]
                self.rises.append(self.rises[first])
                continue
            curve = attitudes(film.grid, clearance, self.running, self.case.supply, load)
            deflections = np.empty(0)
            if pads["law"][m, 0] == OTHER:
                deflections = np.array([law.deflection(w) for w in curve.load.tolist()])
            pivot = pads["law"][m], self.stack.curves[m]
            pads["rows"][m] = pivot_curve(curve[:3], clearance, pivot, deflections, pads["attitudes"][m])
            self.rises.append((len(curve.load) - int(pads["rows"][m]), curve.rise))

    def stand(self) -> Search:
        """Put journal and pads where the curves carry the load, and films as warm as they are there; returns itself."""
        self._find_curves()
        pads, state = self.pads, self.state
        state.position[:], loaded = first_position(self.case.load, pads)
        pads["idle"] = ~loaded & (self.case.hold.flexure == 0.0)  # a pad that is held in its tilt has a film anywhere
        self.load_pads(loaded)
        begun = (state.position, pads["tilt"], pads["deflection"], self.works.temperature)
        self.begun = Begun(*(values.copy() for values in begun))
        for values in self.begun[1:]:
            values[~loaded] = math.nan
        if np.any(pads["rows"] < 2):  # the place is of none that carries without a curve
            self.begun.position[:] = math.nan
        return self

    def load_pads(self, loaded: BoolArray) -> None:
        """Put pads on their loaded attitudes for the journal's position, their films as warm as they are there."""
        pads, reach = self.pads, self.reach
        place_pads(pads, self.works, loaded, self.state.position)
        if self.case.thermal == ISOTHERMAL:
            return
        for m in np.flatnonzero(loaded).tolist():
            curve = pads["attitudes"][m, 0, : pads["rows"][m]]
            (low, rises), film, temperature = self.rises[m], self.films[m], self.works.temperature[m]
            point = np.interp(reach[m], curve, np.arange(len(curve)))
            if np.isnan(point):  # a search that has run away: its status says so
                continue
            row = min(int(low + point), len(rises) - 2)
            part = low + point - row
            along, across = _spread(rises.shape[1:], temperature.shape, film.grid.first == 1)
            temperature[:] = pads["inlet"][m] + along @ ((1.0 - part) * rises[row] + part * rises[row + 1]) @ across
            if film.cross is not None:
                film.cross.temperature[:] = temperature[:, :, None]
                film.cross.face[:] = temperature

    @property
    def reach(self) -> FloatArray:
        """Approach of every film if its pivot were rigid, (n,) [m]."""
        return np.asarray(self.pads["preload"] + self.pads["frame"][:, 0] @ self.state.position)

    def margins(self) -> FloatArray:
        """How far pads are above the folds of their curves, as shares of their clearances, (n,)."""
        folds = np.where(self.pads["rows"] >= 2, self.pads["attitudes"][:, 0, 0], math.inf)
        return np.asarray((self.reach - folds) / self.pads["clearance"])

    def let_idle(self, places: Any) -> None:
        """Let pads carry nothing: their places (from 0), or (n,) which."""
        self.pads["idle"][places] = True
        self.pads["tilt"][places] = self.pads["deflection"][places] = 0.0

    def even_films(self) -> list[int]:
        """Numbers of idle pads that stand at a fold without load, concentric: their films count, as they are there.

        Neither loaded nor loose, such a film has no pressure, and answers a small motion like one that is full.
        """
        pads, even = self.pads, []
        for m in np.flatnonzero(pads["idle"] & (np.abs(self.margins()) < _EVEN)).tolist():
            film = self.films[m]
            if (
                film.rupture == "swift-stieber"
                and self.case.thermal == ISOTHERMAL
                and pads["attitudes"][m, 3, 0] == 0.0
            ):
                film.work.ruptured[:] = False
                film.wedge = (float(pads["clearance"][m]), float(pads["attitudes"][m, 1, 0]), 0.0)
                set_viscosity(film.work, self.case.running.oil)
                film.forces = solve_film(film.grid, film.work, film.wedge, self.running.speed, False)
                even.append(film.number)
        return even

    def start_from(self, start: Equilibrium) -> bool:
        """Take over a neighbour's state, moved as the curves are; False if it has none or its mesh does not fit."""
        coupled, pads, state = self.case.thermal in (COUPLED, ACROSS), self.pads, self.state
        if not start.converged or self.works.pressure.shape != (len(start.films), *start.films[0].work.pressure.shape):
            return False
        self.stand()
        # where a pad has no curve, here or there, nothing is moved; pads that friction holds stay where they are held
        has_curves = not np.isnan(self.begun.position - start.begun.position).any()
        moved = self.begun if has_curves and not self.setup.friction else start.begun
        pairs = zip(moved, start.begun, strict=True)
        shift = Begun(*(np.where(np.isnan(new - old), 0.0, new - old) for new, old in pairs))
        for m, (film, neighbour) in enumerate(zip(self.films, start.films, strict=True)):
            if self.case.mixing and math.isfinite(self.case.fresh):
                pads["passed"][m] = through_flow(neighbour)[1]
            as_curves_say = neighbour.idle == math.isnan(start.begun.tilt[m])
            if has_curves and as_curves_say and pads["idle"][m] != neighbour.idle:
                continue  # the neighbour's pad does as its curve says: so does this one
            pads["idle"][m] = neighbour.idle
            pads["tilt"][m] = neighbour.tilt + shift.tilt[m]
            pads["deflection"][m] = neighbour.deflection + shift.deflection[m]
            if coupled:  # elsewhere the inlet is the supply of this set-up, whatever the neighbour drank
                pads["inlet"][m] = neighbour.inlet
            if self.case.thermal != ISOTHERMAL:
                film.work.temperature[:] = neighbour.work.temperature + shift.temperature[m]
            if film.cross is not None and neighbour.cross is not None:
                film.cross.temperature[:] = neighbour.cross.temperature + shift.temperature[m, :, :, None]
                film.cross.face[:] = neighbour.cross.face + shift.temperature[m]
            film.work.ruptured[:] = neighbour.work.ruptured
            film.work.pressure[1:] = neighbour.work.pressure[1:]
            if self.setup.flexible_pads:
                state.bent[m] = neighbour.bent
                film.work.extra[:] += neighbour.bent
            if self.case.axial:
                self._lean(m, neighbour.axial)
        state.position[:] = start.position + shift.position
        if coupled:
            state.figures[JOURNAL] = start.journal_temperature
        if self.setup.growth is not None:
            hotter = start.grown - state.figures[GROWN]
            state.figures[GROWN] += hotter
            pads["clearance"] -= self.case.closing * hotter
        return True

    def run(self) -> Equilibrium:
        """Iterate from where the search stands."""
        problem = Problem(self.grids, self.bodies, self.stack, self.works, self.state, self.case)
        across, code = self.across, iteration.ASKS_OIL
        memory = iteration.fresh_memory(problem)
        while code >= iteration.ASKS_OIL:
            code = iteration.iterate(problem, memory)
            if code == iteration.ASKS_OIL and across is not None:
                set_cross_viscosities(problem, across)
            elif code == iteration.ASKS_HEAT and across is not None:
                relaxed = float(memory.trail[iteration.RELAXED])
                memory.trail[iteration.HEAT] = settle_cross_temperatures(problem, across, relaxed)
            elif code == iteration.ASKS_LAWS:
                ask_laws(self.setup.pivots, self.pads["law"], self.pads["felt"][:, 0])
            elif code == iteration.ASKS_STABLE:
                memory.trail[iteration.STABLE] = float(not self._leave_unstable())
        self._take_over()
        return self._ended(code, memory)

    def _leave_unstable(self) -> bool:
        """Move pads off attitudes that nothing holds, the part of a curve that comes back from its fold.

        That is flatter than the fold and carries less. Pivots behind the middle of their arc have deep films that are
        flatter too; what these carry tells them, without the heat that follows.
        """
        moved = False
        for pad, film, curve in zip(self.pads.view(np.recarray), self.films, self.stack.curves, strict=True):
            if not pad.solved or not is_doubtful(self.case, pad, curve):
                continue
            stiffness = pad.stiffness
            deep = 0.0 < _BEYOND_FOLD * pad.attitudes[3, 0] < pad.force[0]
            is_held = deep and is_stable(self.case, pad, curve, stiffness)
            if self.case.thermal in (ALONE, COUPLED) and not is_held:  # the temperature follows, and that is known
                wedge = (float(pad.clearance), *pad.wedge.tolist())
                stiffness = stiffness + heat_impedance(film.grid, film.work, wedge, self.running, 0.0, _TOLD).real
            if not is_stable(self.case, pad, curve, stiffness):
                moved = True
                if not rescue(pad, film.work, self.state.position):
                    let_idle(pad)
        return moved

    def _take_over(self) -> None:
        """Leave the films where the arrays stand."""
        pads = self.pads
        for name in ("tilt", "deflection", "axial", "idle", "inlet", "supplied"):
            for film, value in zip(self.films, pads[name].tolist(), strict=True):
                setattr(film, name, value)
        names = ("solved", "resting", "clearance", "wedge", "least", "steps")
        solved, resting, clearances, wedges, least, steps = (pads[name].tolist() for name in names)
        for m, film in enumerate(self.films):
            film.wedge = (clearances[m], *wedges[m])
            if self.across is not None:
                film.outlet = float(self.across.outlet[m])
            if self.setup.flexible_pads:
                film.bent = self.state.bent[m]
            forces = pads["force"][m], pads["stiffness"][m], pads["damping"][m]
            film.forces = FilmForces(*forces, least[m], steps[m]) if solved[m] else None
            film.resting = None if solved[m] else RestingFilm(*resting[m])
            if self.setup.growth is not None:
                assembled = film.pad.assembled_clearance + clearances[m] - film.pad.pad_clearance
                film.pad = replace(film.pad, pad_clearance=clearances[m], assembled_clearance=assembled)

    def _ended(self, code: int, memory: iteration.Memory) -> Equilibrium:
        """The state as an answer."""
        films, figures = self.films, self.state.figures
        names = []
        if code in _FAILURES:
            names.append(named(_FAILURES[code]))
        elif code != iteration.SETTLED and self.setup.friction:  # those that the last step moved most swing
            tilts = np.abs(self.pads["moves"][:, 0])
            largest = np.flatnonzero(tilts >= _SWINGING * tilts.max()) + 1
            names.append(named("pads {pads} neither stick nor slide at rest", largest.tolist()))
        if code != iteration.SETTLED:
            names.append(named("not converged"))
        status = status_of(self.setup, self.load, films, self.running.speed, float(figures[BACKFLOW]), names)
        ended = (int(memory.trail[iteration.ITERATION]), float(figures[JOURNAL]), float(figures[GROWN]))
        return Equilibrium(self.state.position.copy(), tuple(films), *ended, status, self.running, self.begun)


@lru_cache(maxsize=16)
def _spread(coarse: tuple[int, int], fine: tuple[int, int], full_width: bool) -> tuple[FloatArray, FloatArray]:
    """From a curve's mesh to a film's, along and across, where either is graded alike; a whole film is symmetric."""
    z = np.linspace(0.0, 1.0, fine[1])
    places = np.linspace(0.0, 1.0, fine[0]), np.abs(2.0 * z - 1.0) if full_width else z
    hats = []
    for x, count in zip(places, coarse):
        nodes = np.linspace(0.0, 1.0, count)
        hats.append(np.array([np.interp(x, nodes, hat) for hat in np.eye(count)]))
    return hats[0].T, hats[1]
