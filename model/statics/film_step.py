"""One step of every film at the present geometry: pressure, then temperature, then what the pads' deformation asks."""

from __future__ import annotations

import math

from model.pad.bending import SolvedFilm, bending_step, wanted_shapes
from model.statics.carrying import set_loaded
from model.statics.compiled.constants import BOUNDLESS, HEAT_PER_FORCE, HEATING_STEP
from model.statics.cross_heat import settle_cross_temperatures
from model.statics.heat_paths import couples_heat, settle_temperatures
from model.statics.pad_film import PadFilm
from model.statics.search import Search


def solve_films(search: Search) -> float:
    """Solve every film that carries once, at the present positions of journal and pads.

    Parameters
    ----------
    search : Search

    Returns
    -------
    float
        Largest temperature change asked for [K], or change of shape of the same weight; infinite if a film is lost.
    """
    search.limited = 0.0
    for film in search.films:
        if not film.idle:
            _solve_pressure(search, film)
        if film.idle:
            film.forces = film.corrected = film.step = None
            film.work.pressure[:] = 0.0
    if any(f.lost for f in search.films):
        return math.inf  # what has no pressure has no flow that could carry heat
    change = 0.0
    if search.setup.thermal != "isothermal":
        change = _heat_films(search)
    if change < BOUNDLESS:
        change = max(change, search.warm_up())
    if search.setup.flexible_pads and change < BOUNDLESS:
        # a deformation counts like a temperature change of the same weight in the film's resistance
        change = max(change, HEAT_PER_FORCE * _bend_pads(search))
    return change


def refine_derivatives(search: Search) -> None:
    """Find the derivatives once more, with the rupture line between the nodes; the pressure stays.

    Parameters
    ----------
    search : Search
    """
    for film in search.films:
        if film.forces is not None:
            wedge = (film.pad.pad_clearance, *film.approach(search.position))
            film.forces = film.solver(film.grid, film.work, wedge, search.surface_speed, True)


def _solve_pressure(search: Search, film: PadFilm) -> None:
    """Pressure of one film; on its loaded attitude, where it has slipped off that."""
    oil = search.setup.bearing.oil
    film.solve(search.position, search.surface_speed, oil)
    assert film.forces is not None
    if film.forces.steps > 0 and not film.forces.force[0] > 0.0 and search.setup.rotational_stiffness == 0:
        # the unloaded attitude, in which nothing holds the pad: the loaded one counts
        set_loaded(film, search.position)
        if not film.idle:
            film.solve(search.position, search.surface_speed, oil)
            film.idle = not film.forces.force[0] > 0.0


def _heat_films(search: Search) -> float:
    """Temperatures of the films that carry; returns the largest change asked for [K]."""
    limits, carrying, oil = (search.relaxation, HEATING_STEP), search.carrying, search.setup.bearing.oil
    if not couples_heat(search.setup):
        search.limited = max((f.heat(search.surface_speed, oil, limits) for f in carrying), default=0.0)
        return max((f.temperature_change for f in carrying), default=0.0)
    for film in search.films:
        film.rest(search.position, search.surface_speed, oil)
    state = (search.setup, search.films, search.surface_speed, search.journal, limits)
    if search.setup.thermal == "thd":
        change, search.limited, search.journal = settle_cross_temperatures(*state, search.heat_balances)
    else:
        change, search.limited, search.journal = settle_temperatures(*state)
    for film in carrying:
        film.correct(search.surface_speed, oil)
    return change


def _bend_pads(search: Search) -> float:
    """Let every pad ask for the deformation its film gives it; returns the largest change over the least film."""
    setup, carrying = search.setup, search.carrying
    bodies = [f.deformation for f in carrying if f.deformation is not None]
    pressures = [f.corrected_pressure() for f in carrying]
    rises = [f.face_temperature - setup.inlet_temperature for f in carrying]
    wanted = wanted_shapes(bodies, pressures, rises, setup.bending_factor)
    share = 0.0
    for film, body, shape in zip(carrying, bodies, wanted, strict=True):
        assert film.corrected is not None
        wedge = (film.pad.pad_clearance, *film.approach(search.position))
        solved = SolvedFilm(film.grid, film.work, wedge, film.corrected)
        film.step = bending_step(body, solved, shape - film.bent, setup.bending_factor)
        share = max(share, film.step.share)
    return share
