"""Turbulent film of Ng and Pan: laminar limit, published factors, a slider by quadrature, derivatives, heat, mesh."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from model.bearing import Bearing
from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossOperator, cross_film, set_cross_viscosity
from model.film.reynolds import solve_film
from model.film.turbulence import ACROSS, ALONG, SHEAR, excess
from model.options import Options
from model.prediction import Prediction
from model.setup import Mesh
from tests.model import points
from tests.model.points import close, plain_film, slopes, solved
from tests.rigs.bearings import changed_oil

FAST, CLEARANCE = 2 * math.pi * 150.0, 1.2e-4
TURBULENT = Options(turbulence="ng-pan")


def thin(bearing: Bearing, share: float = 0.02) -> Bearing:
    return changed_oil(bearing, viscosity_40=share * bearing.oil.viscosity_40)


def run(bearing: Bearing, thermal: str = "isothermal", options: Options = TURBULENT, **more: Any) -> Prediction:
    return points.run(bearing, load=2000.0, speed=FAST, thermal=thermal, options=options, **more)


def test_constants_are_the_published_ones():
    # kx = 12 + 0.0136 Re^0.9, kz = 12 + 0.0043 Re^0.96
    assert 12 + ALONG[0] * 1e4 ** ALONG[1] == pytest.approx(66.14, abs=0.01)
    assert 12 + ACROSS[0] * 1e4 ** ACROSS[1] == pytest.approx(41.75, abs=0.01)
    assert 1 + SHEAR[0] * 1e4 ** SHEAR[1] == pytest.approx(7.906, abs=0.01)


def test_turbulence_comes_in_between_500_and_1000():
    assert excess(499.0, ALONG) == (0.0, 0.0)
    for reynolds in (1000.0, 5e4):
        more, rate = excess(reynolds, ALONG)
        assert more == pytest.approx(0.0136 * reynolds**0.9, rel=1e-12)
        assert rate == pytest.approx(0.9 * more, rel=1e-12)
    for reynolds in (600.0, 750.0, 990.0, 3000.0):  # the slope by ln Re is one
        ends = [excess(reynolds * math.exp(step), ALONG)[0] for step in (1e-5, -1e-5)]
        assert excess(reynolds, ALONG)[1] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5)


def test_thick_oil_is_laminar(rocker):
    slow = {"load": 1e4, "speed": 5e-2, "thermal": "isothermal", "pivots": "rigid"}
    laminar, p = (points.run(thin(rocker, 100.0), **slow, options=o) for o in (Options(), TURBULENT))
    assert p.reynolds < 1e-3
    close(p.h, laminar.h, 1e-9)


def turbulent(*given):
    return solve_film(*given, True)


def solve(wedge, solver=turbulent, length: float = 0.07, shape: tuple[int, int] = (80, 6)):
    one = plain_film(shape, length, oil=(7e-4, 850.0))
    return solved(one, wedge, True, solver, 45.0, CLEARANCE), *one


def test_an_endless_slider_is_its_quadrature():
    speed, a, b = 45.0, 2e-5, 5e-5
    wedge = a / CLEARANCE, b / CLEARANCE
    _, grid, work = solve(wedge, length=50.0, shape=(320, 4))

    def gap(x: float) -> float:
        return CLEARANCE - a * math.cos(x) - b * math.sin(x)

    def slope(x: float, flow: float) -> float:
        h = gap(x)
        k = 12.0 + 0.0136 * (850.0 * speed * h / 7e-4) ** 0.9
        return k * 7e-4 / h**3 * (0.5 * speed * h - flow) * 0.05

    ends = [0.5 * speed * gap(x) for x in (-0.5, 0.5)]
    flow = brentq(lambda q: quad(slope, -0.5, 0.5, args=(q,))[0], min(ends), max(ends), rtol=1e-14)
    for i in (80, 160, 240):
        exact = quad(slope, -0.5, grid.angle[i], args=(flow,))[0]
        assert work.pressure[i, 0] == pytest.approx(exact, rel=2e-4)
    laminar = solve(wedge, solve_film, 50.0, (320, 4))[2]
    assert work.pressure.max() > 3.0 * laminar.pressure.max()


@pytest.mark.parametrize("wedge", [(1 / 6, 5 / 12), (5 / 12, 1 / 6)])
def test_stiffness_is_the_slope_of_the_force(wedge):
    there, step = solve(wedge)[0], 1e-10 / CLEARANCE
    close(CLEARANCE * there.stiffness, slopes(lambda w: solve(tuple(w))[0].force, np.array(wedge), step), 1e-3)


def test_second_order_in_the_mesh(rocker):
    meshes = (Mesh(20, 2), Mesh(40, 4), Mesh(80, 8), Mesh(160, 16))
    kyy, cyy = np.array([(p.kyy, p.cyy) for p in (run(thin(rocker), mesh=m) for m in meshes)]).T
    for values in (kyy, cyy):
        errors = np.abs(values[:-1] / values[-1] - 1.0)
        assert errors[1] < errors[0] / 3.0
        assert errors[2] < 2e-3


def test_a_turbulent_film_is_asked_for_by_name(rocker):
    assert not any("laminar" in name for name in run(thin(rocker)).status)
    laminar = run(thin(rocker), "adiabatic", Options())
    assert any("film not laminar" in name for name in laminar.status)


def across(reynolds: float, cells: int = 6):
    """A film of one temperature and of a Reynolds number at its middle, with eddies across it."""
    grid, work = plain_film((80, 6))
    cross = cross_film(work, 40.0, cells)
    speed = reynolds * 7e-4 / (850.0 * 1e-4)
    work.thickness[:] = 1e-4
    set_cross_viscosity(cross, work, (7e-4, 0.0, 850.0, 0.0), (speed, 2000.0 / 0.13))
    return grid, work, cross, speed


@pytest.mark.parametrize("reynolds", [1000.0, 2000.0, 5000.0, 2e4])
def test_eddies_across_the_film_are_those_of_ng_and_pan(reynolds):
    # their factors are fits to the same law of the wall, integrated across
    coarse, fine = across(reynolds), across(reynolds, 60)
    for _, work, cross, _ in (coarse, fine):
        np.testing.assert_allclose(work.viscosity, 7e-4, rtol=1e-12)  # which the factors lower
        assert cross.shear[0, 0] / 7e-4 == pytest.approx(1.0 + 0.0012 * reynolds**0.94, rel=0.04)
    cross = fine[2]
    middle, wide = 0.5 * (cross.edges[1:] + cross.edges[:-1]), np.diff(cross.edges)
    driven = 12.0 * 7e-4 * float((wide * cross.fluidity[0, 0] * ((middle - 0.5) ** 2 + wide**2 / 12.0)).sum())
    assert 12.0 / driven == pytest.approx(12.0 + 0.0043 * reynolds**0.96, rel=0.05)


def test_a_turbulent_film_of_one_temperature_across_is_the_film_without_cells():
    grid, work, _, speed = across(4000.0)
    both = (grid, work), plain_film((80, 6), oil=(7e-4, 850.0))
    ours, theirs = (solved(one, (1 / 6, 5 / 12), True, turbulent, speed, CLEARANCE) for one in both)
    for name in ("force", "stiffness", "damping"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-9)


def test_heat_made_across_a_turbulent_film_is_the_work_of_its_shear_and_little_more():
    grid, work, cross, speed = across(4000.0)
    for _ in range(3):  # eddies by the film's own thickness
        solve_film(grid, work, (1.2e-4, 2e-5, 5e-5), speed, False, True)
        set_cross_viscosity(cross, work, (7e-4, 0.0, 850.0, 0.0), (speed, 2000.0 / 0.13))
    operator = CrossOperator.place(*cross.temperature.shape)
    cross_operator(grid, work, cross, speed, (2000.0, 0.13, 1.0, 1.0, 0.0), operator)
    shear = cross.shear * speed**2 / work.thickness
    made = 2.0 * operator.dissipation.sum()
    weight = 2.0 * grid.dx * np.where(np.arange(81) % 80, 1.0, 0.5)[:, None] * grid.height
    plain = float((weight * shear).sum())
    assert plain < made < 1.1 * plain


def test_temperatures_across_a_turbulent_film(rocker):
    thin_oil = thin(rocker, 0.05)
    p = run(thin_oil, "thd")
    flat = run(thin_oil, "adiabatic")
    assert p.reynolds > 1500.0
    assert p.power_loss == pytest.approx(flat.power_loss, rel=0.15)
    np.testing.assert_allclose(np.diag(p.k), np.diag(flat.k), rtol=0.25)
    # eddies mix what a laminar film keeps apart
    laminar = run(thin_oil, "thd", Options())
    spread = [float(np.ptp(q.equilibrium.films[0].cross.temperature, axis=2).max()) for q in (p, laminar)]
    assert spread[0] < 0.7 * spread[1]


def test_below_a_reynolds_number_of_500_the_film_across_is_laminar(rocker):
    laminar, p = (points.run(rocker, thermal="thd", options=o) for o in (Options(), TURBULENT))
    np.testing.assert_allclose(p.h, laminar.h, rtol=1e-9)
