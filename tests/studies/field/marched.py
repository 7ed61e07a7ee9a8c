"""Rigs of the second field battery that are integrated in time: no phasor has a part in making their records.

Shaft and housing are masses, the film between them a force in closed form (Ocvirk's short bearing with its half film
ruptured, in Capone's form, or a law with square and cube). The truth is H of the film linearised where it stands under
the static load. The plan, the actuator's course and the sensors are those of `closed_form`.
"""

import functools
import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from tests.rigs import closed_form as cf
from tests.rigs.acquisition import Array, Campaign, Channel, Signal, unit_vector

#: Steps a second, and how long a rig runs before its record [s].
STEPS, SETTLING = 8000.0, 0.5
#: Damping of cells, and stiffness and damping of the bearings that hold a floating stator's shaft [N s/m, N/m].
QUANTITIES = ("displacement", "force", "acceleration", "command")
CELL_DAMPING, SHAFT_SPRING, SHAFT_DAMPING = 3e3, 3e9, 4e3


class Law(Protocol):
    """A film's force on the housing [N] for displacement [m] and velocity [m/s] of the shaft, (2, n)."""

    clearance: float

    def force(self, d: Array, v: Array) -> Array: ...


@dataclass(frozen=True)
class ShortBearing:
    """Ocvirk's bearing, film ruptured in the diverging half; `scale` is mu omega R L^3 / (4 c^2) [N]."""

    clearance: float = 80e-6
    speed: float = 97.0
    scale: float = 1700.0

    def force(self, d: Array, v: Array) -> Array:
        """Force on the housing (2, n)."""
        (x, y), (u, w) = d / self.clearance, v / (self.clearance * 2 * math.pi * self.speed)
        ahead, aside = x - 2 * w, y + 2 * u
        size = np.sqrt(ahead**2 + aside**2) + 1e-300
        c, s = -ahead / size, -aside / size
        gap2 = 1 - x**2 - y**2
        gap, lever, along = np.sqrt(gap2), y * c - x * s, x * c + y * s
        g = 2 / gap * (math.pi / 2 + np.arctan(lever / gap))
        film, side = (2 + lever * g) / gap2, along / (1 - along**2)
        pull = np.array([3 * x * film - s * g - 2 * c * side, 3 * y * film + c * g - 2 * s * side])
        return np.asarray(self.scale * size / gap2 * pull)


@dataclass(frozen=True)
class CubicFilm:
    """K d + C v and, with k the mean direct stiffness, k (cube |d|^2 d / c^2 + square |d|^2 e_y / c)."""

    film: cf.Film = cf.USUAL
    clearance: float = 80e-6
    cube: float = 0.0
    square: float = 0.0

    @functools.cached_property
    def matrices(self) -> tuple[Array, Array, float]:
        """K, C and the mean direct stiffness."""
        k = np.array(self.film.k)
        return k, np.array(self.film.c), float(np.trace(k)) / 2

    def force(self, d: Array, v: Array) -> Array:
        """Force on the housing (2, n)."""
        k, c, mean = self.matrices
        size2 = (mean / self.clearance**2) * (d[0] * d[0] + d[1] * d[1])
        pull = k @ d + c @ v + (self.cube * size2) * d
        pull[1] += (self.square * self.clearance) * size2
        return np.asarray(pull)


def equilibrium(law: Law, load: Array) -> Array:
    """Where the film carries a load (2,) [m]."""
    scale = 1 + np.abs(load).max()
    start = 0.3 * law.clearance * load / scale
    still = np.zeros((2, 1))
    balance = least_squares(
        lambda d: (law.force(law.clearance * d[:, None], still)[:, 0] - load) / scale,
        start / law.clearance, bounds=(-0.7, 0.7), xtol=1e-15, ftol=1e-15, gtol=1e-15,
    )  # fmt: skip
    assert balance.cost < 1e-16
    return np.asarray(law.clearance * balance.x)


def linear_film(law: Law, load: Array, speed: float) -> cf.Film:
    """K and C where the film carries the load, by central differences of its force."""
    d0, step = np.tile(equilibrium(law, load)[:, None], 2), 1e-9 * np.eye(2)
    fast, still = 2 * np.pi * speed * step, np.zeros((2, 2))
    k = (law.force(d0 + step, still) - law.force(d0 - step, still)) / 2e-9
    c = (law.force(d0, fast) - law.force(d0, -fast)) / (2e-9 * 2 * np.pi * speed)
    (kxx, kxy), (kyx, kyy) = k
    (cxx, cxy), (cyx, cyy) = c
    return cf.Film(((kxx, kxy), (kyx, kyy)), ((cxx, cxy), (cyx, cyy)), load=0.0)


def march(law: Law, rig: cf.Rig, push: Array, steps: float = STEPS) -> dict[str, Array]:
    """States at every step (n, 2, runs) by Runge-Kutta's fourth order; `push` is the actuator at half steps [N]."""
    stiffest = float(np.abs(rig.film.c).sum(axis=1).max()) * (1 / rig.shaft_mass + 1 / rig.mass)
    assert stiffest < 2.2 * steps, "the step is too long for this damping"
    standing, h, omega = rig.mount == "cells", 1 / steps, 2 * np.pi * rig.speed
    pull, springs = rig.loads[0] * unit_vector(rig.load_direction)[:, None], np.array(rig.springs)[:, None]
    turns = 0.5 * h * omega * np.arange(len(push))[:, None] + np.linspace(0, 5, push.shape[2])
    turning = rig.unbalance * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    # what acts from outside on shaft and housing, at half steps
    on_shaft, on_housing = (pull + push + turning, np.zeros_like(push)) if standing else (turning, push - pull)

    def rates(k: int, s: Array) -> Array:
        film, change = law.force(s[0] - s[2], s[1] - s[3]), np.empty_like(s)
        change[0], change[2] = s[1], s[3]
        if standing:
            change[1], change[3] = on_shaft[k] - film, film - springs * s[2] - CELL_DAMPING * s[3]
        else:
            held = SHAFT_SPRING * s[0] + SHAFT_DAMPING * s[1]
            change[1], change[3] = on_shaft[k] - held - film, film + on_housing[k]
        change[1] /= rig.shaft_mass
        change[3] /= rig.mass
        return change

    state = np.zeros((4, 2, push.shape[2]))
    state[2] = pull / springs if standing else -pull / SHAFT_SPRING - equilibrium(law, pull[:, 0])[:, None]
    state[0] = state[2] + equilibrium(law, pull[:, 0])[:, None]
    states = []
    for k in range(0, len(push) - 2, 2):
        first = rates(k, state)
        states.append(np.concatenate([state, first[3:]]))
        second = rates(k + 1, state + h / 2 * first)
        third = rates(k + 1, state + h / 2 * second)
        fourth = rates(k + 2, state + h * third)
        state = state + h / 6 * (first + 2 * (second + third) + fourth)
    shaft, shaft_speed, housing, housing_speed, acceleration = np.moveaxis(np.array(states), 1, 0)
    force = springs * housing + CELL_DAMPING * housing_speed if standing else -push[0:-1:2]
    motion = {"displacement": shaft - housing, "force": force, "acceleration": acceleration, "command": push[0:-1:2]}
    return {**motion, "housing": housing, "shaft_speed": shaft_speed, "housing_speed": housing_speed}


def plan(law: Law, rig: cf.Rig) -> tuple[cf.Rig, Array]:
    """The rig with its linearised film and its unbalance in newtons, and the push of every run at half steps."""
    load = rig.loads[0] * unit_vector(rig.load_direction)
    compliance = 1 / SHAFT_SPRING if rig.mount == "floating" else 0.0
    rig = replace(rig, film=linear_film(law, load, rig.speed), shaft_compliance=compliance)
    grid = np.arange(round((rig.seconds + SETTLING + 0.05) * 2 * STEPS) + 1) / (2 * STEPS) - SETTLING
    pushes = []
    for i, test in enumerate(cf.tests_of(rig)):
        set_of_phases = 0 if rig.excitation in ("multisine", "impact") else i
        courses = cf.course_signals(rig, test, np.random.default_rng(set_of_phases), (test.load, 1.0))
        pushes.append(courses["command"](grid))
    # the linear orbit of 1X has the stated share of the clearance
    orbit = cf.response(rig, np.array(rig.speed), 0.0)["displacement"] @ np.array([1.0, -1.0j])
    force = rig.unbalance * rig.clearance / float(np.abs(orbit).max())
    return replace(rig, unbalance=force), np.moveaxis(np.array(pushes), 0, 2)


@functools.lru_cache(maxsize=4)
def records(law: Law, rig: cf.Rig) -> tuple[cf.Rig, list[Signal]]:
    """The rig with the film of its truth and the signals of every run; the same for every seed."""
    rig, push = plan(law, rig)
    states = march(law, rig, push)
    times = np.arange(len(states["force"])) / STEPS - SETTLING
    signals = []
    for i in range(push.shape[2]):
        curves = {q: CubicSpline(times, states[q][:, :, i]) for q in QUANTITIES}
        signals.append(lambda quantity, t, curves=curves: curves[quantity](t).T)
    return rig, signals


def campaign(law: Law, rig: cf.Rig, channels: tuple[Channel, ...]) -> Campaign:
    """All runs of a rig."""
    linear, signals = records(law, rig)
    return cf.campaign_of(linear, signals, channels)
