"""The film kernel against integrals, an independent solver and itself."""

from typing import Any

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import FilmForces, solve_film
from tests.model.points import close, conserving, plain_film, slopes, solved

MU, SPEED, RADIUS, CLEARANCE = 0.03, 7.0, 0.05, 1e-4


def solve(
    shape: tuple[int, int], wedge: tuple[float, float], sharp: bool = False, solver: Any = solve_film, **more: Any
) -> tuple[FilmGrid, FilmWork, FilmForces]:
    """Solve one isoviscous film; `wedge` is (a, b) over the clearance."""
    one = plain_film(shape, **more)
    return *one, solved(one, wedge, sharp, solver)


def height(alpha: np.ndarray | float, wedge: tuple[float, float]) -> np.ndarray | float:
    return CLEARANCE * (1.0 - wedge[0] * np.cos(alpha) - wedge[1] * np.sin(alpha))


def long_bearing(wedge: tuple[float, float], arc: tuple[float, float]):
    """Pressure of an infinitely long film, p' = 6 mu U R (h - h*) / h^3, with Swift-Stieber rupture (Sommerfeld)."""

    def integral(power: int, end: float) -> float:
        return quad(lambda t: 1.0 / height(t, wedge) ** power, arc[0], end, epsabs=0, epsrel=1e-11)[0]

    def end_pressure(end: float, level: float) -> float:
        return integral(2, end) - level * integral(3, end)

    level, edge = integral(2, arc[1]) / integral(3, arc[1]), arc[1]
    if level < height(arc[1], wedge):  # the film would have to pull at the end: it ruptures at dp/dx = 0
        lowest = np.arctan2(wedge[1], wedge[0])
        edge = brentq(lambda t: end_pressure(t, float(height(t, wedge))), lowest + 1e-6, arc[1])
        level = float(height(edge, wedge))

    def pressure(t: float) -> float:
        return 6.0 * MU * SPEED * RADIUS * end_pressure(t, level) if t < edge else 0.0

    return pressure, edge


@pytest.mark.parametrize(
    ("wedge", "ruptures"),
    [((0.0, 0.6), False), ((0.6, 0.3), False), ((0.85, 0.1), True)],
    ids=["slider", "pad", "deep"],
)
def test_infinitely_long_film_meets_sommerfelds_integral(wedge, ruptures):
    pressure, edge = long_bearing(wedge, (-0.5, 0.5))
    assert (edge < 0.5) is ruptures
    worst = []
    for nt in (40, 80, 160):
        grid, work, _ = solve((nt, 2), wedge, length=100.0)
        exact = np.array([pressure(t) for t in grid.angle])
        worst.append(np.abs(work.pressure[:, 0] - exact).max() / exact.max())
    assert worst[1] < 2e-3
    assert worst[2] < worst[0] / 10.0  # second order: a sixteenth, with room for where the nodes fall


def test_infinitely_short_film_meets_ocvirks_parabola():
    wedge, length = (0.5, 0.3), 5e-4
    grid, work, _ = solve((400, 8), wedge, length=length)
    slope = CLEARANCE * (wedge[0] * np.sin(grid.angle) - wedge[1] * np.cos(grid.angle)) / RADIUS
    h = height(grid.angle, wedge)
    exact = np.maximum(-3.0 * MU * SPEED * slope / h**3, 0.0)[:, None] * (0.25 * length**2 - grid.z**2)
    inside = slice(20, -20)  # the pressure must drop to zero at the ends within a length or so
    assert np.abs(work.pressure - exact)[inside].max() < 2e-3 * exact.max()


def reference_force(grid: FilmGrid, wedge: tuple[float, float], rates: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Film force with squeeze, da/dt and db/dt [m/s]: another matrix, another solver, the same equation."""
    nz = len(grid.z) - 1
    node, face = height(grid.angle, wedge), height(0.5 * (grid.angle[1:] + grid.angle[:-1]), wedge)
    gx = face[:, None] ** 3 / (12 * MU) * grid.height[:-1] / grid.dx
    gz = node[1:-1, None] ** 3 / (12 * MU) * grid.dx / grid.dz
    beside = np.where(np.arange(nz) < nz - 1, gz, 0.0)  # the last of a line has the edge beside it
    whole = gx[1:] + gx[:-1] + gz + np.roll(beside, 1, axis=1)
    links = (gx[1:-1].ravel(), nz), (beside.ravel()[:-1], 1)
    matrix = sum((sparse.diags([-g, -g], [-n, n]) for g, n in links), sparse.diags(whole.ravel())).tocsr()
    squeeze = -(rates[0] * np.cos(grid.angle[1:-1]) + rates[1] * np.sin(grid.angle[1:-1]))
    source = -(0.5 * SPEED * np.diff(face) + squeeze * grid.dx)[:, None] * grid.height[:-1]
    wet = np.ones(source.size, bool)
    for _ in range(100):
        p = np.zeros(source.size)
        keep = np.flatnonzero(wet)
        p[keep] = spsolve(matrix[keep][:, keep].tocsc(), source.ravel()[keep])
        residual = matrix @ p - source.ravel()
        new = np.where(wet, p > 0.0, residual < 0.0)
        if (new == wet).all():
            break
        wet = new
    else:
        raise AssertionError("reference active set did not settle")
    weighted = (p.reshape(source.shape) * grid.area[1:-1, :-1]).sum(axis=1)
    return np.array([weighted @ grid.cos[1:-1], weighted @ grid.sin[1:-1]])


@pytest.mark.parametrize("wedge", [(0.7, 0.15), (0.9, 0.08), (-0.4, 0.5), (-0.6, 0.1)])
def test_force_is_an_independent_solver_s(wedge):
    grid, _, forces = solve((80, 6), wedge)
    np.testing.assert_allclose(forces.force, reference_force(grid, wedge), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("wedge", [(0.6, 0.25), (0.85, 0.1), (0.2, 0.4)])
def test_stiffness_and_damping_are_differences_of_an_independent_solvers_forces(wedge):
    grid, _, forces = solve((160, 8), wedge, sharp=True)
    step = 0.003  # of the clearance: small against the film, large enough that the rupture line crosses nodes
    stiffness = slopes(lambda place: reference_force(grid, tuple(place)), np.array(wedge), step)
    slow = step * SPEED * CLEARANCE / RADIUS
    damping = slopes(lambda rates: reference_force(grid, wedge, tuple(rates)), np.zeros(2), slow)
    close(CLEARANCE * forces.stiffness, stiffness, 2e-3)
    close(forces.damping, damping, 2e-3)


@pytest.mark.parametrize("wedge", [(0.6, 0.25), (-0.3, 0.5)])
def test_plain_stiffness_is_the_derivative_of_the_discrete_force(wedge):
    stiffness = solve((80, 6), wedge)[2].stiffness
    step = 1e-6  # small enough that no node changes sides
    close(CLEARANCE * stiffness, slopes(lambda w: solve((80, 6), tuple(w))[2].force, np.array(wedge), step), 2e-6)


@pytest.mark.parametrize("wedge", [(0.6, 0.25), (0.85, 0.1), (-0.3, 0.5)])
def test_half_speed_whirl_takes_the_pressure_away(wedge):
    # squeeze rates (da, db)/dt = U / 2R (-b, a) cancel the wedge term of Eq. (2) at every angle
    _, _, forces = solve((320, 12), wedge, sharp=True)
    rates = 0.5 * SPEED / RADIUS * CLEARANCE * np.array([-wedge[1], wedge[0]])
    np.testing.assert_allclose(forces.damping @ rates, -forces.force, atol=2e-3 * np.hypot(*forces.force))


@pytest.mark.parametrize(
    ("wedge", "filling", "least"),
    [
        ((0.0, 0.5), None, 1.3),
        ((0.65, 0.2), None, 1.3),
        ((0.9, 0.08), None, 1.3),
        # fronts that run across the mesh fall between its nodes by chance: between the first and the second order
        ((-1.0, 0.1), 1.0, 0.8),
        ((0.3, 0.4), 0.7, 0.8),
    ],
)
def test_forces_and_coefficients_converge_with_second_order(wedge, filling, least):
    solver = solve_film if filling is None else conserving(filling)
    fine = solve((320, 24), wedge, True, solver)[2]
    errors = []
    for scale in (1, 2, 4):
        f = solve((32 * scale, 2 * scale), wedge, True, solver)[2]
        errors.append([np.abs(a - b).max() / np.abs(b).max() for a, b in zip(f[:3], fine[:3], strict=True)])
    assert (errors[2] < np.array([1e-3, 5e-3, 5e-3])).all(), errors
    order = np.log2(np.array(errors)[0] / np.array(errors)[2]) / 2.0
    assert order[0] > 1.7  # force
    # the rupture line falls between nodes by chance: single steps scatter, two halvings show the order
    assert (order[1:] > least).all(), order


@pytest.mark.parametrize(
    ("solver", "wedge", "share"), [(solve_film, (0.6, 0.3), 1e-10), (conserving(), (-1.0, 0.1), 1e-9)]
)
def test_half_width_is_the_mirrored_whole(solver, wedge, share):
    half = solve((60, 4), wedge, sharp=True, solver=solver)[2]
    whole = solve((60, 8), wedge, sharp=True, symmetric=False, solver=solver)[2]
    for got, want in zip(half[:3], whole[:3], strict=True):
        close(got, want, share)


def test_active_set_settles_on_fine_meshes():
    # the rupture line travels one node per step, so that a cold start needs steps in proportion to the mesh
    _, coarse, _ = solve((80, 2), (0.9, 0.08))
    _, work, forces = solve((1280, 2), (0.9, 0.08))
    assert forces.steps > 60
    assert work.ruptured[:, 0].mean() == pytest.approx(coarse.ruptured[:, 0].mean(), abs=0.02)


@pytest.mark.parametrize("solver", [solve_film, conserving()])
def test_touching_film_is_reported(solver):
    forces = solver(*plain_film((40, 4)), (CLEARANCE, 1.2 * CLEARANCE, 0.0), SPEED, False)
    assert forces.steps == -1
    assert forces.min_film < 0.0
