"""Mass-conserving cavitation against integrals, a mass balance and its perturbation, and Swift-Stieber; and bearings
with it: those of pads that tilt freely do not notice."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from model.bearing import Bearing
from model.effects import Effect
from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import FilmForces
from model.options import CAVITATION, Options
from model.prediction import Prediction
from tests.fillings import fluid_fraction
from tests.model import points
from tests.model.balance import Balance
from tests.model.points import LOAD, close, conserving, plain_film, slopes, solved

MU, RHO, SPEED, RADIUS, CLEARANCE = 0.03, 850.0, 7.0, 0.05, 1e-4
ARC = (-0.5, 0.5)
Profile = Callable[[Any], Any]


def lengths(wedge: tuple[float, float]) -> tuple[float, float, float]:
    return CLEARANCE, wedge[0] * CLEARANCE, wedge[1] * CLEARANCE


def solve(one: tuple[FilmGrid, FilmWork], wedge: tuple[float, float], sharp: bool = True, filling: float = 1.0):
    return solved(one, wedge, sharp, conserving(filling))


def wavy(amplitude: float) -> Profile:
    """Two waves along the arc, so that the film ruptures behind the first and forms again before the second."""
    return lambda t: CLEARANCE * (0.7 + amplitude * np.sin(4 * np.pi * t))


def plain(wedge: tuple[float, float]) -> Profile:
    return lambda t: CLEARANCE * (1.0 - wedge[0] * np.cos(t) - wedge[1] * np.sin(t))


#: Found once: it takes longer than the integral.
GAUSS = np.polynomial.legendre.leggauss(60)


def gauss(start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    at, weight = GAUSS
    return start + 0.5 * (end - start) * (at + 1.0), 0.5 * (end - start) * weight


def rise(h: Profile, flow: float, start: float, end: float) -> float:
    """Pressure gained between two angles by a full film with this volume flow per width, Reynolds in 1-D."""
    at, weight = gauss(start, end)
    gap = h(at)
    return float(weight @ (12.0 * MU * RADIUS * (0.5 * SPEED * gap - flow) / gap**3))


class ExactFilm:
    """Olsson's solution in 1-D: zones (start, end) that are full, one flow q for all; between them 2 q / (U h)."""

    def __init__(self, h: Profile, zones: list[tuple[float, float]], flow: float) -> None:
        self.h, self.zones, self.flow = h, zones, flow

    def pressure(self, angle: np.ndarray) -> np.ndarray:
        out = np.zeros_like(angle)
        for start, end in self.zones:
            for i in np.flatnonzero((angle > start) & (angle < end)):
                out[i] = rise(self.h, self.flow, start, angle[i])
        return out

    def force(self, length: float) -> np.ndarray:
        out = np.zeros(2)
        for start, end in self.zones:
            angle, weight = gauss(start, end)
            weighted = weight * self.pressure(angle) * RADIUS * length
            out += [weighted @ np.cos(angle), weighted @ np.sin(angle)]
        return out


def exact_wavy(amplitude: float) -> ExactFilm:
    """Full up to the first rupture, which sets the flow, and full again from where that flow fits the next rupture."""
    h = wavy(amplitude)
    first = brentq(lambda t: rise(h, 0.5 * SPEED * h(t), ARC[0], t), -0.125 + 1e-9, 0.125 - 1e-9)
    flow = 0.5 * SPEED * h(first)
    second = brentq(lambda t: 0.5 * SPEED * h(t) - flow, 0.375, 0.5)
    again = brentq(lambda t: rise(h, flow, t, second), first + 1e-6, 0.374)
    return ExactFilm(h, [(ARC[0], first), (again, second)], flow)


def exact_opening(wedge: tuple[float, float], filling: float = 1.0) -> ExactFilm:
    """A gap that opens behind the leading edge, or is fed too little: what came in flows on until the film forms."""
    h = plain(wedge)
    flow = 0.5 * SPEED * filling * h(ARC[0])
    at = np.linspace(*ARC, 400)
    thinnest = at[int(np.argmin([h(t) for t in at]))]
    narrow = brentq(lambda t: 0.5 * SPEED * h(t) - flow, ARC[0] + 1e-3, thinnest)  # more than the flow fits before
    end = ARC[1]
    if 0.5 * SPEED * h(ARC[1]) > flow:
        end = brentq(lambda t: 0.5 * SPEED * h(t) - flow, thinnest, ARC[1])
    start = brentq(lambda t: rise(h, flow, t, end), ARC[0] + 1e-6, narrow)
    return ExactFilm(h, [(start, end)], flow)


def waves(nt: int, amplitude: float) -> tuple[FilmGrid, FilmWork]:
    one = grid, work = plain_film((nt, 2), 100.0)
    work.extra[:] = CLEARANCE * (amplitude * np.sin(4 * np.pi * grid.angle) - 0.3)[:, None]
    return one


def long_force(grid: FilmGrid, exact: ExactFilm) -> np.ndarray:
    """Of the exact pressure over the length that the axial quadrature gives a film that drops to zero at its edges."""
    return exact.force(float(grid.area[1, :-1].sum() / grid.dx))


def difference(one: tuple[FilmGrid, FilmWork], forces: FilmForces, exact: ExactFilm) -> list[float]:
    """Relative errors of pressure and force."""
    p = exact.pressure(one[0].angle)
    force = long_force(one[0], exact)
    return [np.abs(one[1].pressure[:, 0] - p).max() / p.max(), np.hypot(*(forces.force - force)) / np.hypot(*force)]


def second_order(errors: list[list[float]]) -> None:
    table = np.array(errors)
    assert (table[-1] < 1.5e-3).all(), table
    # two halvings: a sixteenth, with room for where between the nodes the fronts fall
    assert (table[-1] < table[0] / 9.0).all(), table


@pytest.mark.slow
def test_rupture_and_reformation_are_olssons():
    exact = exact_wavy(0.35)
    errors = []
    for nt in (100, 200, 400):
        one = grid, work = waves(nt, 0.35)
        forces = solve(one, (0.0, 0.0))
        errors.append(difference(one, forces, exact))
        ruptured = work.ruptured[1:-1, 0]
        theta = fluid_fraction(*one, lengths((0.0, 0.0)), SPEED)[1:-1, 0]
        face = 0.5 * (grid.angle[1:-1] + grid.angle[2:])  # a node's filling is what leaves it
        expected = 2.0 * exact.flow / SPEED / exact.h(face)
        front = ruptured & np.append(~ruptured[1:], False)  # full in part
        inside = ruptured & ~front
        assert inside.sum() > nt // 10
        np.testing.assert_allclose(theta[inside], expected[inside], rtol=20.0 / nt**2)
    second_order(errors)


@pytest.mark.parametrize("filling", [1.0, 0.85])
def test_opening_gap_is_filled_with_what_came_in(filling):
    wedge = (-1.2, 0.05) if filling == 1.0 else (0.0, 0.2)
    exact = exact_opening(wedge, filling)
    errors = []
    for nt in (50, 100, 200):
        one = plain_film((nt, 2), 100.0)
        forces = solve(one, wedge, filling=filling)
        errors.append(difference(one, forces, exact))
    second_order(errors)


def test_what_does_not_form_again_is_swift_stieber():
    # the film ruptures towards its trailing edge: what lies behind does not matter
    for wedge in ((0.6, 0.25), (0.85, 0.1), (0.9, 0.08), (-0.3, 0.5)):
        one = plain_film((80, 6))
        got = solve(one, wedge)
        pressure = one[1].pressure.copy()
        want = solved(one, wedge, True)
        close(pressure, one[1].pressure, 1e-12)
        for a, b in zip(got[:3], want[:3], strict=True):
            close(a, b, 1e-11)


def test_what_forms_again_is_not():
    # Swift-Stieber makes up the oil that an opening gap lacks: it carries nearly three times as much
    one = plain_film((80, 6))
    jfo = solve(one, (-1.0, 0.1)).force[0]
    assert solved(one, (-1.0, 0.1), True).force[0] > 2.5 * jfo > 0.0


@pytest.mark.parametrize(("ratio", "eccentricity", "attitude"), [(0.5, 0.477, 51.01), (1.0, 0.224, 63.54)])
def test_upper_film_of_a_two_groove_bearing_carries_nothing(ratio, eccentricity, attitude):
    # Lund and Thomsen's bearing: the gap of the upper pad opens first, what then closes has not enough oil to press
    wedge = -eccentricity * np.cos(np.radians(attitude)), -eccentricity * np.sin(np.radians(attitude))
    one = plain_film((80, 6), 2 * RADIUS * ratio, 2 * np.radians(80.0))
    assert solved(one, wedge, True).force[0] > 0.1
    assert (solve(one, wedge).force == 0.0).all()


CASES = [((0.9, 0.08), 1.0), ((-1.0, 0.1), 1.0), ((-0.8, 0.1), 1.0), ((0.3, 0.4), 0.7), ((0.85, 0.1), 0.8)]


@pytest.mark.parametrize(("wedge", "filling"), CASES)
def test_mass_is_conserved_to_rounding(wedge, filling):
    one = grid, work = plain_film((80, 6))
    solve(one, wedge, filling=filling)
    balance = Balance(one, lengths(wedge), SPEED, filling)
    out = balance(balance.start, balance.wedge)[0].reshape(balance.dry.shape)
    assert np.abs(out / (0.5 * SPEED * CLEARANCE * RHO * grid.height[:-1])).max() < 1e-11
    # and the complementarity that goes with it
    p, ruptured, theta = work.pressure, balance.dry, fluid_fraction(*one, lengths(wedge), SPEED, filling)
    assert ruptured.any()
    assert p.min() == 0.0
    assert (p[1:-1, :-1][ruptured] == 0.0).all()
    assert (theta[1:-1, :-1][~ruptured] == 1.0).all()
    assert theta[1:-1, :-1][ruptured].max() <= 1.0
    assert theta.min() > 0.0


@pytest.mark.parametrize(("wedge", "filling"), CASES)
def test_stiffness_and_damping_are_what_the_balance_does_under_a_slow_motion(wedge, filling):
    one = plain_film((60, 4))
    forces, slow = solve(one, wedge, sharp=False, filling=filling), 0.01
    impedance = Balance(one, lengths(wedge), SPEED, filling).impedance(slow)
    close(forces.stiffness, impedance.real, 1e-6)
    close(forces.damping, impedance.imag / slow, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("wedge", "filling"), CASES)
def test_sharp_stiffness_is_the_derivative_of_the_force_while_fronts_cross_nodes(wedge, filling):
    one = plain_film((320, 12))
    stiffness = CLEARANCE * solve(one, wedge, filling=filling).stiffness
    assert np.abs(stiffness).max() > 0.0
    close(slopes(lambda w: solve(one, tuple(w), filling=filling).force, np.array(wedge), 0.006), stiffness, 0.01)


def test_less_supply_carries_less():
    one = plain_film((80, 6))
    loads = [solve(one, (0.3, 0.4), filling=f).force[0] for f in (1.0, 0.9, 0.8, 0.7, 0.6)]
    assert (np.diff(loads) < 0.0).all(), loads
    assert 0.0 < loads[-1] < 0.5 * loads[0]


def test_random_films_settle_from_anywhere():
    rng = np.random.default_rng(11)
    one = grid, work = plain_film((80, 6))
    solved = 0
    for _ in range(150):
        wedge = (rng.uniform(-2.0, 0.9), rng.uniform(-1.5, 1.5))
        wave = np.outer(np.cos(rng.uniform(5, 30) * grid.angle + 1.0), 1.0 + np.sin(rng.uniform(0, 90) * grid.z))
        work.extra[:] = 0.15 * CLEARANCE * wave
        found = []
        for start in (np.zeros_like(work.ruptured), rng.random(work.ruptured.shape) < 0.5):
            work.ruptured[:] = start
            forces = conserving(0.9)(*one, lengths(wedge), SPEED, False)
            found.append(forces.force)
            assert forces.steps != -2
        solved += forces.steps > 0
        np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-9)
    assert solved > 80


EXCITATION = 2 * math.pi * np.array([10.0, 25.0, 50.0])


def run(bearing: Bearing, load: float = LOAD, cavitation: str = "jfo", **more: Any) -> Prediction:
    given = {"excitation": EXCITATION, "mesh": (40, 4), "options": Options(cavitation=cavitation)}
    return points.run(bearing, load=load, **given | more)


@pytest.mark.parametrize("load", [2500.0, 8750.0])
@pytest.mark.parametrize("thermal", ["isothermal", "adiabatic"])
def test_the_papers_bearings_do_not_notice(rocker, spherical, thermal, load):
    # their films rupture towards the trailing edge, if at all, and do not form again
    for bearing in (rocker, spherical):
        with_mass = run(bearing, load, thermal=thermal)
        close(with_mass.h, run(bearing, load, "swift-stieber", thermal=thermal).h, 1e-9)
    assert any(f.work.ruptured[1:].any() for f in with_mass.equilibrium.films) is (load > 5000.0)


def test_pads_that_are_held_notice(rocker):
    """Pads on stiff flexures or stuck rockers open towards the flow: Swift-Stieber fills that gap from nowhere."""
    held = [Effect("pivot_rotation", rotational_stiffness=5e4)]
    slow = {"speed": 2 * math.pi * 10.0, "excitation": 2 * math.pi * 25.0, "effects": held}
    without, conserved = (run(rocker, cavitation=name, **slow) for name in CAVITATION)
    assert conserved.cxx == pytest.approx(0.9 * without.cxx, rel=0.01)
    assert conserved.kxx == pytest.approx(0.991 * without.kxx, rel=0.002)


def test_what_lies_behind_the_rupture_is_known(spherical):
    p = run(spherical, 8750.0)
    film = p.equilibrium.films[0]
    wedge = film.wedge
    theta = fluid_fraction(film.grid, film.work, wedge, points.SPEED * spherical.journal_radius)
    ruptured = film.work.ruptured.copy()
    ruptured[0] = False
    assert ruptured.any()
    assert (theta[~ruptured] == 1.0).all()
    assert 0.5 < theta[ruptured].min() < theta[ruptured].max() < 1.0


def test_bending_pads_and_warm_starts(rocker):
    bending = {"thermal": "tehd", "mesh": (32, 4)}
    cold, warm = (run(rocker, 8750.0, start=start, **bending) for start in (None, run(rocker, 8000.0, **bending)))
    close(warm.h, cold.h, 1e-4)
