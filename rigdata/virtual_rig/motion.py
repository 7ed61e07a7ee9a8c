"""What shaft and housing do in one run, as functions of time: what ideal sensors would see.

With the shaft turning (dynamic and locus runs) actuators push through the film, and shaft and housing answer. At rest
there are dry load steps toward one pad, and a small load swept once around the clearance polygon.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.vector import directions, wrapped
from rigdata.virtual_rig.instruments import Instruments, Noise, stream
from rigdata.virtual_rig.truth import (
    ClearanceSweep,
    DryTest,
    PlannedRun,
    RigTruth,
    VirtualRigError,
    load_vector,
    point_facts,
)

_SETTLING = 0.1  # time constant of an overshoot [s]
#: How far the load passes a pad before the shaft slides along it, and over which angle it does [rad].
_SLIDE_LAG, _SLIDE_WIDTH = np.radians([5.0, 3.0]).tolist()
_UPPER = 0.3  # sine of a pivot's angle above which its pad counts as an upper one


@dataclass(frozen=True)
class MotionLine:
    """One spectral line, phasors of exp(+i omega t)."""

    frequency: float  #: rad/s
    oil_force: ComplexArray  #: (2,) each: N, m, N, m/s^2
    displacement: ComplexArray
    force: ComplexArray  #: of the cells
    acceleration: ComplexArray


@dataclass(frozen=True)
class Motion:
    """What shaft and housing do in one run, to be sampled at any time: a mean state, and spectral lines on it."""

    time: FloatArray  #: (n,), s: of the samples
    position: FloatArray  #: (2,) or, of a quasi-static test, (n, 2): m
    load: FloatArray  #: the same, N
    temperature: FloatArray  #: (n_pads,), degC
    facts: Mapping[str, object]
    lines: tuple[MotionLine, ...] = ()
    speed: float = 0.0  #: rad/s, about +z
    surface: Iterable[complex] = ()  #: runout of 1X, 2X, ... [m]

    def at(self, quantity: str, time: FloatArray) -> FloatArray:
        """X and Y of "displacement" [m], "force" [N] or "acceleration" [m/s^2] at `time` (n,) [s] -> (n, 2)."""
        mean = {"displacement": self.position, "force": self.load}.get(quantity, np.zeros(2))
        if mean.ndim == 2 and not np.array_equal(time, self.time):
            mean = np.stack([np.interp(time, self.time, column) for column in mean.T], axis=1)
        out = np.broadcast_to(mean, (len(time), 2)).copy()
        for line in self.lines:
            phasor = getattr(line, quantity)
            turn = line.frequency * time
            out += np.outer(np.cos(turn), phasor.real) - np.outer(np.sin(turn), phasor.imag)
        return out

    def runout(self, axis: float, time: FloatArray) -> FloatArray:
        """Surface runout (n,) [m] that a probe at `axis` [rad] sees: a point of the surface passes it that much later.

        Of a shaft that does not turn it is part of the gap voltage.
        """
        out = np.zeros(len(time))
        for order, phasor in enumerate(self.surface, 1):
            out += (phasor * np.exp(1j * order * (self.speed * time - axis))).real
        return out


def running_motion(run: PlannedRun, truth: RigTruth, instruments: Instruments, noise: Noise, seed: int) -> Motion:
    """Motion in a dynamic or locus run.

    The actuators' force goes through the film: F_oil = H d at every line, d shaft relative to housing. The
    housing stands on its cells, so F_oil = F_cell + m_h a_h with F_cell = k_cell x_h.
    """
    rng, point = stream(seed, run.record, "physics"), run.point
    load, direction, speed = rng.standard_normal(3)  # by how much the set point is missed
    actual = replace(
        point,
        static_load=point.static_load * (1 + noise.load_miss * load),
        static_load_direction=point.static_load_direction + noise.direction_miss * direction,
        shaft_speed=point.shaft_speed * (1 + noise.speed_miss * speed),
    )
    shaft_angle = rng.uniform(0, 2 * np.pi)
    forces = _actuator_forces(run, noise, rng)
    unbalance = noise.unbalance * actual.shaft_speed**2
    if unbalance:
        turning = unbalance * np.array([1.0, -1j * np.sign(actual.spin)]) * np.exp(1j * shaft_angle)
        forces.append((actual.shaft_speed, turning))
    # the surface is the same in the whole campaign
    runout = np.array(noise.runout, dtype=float)
    phases = stream(seed, "", "campaign").uniform(0, 2 * np.pi, len(runout))
    orders = np.arange(1, len(runout) + 1)
    steady = replace(actual, excitation=0.0)
    lines = []
    for frequency, force in forces:
        h = truth.stiffness(replace(actual, excitation=frequency))
        lines.append(answer(frequency, force, h, instruments))
    position = truth.position(steady)
    frequencies = [{"frequency_Hz": round(line.frequency / (2 * np.pi), 9)} for line in lines]
    return Motion(
        time=np.arange(round(run.seconds * run.rate)) / run.rate,
        position=position,
        load=load_vector(actual),
        temperature=truth.temperature(steady),
        facts=point_facts(actual, position) | {"lines": frequencies},
        lines=tuple(lines),
        speed=actual.spin,
        surface=runout * np.exp(1j * (phases + orders * shaft_angle)),
    )


def _actuator_forces(run: PlannedRun, noise: Noise, rng: np.random.Generator) -> list[tuple[float, ComplexArray]]:
    """Force phasors (2,) [N] of the actuators, with their frequencies [rad/s]."""
    forces = []
    along = directions(run.direction)
    across = np.array([-along[1], along[0]])
    for frequency, amplitude in run.lines:
        phase = np.exp(1j * rng.uniform(0, 2 * np.pi))
        gain = 1 + noise.actuator_scatter * rng.standard_normal()
        talk = noise.cross_talk * (rng.standard_normal() + 1j * rng.standard_normal()) / np.sqrt(2)
        forces.append((frequency, amplitude * phase * (gain * along + talk * across)))
        for order, share in enumerate(noise.actuator_harmonics, 2):
            turn = np.exp(1j * rng.uniform(0, 2 * np.pi))
            forces.append((order * frequency, amplitude * share * turn * along))
    return forces


def answer(frequency: float, force: ComplexArray, h: ComplexArray, instruments: Instruments) -> MotionLine:
    """How shaft and housing answer oil force phasors (.., 2) [N] at one frequency [rad/s].

    The film passes the force on to the housing: k_cell x_h - m_h omega^2 x_h = F_oil.
    """
    cells = np.array(instruments.cell_stiffness)
    # written with the compliance, so that rigid cells (infinite stiffness) are no special case
    housing = (force / cells) / (1 - instruments.true_mass * frequency**2 / cells)
    acceleration = -(frequency**2) * housing
    return MotionLine(
        frequency=frequency,
        oil_force=force,
        displacement=np.asarray(np.linalg.solve(h, force.T).T),
        force=force - instruments.true_mass * acceleration,
        acceleration=acceleration,
    )


def dry_motion(run: PlannedRun, test: DryTest, truth: RigTruth, noise: Noise, seed: int) -> Motion:
    """Motion in a dry pivot test: position along the pad = clearance + deflection under the load on the pivot."""
    rng = stream(seed, run.record, "dry")
    toward = directions(run.direction)
    sideways = np.array([-toward[1], toward[0]])
    time, load = load_history(test, run.rate)
    flaws = noise.dry
    turn = either_sign(rng, flaws.direction)
    side = either_sign(rng, flaws.side)
    side_start = flaws.side_start * rng.standard_normal()
    gap = rng.uniform(*flaws.contact_gap) if toward[1] > _UPPER else 0.0
    on_pivot = held_back(load * np.cos(turn), flaws.friction)
    deflection = truth.deflection(test.pad, on_pivot)
    missing = gap * np.exp(-load / flaws.contact_load)
    radial = truth.clearance[test.pad - 1] + deflection - missing
    position = np.outer(radial, toward) + np.outer(side_start + side * (deflection - missing), sideways)
    facts = {
        "load_direction_error_deg": float(np.degrees(turn)),
        "side_share": side,
        "contact_gap_m": gap,
    }
    return Motion(time, position, np.outer(load, directions(run.direction + turn)), truth.cold_temperatures, facts)


def load_history(test: DryTest, rate: float) -> tuple[FloatArray, FloatArray]:
    """Time (n,) [s] and load (n,) [N] of a dry test: ramps and holds."""
    knots, level, held = [0.0], [test.levels[-1] if test.branch == "down" else test.start], []
    rising = list(zip(test.levels, test.holds))
    order = {"up": rising, "down": rising[::-1], "cycle": rising + rising[-2::-1]}[test.branch]
    for target, hold in order:
        arrival = knots[-1] + (test.ramp if target != level[-1] else 0.0)
        held.append((arrival, arrival + hold, target - level[-1], target))
        knots += [arrival, arrival + hold]
        level += [target, target]
    if test.branch != "up":
        knots.append(knots[-1] + test.ramp)
        level.append(test.start)
    time = np.arange(round(knots[-1] * rate)) / rate
    load = np.interp(time, knots, level)
    for start, stop, step, target in held:
        inside = (time >= start) & (time < stop)
        since = time[inside] - start
        load[inside] += test.overshoot * step * np.exp(-since / _SETTLING)
        load[inside] += test.load_drift * target * since
    return time, load


def held_back(load: FloatArray, friction: float) -> FloatArray:
    """Load (n,) [N] that reaches the pivot past dry friction of a fraction of the force.

    The play operator: going up the pivot feels (1 - friction) of the load, going down (1 + friction), and on
    reversal it waits until the load has crossed that gap.
    """
    if friction == 0.0:
        return load
    felt = np.empty_like(load)
    low, high = (load * (1 - friction)).tolist(), (load * (1 + friction)).tolist()
    # a falling test begins at the top of a load that came from above
    now = high[0] if load[-1] < load[0] else low[0]
    for i, (least, most) in enumerate(zip(low, high)):
        now = min(max(now, least), most)
        felt[i] = now
    return felt


def either_sign(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """A number whose size is between limits."""
    return float(rng.uniform(*limits) * rng.choice([-1.0, 1.0]))


def clearance_motion(run: PlannedRun, sweep: ClearanceSweep, truth: RigTruth, noise: Noise, seed: int) -> Motion:
    """Motion in a clearance sweep."""
    push = sweep.push * (1 + noise.dry.push_scatter * stream(seed, run.record, "dry").standard_normal())
    time = np.arange(round(sweep.seconds * run.rate)) / run.rate
    direction = 2 * np.pi * time / sweep.seconds
    position = swept_position(truth, push, direction)
    return Motion(time, position, push * directions(direction), truth.cold_temperatures, {"push_N": push})


def swept_position(truth: RigTruth, push: float, direction: FloatArray, lag: float = _SLIDE_LAG) -> FloatArray:
    """Shaft position (n, 2) [m] under a load `push` [N] toward `direction` (n,) [rad].

    The shaft rests in the corner between the two pads that the load points between; each pivot carries its share
    of the load and gives by its own law. It slides along a pad's side to the next corner when the load has
    passed that pad by `lag`, over a few degrees (friction). On its way that pad alone carries, push times the cosine
    of the angle between them: there the side is at clearance + deflection(that).
    """
    pads = _sides(truth)
    angles = np.array(truth.pivot_angles)[pads]
    shares, places = [], []
    for pad, after in zip(pads, [*pads[1:], pads[0]], strict=True):
        angle, next_angle = truth.pivot_angles[pad], truth.pivot_angles[after]
        gap = (next_angle - angle) % (2 * np.pi)
        passed, remaining = wrapped(direction - angle - lag), wrapped(next_angle + lag - direction)
        share = 0.25 * (1 + np.tanh(passed / _SLIDE_WIDTH)) * (1 + np.tanh(remaining / _SLIDE_WIDTH))
        turned = np.clip(wrapped(direction - angle), 0.0, gap)
        forces = push * np.stack([np.sin(gap - turned), np.sin(turned)]) / np.sin(gap)
        reach = np.stack([_reach(truth, k, force) for k, force in zip((pad, after), forces, strict=True)])
        shares.append(share)
        places.append(np.linalg.solve(directions([angle, next_angle]), reach).T)
    weight = np.array(shares) / np.sum(shares, axis=0)
    position = np.einsum("kn,knj->nj", weight, np.array(places))
    for i, (pad, normal) in enumerate(zip(pads, directions(angles), strict=True)):
        # between two corners a blend of both would share the load among three pads
        alone = 4.0 * weight[i - 1] * weight[i]
        side = _reach(truth, pad, push * np.cos(direction - angles[i]))
        position += (alone * (side - position @ normal))[:, None] * normal
    return position


def _reach(truth: RigTruth, pad: int, force: FloatArray) -> FloatArray:
    """How far (n,) [m] the shaft gets toward a pad, counted from 0, that carries a force (n,) [N]."""
    return truth.clearance[pad] + truth.deflection(pad + 1, force)


def _sides(truth: RigTruth) -> list[int]:
    """Pads in counter-clockwise order, less those that the shaft cannot touch between their neighbours.

    By duality a pad has a side of the polygon where normal / clearance is a corner of the convex hull of all pads;
    the polygon is closed where that hull holds the origin.
    """
    from scipy.spatial import ConvexHull, QhullError

    open_bearing = "the pads leave half the circle open: the shaft would fall out of the bearing"
    try:
        hull = ConvexHull(directions(truth.pivot_angles) / np.array(truth.clearance)[:, None])
    except QhullError as error:  # all pads are on one line
        raise VirtualRigError(open_bearing) from error
    if np.max(hull.equations[:, -1]) * min(truth.clearance) >= -1e-6:
        raise VirtualRigError(open_bearing)
    return sorted(hull.vertices.tolist(), key=lambda pad: truth.pivot_angles[pad] % (2 * np.pi))
