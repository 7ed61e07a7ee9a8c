"""Structure, uneven pads, oil law, heat paths and pivots that roll or slide: each against an exact limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.dynamics import bearing_impedance, describing, friction_impedance
from model.effects import Effect, EffectError, apply_effects, known_effects
from model.film.oil_state import set_viscosity
from model.film.reynolds import solve_film
from model.measured_pivot import MeasuredPivot
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict_setup
from model.setup import Setup
from model.static_tests import dry_curve, polygon_sides
from model.statics.pad_film import oil_constants
from model.tilt_hold import TiltHold, friction_limits, held_moment, hold_numbers, rolling_radius
from tests.model.points import DOWN, LOAD, OMEGA, SPEED, slopes
from tests.model.points import excited as run
from tests.rigs.bearings import changed_pads
from tests.rigs.random_bearings import draw
from tests.studies.random_bearings import fault, rolling


def offsets(*values: float) -> Effect:
    return Effect("uneven_pads", **{f"offset_{k}": v for k, v in enumerate(values, start=1)})


def test_structure_compliance_is_a_spring_in_one_direction(rocker):
    base = run(rocker)
    e = np.array([math.cos(0.6), math.sin(0.6)])
    p = run(rocker, Effect("structure_compliance", stiffness=1.5e9, direction=0.6))
    series = np.linalg.inv(base.h) + np.outer(e, e) / 1.5e9
    np.testing.assert_allclose(np.linalg.inv(p.h), series, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(p.position - base.position, np.outer(e, e) @ [0.0, -LOAD / 1.5e9], atol=1e-14)


def test_structure_compliance_gives_in_dry_tests_and_clearance_too(rocker):
    plain = Setup(rocker, pivot_laws("kirk", rocker))
    soft = apply_effects(plain, [Effect("structure_compliance", stiffness=1e9, direction=-math.pi / 2)])
    load = np.linspace(100.0, 5000.0, 7)
    for pad, along in ((1, 1.0), (2, math.sin(math.radians(18.0)) ** 2)):
        more = dry_curve(soft, pad, load)[1] - dry_curve(plain, pad, load)[1]
        np.testing.assert_allclose(more, along * load / 1e9, rtol=1e-9)
    sides = polygon_sides(soft, 2000.0)[0] - polygon_sides(plain, 2000.0)[0]
    normals = np.array([[math.cos(p.pivot_angle), math.sin(p.pivot_angle)] for p in rocker.pads])
    np.testing.assert_allclose(sides, normals[:, 1] ** 2 * 2000.0 / 1e9, atol=1e-15)


def test_parts_of_the_structure_are_taken_off_a_measured_curve_one_by_one(rocker):
    load = np.linspace(0.0, 8000.0, 30)
    pivot = 4e-6 * (load / 4000.0) ** 0.8
    measured = MeasuredPivot(load, pivot + load / 2e9 + load / 4e9)
    parts = [
        Effect("housing_flexibility", stiffness=2e9),
        Effect("structure_compliance", stiffness=4e9, direction=math.pi / 2),
    ]
    setup = apply_effects(Setup(rocker, (measured,) * 5), parts)
    np.testing.assert_allclose(setup.pivots[0].deflection_points, pivot, atol=1e-15)
    np.testing.assert_allclose(dry_curve(setup, 1, load[5:])[1], measured.deflection_points[5:], rtol=1e-9)


def test_uneven_pads_know_no_rigid_shift(rocker):
    base = run(rocker)
    normals = np.array([[math.cos(p.pivot_angle), math.sin(p.pivot_angle)] for p in rocker.pads])
    shifted = run(rocker, offsets(*(normals @ [6e-6, -9e-6])))
    np.testing.assert_allclose(shifted.h, base.h, rtol=1e-7, atol=10.0)
    np.testing.assert_allclose(shifted.position, base.position, atol=1e-12)
    scatter = np.array([3e-6, -2e-6, 1e-6, 0.0, -4e-6])
    one, two = run(rocker, offsets(*scatter)), run(rocker, offsets(*(scatter + normals @ [5e-6, 2e-6])))
    np.testing.assert_allclose(one.h, two.h, rtol=1e-7, atol=10.0)
    # one pad alone is pad_offset, seen from where the shift puts the bearing centre
    alone = run(rocker, Effect("pad_offset", pad=2, radial_offset=5e-6))
    np.testing.assert_allclose(run(rocker, offsets(0.0, 5e-6, 0.0, 0.0, 0.0)).h, alone.h, rtol=1e-6, atol=50.0)


def test_uneven_pads_take_one_number_per_pad(rocker):
    kind = known_effects()["uneven_pads"]
    assert [p.name for p in kind.parameters_of(3)] == ["offset_1", "offset_2", "offset_3"]
    with pytest.raises(EffectError, match=r"the bearing has 5 pads; give offset_1, .*offset_5"):
        run(rocker, offsets(1e-6, 2e-6, 3e-6))
    with pytest.raises(EffectError, match="offset_2"):
        Effect("uneven_pads", offset_1=0.0, offset_3=0.0)


def test_viscosity_law_turns_about_the_supply_temperature(rocker):
    setup = Setup(replace(rocker, oil=replace(rocker.oil, supply_temperature=47.0)), pivot_laws("kirk", rocker))
    oil = apply_effects(setup, [Effect("viscosity_law", factor=1.25)]).bearing.oil
    assert oil.viscosity(47.0) == pytest.approx(setup.bearing.oil.viscosity(47.0), rel=1e-12)
    ratio = oil.viscosity(57.0) / oil.viscosity(47.0)
    assert ratio == pytest.approx(math.exp(-12.5 * rocker.oil.viscosity_exponent), rel=1e-12)


def test_heat_that_is_lost_warms_no_film(rocker):
    most, cold = run(rocker, Effect("heat_loss", share=0.95)), run(rocker, thermal="isothermal")
    assert most.max_temperature - 40.0 == pytest.approx(0.05 * (run(rocker).max_temperature - 40.0), rel=0.3)
    np.testing.assert_allclose(most.h, cold.h, rtol=0.02, atol=1e6)


def test_heat_loss_acts_through_the_coupled_paths_alike(rocker):
    effects = [Effect("heat_loss", share=0.25)]
    plain = run(rocker, *effects)
    setup = apply_effects(Setup(rocker, pivot_laws("kirk", rocker)), effects).change(carryover=1e-12)
    coupled = predict_setup(setup, LOAD, DOWN, SPEED, OMEGA)
    np.testing.assert_allclose(coupled.h, plain.h, rtol=1e-6, atol=10.0)


@pytest.mark.slow
def test_pad_conduction_is_the_heat_paths_that_are_there(rocker):
    p = run(rocker, Effect("pad_conduction", back_convection=80.0))
    options = Options(conduction=True, isothermal_journal=True)
    np.testing.assert_allclose(p.h, run(changed_pads(rocker, back_convection=80.0), options=options).h, rtol=1e-10)
    assert p.max_temperature < run(rocker).max_temperature - 1.0


def test_rolling_radii_of_the_drawings(rocker, spherical):
    assert rolling_radius(rocker.pivot) == pytest.approx(0.64, abs=0.005)
    assert rolling_radius(spherical.pivot) == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["rocker", "spherical"])
def test_a_rolling_pivot_holds_the_pad_in_proportion_to_its_load(name, request):
    bearing = request.getfixturevalue(name)
    p = run(bearing, Effect("pivot_rolling", factor=1.0))
    reach = rolling_radius(bearing.pivot)
    for film in p.equilibrium.films:
        moment = film.forces.force[1] * bearing.pivot_radius(film.pad)
        assert moment == pytest.approx(-reach * film.forces.force[0] * film.tilt, abs=2e-3)
    for pad, load in zip(p.pad_matrices, p.pad_load, strict=True):
        assert pad.pad_stiffness[0, 0] == pytest.approx(reach * load, rel=1e-9)


def test_pivots_without_radii_or_spheres_are_refused(rocker, spherical):
    rigid = replace(rocker, pivot=replace(rocker.pivot, kind="rigid"))
    with pytest.raises(EffectError, match="no radii to roll on"):
        run(rigid, Effect("pivot_rolling", factor=1.0))
    with pytest.raises(EffectError, match="only a spherical pivot slides"):
        run(rocker, Effect("pivot_friction", coefficient=0.1))


def tilt_hold(setup: Setup, tilt: float, load: float) -> TiltHold:
    return held_moment(hold_numbers(setup), tilt, load)


@pytest.mark.parametrize("coefficient", [0.002, 0.02, 0.1, 0.3])
def test_friction_holds_a_pad_up_to_its_limit(spherical, coefficient):
    p = run(spherical, Effect("pivot_friction", coefficient=coefficient))
    for film in p.equilibrium.films:
        load = float(film.forces.force[0])
        limit = coefficient * load * 0.2
        moment = film.forces.force[1] * spherical.pivot_radius(film.pad)
        hold = tilt_hold(p.setup, film.tilt, load)
        assert abs(moment) <= limit * 1.001 + 1e-2
        assert moment == pytest.approx(-hold.moment, abs=2e-2)
    named = " ".join(p.status)
    assert "pivot friction holds" in named or "loose" in named


def test_friction_gives_way_by_mindlins_partial_slip(spherical):
    """Initial slope, limit, a slope without a kink between them, and both derivatives by differences."""
    setup = apply_effects(Setup(spherical, pivot_laws("kirk", spherical)), [Effect("pivot_friction", coefficient=0.1)])
    load = 3000.0
    stick, slip = friction_limits(setup, load)
    end = 1.5 * slip / stick
    assert tilt_hold(setup, 1e-6 * end, load).stiffness == pytest.approx(stick, rel=1e-5)
    assert tilt_hold(setup, 0.5 * end, load).moment == pytest.approx(slip * (1 - 0.5**1.5))
    beyond = tilt_hold(setup, -1.01 * end, load)
    assert (beyond.moment, beyond.stiffness) == (pytest.approx(-slip), 0.0)
    assert tilt_hold(setup, 0.9999 * end, load).stiffness < 0.02 * stick

    def moment(at):
        return np.array([tilt_hold(setup, at[0] * end, at[1] * load).moment])

    for tilt in (0.2, -0.7):
        told = tilt_hold(setup, tilt * end, load)
        by_tilt, by_load = slopes(moment, np.array([tilt, 1.0]), 1e-4)[0]
        assert told.stiffness * end == pytest.approx(by_tilt, rel=1e-6)
        assert told.arm * load == pytest.approx(by_load, rel=1e-6)


def test_friction_that_is_broken_loose_leaves_a_free_pad(spherical):
    free = run(spherical)
    setup = apply_effects(Setup(spherical, pivot_laws("kirk", spherical)), [Effect("pivot_friction", coefficient=1e-4)])
    far = predict_setup(setup.change(vibration=1e-3), LOAD, DOWN, SPEED, OMEGA)
    np.testing.assert_allclose(far.h, free.h, rtol=0.02, atol=1e6)
    assert any("breaks the pivots of pads 1, 2, 3, 4, 5 loose" in name for name in far.status)
    held = predict_setup(setup.change(vibration=1e-12), LOAD, DOWN, SPEED, OMEGA)
    assert held.status == ("pivot friction holds pads 1, 2, 3, 4, 5",)
    # what sticks is a rotational stiffness of the contact, far above that of the film: a pad that does not tilt
    stick, _ = friction_limits(held.setup, float(held.pad_load[0]))
    assert stick > 1e7
    fixed = Setup(spherical, pivot_laws("kirk", spherical)).change(rotational_stiffness=stick)
    h = bearing_impedance(fixed, held.equilibrium, np.array([OMEGA]))[0]
    np.testing.assert_allclose(h, held.h, rtol=0.03, atol=1e6)


def test_describing_function_of_a_sliding_contact():
    stick, slip = 3e6, 12.0
    edge = slip / stick
    assert describing(np.array([0.5 * edge]), stick, slip)[0] == pytest.approx(stick)
    far = describing(np.array([1e3 * edge]), stick, slip)[0]
    assert far.imag == pytest.approx(4 * slip / (math.pi * 1e3 * edge), rel=2e-3)  # Coulomb's equivalent damping
    assert abs(far.real) < 0.05 * abs(far.imag)
    # the first harmonic of the hysteresis itself, at an amplitude between
    amplitude = 2.7 * edge
    t = np.linspace(0.0, 2 * math.pi, 200001)
    angle, moment = amplitude * np.cos(t), np.empty_like(t)
    moment[0] = slip
    for k in range(1, len(t)):
        moment[k] = min(max(moment[k - 1] + stick * (angle[k] - angle[k - 1]), -slip), slip)
    harmonic = 2.0 * np.mean((moment * np.exp(-1j * t))[1:]) / amplitude
    assert describing(np.array([amplitude]), stick, slip)[0] == pytest.approx(harmonic, rel=1e-3)


def test_friction_impedance_balances_the_drive():
    stick, slip = 3e6, 12.0
    own = np.array([[2e5 + 1e5j, 2e5 + 1e5j]])
    drive = np.array([[30.0, 1.0]])
    n = friction_impedance(own, drive, stick, slip)
    assert n[0, 1] == stick
    amplitude = drive[0, 0] / abs(own[0, 0] + n[0, 0])
    assert describing(np.array([amplitude]), stick, slip)[0] == pytest.approx(n[0, 0], rel=1e-6)


@pytest.mark.slow
def test_pads_that_friction_holds_off_their_loaded_attitude_idle():
    case = draw(2000, 1)[538]
    p = rolling(case, np.random.default_rng(538))
    assert "pads 4 cannot keep their load" in p.status
    assert p.idle_pads == (4,)
    assert fault(p) == ""
    # nor is there any tilt at which pad #4 carries: the film's moment is above what friction holds, or below
    film, missing = p.equilibrium.films[3], []
    set_viscosity(film.work, oil_constants(p.setup.bearing.oil))
    for film.tilt in np.linspace(-1e-3, 2.5e-3, 200):
        beside = float(film.tangent @ p.bearing_position) + film.pivot_radius * film.tilt
        wedge = (film.pad.pad_clearance, film.preload_distance + film.normal @ p.bearing_position, beside)
        forces = solve_film(film.grid, film.work, wedge, p.equilibrium.running.speed, False)
        load, moment = forces.force * (1.0, -film.pivot_radius)
        if forces.steps > 0 and load > 1.0:
            missing.append(moment - tilt_hold(p.setup, film.tilt, load).moment)
    assert len(missing) > 50
    assert max(missing) < 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("number", "unloaded"), [(717, [1]), (879, [])])
def test_pads_that_friction_holds_carry_beyond_what_free_ones_do(number, unloaded):
    p = rolling(draw(2000, 1)[number], np.random.default_rng(number))
    assert p.converged, p.status
    assert [m + 1 for m, load in enumerate(p.pad_load) if load < 1e-3] == unloaded
    assert fault(p) == ""


def test_a_pad_that_carries_under_friction_is_not_let_idle(spherical):
    friction = Effect("pivot_friction", coefficient=0.1)
    assert run(spherical, friction, load=8000.0, direction=-1.2).idle_pads == ()
