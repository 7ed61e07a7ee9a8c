"""Conditions of an operating point that deserve a name: a load that nothing can hold, a film thinner than surfaces are.

Equations have solutions where bearings have none. These are told from the drawing and from the films, apart from how
the iteration went.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from model.bearing import pad_rooms
from model.conditions import conditions_of
from model.setup import Setup
from model.statics.pad_film import PadFilm
from model.statics.pad_flow import starved
from rigdata.arrays import FloatArray
from rigdata.problem import Condition

#: Below this film the surfaces touch: three times the combined roughness, 1 um, of ground journal and bored pad [m].
_THINNEST_FILM = 3e-6
#: Below this preload a pad's ends come nearer to the journal than its pivot, by more than bores of none scatter.
_LEAST_PRELOAD = -0.1
#: Above this pressure tin babbitt yields, cold (0.2 % proof stress of SnSb8Cu4, ISO 4381) [Pa].
_HIGHEST_PRESSURE = 45e6
#: Above this local Reynolds number rho U h / mu a film begins to leave the laminar regime.
_LAMINAR = 1000.0
#: The exponential mu(T) of Eq. (4), fitted about 40 to 100 degC, leaves the Walther line of an ISO VG 46 oil by a third
#: at 20 and at 122 degC [degC].
_OIL_DATA = (20.0, 120.0)
#: Above this film temperature tin babbitt creeps; machines are tripped at pad temperatures of 115 to 130 [degC].
HOTTEST_FILM = 150.0


def unsupported(setup: Setup, load: FloatArray) -> bool:
    """Whether no pads can hold a load, wherever the journal goes: free pads push along their pivots only.

    Those nearest to the load on its two sides hold it, unless they stand half a turn apart or more.
    """
    if not load.any() or setup.rotational_stiffness > 0.0:
        return False
    turns = np.array(setup.bearing.pivot_angles) - math.atan2(load[1], load[0])
    aside = np.round((turns + math.pi) % math.tau - math.pi, 9)  # a pad in the load's way stands on both its sides
    return bool((aside % math.tau).min() + (-aside % math.tau).min() > math.pi - 1e-8)


def overloaded_pads(films: Sequence[PadFilm]) -> list[int]:
    """Numbers of the pads whose film is too thin, whose pressure too high or whose oil too hot for a pad to live."""
    numbers = []
    for film in films:
        work = film.work
        thin = float(work.thickness.min()) < _THINNEST_FILM
        pressed = float(work.pressure.max()) > _HIGHEST_PRESSURE
        if not film.idle and (thin or pressed or float(work.temperature.max()) > HOTTEST_FILM):
            numbers.append(film.number)
    return numbers


def status_of(
    setup: Setup, load: FloatArray, films: Sequence[PadFilm], speed: float, back: float, failures: Sequence[Condition]
) -> tuple[Condition, ...]:
    """All that is to be said of the end of a search: `failures` is empty where it found an equilibrium.

    `speed` of the journal's surface [m/s]; `back`: share of the oil that runs back at a leading edge.
    """
    pads = setup.bearing.pads
    heavy = [] if failures else overloaded_pads(films)
    limits = f"{1e6 * _THINNEST_FILM:g} um, {_HIGHEST_PRESSURE / 1e6:g} MPa, {HOTTEST_FILM:g} degC"
    idle, short = [f.number for f in films if f.idle], starved(films)
    ends = "and their films start where it suffices" if films[0].rupture == "jfo" else "and run as if it did"
    # pads in the journal's way, or in each other's, stand in bearings built in code: a file is refused
    narrow = [k for k, p in enumerate(pads, 1) if not p.assembled_clearance + setup.clearance_change > 0.0]
    hollow = [k for k, p in enumerate(pads, 1) if p.preload < _LEAST_PRELOAD]
    meeting = []
    for number, neighbour, room in pad_rooms(setup.bearing):
        gap = room - pads[number - 1].arc
        meeting.append((gap < 1e-9, "pads {pads} touch" if gap > -1e-9 else "pads {pads} overlap", (number, neighbour)))
    reynolds = largest_reynolds(films, speed)
    swirls = reynolds > _LAMINAR and setup.options.turbulence == "none"
    warmth = np.array([f.work.temperature for f in films if f.forces is not None] or _OIL_DATA)
    coldest, hottest = float(warmth.min()), float(warmth.max())
    extreme = coldest if coldest < _OIL_DATA[0] else hottest
    normals = [f.normal.tolist() for f in films if f.forces is not None]
    is_free = not failures and setup.rotational_stiffness == 0.0
    on_one_line = all(abs(x * normals[0][1] - y * normals[0][0]) < 1e-6 for x, y in normals)
    conditions: tuple[tuple[Any, ...], ...] = (
        (is_free and on_one_line, "nothing holds the journal across its load"),
        (heavy, "overloaded pads {pads}", heavy, limits),
        (idle, "idle pads {pads}", idle),
        (back > 0.0, "flow back at a leading edge"),
        (short, "pads {pads} are short of oil", short, ends),
        (narrow, "interference: no clearance at pads {pads}", narrow),
        (hollow, "negative preload of pads {pads}", hollow),
        *meeting,
        (swirls, "film not laminar: Re {number:.0f}", (), reynolds),
        (extreme < _OIL_DATA[0] or extreme > _OIL_DATA[1], "oil beyond its data: {number:.0f} degC", (), extreme),
    )
    against = conditions_of([(failures and unsupported(setup, load), "no pads against the load")])
    return (*against, *failures, *conditions_of(conditions))


def largest_reynolds(films: Sequence[PadFilm], surface_speed: float) -> float:
    """Largest local Reynolds number rho U h / mu of all films, the idle pads' too; NaN where there is none."""
    numbers = []
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # a lost film may be as hot as numbers go
        for f in films:
            if f.forces is not None:
                numbers.append(float((f.work.density * f.work.thickness / f.work.viscosity).max()) * surface_speed)
            if f.resting is not None:
                numbers.append(f.resting.reynolds)
    return max((n for n in numbers if math.isfinite(n)), default=math.nan)
