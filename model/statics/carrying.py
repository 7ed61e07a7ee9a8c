"""Which pads carry: a pad is put on its loaded attitude where it has one, and idles where it has none.

A pad behind whose middle the pivot stands takes up its load with a jump, and on the way to the equilibrium pads do
so more than once. What is tabulated for an isothermal film (`model.film.loaded_attitude`) tells about where; near
that edge the film itself decides.
"""

from __future__ import annotations

import math

from model.film.loaded_attitude import Branch, LoadedAttitude, loaded_attitude
from model.setup import Setup
from model.statics.compiled.constants import CROWN, EDGE, LONGEST_STEP, MAX_LOAD_CHANGES, NEAR_EDGE
from model.statics.pad_film import PadFilm
from model.statics.tilt_hold import tilt_hold
from rigdata.arrays import FloatArray


def attitude_of(setup: Setup, film: PadFilm) -> LoadedAttitude:
    """The pad shape's table."""
    angle, bearing = film.grid.angle, setup.bearing
    start, end = round(float(angle[0]), 12), round(float(angle[-1]), 12)
    return loaded_attitude(start, end, bearing.journal_radius, bearing.length)


def find_branch(setup: Setup, film: PadFilm, surface_speed: float, hotter: float = 0.0) -> Branch:
    """Loaded attitudes of a pad at its film's mean temperature, or `hotter` [K] than that."""
    bearing, clearance = setup.bearing, film.pad.pad_clearance
    viscosity = float(bearing.oil.viscosity(float(film.work.temperature.mean()) + hotter))
    scale = viscosity * surface_speed * bearing.journal_radius**2 * bearing.length
    return attitude_of(setup, film).branch(clearance, scale, setup.pivots[film.number - 1].deflection)


def margin(film: PadFilm, position: FloatArray) -> float:
    """How far a pad is from where it stops carrying, as a share of its clearance; negative beyond."""
    assert film.branch is not None
    return float(_reach(film, position) - film.branch.rigid_approach[0]) / film.pad.pad_clearance


def _reach(film: PadFilm, position: FloatArray) -> float:
    """How near the journal is to a pad on a rigid pivot [m], counting by how much a warm pad's face stands inward."""
    return film.rigid_approach(position) + film.bulge


def _edge(film: PadFilm) -> float:
    """Share of the clearance by which the table of rigid pads may be wrong about where a pad stops carrying."""
    return EDGE + CROWN * abs(film.bulge) / film.pad.pad_clearance


def let_idle(film: PadFilm) -> None:
    """Let a pad carry nothing."""
    film.idle = True
    film.deflection = film.tilt = 0.0


def set_loaded(film: PadFilm, position: FloatArray) -> None:
    """Put a pad on its loaded attitude for a journal position, or let it idle: `position` (2,) [m]."""
    assert film.branch is not None
    let_idle(film)
    film.idle = margin(film, position) <= 0.0
    film.work.ruptured[:] = False
    if not film.idle:
        reach = _reach(film, position)
        a, b = film.branch.at(reach)
        film.deflection = reach - a
        film.tilt = (b - float(film.tangent @ position)) / film.pivot_radius


def update_carrying(setup: Setup, films: list[PadFilm], position: FloatArray, surface_speed: float) -> bool:
    """Let pads take up or shed their load as the journal's position has it; True if any did: `position` (2,) [m]."""
    changed = False
    for film in films:
        if film.branch is None or abs(margin(film, position)) < NEAR_EDGE:
            film.branch = find_branch(setup, film, surface_speed)
        inside = margin(film, position)
        if film.idle and inside > 0.0 and film.load_changes < MAX_LOAD_CHANGES:
            set_loaded(film, position)
        elif not film.idle and setup.rotational_stiffness == 0 and not _keeps_its_load(setup, film, inside):
            let_idle(film)
        else:
            continue
        film.load_changes += 1
        changed = True
    return changed


def _keeps_its_load(setup: Setup, film: PadFilm, inside: float) -> bool:
    """Whether a pad can go on carrying: near its edge, whether the film would push a small change back.

    Friction holds pads where the table of free ones knows no load: there the film decides alone.
    """
    if inside > 0.0 or film.forces is None or (inside < -_edge(film) and not setup.friction):
        return inside > 0.0
    return _is_stable(setup, film)


def _is_stable(setup: Setup, film: PadFilm) -> bool:
    """Whether film and pivot push a pad back from a small change of tilt and deflection.

    The determinant of the pad's own two equations is positive: kbb (1 + c kaa) > c kba kab, c the pivot's compliance,
    with what holds the tilt back added to the film's moment.
    """
    assert film.forces is not None
    (kaa, kab), (kba, kbb) = film.forces.stiffness
    load = float(film.forces.force[0])
    compliance = 1.0 / setup.pivots[film.number - 1].stiffness(max(load, 1e-6))
    hold = tilt_hold(setup, film.tilt, load)
    arm = hold.arm / film.pivot_radius
    turning = kbb + arm * kab + hold.stiffness / film.pivot_radius**2
    return bool(turning * (1.0 + compliance * kaa) > compliance * (kba + arm * kaa) * kab)


def leave_unstable(setup: Setup, films: list[PadFilm], position: FloatArray) -> bool:
    """Move pads off attitudes that nothing holds, the falling part of the load near an edge; True if there were any."""
    found = False
    for film in films:
        if film.forces is None or setup.rotational_stiffness > 0 or _is_stable(setup, film):
            continue
        found = True
        film.load_changes += 1
        if margin(film, position) > _edge(film) and film.load_changes < MAX_LOAD_CHANGES:
            set_loaded(film, position)
        else:
            let_idle(film)
            film.load_changes = MAX_LOAD_CHANGES
    return found


def unloaded_pads(films: list[PadFilm], position: FloatArray) -> tuple[list[int], list[int]]:
    """Pads that were left idle although they have a loaded attitude here.

    Carrying, they would push the journal away.
    """
    unloaded = [f for f in films if f.idle and f.branch is not None and margin(f, position) > _edge(f)]
    staying = [f.number for f in unloaded if _reach(f, position) <= 0.0]
    return staying, [f.number for f in unloaded if f.number not in staying]


def longest_step(films: list[PadFilm], shift: FloatArray) -> float:
    """Share of a step [m] that the journal may take: `shift` (2,) [m]."""
    least = min(f.pad.pad_clearance for f in films)
    return LONGEST_STEP * least / max(math.hypot(shift[0], shift[1]), 1e-30)
