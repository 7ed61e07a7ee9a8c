"""What enters and leaves the films: balances, hot oil round the ring, idle pads, named regimes, numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from model.effects import Effect
from model.film.mesh import film_grid
from model.film.oil_state import Running, edge_flows
from model.film.resting import resting_film
from model.predict import predict
from model.setup import Mesh
from model.statics.pad_film import oil_constants
from model.statics.pad_flow import striation, through_flow
from tests.model.points import DOWN, LOAD, SPEED, run
from tests.rigs.bearings import changed_pads

HELD = Effect("pivot_rotation", rotational_stiffness=1e6)


def test_what_enters_a_full_film_leaves_it(rocker):
    p = run(rocker, load=3000.0)
    for film in p.equilibrium.films:
        assert not film.work.ruptured.any()
        entering, leaving = through_flow(film)
        assert entering == pytest.approx(leaving + edge_flows(film.grid, film.work, math.inf)[1], rel=1e-9)


def test_streaks_carry_what_the_rupture_line_lets_pass(rocker):
    # pads pressed hard downstream of their pivots rupture there: what the balance leaves is what the streaks hold
    for mesh, tolerance in ((Mesh(80, 6), 0.03), (Mesh(320, 12), 0.015)):
        p = run(changed_pads(rocker, pivot_offset=0.35), HELD, load=8000.0, mesh=mesh)
        films = [f for f in p.equilibrium.films if f.forces is not None and f.work.ruptured[-2].any()]
        films = [f for f in films if not f.work.ruptured[1].any()]  # nothing made up at the inlet
        assert films
        for film in films:
            streaks = 2.0 * float((film.work.flow_x[-1] * striation(film.work)[-2]).sum())
            assert through_flow(film)[1] == pytest.approx(streaks, rel=tolerance)


@pytest.mark.parametrize("fraction", [0.3, 0.8, 0.98])
def test_hot_oil_goes_round_with_a_flow_balance(rocker, fraction):
    flow = run(rocker, Effect("hot_oil_carryover", fraction=fraction)).pad_flow
    for k in range(5):  # pad 5, at 198 deg, feeds pad 1, at 270 deg
        oil, before = rocker.oil, flow[k - 1]
        passed = fraction * before.outflow * oil.density(before.outlet) / (flow[k].inflow * oil.density(flow[k].inlet))
        assert flow[k].inlet - 40.0 == pytest.approx(min(1.0, passed) * (before.outlet - 40.0), abs=2e-3)


@pytest.mark.slow
def test_hot_oil_converges_on_bearings_of_all_kinds(rocker):
    rng = np.random.default_rng(19)
    failed = []
    for case in range(60):
        cp = rng.uniform(8e-5, 2e-4)
        pads = tuple(replace(p, pad_clearance=cp, assembled_clearance=cp * rng.uniform(0.4, 1.0)) for p in rocker.pads)
        p = predict(
            rocker.with_pads(pads), 10.0 ** rng.uniform(2.7, 4.1), rng.uniform(-math.pi, math.pi),
            2 * math.pi * rng.uniform(10, 120), mesh=(40, 4),
            effects=[Effect("hot_oil_carryover", fraction=rng.uniform(0.3, 0.98))],
        )  # fmt: skip
        if not p.converged:
            failed.append((case, p.status))
    assert len(failed) <= 1, failed


def test_a_resting_film_heats_and_shears_as_its_equation_says(rocker):
    oil, speed = rocker.oil, 40.0
    grid = film_grid(-0.55, 0.55, 0.05, 0.07, (400, 4), True)
    cp, a = 130e-6, -25e-6
    running = Running(speed, oil_constants(oil), (oil.specific_heat / 0.8, oil.conductivity))
    rest = resting_film(grid, (cp, a), running, 45.0)

    def gap(angle: float) -> float:
        return cp - a * math.cos(angle)

    heat = float(oil.density(45.0)) * oil.specific_heat
    found = solve_ivp(
        lambda x, t: 0.8 * 2.0 * oil.viscosity(t) * speed / (heat * gap(x / 0.05 - 0.55) ** 2),
        (0.0, 0.055), [45.0], rtol=1e-10, atol=1e-10, dense_output=True,
    )  # fmt: skip
    assert rest.outlet == pytest.approx(float(found.y[0, -1]), abs=1e-5)
    lead = gap(-0.55)
    power = quad(
        lambda x: oil.viscosity(found.sol(x)[0]) * speed**2 * lead / gap(x / 0.05 - 0.55) ** 2 * 0.07, 0.0, 0.055
    )[0]
    assert rest.power == pytest.approx(power, rel=1e-5)
    assert rest.flow == pytest.approx(0.5 * oil.density(45.0) * speed * lead * 0.07, rel=1e-12)
    # the heat that stays is what the flow takes along
    assert rest.flow * oil.specific_heat * (rest.outlet - 45.0) == pytest.approx(0.8 * rest.power, rel=1e-3)


@pytest.mark.parametrize(("preload", "direction"), [(0.1, -90.0), (0.03, -54.0), (-0.02, -90.0)])
def test_idle_pads_of_isothermal_films_shear_oil_as_cold_as_it_enters(rocker, preload, direction):
    pads = tuple(replace(p, assembled_clearance=(1.0 - preload) * p.pad_clearance) for p in rocker.pads)
    bearing, turning = rocker.with_pads(pads), 2 * math.pi * 40
    p = run(bearing, load=9000.0, direction=math.radians(direction), speed=turning, thermal="isothermal")
    idle = [film for film in p.equilibrium.films if film.idle]
    assert idle
    surface, supply = turning * bearing.journal_radius, bearing.oil.supply_temperature
    viscosity, density = float(bearing.oil.viscosity(supply)), float(bearing.oil.density(supply))
    for film in idle:
        approach = film.preload_distance + film.normal @ p.equilibrium.position
        gap = film.pad.pad_clearance - approach * np.cos(film.grid.angle)
        shear = viscosity * surface**2 * gap[0] / gap**2
        power = np.trapezoid(np.where(gap > gap[0], shear, viscosity * surface**2 / gap), dx=film.grid.dx)
        assert film.resting.power == pytest.approx(power * bearing.length, rel=1e-9)
        assert film.resting.reynolds == pytest.approx(density * surface * gap.max() / viscosity, rel=1e-9)
        assert film.resting.outlet == supply


def test_power_loss_does_not_fall_when_pads_unload(rocker):
    # as the load grows the upper pads go idle, one film after the other; their oil is sheared on
    loads = np.linspace(6000.0, 18000.0, 13)
    points = [run(rocker, load=float(w)) for w in loads]
    idle = [len(p.idle_pads) for p in points]
    assert idle[0] == 0
    assert idle[-1] >= 2
    losses = np.array([p.power_loss for p in points])
    assert np.abs(np.diff(losses) / losses[:-1]).max() < 0.05
    p = points[-1]
    for film in p.equilibrium.films:
        assert (film.resting is not None) == film.idle
    flows = [p.pad_flow[k - 1] for k in p.idle_pads]
    assert all(f.leakage == 0.0 and f.inflow > 0.0 and f.outlet > f.inlet for f in flows)


def test_numbers_that_people_expect(rocker):
    p = run(rocker)
    mu = rocker.oil.viscosity(40.0)
    expected = mu * 22.0 * 0.09986 * 0.0696 / LOAD * (0.04993 / 80e-6) ** 2
    assert p.sommerfeld == pytest.approx(expected, rel=1e-12)
    assert p.eccentricity_ratio == pytest.approx(math.hypot(*p.bearing_position) / 80e-6)
    assert p.attitude_angle == pytest.approx(0.0, abs=1e-3)
    film = max(p.equilibrium.films, key=lambda f: f.work.thickness.max())
    local = SPEED * rocker.journal_radius * film.work.density * film.work.thickness / film.work.viscosity
    assert p.reynolds == pytest.approx(local.max(), rel=1e-9)
    assert 0.1 < run(rocker, HELD).attitude_angle < math.pi / 2  # a fixed pad lets the journal move on with rotation


def test_regimes_are_named(rocker):
    thin = replace(rocker, oil=replace(rocker.oil, viscosity_40=0.0004))
    fast = run(thin, load=200.0, speed=20 * SPEED, thermal="isothermal")
    named = [name for name in fast.status if name.startswith("film not laminar: Re ")]
    assert named == [f"film not laminar: Re {fast.reynolds:.0f}"]
    assert fast.reynolds > 1000.0
    cold = run(rocker, Effect("supply_temperature", change=-25.0))
    assert "oil beyond its data: 15 degC" in cold.status
    assert run(rocker).status == ()


def test_pads_in_each_others_way_are_named(rocker):
    def status(**changes: float) -> str:
        pads = (replace(rocker.pads[0], **changes), *rocker.pads[1:])
        return "; ".join(predict(rocker.with_pads(pads), LOAD, DOWN, SPEED).status)

    assert "interference: no clearance at pads 1" in status(assembled_clearance=-2e-6)
    assert "pads 5 and 1 overlap" in status(arc=math.radians(110.0))
    ring = changed_pads(rocker, arc=math.radians(72.0))
    assert "pads 1 and 2 touch" in predict(ring, LOAD, DOWN, SPEED).status
