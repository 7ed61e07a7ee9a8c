"""Temperatures of films, pads, journal and grooves together, with the temperature across the films (`thermal="thd"`).

- Film: `model.film.cross_energy`; its viscosity across the film acts on the pressure (`model.film.cross_film`).
- Pads conduct, `model.pad.operators`: film temperature and heat flux are those of the face, free faces cool in the oil.
- Journal: one temperature, at which it keeps no heat over a turn.
- Grooves: the flow balance of `model.statics.compiled.heat`, oil of one temperature enters.

For given flows all of it is linear: a film's temperatures are those of fresh oil, plus what they answer to its inlet
and to the journal, and inlets and journal follow from one small system. What a pad conducts hangs on all of its face;
that is solved as a correction by a few Krylov steps. It is a compiled call of its own beside the search's.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from model.compilation import compiled, inner
from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossFilm, CrossOperator, cross_pressure_change, set_cross_viscosity
from model.film.cross_march import conduct, face_temperature, march_cross, station_heat
from model.film.dense import BOUNDLESS, product, times
from model.film.energy import limited_share
from model.film.models import TURBULENT
from model.interpolation import largest
from model.pad.bending import PadDeformation
from model.statics.compiled.case import HEATING_STEP, Problem, film_of
from model.statics.compiled.heat import balance_heat, note_flows, note_heat
from model.statics.compiled.stack import BACKFLOW, JOURNAL
from rigdata.arrays import FloatArray

#: What a pad conducts is solved to this share in every step; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.03
#: And to this one where the last step has changed a temperature by more than so much [K]: all else is far off, too.
_ROUGH_TOLERANCE, _ROUGH = 0.15, 3.0
#: Share of a pad's clearance, about two films, through which heat gets from its face into the oil that carries it away.
_FACE_SHARE = 0.05


class Across(NamedTuple):
    """What a search across films works on besides, n pads."""

    films: CrossFilm  #: Side by side.
    operator: CrossOperator  #: Room for the balances of one film after the other.
    guesses: FloatArray  #: (n, c, c): See `_settled`.
    #: (n, nt + 1, lines * cells, 3), (n, 3, nt + 1, nz + 1): Answers of cells and faces to all else, to a kelvin of the
    #: inlet, and of the journal.
    fields: FloatArray
    faces: FloatArray
    outlet: FloatArray  #: (n,): Of the oil at the trailing edge [degC].


def across_of(
    films: CrossFilm, bodies: Sequence[PadDeformation], clearances: FloatArray, conductivity: float
) -> Across:
    """Room for the heat of films with temperatures across."""
    n, rows, lines, cells = films.temperature.shape
    powers = [round(math.log2(_FACE_SHARE * c / conductivity)) for c in clearances.tolist()]
    fields = np.zeros((n, rows, lines * cells, 3))
    fields[:, 0, :, 1] = 1.0
    return Across(
        films,
        CrossOperator.place(rows, lines, cells),
        np.array([_settled(body, power) for body, power in zip(bodies, powers, strict=True)]),
        fields,
        np.empty((n, 3, rows, lines)),
        np.full(n, math.nan),
    )


@lru_cache(maxsize=64)
def _settled(pad: PadDeformation, power: int) -> FloatArray:
    """About what the pad's coarser nodes change by, per kelvin that the film would bring them by, (c, c).

    For a film whose oil lies behind a resistance of 2^power [m^2 K/W].
    """
    return np.asarray(np.linalg.inv(np.eye(pad.flux.shape[1]) + 2.0**power * (pad.to_coarse @ pad.flux)))


@inner
def _film(films: CrossFilm, m: int) -> CrossFilm:
    """One film across."""
    return CrossFilm(
        films.edges, films.temperature[m], films.face[m], films.fluidity[m], films.shear[m], films.centre[m],
        films.eddy[m], films.mixing[m], films.driven[m],
    )  # fmt: skip


@compiled
def set_cross_viscosities(problem: Problem, across: Across) -> None:
    """Viscosities of the films that carry, for their pressure."""
    running, turbulent = problem.case.running, (0.0, 0.0)
    if problem.case.rupture == TURBULENT:
        turbulent = (running.speed, running.heat[0] / max(running.heat[1], 1e-9))
    for m in range(len(problem.pads.table)):
        if not problem.pads.table[m].idle:
            set_cross_viscosity(_film(across.films, m), film_of(problem, m)[1], running.oil, turbulent)


@compiled
def settle_cross_temperatures(problem: Problem, across: Across, relaxation: float) -> float:
    """Temperatures of all films, pads and the journal for the present flows; returns the largest change asked for [K].

    As `exchange_heat` of `model.statics.compiled.heat`.
    """
    pads, state, case = problem.pads, problem.state, problem.case
    n, limits = len(pads.table), (relaxation, HEATING_STEP)
    flows, outlets, uptake = np.empty((n, 2)), np.zeros((n, 3)), np.zeros((n, 3))
    for m in range(n):
        note_flows(problem, m, math.inf, flows[m], outlets[m])
        if pads.table[m].solved:
            _answer(problem, across, m, outlets[m], uptake[m])
    inlets, journal = balance_heat(pads.order, (flows, outlets, uptake), pads.table["solved"], case.supply, case.mixing)
    change = 0.0
    for m in range(n):
        pad = pads.table[m]
        hotter = inlets[m] - pad.inlet
        pad.inlet += limited_share(hotter, limits) * hotter
        change = note_heat(pad, abs(hotter), (0.0, 0.0), change)
        if pad.solved:
            (grid, work), cross = film_of(problem, m), _film(across.films, m)
            running, weights = case.running, (inlets[m], journal)
            increment = _warm(cross, across.fields[m], across.faces[m], weights, limits)
            across.outlet[m] = outlets[m, 0] + outlets[m, 1] * inlets[m] + outlets[m, 2] * journal
            force_change = cross_pressure_change(grid, work, cross, running.speed, running.oil, state.shift[m])
            change = note_heat(pad, increment, force_change, change)
    state.figures[JOURNAL] = journal
    return change


@inner
def _warm(
    cross: CrossFilm,
    fields: FloatArray,
    faces: FloatArray,
    weights: tuple[float, float],
    limits: tuple[float, float],
) -> float:
    """Change a film's temperatures by a share of what is asked for, no more than a limit; returns the largest [K]."""
    inlet, journal = weights
    cells = cross.temperature.reshape(fields.shape[:2])
    increment = fields[:, :, 0] + inlet * fields[:, :, 1] + journal * fields[:, :, 2] - cells
    face = faces[0] + inlet * faces[1] + journal * faces[2] - cross.face
    change = np.maximum(largest(increment.reshape(-1)), largest(face.reshape(-1)))
    share = limited_share(change, limits)
    cells += share * increment
    cross.face[:] += share * face
    return change


@inner
def _answer(problem: Problem, across: Across, m: int, outlet: FloatArray, uptake: FloatArray) -> None:
    """What a film's temperatures are made of: with all else at zero, per kelvin of its inlet, of the journal.

    Of cells and faces; of the oil at the trailing edge (3,) [degC], and what the journal takes (3,) [W]. Which share of
    the oil runs back where it enters is noted in the figures.
    """
    (grid, work), cross = film_of(problem, m), _film(across.films, m)
    pad, state, case = problem.pads.table[m], problem.state, problem.case
    bodies, operator = problem.bodies, across.operator
    assert bodies is not None
    fields, faces, (specific, conductivity) = across.fields[m], across.faces[m], case.running.heat
    journal = state.figures[JOURNAL] if math.isfinite(state.figures[JOURNAL]) else case.supply
    heat = (specific, conductivity, case.heat_share, 1.0, case.running.oil[1])
    back = cross_operator(grid, work, cross, case.running.speed, heat, operator)
    state.figures[BACKFLOW] = max(state.figures[BACKFLOW], back)
    body = (bodies.flux[bodies.kind[m]], bodies.to_coarse[bodies.kind[m]], across.guesses[m])
    around = 0.0  # what the grooves hold
    for entry in problem.pads.table:
        around += entry.inlet / len(problem.pads.table)
    into_pad = times(body[0], times(body[1], (cross.face - around).reshape(-1))).reshape(cross.face.shape)
    operator.dissipation[:, :: len(cross.edges) - 1] -= station_heat(grid, into_pad)
    uptake[:] = march_cross(operator, fields, operator.dissipation)
    for q in range(3):
        heat_flow = (1.0 if q == 0 else 0.0) * into_pad
        face_temperature(work, cross.edges, conductivity, fields[:, :, q], heat_flow, faces[q])
    missing = faces[0] + pad.inlet * faces[1] + journal * faces[2] - cross.face
    if 0.0 < largest(missing.reshape(-1)) < BOUNDLESS:
        solved = (grid, work, cross.edges, conductivity)
        tolerance = _ROUGH_TOLERANCE if pad.heating > _ROUGH else _CONDUCTION_TOLERANCE
        uptake[0] += conduct(solved, operator, body, missing, tolerance, (fields[:, :, 0], faces[0]))
    carried = operator.carried.reshape(-1)
    for q in range(3):
        outlet[q] = product(carried, fields[-1, :, q]) / product(carried, np.ones(len(carried)))
