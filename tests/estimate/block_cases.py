"""Blocks of campaigns made by hand: what probes, cells and accelerometers read of a film that is known."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rigdata.operating_point import OperatingPoint
from tests.phasors.phasor_cases import complex_normal
from tpjb_ident.estimate.equation import CORNERS, Blocks, Rig, Sensor
from tpjb_ident.estimate.solve import Solution, Solver
from tpjb_ident.terms.clock import Clock
from tpjb_ident.terms.load_turn import PLAUSIBLE
from tpjb_ident.terms.registry import TERMS

MASS = 30.0
#: Windows of a run [s each], and the middle of its record [s].
WINDOWS, LENGTH, MIDDLE = 20, 0.5, 5.0
#: Sum of squared distances of the windows from their middle [s^2].
SPREAD = LENGTH**2 * (WINDOWS**3 - WINDOWS) / 12
STIFFNESS = np.array([[1.5e8, 2.0e7], [-1.6e7, 2.6e8]])
DAMPING = np.array([[3.0e5, 2.0e4], [1.5e4, 4.5e5]])
EXPONENTS = np.array([[0.6, -0.4], [0.5, 0.8]]), np.array([[0.3, 0.5], [-0.3, 0.4]])
COMPLIANCE = np.array([[2.2e-9, 0.1e-9], [0.1e-9, 1.7e-9]]) * (1 - 0.01j)
PROBES = (45.0, 135.0, 90.0, 20.0)
DRIVE = 500.0
#: Share of the noise's variance that all sensors have in common, as of a foundation that moves.
SHARED = 0.3


def film(load: float, omega: float) -> np.ndarray:
    """H of the film (2, 2) [N/m]: a power law of the load."""
    w = load / 5000.0
    return STIFFNESS * w ** EXPONENTS[0] + 1j * omega * DAMPING * w ** EXPONENTS[1]


def film_slope(load: float, omega: float) -> np.ndarray:
    """DH / d ln W (2, 2) [N/m]."""
    h = film(load, omega)
    return EXPONENTS[0] * h.real + 1j * EXPONENTS[1] * h.imag


@dataclass(frozen=True)
class Case:
    """A campaign, and what is wrong with its instruments; errors by sensor or device."""

    loads: tuple[float, ...] = (3000.0, 5000.0, 8000.0)
    hertz: tuple[float, ...] = (40.0,)
    directions: int = 4
    sizes: tuple[float, ...] = (1.0,)
    probes: int = 2
    accelerometers: int = 2
    mount: str = "cells"
    noise: float = 1e-3  #: of a run's phasor, relative to the sensor's usual reading
    scatter: float = 0.0  #: of the force from run to run, relative
    miss: tuple[float, float] = (0.0, 0.0)  #: of the runs' loads: size, turn [rad], standard deviations
    stated: Mapping[str, Mapping[str, object]] = field(default_factory=dict)  #: by quantity or sensor: of `Sensor`
    mass_uncertainty: float = 0.0
    gains: Mapping[str, float] = field(default_factory=dict)  #: logarithms
    turned: Mapping[str, float] = field(default_factory=dict)  #: rad
    late: Mapping[str, float] = field(default_factory=dict)  #: s, by sensor or quantity
    rates: Mapping[str, float] = field(default_factory=dict)  #: relative, by quantity
    drift: Mapping[str, float] = field(default_factory=dict)  #: 1/K
    kelvins: float = 0.0  #: standard deviation of the runs' temperatures
    warmer: tuple[float, ...] = (0.0,)  #: K: of the film in the runs of a point, over and over
    thinner: float = 0.0  #: change of H, 1/K
    mass_error: float = 0.0  #: relative
    common_miss: complex = 0j  #: of all loads alike: relative size + i turn
    turning: np.ndarray = field(default_factory=lambda: np.zeros(16))  #: the numbers of `LoadTurn`
    shaft: float = 0.0  #: runout, relative to the probes' usual reading
    bent: float = 0.0  #: change of H by the usual motion
    bent_told: float = 0.0  #: what the harmonics let expect of it
    corner: float = 0.0  #: Hz: of cells that show no static force
    input_corner: float = 0.0  #: Hz: of the accelerometers
    crosstalk: float = 0.0  #: share of the second cell in the first
    shaft_gives: float = 0.0  #: compliance of a floating stator's shaft [m/N]
    shaft_mass: float = 0.0  #: kg


def sensors_of(case: Case) -> tuple[Sensor, ...]:
    """Probes D1.., cells F1, F2, accelerometers A1.. with what the case states of them."""
    names = [(f"D{k + 1}", "displacement") for k in range(case.probes)]
    names += [("F1", "force"), ("F2", "force")]
    names += [(f"A{k + 1}", "acceleration") for k in range(case.accelerometers)]
    sensors = []
    for name, quantity in names:
        usual = {"corner_uncertainty": CORNERS.get(quantity, 0.0)}
        stated = {**usual, **case.stated.get(quantity, {}), **case.stated.get(name, {})}
        sensors.append(Sensor(name, quantity, **stated))
    return tuple(sensors)


def axes_of(case: Case) -> np.ndarray:
    """Angles of the sensors' axes (m,) [rad]."""
    degrees = [*PROBES[: case.probes], 0.0, 90.0]
    return np.radians(degrees + [0.0, 90.0, 0.0, 90.0][: case.accelerometers])


def made(case: Case, seed: int = 0) -> tuple[Rig, Blocks, np.ndarray]:
    """Rig, blocks, and the true H of every point (P, 2, 2)."""
    rng = np.random.default_rng([38, seed])
    sensors = sensors_of(case)
    rig = Rig(sensors, MASS, case.mass_uncertainty * MASS, case.mount, static=not case.corner)
    points = [OperatingPoint(w, -math.pi / 2, 138.0, 2 * math.pi * f) for f in case.hertz for w in case.loads]
    point = np.repeat(np.arange(len(points)), case.directions * len(case.sizes))
    n, m = len(point), len(sensors)
    miss = np.array(case.miss) * rng.standard_normal((n, 2))
    shaft = np.exp(2j * np.pi * rng.random(n)) if case.shaft else np.full(n, np.nan + 0j)
    temperature = 300.0 + case.kelvins * rng.standard_normal(n)
    omega = np.array([points[p].excitation for p in point])
    u, force = _motion(case, points, point, miss, rng)
    clean = _readings(case, sensors, u, force)
    factor = _factor(case, sensors, omega, temperature)
    usual = np.median(np.abs(clean), axis=0)
    z = clean * factor
    if case.shaft:
        z[:, : case.probes] += case.shaft * usual[: case.probes] * shaft[:, None]
    root = np.sqrt(1 - SHARED) * np.eye(m) + 0j
    root = np.concatenate([root, np.sqrt(SHARED) * np.exp(1j * np.arange(m))[:, None]], axis=1)
    root = case.noise * usual[:, None] * root
    noise = np.tile(root @ root.conj().T, (n, 1, 1))
    fast = np.array([case.rates.get(sensor.quantity, 0.0) for sensor in sensors])
    slope = -1j * omega[:, None] * fast * z
    return (
        rig,
        Blocks(
            points=tuple(points),
            runs=tuple(f"r{k}" for k in range(n)),
            point=point,
            run=np.arange(n),
            omega=omega,
            z=z + complex_normal(rng, n, m + 1) @ root.T,
            present=np.ones((n, m), dtype=bool),
            along=np.tile(_unit(axes_of(case)), (n, 1, 1)),
            calibration=np.zeros((n, m), dtype=int),
            noise=noise,
            dof=np.full(n, 80.0),
            slope=slope + complex_normal(rng, n, m + 1) @ root.T * math.sqrt(WINDOWS / SPREAD),
            slope_noise=noise * WINDOWS / SPREAD,
            windows=np.full(n, float(WINDOWS)),
            time=np.full(n, MIDDLE),
            temperature=temperature,
            film_temperature=320.0 + _warmer(case, n),
            miss=miss[:, 0] + 1j * miss[:, 1],
            miss_error=np.zeros(n),
            shaft=shaft,
            uneven=np.zeros((n, 2)),
            gain_scatter=np.zeros(n),
            bent=np.full(len(points), case.bent_told),
            band=np.full(len(points), -1),
        ),
        np.array([film(p.static_load, p.excitation) for p in points]),
    )


def _unit(angles: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _warmer(case, n) -> np.ndarray:
    """Film temperatures of the runs above the usual one, (n,) [K]."""
    return np.resize(case.warmer, n)


def _motion(case, points, point, miss, rng) -> tuple[np.ndarray, np.ndarray]:
    """True motion (n, 4) of displacement and acceleration, and the oil force (n, 2)."""
    n = len(point)
    place = np.arange(n) % (case.directions * len(case.sizes))
    angle = (place % case.directions) * math.pi / case.directions + 0.2
    size = DRIVE * np.array(case.sizes)[place // case.directions]
    drive = (size * np.exp(2j * np.pi * rng.random(n)))[:, None] * _unit(angle)
    h = np.array([film(p.static_load, p.excitation) for p in points])
    log_load = np.log([p.static_load for p in points])
    direct = np.abs(h[:, [0, 1], [0, 1]].real).mean(1), np.abs(h[:, [0, 1], [0, 1]].imag).mean(1)
    numbers = case.turning.reshape(4, 2, 2)
    aside = (log_load - log_load.mean())[:, None, None]
    turn = direct[0][:, None, None] * (numbers[0] + aside * numbers[2])
    turn = turn + 1j * direct[1][:, None, None] * (numbers[1] + aside * numbers[3])
    slope = np.array([film_slope(p.static_load, p.excitation) for p in points])
    true = miss + np.array([case.common_miss.real, case.common_miss.imag])
    at_run = h[point] + true[:, :1, None] * slope[point] + true[:, 1:, None] * turn[point]
    d = np.linalg.solve(h[point], drive[:, :, None])[:, :, 0]
    square = np.sum(np.abs(d) ** 2, axis=1)
    usual = np.array([square[point == p].mean() for p in range(len(points))])
    at_run = at_run * (1 + case.bent * square / usual[point] + case.thinner * _warmer(case, n))[:, None, None]
    force = np.einsum("nij,nj->ni", at_run, d)
    force = force + case.scatter * np.linalg.norm(force, axis=1)[:, None] * complex_normal(rng, n, 2)
    omega = np.array([points[p].excitation for p in point])
    square = omega[:, None] ** 2
    a = square * (d + case.shaft_gives / (1 - square * case.shaft_gives * case.shaft_mass) * force)
    if case.mount == "cells":
        for k in range(n):
            rows = np.eye(2) - omega[k] ** 2 * MASS * (1 + case.mass_error) * COMPLIANCE
            a[k] = -np.linalg.solve(rows, omega[k] ** 2 * COMPLIANCE @ force[k])
    if not case.accelerometers and case.mount == "unknown":
        a = 0 * a
    return np.concatenate([d, a], axis=1), force


def _readings(case, sensors, u, force) -> np.ndarray:
    """What faultless electronics on the sensors' true axes read, (n, m)."""
    d, a = u[:, :2], u[:, 2:]
    cells = force - MASS * (1 + case.mass_error) * a
    cells = cells + case.crosstalk * cells[:, ::-1] * [1, 0]
    vectors = {"displacement": d, "force": cells, "acceleration": a}
    angles = axes_of(case) + np.array([case.turned.get(sensor.name, 0.0) for sensor in sensors])
    columns = [vectors[sensor.quantity] @ unit for sensor, unit in zip(sensors, _unit(angles))]
    return np.stack(columns, axis=1)


def _factor(case, sensors, omega, temperature) -> np.ndarray:
    """What electronics make of a reading of one, (n, m)."""
    gain = np.array([case.gains.get(sensor.name, 0.0) for sensor in sensors])
    late = np.array([case.late.get(sensor.name, case.late.get(sensor.quantity, 0.0)) for sensor in sensors])
    fast = np.array([case.rates.get(sensor.quantity, 0.0) for sensor in sensors])
    drift = np.array([case.drift.get(sensor.name, 0.0) for sensor in sensors])
    away = temperature - temperature.mean()
    exponent = gain - 1j * omega[:, None] * (late + fast * MIDDLE) + away[:, None] * drift
    corners = {"force": case.corner, "acceleration": case.input_corner}
    corner = np.array([corners.get(sensor.quantity, 0.0) for sensor in sensors])
    return np.exp(exponent) / (1 - 2j * np.pi * corner / omega[:, None])


def solved(rig: Rig, blocks: Blocks, truth: np.ndarray, *more, without=(), seed: int = 1) -> Solution:
    """The solve with all terms and `more`, from a start some per cent beside the truth."""
    rng = np.random.default_rng(seed)
    start = truth * (1 + 0.02 * complex_normal(rng, *truth.shape))
    return Solver(rig, blocks, [*terms_of(rig, blocks, without), *more], start).run()


def terms_of(rig: Rig, blocks: Blocks, without=()) -> list:
    """All terms that apply; a clock where sensors name devices."""
    used = [term for term in TERMS if term not in without]
    if len({sensor.clock for sensor in rig.channels}) == 1:
        used = [term for term in used if term is not Clock]
    return [term(rig, blocks) for term in used]


def numbers(h: np.ndarray) -> np.ndarray:
    """The eight real numbers of H, (..., 8)."""
    flat = h.reshape(*h.shape[:-2], 4)
    return np.concatenate([flat.real, flat.imag], axis=-1)


def deviations(solution: Solution) -> np.ndarray:
    """Standard deviation of every number, (P, 8)."""
    total = solution.records + sum(solution.shares.values())
    return np.sqrt(np.einsum("pii->pi", total))


def away(solution: Solution, truth: np.ndarray) -> np.ndarray:
    """Distance from the truth in standard deviations, (P, 8)."""
    return (numbers(solution.h) - numbers(truth)) / deviations(solution)


def drawn_turning(rng) -> np.ndarray:
    """Numbers of `LoadTurn` as its prior lets expect."""
    return 0.5 * np.repeat(PLAUSIBLE, 8) * rng.standard_normal(16)
