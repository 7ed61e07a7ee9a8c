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
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossOperator
from model.film.cross_march import conduct, face_temperature, march_cross, station_heat
from model.pad.bending import PadDeformation
from model.setup import Setup
from model.statics.compiled.case import BOUNDLESS
from model.statics.compiled.heat import balance_heat
from model.statics.pad_film import PadFilm
from model.statics.pad_flow import outlet_temperature, through_flow
from rigdata.arrays import FloatArray

#: What a pad conducts is solved to this share in every step; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.03
#: And to this one where the last step has changed a temperature by more than so much [K]: all else is far off, too.
_ROUGH_TOLERANCE, _ROUGH = 0.15, 3.0
#: Share of a film's thickness through which heat gets from the pad's face into the oil that carries it away.
_FACE_SHARE = 0.1


@dataclass
class CrossAnswer:
    """What one film's temperatures are made of: with all else at zero, per kelvin of its inlet, of the journal."""

    fields: FloatArray  #: (nt + 1, n, 3): Of the cells [degC].
    faces: FloatArray  #: (3, nt + 1, nz + 1): Of the pad's face [degC].
    outlet: FloatArray  #: (3,): Flow-weighted at the trailing edge [degC].
    taken: FloatArray  #: (3,): By the journal [W].


def settle_cross_temperatures(
    setup: Setup,
    films: list[PadFilm],
    surface_speed: float,
    journal: float,
    limits: tuple[float, float],
    operator: CrossOperator,
) -> tuple[float, float, float]:
    """Temperatures of all films, pads and the journal for the present flows.

    As `exchange_heat` of `model.statics.compiled.heat`.
    """
    order = sorted(films, key=lambda f: f.pad.pivot_angle % (2 * math.pi))
    start = journal if math.isfinite(journal) else setup.inlet_temperature
    answers: list[CrossAnswer | None] = []
    outlets, taken = [], []
    back, around = 0.0, sum(f.inlet for f in films) / len(films)  # what the grooves hold, on the mean
    for film in order:
        answer, share = _answer(setup, film, surface_speed, (start, around), operator)
        answers.append(answer)
        # an idle pad passes its inlet on, somewhat warmer
        warmer = (outlet_temperature(film) - film.inlet, 1.0, 0.0)
        outlets.append(warmer if answer is None else answer.outlet)
        taken.append(np.zeros(3) if answer is None else answer.taken)
        back = max(back, share)
    outer = np.array([through_flow(f) for f in order]), np.array(outlets), np.array(taken)
    solved = np.array([a is not None for a in answers])
    supply, mixing = float(setup.inlet_temperature), float(setup.mixing)
    inlets, journal = balance_heat(np.arange(len(order)), outer, solved, supply, mixing)
    change = 0.0
    for film, part, inlet in zip(order, answers, inlets.tolist(), strict=True):
        hotter = inlet - film.inlet
        film.inlet += _limited_share(hotter, limits) * hotter
        film.temperature_change = abs(hotter)
        change = float(np.maximum(change, film.temperature_change))  # a NaN is not to be lost
        if part is None or film.cross is None:
            continue
        weights = np.array([1.0, inlet, journal])
        asked = (part.fields @ weights).reshape(film.cross.temperature.shape) - film.cross.temperature
        face = np.tensordot(weights, part.faces, 1) - film.cross.face
        film.temperature_change = float(np.maximum(np.abs(asked).max(), np.abs(face).max()))
        share = _limited_share(film.temperature_change, limits)
        film.cross.temperature[:] += share * asked
        film.cross.face[:] += share * face
        film.outlet = float(np.dot(part.outlet, weights))
        change = float(np.maximum(change, film.temperature_change))
    return change, back, journal


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
    setup: Setup, film: PadFilm, surface_speed: float, temperatures: tuple[float, float], operator: CrossOperator
) -> tuple[CrossAnswer | None, float]:
    """A film's answers, and which share of its oil runs back where it enters; None if the film carries nothing.

    For the temperatures of the journal and of the oil around the pads so far.
    """
    journal, around = temperatures
    cross = film.cross
    pad = film.deformation
    if film.forces is None or cross is None or pad is None:
        return None, 0.0
    oil = setup.bearing.oil
    heat = (oil.specific_heat, oil.conductivity, film.kept, 1.0, oil.viscosity_exponent)
    back = cross_operator(film.grid, film.work, cross, surface_speed, heat, operator)
    taken: FloatArray = np.asarray(pad.flux @ (pad.to_coarse @ (cross.face - around).ravel())).reshape(cross.face.shape)
    fields = np.zeros((taken.shape[0], operator.dissipation.shape[1], 3))
    fields[0, :, 1] = 1.0
    sources = operator.dissipation
    sources[:, :: len(cross.edges) - 1] -= station_heat(film.grid, taken)
    kept = march_cross(operator, fields, sources)
    faces = np.empty((3, *taken.shape))
    for m in range(3):
        given = taken if m == 0 else np.zeros_like(taken)
        face_temperature(film.work, cross.edges, oil.conductivity, fields[:, :, m], given, faces[m])
    missing = faces[0] + film.inlet * faces[1] + journal * faces[2] - cross.face
    if 0.0 < np.abs(missing).max() < BOUNDLESS:
        solved = (film.grid, film.work, cross.edges, oil.conductivity)
        resistance = _FACE_SHARE * float(film.work.thickness.mean()) / oil.conductivity
        body = (pad.flux, pad.to_coarse, _settled(pad, round(math.log2(resistance))))
        far = film.temperature_change > _ROUGH
        tolerance = _ROUGH_TOLERANCE if far else _CONDUCTION_TOLERANCE
        more = conduct(solved, operator, body, missing, tolerance, (fields[:, :, 0], faces[0]))
        kept[0] += more if math.isfinite(more) else 0.0
    weight = operator.carried / operator.carried.sum()
    outlet = weight.ravel() @ fields[-1]
    return CrossAnswer(fields, faces, outlet, kept), back
