"""Oil that the grooves give: films that conserve mass start where it suffices; pressure at the leading edge."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import model
from model.bearing import BearingError
from model.bearing_file import load_bearing, parse_bearing
from model.effects import Effect
from model.film.cavitation import solve_film_jfo
from model.film.oil_state import set_viscosity
from model.film.reynolds import solve_film
from model.options import Options
from model.predict import predict
from model.statics.pad_film import oil_constants
from tests.model.points import DOWN, close, plain_film, run, slopes, solved

SPEED, COARSE = 2 * math.pi * 60.0, (40, 4)
CLEARANCE, SURFACE = 1e-4, 20.0
CONSERVING = {"options": Options(cavitation="jfo")}
SUPPLIED = (1.0, 0.5 * SURFACE * 860.0 * 0.7 * CLEARANCE)


def short_film():
    return plain_film((40, 4), 0.05, oil=(0.03, 860.0))


def supplied_film(*given):
    return solve_film_jfo(*given, SUPPLIED)


def fed(bearing, litres_per_minute: float):
    return replace(bearing, oil=replace(bearing.oil, supply_flow=litres_per_minute / 60e3))


def pressed(bearing, pressure: float):
    return bearing.with_pads(tuple(replace(p, leading_edge_pressure=pressure) for p in bearing.pads))


def test_a_film_short_of_oil_takes_what_there_is_and_keeps_it():
    one = grid, work = short_film()
    full = solved(one, (0.3, 0.25), speed=SURFACE)
    short = solved(one, (0.3, 0.25), solver=supplied_film, speed=SURFACE)
    assert work.ruptured[0, :-1].all()
    assert 0.3 * full.force[0] < short.force[0] < 0.99 * full.force[0]
    # what enters the pressed part of the film is what is supplied: the streaks before it carry no more
    begins = int(np.argmin(work.ruptured[:, 0]))
    assert begins > 1
    assert work.flow_x[begins, 0] / grid.height[0] == pytest.approx(SUPPLIED[1], rel=0.05)


def test_stiffness_of_a_film_short_of_oil_is_the_derivative_at_its_flow():
    def forces(wedge):
        return solved(short_film(), tuple(wedge), solver=supplied_film, speed=SURFACE)

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
    conserved = solve_film_jfo(grid, work, (CLEARANCE, 0.0, 0.0), 1e-9, False, (1.0, np.inf)).force
    assert conserved == pytest.approx(force, rel=1e-9, abs=1e-3)


@pytest.mark.slow
def test_films_that_conserve_mass_keep_to_the_flow_of_their_grooves(rocker):
    point = {"speed": SPEED, "mesh": COARSE, "thermal": "isothermal", **CONSERVING}
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
    carried, point = Effect("hot_oil_carryover", fraction=0.8), {"speed": SPEED, "mesh": COARSE, **CONSERVING}
    alone, helped = predict(fed(rocker, 16.0), 5000.0, **point), run(fed(rocker, 16.0), carried, **point)
    assert any("short of oil" in c for c in alone.status)
    assert not any("short of oil" in c for c in helped.status)


@pytest.mark.slow
def test_other_films_run_as_if_the_oil_sufficed_and_say_where_it_does_not(rocker):
    plain, thin = (run(bearing, speed=SPEED, mesh=COARSE) for bearing in (rocker, fed(rocker, 11.0)))
    np.testing.assert_allclose(thin.h, plain.h, rtol=1e-9)
    (said,) = [c for c in thin.status if "short of oil" in c]
    assert said.severity == "warning"
    assert said.pads == (1, 2, 3, 4, 5)
    assert said.detail.endswith("run as if it did")


@pytest.mark.slow
def test_a_pressed_leading_edge_carries(rocker):
    plain, lifted = (run(bearing, speed=SPEED, mesh=COARSE) for bearing in (rocker, pressed(rocker, 2e5)))
    assert sum(lifted.pad_load) > 1.05 * sum(plain.pad_load)
    again = run(pressed(rocker, 2e5), speed=SPEED, mesh=COARSE, start=plain)
    np.testing.assert_allclose(again.h, lifted.h, rtol=1e-4)


def test_a_bearing_file_states_flow_and_pressure(rocker):
    text = (Path(model.__file__).parent / "bearings" / "rocker.toml").read_text(encoding="utf-8")
    assert load_bearing(text).oil.supply_flow == math.inf
    stated = text.replace("[oil]", '[oil]\nsupply_flow = "12 L/min"').replace(
        "[pads]", '[pads]\nleading_edge_pressure = ["0.4 bar", "0.3 bar", "0 bar", "0 bar", "0 bar"]'
    )
    bearing = parse_bearing(stated, "bearing.toml")
    assert bearing.oil.supply_flow == pytest.approx(2e-4)
    assert [p.leading_edge_pressure for p in bearing.pads] == pytest.approx([4e4, 3e4, 0.0, 0.0, 0.0])
    with pytest.raises(BearingError, match=r"\[oil\] supply_flow: must be positive"):
        parse_bearing(text.replace("[oil]", '[oil]\nsupply_flow = "0 L/min"'), "bearing.toml")
    assert rocker.oil.supply_flow == math.inf


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
        forces = solve_film_jfo(film.grid, film.work, shape, surface, False, (1.0, film.supplied))
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
