"""Which pads carry: a pad is put on its loaded attitude where it has one, and idles where it has none.

A pad behind whose middle the pivot stands takes up its load with a jump, and on the way to the equilibrium pads do
so more than once. What is tabulated for an isothermal film (`model.film.loaded_attitude`) tells about where; near
that edge the film itself decides.
"""

from __future__ import annotations

import math

from model.arrays import FloatArray
from model.film.loaded_attitude import Branch, LoadedAttitude, loaded_attitude
from model.setup import Setup
from model.statics.pad_film import PadFilm
from model.statics.tilt_hold import tilt_hold

#: The tabulated edge of carrying is right within this share of the pad clearance.
EDGE = 0.03
#: Within this share of it the table is made anew for the film's present temperature.
NEAR_EDGE = 0.1
#: How often a pad may take up and shed its load before it is left idle.
MAX_FLIPS = 6
#: How many steps in a row are shortened lest a pad passes its edge.
MAX_HOLDS = 4


def attitude_of(setup: Setup, film: PadFilm) -> LoadedAttitude:
    """The pad shape's table."""
    angle, bearing = film.grid.angle, setup.bearing
    start, end = round(float(angle[0]), 12), round(float(angle[-1]), 12)
    return loaded_attitude(start, end, bearing.journal_radius, bearing.length)


def find_branch(setup: Setup, film: PadFilm, surface_speed: float, warmer: float = 0.0) -> Branch:
    """Loaded attitudes of a pad at its film's mean temperature, or `warmer` [K] than that."""
    bearing, clearance = setup.bearing, film.pad.pad_clearance
    viscosity = float(bearing.oil.viscosity(float(film.work.temperature.mean()) + warmer))
    scale = viscosity * surface_speed * bearing.journal_radius**2 * bearing.length
    return attitude_of(setup, film).branch(clearance, scale, setup.pivots[film.number - 1].deflection)


def spare(film: PadFilm, position: FloatArray) -> float:
    """How far a pad is from where it stops carrying, as a share of its clearance; negative beyond."""
    assert film.branch is not None
    return float(film.reach(position) - film.branch.reach[0]) / film.pad.pad_clearance


def set_loaded(film: PadFilm, position: FloatArray) -> None:
    """Put a pad on its loaded attitude for a journal position, or let it idle."""
    assert film.branch is not None
    film.idle = spare(film, position) <= 0.0
    film.deflection = film.tilt = 0.0
    film.work.ruptured[:] = False
    if not film.idle:
        reach = film.reach(position)
        a, b = film.branch.at(reach)
        film.deflection = reach - a
        film.tilt = (b - float(film.tangent @ position)) / film.pivot_radius


def wake_or_rest(setup: Setup, films: list[PadFilm], position: FloatArray, surface_speed: float) -> bool:
    """Let pads take up or shed their load as the journal's position has it; True if any did."""
    changed = False
    for film in films:
        if film.branch is None or abs(spare(film, position)) < NEAR_EDGE:
            film.branch = find_branch(setup, film, surface_speed)
        room = spare(film, position)
        if film.idle and room > 1e-4 and film.flips < MAX_FLIPS:
            set_loaded(film, position)
        elif not film.idle and setup.rotational_stiffness == 0 and not _holds(setup, film, room):
            film.idle = True
            film.deflection = film.tilt = 0.0
        else:
            continue
        film.flips += 1
        changed = True
    return changed


def _holds(setup: Setup, film: PadFilm, room: float) -> bool:
    """Whether a pad can go on carrying: near its edge, whether the film would push a small change back."""
    if room > 0.0 or room < -EDGE or film.forces is None:
        return room > 0.0
    return _stable(setup, film)


def _stable(setup: Setup, film: PadFilm) -> bool:
    """Whether film and pivot push a pad back from a small change of tilt and deflection."""
    assert film.forces is not None
    (kaa, kab), (kba, kbb) = film.forces.stiffness
    load = float(film.forces.force[0])
    give = 1.0 / setup.pivots[film.number - 1].stiffness(max(load, 1e-6))
    hold = tilt_hold(setup, film.tilt, load)
    lever, arm = film.pivot_radius, hold.arm / film.pivot_radius
    turning = kbb + arm * kab + hold.stiffness / lever**2
    return bool(turning * (1.0 + give * kaa) > give * (kba + arm * kaa) * kab)


def leave_unstable(setup: Setup, films: list[PadFilm], position: FloatArray) -> bool:
    """Move pads off attitudes that nothing holds, the falling part of the load near an edge; True if there were any."""
    found = False
    for film in films:
        if film.forces is None or setup.rotational_stiffness > 0 or _stable(setup, film):
            continue
        found = True
        film.flips += 1
        if spare(film, position) > EDGE and film.flips < MAX_FLIPS:
            set_loaded(film, position)
        else:
            film.idle, film.flips = True, MAX_FLIPS
            film.deflection = film.tilt = 0.0
    return found


def shorten(films: list[PadFilm], position: FloatArray, shift: FloatArray, scale: float) -> float:
    """Shorten a step of the journal that would take a pad past its edge, for a while: the load bends sharply there."""
    for film in films:
        if film.idle or film.branch is None:
            continue
        room = spare(film, position)
        change = scale * float(film.normal @ shift) / film.pad.pad_clearance
        if not 0.0 < room < -change:
            film.held = 0
        elif film.held < MAX_HOLDS:
            film.held += 1
            scale *= 0.8 * room / -change
    return scale


def shed_pads(films: list[PadFilm], position: FloatArray) -> tuple[list[int], list[int]]:
    """Pads that were left idle although they have a loaded attitude here: carrying, they would push the journal away.

    Returns
    -------
    resting, torn : list of int
        Numbers of pads that stay unloaded when left alone (a < 0: the film opens towards both edges), and of those
        that would take up load again at once.
    """
    shed = [f for f in films if f.idle and f.branch is not None and spare(f, position) > EDGE]
    resting = [f.number for f in shed if f.reach(position) <= 0.0]
    return resting, [f.number for f in shed if f.number not in resting]


def longest_step(films: list[PadFilm], shift: FloatArray) -> float:
    """Share of a step that the journal may take: no pad can be left to guess when it jumps."""
    return 0.3 * min(f.pad.pad_clearance for f in films) / max(math.hypot(shift[0], shift[1]), 1e-30)
