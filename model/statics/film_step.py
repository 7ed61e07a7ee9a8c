"""One step of every film at the present geometry: pressure, then temperature, then what the pads' deformation asks."""

from __future__ import annotations

import math

import numpy as np

from model.pad.bending import SolvedFilm, bending_step, wanted_shapes
from model.statics.axial_tilt import axial_tilt_of
from model.statics.carrying import set_loaded
from model.statics.compiled.constants import BOUNDLESS, HEAT_PER_FORCE, HEATING_STEP
from model.statics.cross_heat import settle_cross_temperatures
from model.statics.heat_paths import couples_heat, settle_temperatures
from model.statics.pad_film import PadFilm
from model.statics.search import Search


def solve_films(search: Search) -> float:
    """Solve every film that carries once, at the present positions of journal and pads."""
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
    if (search.setup.flexible_pads or search.setup.pads_follow) and change < BOUNDLESS:
        # a deformation counts like a temperature change of the same weight in the film's resistance
        change = max(change, HEAT_PER_FORCE * _shape_pads(search))
    return change


def refine_derivatives(search: Search) -> None:
    """Find the derivatives once more, with the rupture line between the nodes; the pressure stays."""
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


def _shape_pads(search: Search) -> float:
    """Let every pad ask for the deformation and axial tilt that its film gives it; largest change over the film."""
    setup, carrying = search.setup, search.carrying
    pressures = [f.corrected_pressure() for f in carrying]
    asked = [np.zeros_like(f.bent) for f in carrying]
    if setup.flexible_pads:
        bodies = [f.deformation for f in carrying if f.deformation is not None]
        rises = [f.face_temperature - setup.inlet_temperature for f in carrying]
        wanted = wanted_shapes(bodies, pressures, rises, setup.bending_factor)
        asked = [shape - f.bent for f, shape in zip(carrying, wanted, strict=True)]
    share = 0.0
    for film, pressure, change in zip(carrying, pressures, asked, strict=True):
        assert film.corrected is not None
        wedge = (film.pad.pad_clearance, *film.approach(search.position))
        solved = SolvedFilm(film.grid, film.work, wedge, film.corrected)
        axial = axial_tilt_of(setup, film, pressure, film.corrected) if setup.pads_follow else None
        body = film.deformation if setup.flexible_pads else None
        film.step = bending_step(body, solved, change, setup.bending_factor, axial)
        share = max(share, film.step.share)
    return share
