"""Random physical bearings, and a check of every answer from scratch.

Latin hypercube over pads, arc, preload, clearance, offset, size, load, speed, pivots, load direction and oil. Checked
are the film thickness by its formula, Reynolds' equation by plain numpy, force,
moment and pivot balance, the heat fixed point, and for idle pads a search for a loaded attitude that was missed.
"""

import math
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import qmc

from model.bearing import Bearing
from model.film.energy import solve_energy
from model.film.mesh import film_work
from model.film.oil_state import Running
from model.film.reynolds import solve_film
from model.predict import predict
from model.prediction import Prediction
from model.statics.pad_film import PadFilm
from tests.rigs.bearings import ring

#: name: (low, high, logarithmic). Preload from 0.1: with less, a pad behind whose middle the pivot stands takes up
#: and sheds its load with a jump, and many loads have no steady state at all. Loads and pivots are drawn so that no
#: pivot gives way by more than the clearance and that the film is one of a running bearing (see `physical`).
RANGES = {
    "pads": (3.0, 7.0, False),
    "arc_share": (0.6, 0.95, False),
    "preload": (0.1, 0.7, False),
    "diameter": (0.05, 0.3, True),
    "clearance_ratio": (0.8e-3, 2.5e-3, True),
    "offset": (0.5, 0.6, False),
    "length_ratio": (0.4, 1.2, False),
    "unit_load": (0.1e6, 3.0e6, True),
    "surface_speed": (3.0, 90.0, True),
    "pivot_stiffness": (5e7, 5e9, True),
    "direction": (-math.pi, math.pi, False),
    "viscosity": (0.01, 0.08, True),
    "supply": (30.0, 55.0, False),
}


@dataclass(frozen=True)
class Case:
    """A bearing and its operating point."""

    bearing: Bearing
    load: float
    direction: float
    speed: float
    stiffness: float

    def predict(self) -> Prediction:
        return predict(self.bearing, self.load, self.direction, self.speed, pivots=self.stiffness)

    def turned(self, angle: float) -> "Case":
        """The same bearing and load, turned as a whole."""
        pads = tuple(replace(p, pivot_angle=p.pivot_angle + angle) for p in self.bearing.pads)
        return replace(self, bearing=self.bearing.with_pads(pads), direction=self.direction + angle)

    @property
    def sommerfeld(self) -> float:
        """Mu N L D (R / Cb)^2 / W."""
        b = self.bearing
        ratio = b.journal_radius / b.pads[0].assembled_clearance
        return b.oil.viscosity_40 * self.speed / (2 * math.pi) * b.length * b.journal_diameter * ratio**2 / self.load


def draw(cases: int, seed: int, ranges: dict[str, tuple[float, float, bool]] = RANGES) -> list[Case]:
    """The first `cases` physical ones of a Latin hypercube."""
    out: list[Case] = []
    sampler = qmc.LatinHypercube(len(ranges), seed=seed)
    while len(out) < cases:
        out += [case for row in sampler.random(cases) if physical(case := _case(row, ranges))]
    return out[:cases]


def physical(case: Case) -> bool:
    """Pivots give by less than the clearance; Sommerfeld numbers of running bearings; laminar film."""
    clearance = case.bearing.pads[0].assembled_clearance
    give = case.load / case.stiffness / clearance
    reynolds = case.speed * case.bearing.journal_radius * clearance * 860.0 / case.bearing.oil.viscosity_40
    return give < 1.0 and 0.03 < case.sommerfeld < 30.0 and reynolds < 2000.0


def _case(row: np.ndarray, ranges: dict[str, tuple[float, float, bool]]) -> Case:
    v = {}
    for u, (name, (low, high, logarithmic)) in zip(row, ranges.items(), strict=True):
        v[name] = low * (high / low) ** u if logarithmic else low + u * (high - low)
    n, diameter = int(v["pads"]), v["diameter"]
    radius, length = 0.5 * diameter, v["length_ratio"] * diameter
    cb = radius * v["clearance_ratio"]
    angles = [2 * math.pi * k / n for k in range(n)]
    arc = min(v["arc_share"] * 2 * math.pi / n, math.radians(100.0))
    clearances, oil = (cb / (1.0 - v["preload"]), cb), (v["viscosity"], v["supply"])
    bearing = ring(angles, (diameter, length), arc, clearances, oil, v["offset"])
    load = v["unit_load"] * length * diameter
    return Case(bearing, load, v["direction"], v["surface_speed"] / radius, v["pivot_stiffness"])


def errors(p: Prediction) -> dict[str, float]:
    """Every condition of an equilibrium, from scratch; each number should be next to nothing."""
    bearing, surface = p.setup.bearing, p.speed * p.setup.bearing.journal_radius
    out = dict.fromkeys(("force", "moment", "pivot", "reynolds", "heat", "stability", "missed"), 0.0)
    total = np.zeros(2)
    for film in p.equilibrium.films:
        if film.idle:
            if not any("cannot keep" in c and film.number in c.pads for c in p.status):
                out["missed"] = max(out["missed"], missed_attitude(p, film))
            continue
        theta = film.grid.angle + film.pad.pivot_angle
        weighted = film.work.pressure * film.grid.area
        load = weighted.sum(axis=1) @ np.cos(film.grid.angle)
        total += [weighted.sum(axis=1) @ np.cos(theta), weighted.sum(axis=1) @ np.sin(theta)]
        out["moment"] = max(out["moment"], abs(weighted.sum(axis=1) @ np.sin(film.grid.angle)) / p.load)
        give = p.setup.pivots[film.number - 1].deflection(float(load))
        out["pivot"] = max(out["pivot"], abs(give - film.deflection) / film.pad.assembled_clearance)
        out["reynolds"] = max(out["reynolds"], reynolds_error(bearing, film, p.bearing_position, surface))
        fresh = np.empty_like(film.work.temperature)
        heat, oil = (bearing.oil.specific_heat, bearing.oil.conductivity), (bearing.oil.viscosity_40, 0.0, 0.0, 0.0)
        film.work.viscosity[:] = bearing.oil.viscosity(film.work.temperature)
        film.work.density[:] = bearing.oil.density(film.work.temperature)
        solve_energy(film.grid, film.work, film.inlet, Running(surface, oil, heat), fresh)
        if p.setup.thermal == "isothermal":
            fresh[:] = film.inlet
        out["heat"] = max(out["heat"], float(np.abs(fresh - film.work.temperature).max()))
        assert film.forces is not None
        (kaa, kab), (kba, kbb) = film.forces.stiffness
        give = 1.0 / p.setup.pivots[film.number - 1].stiffness(float(load))
        determinant = kbb * (1.0 + give * kaa) - give * kba * kab
        out["stability"] = max(out["stability"], -determinant / max(abs(kbb), 1.0))
    force = p.load * np.array([math.cos(p.load_direction), math.sin(p.load_direction)])
    out["force"] = float(np.hypot(*(total - force))) / p.load
    return out


def thickness(bearing: Bearing, film: PadFilm, position: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Film thickness by the formula of docs/theory.md [m]."""
    pad, theta = film.pad, alpha + film.pad.pivot_angle
    return (
        pad.pad_clearance
        - (film.preload_distance - film.deflection) * np.cos(alpha)
        - position[0] * np.cos(theta)
        - position[1] * np.sin(theta)
        - bearing.pivot_radius(pad) * film.tilt * np.sin(alpha)
    )


def reynolds_error(bearing: Bearing, film: PadFilm, position: np.ndarray, surface: float) -> float:
    """Violation of p >= 0, net outflow >= 0, p times net outflow = 0, over the largest Couette flow of a cell."""
    grid, p, t, oil = film.grid, film.work.pressure, film.work.temperature, bearing.oil
    mu = oil.viscosity_40 * np.exp(oil.viscosity_exponent * (40.0 - t))
    rho = oil.density_40 * (1.0 + oil.thermal_expansion * (40.0 - t))
    fluidity = rho / mu
    h = np.repeat(thickness(bearing, film, position, grid.angle)[:, None], len(grid.z), axis=1)
    face = thickness(bearing, film, position, 0.5 * (grid.angle[1:] + grid.angle[:-1]))[:, None]
    couette = 0.5 * surface * face * 0.5 * (rho[1:] + rho[:-1]) * grid.height
    mobile = face**3 / 12.0 * 0.5 * (fluidity[1:] + fluidity[:-1]) * grid.height / grid.dx
    along = couette - mobile * np.diff(p, axis=0)
    mobile = h[:, 1:] ** 3 / 12.0 * 0.5 * (fluidity[:, 1:] + fluidity[:, :-1]) * grid.dx / grid.dz
    across = -mobile * np.diff(p, axis=1)
    outflow = np.diff(along, axis=0)[:, grid.first : -1]
    outflow = outflow + across[1:-1, grid.first :]
    outflow[:, (1 - grid.first) :] -= across[1:-1, : across.shape[1] - 1 + grid.first][:, : outflow.shape[1]]
    inner = p[1:-1, grid.first : -1]
    violation = np.where(inner > 0.0, np.abs(outflow), np.maximum(-outflow, 0.0))
    return float(max(violation.max() / couette.max(), -min(p.min(), 0.0) / max(p.max(), 1e-30)))


def missed_attitude(p: Prediction, film: PadFilm) -> float:
    """Search the attitudes that tilt freely for one that carries at the idle pad's journal position.

    Isothermal at the mean temperature of the films that carry. Along the wedge b, the approach a is where the moment
    vanishes, and a + delta(W) is the reach at which the pad carries so; the least of them is the edge of carrying.
    """
    oil, pad, surface = p.setup.bearing.oil, film.pad, p.speed * p.setup.bearing.journal_radius
    warm = [f.work.temperature.mean() for f in p.equilibrium.films if not f.idle] or [film.inlet]
    work = film_work(film.grid, film.inlet)
    work.viscosity[:] = oil.viscosity(float(np.mean(warm)))
    work.density[:] = oil.density_40
    law = p.setup.pivots[film.number - 1]
    reach = film.preload_distance + float(film.normal @ p.bearing_position)

    def force(a: float, b: float) -> np.ndarray:
        work.ruptured[:] = False
        f = solve_film(film.grid, work, (pad.pad_clearance, a, b), surface, False)
        return f.force if f.steps > 0 else np.array([math.inf, math.inf])

    edge = math.inf
    high = 0.6 * pad.pad_clearance
    for b in pad.pad_clearance * np.linspace(0.02, 0.5, 20):
        low = -2.0 * pad.pad_clearance
        while math.isinf(force(low, b)[1]) and low < 0.55 * pad.pad_clearance:
            low = 0.5 * (low + high)
        if force(low, b)[1] > 0.0 > force(high, b)[1]:
            a = brentq(lambda x, b=b: force(x, b)[1], low, high, xtol=1e-4 * pad.pad_clearance)
            edge = min(edge, a + law.deflection(float(force(a, b)[0])))
    return max(0.0, (reach - edge) / pad.pad_clearance)


#: Largest errors of an answer that counts as right: solver tolerances with room for the sum over pads; the edge of
#: carrying is known to a few per cent of the clearance.
LIMITS = {
    "force": 1e-6,
    "moment": 1e-6,
    "pivot": 1e-6,
    "reynolds": 1e-6,
    "heat": 1e-4,
    "stability": 0.0,
    "missed": 0.06,
}


@dataclass
class Outcome:
    """What became of a set of cases."""

    converged: int = 0
    statuses: Counter[str] = field(default_factory=Counter)  #: of those that did not converge
    wrong: list[tuple[int, str, float]] = field(default_factory=list)
    asymmetry: float = 0.0


def run(cases: list[Case], turn_every: int = 20) -> Outcome:
    """Predict and check every case; every `turn_every`-th one also turned as a whole by 1 rad."""
    out = Outcome()
    for number, case in enumerate(cases):
        p = case.predict()
        if not p.converged:
            out.statuses["; ".join(c for c in p.status if c.severity != "note")] += 1
            continue
        out.converged += 1
        out.wrong += [(number, name, value) for name, value in errors(p).items() if not value <= LIMITS[name]]
        if number % turn_every == 0:
            q = case.turned(1.0).predict()
            same = np.abs(q.pad_load - p.pad_load).max() / case.load
            out.asymmetry = max(out.asymmetry, float(same))
    return out
