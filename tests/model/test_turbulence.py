"""Turbulent film of Ng and Pan: laminar limit, published factors, a slider by quadrature, derivatives, heat, mesh."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from model.bearing import Bearing
from model.dynamics import bearing_impedance
from model.film.cross_energy import cross_operator
from model.film.cross_film import CrossOperator, cross_film, set_cross_viscosity
from model.film.mesh import film_grid, film_work
from model.film.reynolds import solve_film
from model.film.turbulence import ACROSS, ALONG, SHEAR, excess
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict, predict_setup
from model.prediction import Prediction
from model.setup import Mesh, Setup

DOWN, FAST = -math.pi / 2, 2 * math.pi * 150.0
TURBULENT = Options(turbulence="ng-pan")


def thin(bearing: Bearing, share: float = 0.02) -> Bearing:
    return replace(bearing, oil=replace(bearing.oil, viscosity_40=share * bearing.oil.viscosity_40))


def run(bearing: Bearing, thermal: str = "isothermal", load: float = 2000.0, mesh: Mesh | None = None) -> Prediction:
    p = predict(bearing, load, DOWN, FAST, thermal=thermal, options=TURBULENT, mesh=mesh)
    assert p.converged
    return p


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
    thick = thin(rocker, 500.0)
    laminar = predict(thick, 1e4, DOWN, 1e-2, thermal="isothermal", pivots="rigid")
    p = predict(thick, 1e4, DOWN, 1e-2, thermal="isothermal", pivots="rigid", options=TURBULENT)
    assert p.reynolds < 2e-5
    np.testing.assert_allclose(p.h, laminar.h, rtol=1e-9, atol=1e-9 * np.abs(laminar.h).max())


def film(a: float, b: float, speed: float, length: float, shape: tuple[int, int], turbulent: bool | None = True):
    grid = film_grid(-0.5, 0.5, 0.05, length, shape, True)
    work = film_work(grid, 40.0)
    work.viscosity[:], work.density[:] = 7e-4, 850.0
    more = () if turbulent is None else (turbulent,)  # a laminar film as everybody asks for it: it is compiled already
    return solve_film(grid, work, (1.2e-4, a, b), speed, True, *more), work, grid


def test_an_endless_slider_is_its_quadrature():
    speed, a, b = 45.0, 2e-5, 5e-5
    _, work, grid = film(a, b, speed, 50.0, (320, 4))

    def gap(x: float) -> float:
        return 1.2e-4 - a * math.cos(x) - b * math.sin(x)

    def slope(x: float, flow: float) -> float:
        h = gap(x)
        k = 12.0 + 0.0136 * (850.0 * speed * h / 7e-4) ** 0.9
        return k * 7e-4 / h**3 * (0.5 * speed * h - flow) * 0.05

    ends = [0.5 * speed * gap(x) for x in (-0.5, 0.5)]
    flow = brentq(lambda q: quad(slope, -0.5, 0.5, args=(q,))[0], min(ends), max(ends), rtol=1e-14)
    for i in (80, 160, 240):
        exact = quad(slope, -0.5, grid.angle[i], args=(flow,))[0]
        assert work.pressure[i, 0] == pytest.approx(exact, rel=2e-4)
    assert work.pressure.max() > 3.0 * film(a, b, speed, 50.0, (320, 4), None)[1].pressure.max()


@pytest.mark.parametrize(("a", "b"), [(2e-5, 5e-5), (5e-5, 2e-5)])
def test_stiffness_is_the_slope_of_the_force(a, b):
    step = 1e-10
    there = film(a, b, 45.0, 0.07, (80, 6))[0]
    for axis, move in enumerate(((step, 0.0), (0.0, step))):
        ends = [film(a + s * move[0], b + s * move[1], 45.0, 0.07, (80, 6))[0].force for s in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(there.stiffness[:, axis], slope, rtol=2e-3, atol=1e-4 * abs(slope).max())


def test_the_slope_of_the_locus_is_the_stiffness(rocker):
    setup = Setup(thin(rocker), pivot_laws("kirk", rocker), "isothermal", options=TURBULENT, accuracy=1e-11)
    points = [predict_setup(setup, load, DOWN, FAST, FAST) for load in (2000.0, 1996.0, 2004.0)]
    slope = (points[2].position - points[1].position) / 8.0
    slow = bearing_impedance(setup, points[0].equilibrium, np.array([1e-6]))[0].real
    np.testing.assert_allclose(slow @ slope, [0.0, -1.0], atol=5e-3)


def test_the_work_of_the_journal_heats_the_oil(rocker):
    p = run(thin(rocker, 0.05), "adiabatic")
    heat = rocker.oil.specific_heat
    total = 0.0
    for one in p.equilibrium.films:
        work = one.work
        assert not work.ruptured.any()
        side = work.flow_z[:, -1].copy()
        side[1:-1] += work.flow_x[:-1, -1] - work.flow_x[1:, -1]
        side[[0, -1]] *= 0.5
        rise = work.temperature - 40.0
        total += 2.0 * heat * float(work.flow_x[-1] @ rise[-1] + side @ rise[:, -1])
    assert p.power_loss == pytest.approx(total, rel=0.01)
    assert p.power_loss > 1.5 * predict(thin(rocker, 0.05), 2000.0, DOWN, FAST).power_loss


def test_second_order_in_the_mesh(rocker):
    meshes = (Mesh(20, 2), Mesh(40, 4), Mesh(80, 8), Mesh(160, 16))
    kyy, cyy = np.array([(p.kyy, p.cyy) for p in (run(thin(rocker), mesh=m) for m in meshes)]).T
    for values in (kyy, cyy):
        errors = np.abs(values[:-1] / values[-1] - 1.0)
        assert errors[1] < errors[0] / 3.0
        assert errors[2] < 2e-3


def test_a_turbulent_film_is_asked_for_by_name(rocker):
    assert not any("laminar" in name for name in run(thin(rocker)).status)
    assert any("film not laminar" in name for name in predict(thin(rocker), 2000.0, DOWN, FAST).status)
    with pytest.raises(ValueError, match="turbulence must be one of none, ng-pan"):
        Options(turbulence="ngpan")
    with pytest.raises(ValueError, match="ruptures by swift-stieber"):
        Options(turbulence="ng-pan", cavitation="jfo")


def across(reynolds: float, cells: int = 6):
    """A film of one temperature and of a Reynolds number at its middle, with eddies across it."""
    grid = film_grid(-0.5, 0.5, 0.05, 0.07, (80, 6), True)
    work, oil = film_work(grid, 40.0), (7e-4, 0.0, 850.0, 0.0)
    cross = cross_film(work, 40.0, cells)
    speed = reynolds * 7e-4 / (850.0 * 1e-4)
    work.thickness[:] = 1e-4
    set_cross_viscosity(cross, work, oil, (speed, 2000.0 / 0.13))
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
    plain = film_work(grid, 40.0)
    plain.viscosity[:], plain.density[:] = 7e-4, 850.0
    wedge = (1.2e-4, 2e-5, 5e-5)
    ours, theirs = (solve_film(grid, w, wedge, speed, True, True) for w in (work, plain))
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
    laminar = predict(thin_oil, 2000.0, DOWN, FAST, thermal="thd")
    spread = [float(np.ptp(q.equilibrium.films[0].cross.temperature, axis=2).max()) for q in (p, laminar)]
    assert spread[0] < 0.7 * spread[1]


def test_below_a_reynolds_number_of_500_the_film_across_is_laminar(rocker):
    laminar = predict(rocker, 5000.0, DOWN, 138.23, thermal="thd")
    p = predict(rocker, 5000.0, DOWN, 138.23, thermal="thd", options=TURBULENT)
    np.testing.assert_allclose(p.h, laminar.h, rtol=1e-9)
