"""Oil: what enters and leaves the films, hot oil round the ring, idle pads, named regimes, numbers; what grooves give:
films that conserve mass start where it suffices; pressure at the leading edge."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from model.bearing import BearingError
from model.bearing_file import load_bearing, parse_bearing
from model.effects import Effect
from model.film.mesh import film_grid
from model.film.oil_state import Running, edge_flows, set_viscosity
from model.film.resting import resting_film
from model.film.reynolds import solve_film
from model.options import Options
from model.predict import predict
from model.setup import Mesh
from model.statics.pad_film import oil_constants
from model.statics.pad_flow import striation, through_flow
from tests.model.points import DOWN, LOAD, SPEED, close, conserving, plain_film, run, slopes, solved
from tests.rigs.bearings import changed_oil, changed_pads

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
    fast = run(changed_oil(rocker, viscosity_40=0.0004), load=200.0, speed=20 * SPEED, thermal="isothermal")
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
    assert "negative preload of pads 1" in status(assembled_clearance=180e-6)
    assert "negative preload" not in status(assembled_clearance=130e-6)
    assert "pads 5 and 1 overlap" in status(arc=math.radians(110.0))
    ring = changed_pads(rocker, arc=math.radians(72.0))
    assert "pads 1 and 2 touch" in predict(ring, LOAD, DOWN, SPEED).status


QUICK, COARSE = 2 * math.pi * 60.0, (40, 4)
CLEARANCE, SURFACE = 1e-4, 20.0
CONSERVING = {"options": Options(cavitation="jfo")}
SUPPLIED = 0.5 * SURFACE * 860.0 * 0.7 * CLEARANCE
SHORT = {"solver": conserving(flow=SUPPLIED), "speed": SURFACE}


def short_film():
    return plain_film((40, 4), 0.05, oil=(0.03, 860.0))


def fed(bearing, litres_per_minute: float):
    return changed_oil(bearing, supply_flow=litres_per_minute / 60e3)


def test_a_film_short_of_oil_takes_what_there_is_and_keeps_it():
    one = grid, work = short_film()
    full = solved(one, (0.3, 0.25), speed=SURFACE)
    short = solved(one, (0.3, 0.25), **SHORT)
    assert work.ruptured[0, :-1].all()
    assert 0.3 * full.force[0] < short.force[0] < 0.99 * full.force[0]
    # what enters the pressed part of the film is what is supplied: the streaks before it carry no more
    begins = int(np.argmin(work.ruptured[:, 0]))
    assert begins > 1
    assert work.flow_x[begins, 0] / grid.height[0] == pytest.approx(SUPPLIED, rel=0.05)


def test_stiffness_of_a_film_short_of_oil_is_the_derivative_at_its_flow():
    def forces(wedge):
        return solved(short_film(), tuple(wedge), **SHORT)

    wedge = np.array([0.3, 0.25])
    close(CLEARANCE * forces(wedge).stiffness, slopes(lambda w: forces(w).force, wedge, 1e-4), 2e-3)


def test_a_pressed_leading_edge_adds_a_pressure_that_falls_along_a_long_even_film():
    grid, work = plain_film((40, 4), 50.0, 0.4, (0.03, 860.0))
    work.pressure[0, :-1] = 1e5
    force = solve_film(grid, work, (CLEARANCE, 0.0, 0.0), 1e-9, False).force
    x = (grid.angle - grid.angle[0]) / (grid.angle[-1] - grid.angle[0])
    expected = 1e5 * 0.05 * 50.0 * np.trapezoid((1.0 - x) * np.cos(grid.angle), grid.angle)
    assert force[0] == pytest.approx(expected, rel=0.05)  # at its sides the film leaks
    np.testing.assert_allclose(work.pressure[:, 0], 1e5 * (1.0 - x), atol=1.0)
    conserved = conserving()(grid, work, (CLEARANCE, 0.0, 0.0), 1e-9, False).force
    assert conserved == pytest.approx(force, rel=1e-9, abs=1e-3)


@pytest.mark.slow
def test_films_that_conserve_mass_keep_to_the_flow_of_their_grooves(rocker):
    point = {"speed": QUICK, "mesh": COARSE, "thermal": "isothermal", **CONSERVING}
    flooded, plenty, short = (run(bearing, **point) for bearing in (rocker, fed(rocker, 1000.0), fed(rocker, 18.0)))
    close(plenty.h, flooded.h, 1e-12)
    assert plenty.status == flooded.status
    assert "pads 3, 4 are short of oil" in short.status
    drawn = [flow.inflow for flow in short.pad_flow]
    assert drawn[2:4] == pytest.approx([18.0 / 60e3 / 5] * 2, rel=1e-9)
    assert max(drawn) == pytest.approx(drawn[2], rel=1e-9)
    assert short.pad_load[2] < 0.9 * flooded.pad_load[2]


@pytest.mark.slow
def test_hot_oil_from_the_pad_before_is_oil_too(rocker):
    carried, point = Effect("hot_oil_carryover", fraction=0.8), {"speed": QUICK, "mesh": COARSE, **CONSERVING}
    alone, helped = predict(fed(rocker, 16.0), 5000.0, **point), run(fed(rocker, 16.0), carried, **point)
    assert any("short of oil" in c for c in alone.status)
    assert not any("short of oil" in c for c in helped.status)


@pytest.mark.slow
def test_other_films_run_as_if_the_oil_sufficed_and_say_where_it_does_not(rocker):
    plain, thin = (run(bearing, speed=QUICK, mesh=COARSE) for bearing in (rocker, fed(rocker, 11.0)))
    np.testing.assert_allclose(thin.h, plain.h, rtol=1e-9)
    (said,) = [c for c in thin.status if "short of oil" in c]
    assert said.severity == "warning"
    assert said.pads == (1, 2, 3, 4, 5)
    assert said.detail.endswith("run as if it did")


@pytest.mark.slow
def test_a_pressed_leading_edge_carries(rocker):
    pressed = changed_pads(rocker, leading_edge_pressure=2e5)
    plain, lifted = (run(bearing, speed=QUICK, mesh=COARSE) for bearing in (rocker, pressed))
    assert sum(lifted.pad_load) > 1.05 * sum(plain.pad_load)
    again = run(pressed, speed=QUICK, mesh=COARSE, start=plain)
    np.testing.assert_allclose(again.h, lifted.h, rtol=1e-4)


def test_a_bearing_file_states_flow_and_pressure(rocker_file):
    text = rocker_file.read_text(encoding="utf-8")
    assert load_bearing(text).oil.supply_flow == math.inf
    stated = text.replace("[oil]", '[oil]\nsupply_flow = "12 L/min"').replace(
        "[pads]", '[pads]\nleading_edge_pressure = ["0.4 bar", "0.3 bar", "0 bar", "0 bar", "0 bar"]'
    )
    bearing = parse_bearing(stated, "bearing.toml")
    assert bearing.oil.supply_flow == pytest.approx(2e-4)
    assert [p.leading_edge_pressure for p in bearing.pads] == pytest.approx([4e4, 3e4, 0.0, 0.0, 0.0])
    with pytest.raises(BearingError, match=r"\[oil\] supply_flow: must be positive"):
        parse_bearing(text.replace("[oil]", '[oil]\nsupply_flow = "0 L/min"'), "bearing.toml")


def attitudes_without_moment(p, pad: int) -> int:
    """How many wedges of a pad's film, at the journal's place and its groove's flow, leave no moment."""
    film = p.equilibrium.films[pad - 1]
    oil = p.setup.bearing.oil
    set_viscosity(film.work, oil_constants(oil))
    surface = p.speed * p.setup.bearing.journal_radius
    approach = film.preload_distance + film.normal @ p.equilibrium.position
    moments = []
    for wedge in np.linspace(-4e-5, 1.2e-4, 161).tolist():
        film.work.ruptured[:] = False
        shape = (film.pad.pad_clearance, approach, wedge)
        forces = conserving(flow=film.supplied)(film.grid, film.work, shape, surface, False)
        moments.append(forces.force[1] if forces.steps > 0 and forces.force[0] > 1.0 else math.nan)
    signs = np.sign(moments)
    return int(np.sum(signs[1:] * signs[:-1] < 0))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_a_pad_whose_oil_fills_no_gap_idles(request, name):
    bearing = request.getfixturevalue(name)
    point = {"load_direction": DOWN, "speed": 138.23, "mesh": COARSE, "thermal": "isothermal", **CONSERVING}
    flooded = predict(bearing, 5000.0, **point)
    drawn = sum(flow.inflow for flow in flooded.pad_flow)
    idle = []
    for share in (1.4, 1.0, 0.9, 0.75, 0.6):
        p = predict(fed(bearing, 60e3 * share * drawn), 5000.0, **point)
        assert p.converged, (share, p.status)
        idle.append(set(p.idle_pads))
        for pad in p.idle_pads:
            assert attitudes_without_moment(p, pad) == 0
        (said,) = [c for c in p.status if "short of oil" in c] or [None]
        assert idle[-1] <= set(said.pads if said else ())
        carried = sum(p.pad_load[k] * np.array([math.cos(x.pivot_angle), math.sin(x.pivot_angle)])
                      for k, x in enumerate(bearing.pads))  # fmt: skip
        np.testing.assert_allclose(carried, [0.0, -5000.0], atol=5.0)
    assert idle[0] <= idle[1] <= idle[2] <= idle[3] <= idle[4]
    assert idle[-1]
