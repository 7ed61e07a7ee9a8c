"""Temperatures of films, pads, journal and grooves together, with the temperature across the films (`thermal="thd"`).

- Film: `model.film.cross_energy`; its viscosity across the film acts on the pressure (`model.film.cross_film`).
- Pads conduct, `model.pad.operators`: film temperature and heat flux are those of the face, free faces cool in the oil.
- Journal: one temperature, at which it keeps no heat over a turn.
- Grooves: the flow balance of `model.statics.compiled.heat`, oil of one temperature enters.

For given flows all of it is linear: a film's temperatures are those of fresh oil, plus what they answer to its inlet
and to the journal, and inlets and journal follow from one small system. What a pad conducts hangs on all of its face;
that is solved as a correction by a few Krylov steps.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossFilm, CrossOperator, cross_pressure_change
from model.film.cross_march import conduct, face_temperature, march_cross, station_heat
from model.film.oil_state import edge_flows
from model.pad.bending import PadDeformation
from model.statics.compiled.case import BOUNDLESS, HEATING_STEP, Case
from model.statics.compiled.heat import balance_heat
from model.statics.compiled.stack import BACKFLOW, JOURNAL, PadStack, PadState
from model.statics.pad_film import PadFilm
from rigdata.arrays import FloatArray

#: What a pad conducts is solved to this share in every step; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.03
#: And to this one where the last step has changed a temperature by more than so much [K]: all else is far off, too.
_ROUGH_TOLERANCE, _ROUGH = 0.15, 3.0
#: Share of a film's thickness through which heat gets from the pad's face into the oil that carries it away.
_FACE_SHARE = 0.1


def settle_cross_temperatures(
    films: list[PadFilm], pads: PadStack, state: PadState, case: Case, relaxation: float, operator: CrossOperator
) -> float:
    """Temperatures of all films, pads and the journal for the present flows; returns the largest change asked for [K].

    As `exchange_heat` of `model.statics.compiled.heat`.
    """
    n, limits = len(films), (relaxation, HEATING_STEP)
    flows = np.empty((n, 2))
    outlets = np.zeros((n, 3))
    taken = np.zeros((n, 3))
    answers: dict[int, tuple[FloatArray, FloatArray]] = {}
    journal, around = float(state.figures[JOURNAL]), float(state.inlet.mean())  # what the grooves hold, on the mean
    start = journal if math.isfinite(journal) else case.supply
    for m, film in enumerate(films):
        if not state.solved[m]:  # an idle pad passes its inlet on, somewhat warmer
            flows[m] = state.resting[m, 1]
            outlets[m] = (state.resting[m, 2] - state.inlet[m], 1.0, 0.0)
            continue
        entering, sides = edge_flows(film.grid, film.work, math.inf)
        flows[m] = entering, entering - sides
        far = state.heating[m] > _ROUGH
        temperatures = (start, float(state.inlet[m]), around)
        fields, faces, outlets[m], taken[m] = _answer(film, case, temperatures, far, state.figures, operator)
        answers[m] = fields, faces
    inlets, journal = balance_heat(pads.order, (flows, outlets, taken), state.solved, case.supply, case.mixing)
    change = 0.0
    for m, inlet in enumerate(inlets.tolist()):
        hotter = inlet - state.inlet[m]
        state.inlet[m] += _limited_share(hotter, limits) * hotter
        state.heating[m] = abs(hotter)
        if m in answers:
            weights = np.array([1.0, inlet, journal])
            film, running = films[m], case.running
            assert film.cross is not None
            state.heating[m] = _warm(film.cross, answers[m], weights, limits)
            film.outlet = float(outlets[m] @ weights)
            shift = state.shift[m]
            more = cross_pressure_change(film.grid, film.work, film.cross, running.speed, running.oil, shift)
            state.corrected[m] = state.force[m] + more
        change = float(np.max([change, abs(hotter), state.heating[m]]))  # a NaN is not to be lost
    state.figures[JOURNAL] = journal
    return change


def _warm(
    cross: CrossFilm, answer: tuple[FloatArray, FloatArray], weights: FloatArray, limits: tuple[float, float]
) -> float:
    """Change a film's temperatures by a share of what is asked for, no more than a limit; returns the largest [K]."""
    asked = (answer[0] @ weights).reshape(cross.temperature.shape) - cross.temperature
    face = np.tensordot(weights, answer[1], 1) - cross.face
    change = float(np.maximum(np.abs(asked).max(), np.abs(face).max()))
    share = _limited_share(change, limits)
    cross.temperature[:] += share * asked
    cross.face[:] += share * face
    return change


def _limited_share(change: float, limits: tuple[float, float]) -> float:
    """Share of a change of temperature that is made."""
    return limits[0] * min(1.0, limits[1] / max(abs(change), 1e-30))


@lru_cache(maxsize=64)
def _settled(pad: PadDeformation, power: int) -> FloatArray:
    """About what the pad's coarser nodes change by, per kelvin that the film would bring them by, (c, c).

    For a film whose oil lies behind a resistance of 2^power [m^2 K/W].
    """
    return np.asarray(np.linalg.inv(np.eye(pad.flux.shape[1]) + 2.0**power * (pad.to_coarse @ pad.flux)))


def _answer(
    film: PadFilm,
    case: Case,
    temperatures: tuple[float, float, float],
    far: bool,
    figures: FloatArray,
    operator: CrossOperator,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """What a film's temperatures are made of: with all else at zero, per kelvin of its inlet, of the journal.

    Of the cells (nt + 1, n, 3), the pad's face (3, nt + 1, nz + 1), the oil at the trailing edge (3,) [degC], and what
    the journal takes (3,) [W]; for the temperatures so far of journal, inlet and the oil around the pads. Which share
    of the oil runs back where it enters is noted in the figures.
    """
    journal, inlet, around = temperatures
    cross, pad, (specific, conductivity) = film.cross, film.deformation, case.running.heat
    assert cross is not None
    assert pad is not None
    heat = (specific, conductivity, case.kept, 1.0, case.running.oil[1])
    back = cross_operator(film.grid, film.work, cross, case.running.speed, heat, operator)
    figures[BACKFLOW] = max(figures[BACKFLOW], back)
    taken: FloatArray = np.asarray(pad.flux @ (pad.to_coarse @ (cross.face - around).ravel())).reshape(cross.face.shape)
    fields = np.zeros((taken.shape[0], operator.dissipation.shape[1], 3))
    fields[0, :, 1] = 1.0
    sources = operator.dissipation
    sources[:, :: len(cross.edges) - 1] -= station_heat(film.grid, taken)
    kept = march_cross(operator, fields, sources)
    faces = np.empty((3, *taken.shape))
    for m in range(3):
        given = taken if m == 0 else np.zeros_like(taken)
        face_temperature(film.work, cross.edges, conductivity, fields[:, :, m], given, faces[m])
    missing = faces[0] + inlet * faces[1] + journal * faces[2] - cross.face
    if 0.0 < np.abs(missing).max() < BOUNDLESS:
        solved = (film.grid, film.work, cross.edges, conductivity)
        resistance = _FACE_SHARE * float(film.work.thickness.mean()) / conductivity
        body = (pad.flux, pad.to_coarse, _settled(pad, round(math.log2(resistance))))
        tolerance = _ROUGH_TOLERANCE if far else _CONDUCTION_TOLERANCE
        more = conduct(solved, operator, body, missing, tolerance, (fields[:, :, 0], faces[0]))
        kept[0] += more if math.isfinite(more) else 0.0
    weight = operator.carried / operator.carried.sum()
    return fields, faces, weight.ravel() @ fields[-1], kept
