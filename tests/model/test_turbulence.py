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
from model.film.mesh import film_grid, film_work
from model.film.reynolds import solve_film
from model.film.turbulence import ACROSS, ALONG, SHEAR, excess, solve_turbulent_film
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
    assert excess(499.0, *ALONG) == (0.0, 0.0)
    for reynolds in (1000.0, 5e4):
        more, rate = excess(reynolds, *ALONG)
        assert more == pytest.approx(0.0136 * reynolds**0.9, rel=1e-12)
        assert rate == pytest.approx(0.9 * more, rel=1e-12)
    for reynolds in (600.0, 750.0, 990.0, 3000.0):  # the slope by ln Re is one
        ends = [excess(reynolds * math.exp(step), *ALONG)[0] for step in (1e-5, -1e-5)]
        assert excess(reynolds, *ALONG)[1] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5)


def test_thick_oil_is_laminar(rocker):
    thick = thin(rocker, 1e5)
    laminar = predict(thick, 2e6, DOWN, 1e-2, thermal="isothermal", pivots="rigid")
    p = predict(thick, 2e6, DOWN, 1e-2, thermal="isothermal", pivots="rigid", options=TURBULENT)
    assert p.reynolds < 1e-7
    np.testing.assert_allclose(p.h, laminar.h, rtol=1e-9, atol=1e-9 * np.abs(laminar.h).max())


def film(a: float, b: float, speed: float, length: float, shape: tuple[int, int], solver=solve_turbulent_film):
    grid = film_grid(-0.5, 0.5, 0.05, length, shape, True)
    work = film_work(grid, 40.0)
    work.viscosity[:], work.density[:] = 7e-4, 850.0
    return solver(grid, work, (1.2e-4, a, b), speed, True), work, grid


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
    assert work.pressure.max() > 3.0 * film(a, b, speed, 50.0, (320, 4), solve_film)[1].pressure.max()


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
