"""Conditions of an operating point that deserve a name: a load that nothing can hold, a film thinner than surfaces are.

Equations have solutions where bearings have none. These are told from the drawing and from the films, apart from how
the iteration went.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from model.setup import Setup
from model.statics.pad_film import PadFilm
from rigdata.arrays import FloatArray
from rigdata.problem import Condition

#: Below this film the surfaces touch: three times the combined roughness, 1 um, of ground journal and bored pad [m].
_THINNEST_FILM = 3e-6
#: Above this pressure tin babbitt yields, cold (0.2 % proof stress of SnSb8Cu4, ISO 4381) [Pa].
_HIGHEST_PRESSURE = 45e6
#: Above this local Reynolds number rho U h / mu a film begins to leave the laminar regime.
_LAMINAR = 1000.0
#: The exponential mu(T) of Eq. (4), fitted about 40 to 100 degC, leaves the Walther line of an ISO VG 46 oil by a third
#: at 20 and at 122 degC [degC].
_OIL_DATA = (20.0, 120.0)
#: Above this film temperature tin babbitt creeps; machines are tripped at pad temperatures of 115 to 130 [degC].
HOTTEST_FILM = 150.0

NOT_CONVERGED = Condition("not converged", "error", "no equilibrium was found, and there are no coefficients")
FILM_LOST = Condition("film lost", "error", "a film closed on the way: too much load, or too much heat")
BOUNDLESS_HEAT = Condition("heat without bounds", "error", "the film's heat is beyond any number that means something")
SINGULAR = Condition("singular", "error", "a Newton step has no solution")
UNSUPPORTED = Condition(
    "no pads against the load", "error", "no set of pivots can balance the load, wherever the journal goes"
)
_LEFT = "carrying, they would push the journal off, or friction holds them off"
_STICK_AND_SLIP = "friction holds them where their film loses its load, and without load there is no friction"
NOT_HELD = Condition(
    "nothing holds the journal across its load",
    "warning",
    "all pads that carry push along one line: kxx or kyy is zero",
)
FLOW_BACK = Condition(
    "flow back at a leading edge", "warning", "a pressure peak pushes oil back; the heat balance there is limited"
)


def runaway(share: float) -> Condition:
    """No equilibrium with all of the heat; where it ended."""
    said = f"journal and films find rest with up to {100 * share:.0f} % of the heat they make, and not with more"
    return Condition("heat runs away", "error", said)


def idle(pads: Sequence[int]) -> Condition:
    """Pads without a loaded attitude, numbers from 1."""
    return Condition(
        f"idle pads {_listed(pads)}", "note", "they carry nothing and take no part in the dynamics", tuple(pads)
    )


def overloaded(pads: Sequence[int]) -> Condition:
    """Pads whose film no bearing has, numbers from 1."""
    limits = f"{1e6 * _THINNEST_FILM:g} um, {_HIGHEST_PRESSURE / 1e6:g} MPa, {HOTTEST_FILM:g} degC"
    return Condition(
        f"overloaded pads {_listed(pads)}", "warning", f"thinnest film, pressure or heat beyond {limits}", tuple(pads)
    )


def left_unloaded(pads: Sequence[int]) -> Condition:
    """Pads that were left idle on the way, although they could carry, numbers from 1."""
    return Condition(
        f"pads {_listed(pads)} cannot keep their load", "warning",
        _LEFT, tuple(pads),
    )  # fmt: skip


def left(status: Sequence[Condition]) -> bool:
    """Whether pads were left idle that could carry."""
    return any(c.detail == _LEFT for c in status)


def even(pads: Sequence[int]) -> Condition:
    """Pads whose film is even and without load, numbers from 1."""
    return Condition(
        f"pads {_listed(pads)} stand concentric", "note", "without load, their films take part in the dynamics",
        tuple(pads),
    )  # fmt: skip


def on_edge(pads: Sequence[int]) -> Condition:
    """Pads so near their fold that the mesh decides whether they carry, numbers from 1."""
    return Condition(
        f"pads {_listed(pads)} on the edge of carrying", "note", "a finer mesh may let them carry or idle", tuple(pads)
    )


def another(pads: Sequence[int]) -> Condition:
    """Another equilibrium, with other pads idle, numbers from 1."""
    return Condition(
        "another equilibrium exists", "note", f"in it pads {_listed(pads)} idle; this one leaves the last pads idle",
        tuple(pads),
    )  # fmt: skip


def undecided(pads: Sequence[int]) -> Condition:
    """Pads that find no state at all, numbers from 1."""
    return Condition(
        f"pads {_listed(pads)} can neither carry nor idle", "error",
        "idle they take up load at once, carrying they push the journal off", tuple(pads),
    )  # fmt: skip


def stick_and_slip(pads: Sequence[int]) -> Condition:
    """Pads that swing between sticking and sliding, numbers from 1."""
    return Condition(
        f"pads {_listed(pads)} neither stick nor slide at rest", "error",
        _STICK_AND_SLIP, tuple(pads),
    )  # fmt: skip


def held_off(status: Sequence[Condition]) -> tuple[int, ...]:
    """Pads of `stick_and_slip` in a status."""
    return tuple(pad for c in status if c.detail == _STICK_AND_SLIP for pad in c.pads)


def _listed(pads: Sequence[int]) -> str:
    return ", ".join(map(str, pads))


def unsupported(setup: Setup, load: FloatArray) -> bool:
    """Whether no pads can hold a load, wherever the journal goes: free pads push along their pivots only."""
    size = float(np.hypot(load[0], load[1]))
    if size == 0.0 or setup.rotational_stiffness > 0.0:
        return False
    from scipy.optimize import nnls

    angles = np.array([pad.pivot_angle for pad in setup.bearing.pads])
    _, missing = nnls(np.array([np.cos(angles), np.sin(angles)]), np.asarray(load, float) / size)
    return bool(missing > 1e-9)


def overloaded_pads(films: Sequence[PadFilm]) -> list[int]:
    """Numbers of the pads whose film is too thin, whose pressure too high or whose oil too hot for a pad to live."""
    return [
        f.number
        for f in films
        if not f.idle
        and (
            float(f.work.thickness.min()) < _THINNEST_FILM
            or float(f.work.pressure.max()) > _HIGHEST_PRESSURE
            or float(f.work.temperature.max()) > HOTTEST_FILM
        )
    ]


def regimes(setup: Setup, films: Sequence[PadFilm], surface_speed: float) -> list[Condition]:
    """Named regimes beyond what the equations hold for: pads in each other's way, films not laminar, oil too hot."""
    names = _misfits(setup)
    reynolds = largest_reynolds(films, surface_speed)
    if reynolds > _LAMINAR and setup.options.turbulence == "none":
        detail = f"above Re {_LAMINAR:.0f} turbulence, which is off unless asked for, carries and heats"
        names.append(Condition(f"film not laminar: Re {reynolds:.0f}", "warning", detail))
    carrying = [f for f in films if f.forces is not None]
    low = min((float(f.work.temperature.min()) for f in carrying), default=_OIL_DATA[0])
    high = max((float(f.work.temperature.max()) for f in carrying), default=_OIL_DATA[1])
    if low < _OIL_DATA[0] or high > _OIL_DATA[1]:
        beyond = low if low < _OIL_DATA[0] else high
        detail = "mu(T) of Eq. (4) holds from {:g} to {:g} degC".format(*_OIL_DATA)
        names.append(Condition(f"oil beyond its data: {beyond:.0f} degC", "warning", detail))
    return names


def largest_reynolds(films: Sequence[PadFilm], surface_speed: float) -> float:
    """Largest local Reynolds number rho U h / mu of all films, the idle pads' too; NaN where there is none."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # a lost film may be as hot as numbers go
        numbers = [
            float((f.work.density * f.work.thickness / f.work.viscosity).max()) * surface_speed
            for f in films
            if f.forces is not None
        ]
    numbers += [f.resting.reynolds for f in films if f.resting is not None]
    return max((n for n in numbers if math.isfinite(n)), default=math.nan)


def _misfits(setup: Setup) -> list[Condition]:
    """Pads that stand in each other's way, or in the journal's, in a bearing built in code (a file is refused)."""
    pads = setup.bearing.pads
    names = []
    inside = [k for k, p in enumerate(pads, 1) if not p.assembled_clearance + setup.clearance_change > 0.0]
    if inside:
        said = f"interference: no clearance at pads {_listed(inside)}"
        names.append(Condition(said, "warning", "a concentric journal would touch them", tuple(inside)))
    ring = sorted(((p.pivot_angle + p.leading_edge) % (2.0 * math.pi), k) for k, p in enumerate(pads))
    for at, (start, k) in enumerate(ring):
        following, other = ring[(at + 1) % len(ring)]
        room = (following - start) % (2.0 * math.pi) or 2.0 * math.pi
        if len(pads) > 1 and other != k and following == start:
            room = 0.0
        gap = room - pads[k].arc
        if gap < 1e-9:
            said = f"pads {k + 1} and {other + 1} {'touch' if gap > -1e-9 else 'overlap'}"
            names.append(Condition(said, "warning", "no room for oil to enter", (k + 1, other + 1)))
    return names
