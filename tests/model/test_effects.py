"""Effects: neutral values change nothing, the others exactly what each says of itself; messages; files; one's own.
Structure, uneven pads, oil law, heat paths and pivots that roll or slide, each against an exact limit."""

import math
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import bearing_impedance, describing, friction_impedance
from model.effects import Effect, EffectError, EffectWords, apply_effects, known_effects, load_effects, register
from model.effects.registry import load_library
from model.film.oil_state import set_viscosity
from model.film.reynolds import solve_film
from model.measured_pivot import MeasuredPivot
from model.options import Options
from model.pivots import pivot_laws
from model.predict import predict, predict_setup
from model.prediction import Prediction
from model.setup import Setup
from model.static_tests import dry_curve, polygon_sides
from model.statics.pad_film import oil_constants
from model.tilt_hold import TiltHold, friction_limits, held_moment, hold_numbers, rolling_radius
from tests.model.points import DOWN, LOAD, OMEGA, SPEED, close, slopes
from tests.model.points import excited as run
from tests.rigs.bearings import changed_oil, changed_pads
from tests.rigs.random_bearings import draw
from tests.studies.random_bearings import fault, rolling

NAMES = {
    "pivot_flexibility", "soft_pivot", "pad_offset", "thermal_growth", "preload_error", "oil_viscosity",
    "supply_temperature", "hot_oil_carryover", "pad_bending", "housing_flexibility", "fluid_inertia",
    "pivot_rotation", "pivot_damping", "misalignment", "starvation", "probe_gain", "probe_rotation",
    "loadcell_gain", "loadcell_crosstalk", "channel_delay", "housing_mass", "structure_compliance", "uneven_pads",
    "viscosity_law", "heat_loss", "pad_conduction", "pivot_rolling", "pivot_friction", "one_probe_gain",
    "one_cell_gain", "thermometer_offset", "pad_bore", "clearance_error", "pivot_offset_error", "pad_arc_error",
    "pad_length_error", "pivot_angle_error",
}  # fmt: skip
HOUSING_MASS, CELLS = 30.0, np.array([4.0e8, 6.0e8])


@pytest.fixture(scope="module")
def base(rocker) -> Prediction:
    return run(rocker)


def same(p: Prediction, q: Prediction, tolerance: float = 1e-10) -> None:
    np.testing.assert_allclose(p.h, q.h, atol=tolerance * np.abs(q.h).max())
    np.testing.assert_allclose(p.position, q.position, atol=tolerance * 1e-4)
    np.testing.assert_allclose(p.load_reading, q.load_reading, atol=tolerance * LOAD)


def neutral(name: str) -> Effect:
    values = {p.name: p.neutral for p in known_effects()[name].parameters_of(5)}
    places = {"pad": 2, "probe": 1, "cell": 2}
    return Effect(name, **{k: places.get(k, 0.3) if math.isnan(v) else v for k, v in values.items()})


def typical(name: str) -> Effect:
    """The effect at a size one would not be surprised by, all else neutral."""
    values = dict(neutral(name).parameters)
    first = next(p for p in known_effects()[name].parameters_of(5) if math.isfinite(p.typical))
    values[first.name] = first.typical if math.isinf(first.neutral) else first.neutral + first.typical
    if not first.low <= values[first.name] <= first.high:
        values[first.name] = first.neutral - first.typical
    return Effect(name, **values)


#: Those that solve the pads' conduction or bending are as slow as their first solution; they are left to the whole run.
SLOW = {"pad_bending", "pad_conduction"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in sorted(NAMES)]
)
def test_an_effect_is_the_same_from_a_start_without_it(rocker, base, name):
    """What a diagnosis and a sweep rely on: nothing of the neighbour's set-up comes along with its state."""
    if known_effects()[name].missing(rocker):
        pytest.skip("the bearing cannot have it")
    effect = typical(name)
    same(run(rocker, effect, start=base), run(rocker, effect), 2e-6)


def test_library_has_every_name_that_users_know():
    assert set(known_effects()) >= NAMES
    for kind in known_effects().values():
        assert kind.source, kind.name
        for p in kind.parameters:
            assert p.low < p.high
            assert math.isnan(p.neutral) or p.low <= p.neutral <= p.high


@pytest.mark.parametrize("name", sorted(NAMES))
def test_neutral_value_changes_nothing(rocker, base, name):
    if known_effects()[name].missing(rocker):
        rocker = replace(rocker, pivot=replace(rocker.pivot, kind="spherical", sphere_diameter=0.4))
        base = run(rocker)
    same(run(rocker, neutral(name)), base)


def test_pivot_flexibility_and_soft_pivot(rocker):
    soft = run(rocker, Effect("pivot_flexibility", stiffness_factor=0.4))
    laws = pivot_laws("kirk", rocker)
    expected = [law.deflection(w) / 0.4 for law, w in zip(laws, soft.pad_load, strict=True)]
    np.testing.assert_allclose(soft.deflection, expected, rtol=1e-5)
    assert soft.pad_matrices[0].pad_stiffness[1, 1] == pytest.approx(0.4 * laws[0].stiffness(soft.pad_load[0]))
    one = run(rocker, Effect("soft_pivot", pad=1, stiffness_factor=0.4))
    expected = [law.deflection(w) / f for law, w, f in zip(laws, one.pad_load, (0.4, 1, 1, 1, 1), strict=True)]
    np.testing.assert_allclose(one.deflection, expected, rtol=1e-5)


def oil(**changes: float) -> Callable[[Bearing], Bearing]:
    return lambda bearing: changed_oil(bearing, **changes)


def moved(bearing: Bearing) -> Bearing:
    pads = [*bearing.pads]
    pads[3] = replace(pads[3], assembled_clearance=92e-6)
    return bearing.with_pads(tuple(pads))


OTHERS = {
    "pad_offset": ({"pad": 4, "radial_offset": 12e-6}, moved),
    "thermal_growth": ({"clearance_change": 9e-6}, lambda b: changed_pads(b, assembled_clearance=89e-6)),
    "uneven_pads": ({f"offset_{k}": 4e-6 for k in range(1, 6)}, lambda b: changed_pads(b, assembled_clearance=84e-6)),
    "preload_error": ({"pad_clearance_change": 10e-6}, lambda b: changed_pads(b, pad_clearance=140e-6)),
    "oil_viscosity": ({"factor": 1.2}, oil(viscosity_40=1.2 * 0.0396)),
    "supply_temperature": ({"change": 7.0}, oil(supply_temperature=47.0)),
    # heat that is lost is oil that takes up more
    "heat_loss": ({"share": 0.3}, oil(specific_heat=2000.0 / 0.7, conductivity=0.13 / 0.7)),
}


@pytest.mark.parametrize("name", OTHERS)
def test_an_effect_on_geometry_or_oil_is_another_bearing(rocker, name):
    parameters, other = OTHERS[name]
    same(run(rocker, Effect(name, **parameters)), run(other(rocker)), 1e-9)


def housing(stiffness: float) -> Effect:
    return Effect("housing_flexibility", stiffness=stiffness)


def springs(*turns: float) -> list[Effect]:
    return [Effect("structure_compliance", stiffness=2e9, direction=0.3 + turn) for turn in turns]


EQUAL = {
    "viscosity twice": ([Effect("oil_viscosity", factor=1.1)] * 2, [Effect("oil_viscosity", factor=1.21)]),
    # twice a loss is what is left of what is left
    "heat lost twice": ([Effect("heat_loss", share=1 - math.sqrt(0.7))] * 2, [Effect("heat_loss", share=0.3)]),
    "alike in all directions": ([Effect("series_compliance", xx=1e-9, xy=0.0, yy=1e-9)], [housing(1e9)]),
    # a direction and its opposite are one, two at right angles the spring of the housing
    "a spring seen from behind": (springs(-math.pi), springs(0.0)),
    "two springs at right angles": (springs(0.0, math.pi / 2), [housing(2e9)]),
}


@pytest.mark.parametrize("name", EQUAL)
def test_effects_that_are_the_same_in_other_words(rocker, name):
    same(*(run(rocker, *effects) for effects in EQUAL[name]), 1e-9)


def test_growth_is_a_matter_of_running_the_drawing_and_with_it_the_dry_tests_keep_their_clearance(rocker):
    setup = apply_effects(Setup(rocker, pivot_laws("kirk", rocker)), [Effect("thermal_growth", clearance_change=9e-6)])
    assert setup.bearing == rocker


def test_a_measured_curve_does_not_hold_the_housing_twice(rocker):
    load = np.linspace(0.0, 8000.0, 30)
    stiffness = 1.5e9
    pivot = 4e-6 * (load / 4000.0) ** 0.8
    measured = MeasuredPivot(load, pivot + load / stiffness)
    alone = MeasuredPivot(load, pivot, includes_housing=False)
    housing = [Effect("housing_flexibility", stiffness=stiffness)]
    curves = [apply_effects(Setup(rocker, (law,) * 5), housing) for law in (measured, alone)]
    for setup in curves:  # the dry test reads what was measured, once
        np.testing.assert_allclose(dry_curve(setup, 1, load[5:])[1], (pivot + load / stiffness)[5:], rtol=1e-9)
    h = [predict_setup(setup, 5000.0, -math.pi / 2, 138.0, 157.0).h for setup in curves]
    np.testing.assert_allclose(h[0], h[1], rtol=1e-9)
    # through a law that another effect has scaled, too; and never to nothing
    soft = apply_effects(Setup(rocker, (measured,) * 5), [Effect("soft_pivot", pad=1, stiffness_factor=0.5), *housing])
    assert soft.pivots[0].deflection(4000.0) == pytest.approx(2 * alone.deflection(4000.0))
    assert 0.0 < measured.without_housing(1e-6).deflection(4000.0) < 0.03 * measured.deflection(4000.0)


ALONG = np.array([math.cos(0.6), math.sin(0.6)])


@pytest.mark.parametrize(
    ("effect", "compliance"),
    [
        (housing(2e9), np.eye(2) / 2e9),
        (Effect("structure_compliance", stiffness=1.5e9, direction=0.6), np.outer(ALONG, ALONG) / 1.5e9),
    ],
)
def test_housing_and_structure_are_springs_in_series(rocker, base, effect, compliance):
    p = run(rocker, effect)
    np.testing.assert_allclose(np.linalg.inv(p.h), np.linalg.inv(base.h) + compliance, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(p.position - base.position, compliance @ [0.0, -LOAD], atol=1e-14)
    np.testing.assert_allclose(p.bearing_position, base.position, atol=1e-14)


def test_pivot_damping_is_c_eta(rocker, base):
    p = run(rocker, Effect("pivot_damping", damping=5e5))
    assert p.pad_matrices[0].pad_damping[1, 1] == 5e5
    np.testing.assert_allclose(p.position, base.position, atol=1e-14)
    assert np.abs(p.h - base.h).max() > 1e-3 * np.abs(base.h).max()


def test_pivot_rotation_holds_the_pads_back_in_statics_too(rocker, base):
    k_theta = 5e3
    p = run(rocker, Effect("pivot_rotation", rotational_stiffness=k_theta))
    for film in p.equilibrium.films:
        moment = film.forces.force[1] * rocker.pivot_radius(film.pad)
        assert moment == pytest.approx(-k_theta * film.tilt, abs=1e-4)
    assert p.pad_matrices[0].pad_stiffness[0, 0] == k_theta
    assert abs(p.tilt[0]) < abs(base.tilt[0])
    stuck = run(rocker, Effect("pivot_rotation", rotational_stiffness=1e6))
    assert abs(stuck.tilt).max() < 0.02 * abs(base.tilt).max()
    assert abs(stuck.kxy - stuck.kyx) > 0.2 * stuck.kxx  # a fixed-pad bearing again: cross-coupled


def test_misalignment(rocker, base):
    small = [run(rocker, Effect("misalignment", angle=a, direction=0.7)) for a in (2e-5, 4e-5)]
    change = [p.kyy - base.kyy for p in small]
    assert change[1] / change[0] == pytest.approx(4.0, rel=0.15)  # even in the angle: quadratic where it is small
    there, back = (run(rocker, Effect("misalignment", angle=3e-4, direction=d)) for d in (0.7, 0.7 + math.pi))
    close(back.h, there.h, 1e-7)
    film = there.equilibrium.films[0]
    assert film.work.pressure.shape[1] == 2 * (base.equilibrium.films[0].work.pressure.shape[1] - 1) + 1
    theta = film.grid.angle + film.pad.pivot_angle
    slope = (film.work.thickness[:, -1] - film.work.thickness[:, 0]) / rocker.length
    np.testing.assert_allclose(slope, -3e-4 * np.cos(theta - 0.7), atol=1e-12)


def test_starvation(rocker):
    p = run(rocker, Effect("starvation", arc_fraction=0.2))
    for film in p.equilibrium.films:
        start = film.pad.leading_edge + 0.2 * film.pad.arc
        assert film.grid.angle[0] == pytest.approx(start)
        assert film.grid.angle[-1] == pytest.approx(film.pad.leading_edge + film.pad.arc)
    assert p.pad_temperature(0.1) == pytest.approx([40.0] * 5)


def rig_force(h: np.ndarray, gain: np.ndarray, mass: float = HOUSING_MASS, stated: float = HOUSING_MASS) -> np.ndarray:
    """What a rig computes for the film force per displacement: cells times gain, plus stated mass times acceleration.

    F_oil = h d; housing on springs: F_cell = K x, F_oil = F_cell + m a, a = -omega^2 x.
    """
    force = h.copy()
    x = force / (CELLS - mass * OMEGA**2)[:, None]
    return gain @ (CELLS[:, None] * x) - stated * OMEGA**2 * x


def by(*rows: list[complex]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda h: h + np.array(rows)


I2, CROSS = np.eye(2), np.array([[1.0, 0.04], [0.04, 1.0]])
#: A probe that really stands at theta + angle reads the displacement along there and is taken to stand at theta.
TURNED = np.array([[math.cos(0.05), math.sin(0.05)], [-math.sin(0.05), math.cos(0.05)]])
#: Parameters, h as it is read, and what the readings of position and of load are of the true ones.
READINGS = {
    "fluid_inertia": ({"added_mass": 25.0}, lambda h: h - OMEGA**2 * 25.0 * I2, I2, I2),
    "parallel_stiffness": ({"xx": 1e6, "xy": 2e6, "yx": -2e6, "yy": 0.0}, by([1e6, 2e6], [-2e6, 0.0]), I2, I2),
    "parallel_damping": ({"xx": 0.0, "xy": 0.0, "yx": 0.0, "yy": 1e3}, by([0.0, 0.0], [0.0, 1e3j * OMEGA]), I2, I2),
    "probe_gain": ({"factor": 1.25}, lambda h: h / 1.25, 1.25 * I2, I2),
    "probe_rotation": ({"angle": 0.05}, lambda h: h @ TURNED.T, TURNED, I2),
    "channel_delay": ({"delay": 2e-4}, lambda h: h * np.exp(1j * OMEGA * 2e-4), I2, I2),
    "loadcell_gain": ({"factor": 0.97}, lambda h: rig_force(h, 0.97 * I2), I2, 0.97 * I2),
    "loadcell_crosstalk": ({"fraction": 0.04}, lambda h: rig_force(h, CROSS), I2, CROSS),
    "housing_mass": ({"mass_error": 12.0}, lambda h: rig_force(h, I2, mass=HOUSING_MASS + 12.0), I2, I2),
    "none": ({}, lambda h: rig_force(h, I2), I2, I2),
}


@pytest.mark.parametrize("name", READINGS)
def test_what_acts_on_the_readings_leaves_the_film_as_it_is(rocker, base, name):
    parameters, read, place, load = READINGS[name]
    p = run(rocker, *([Effect(name, **parameters)] if parameters else ()))
    np.testing.assert_allclose(p.h, read(base.h), rtol=1e-9, atol=1.0)
    np.testing.assert_allclose(p.position, place @ base.position, atol=1e-16)
    np.testing.assert_allclose(p.load_reading, load @ [0.0, -LOAD], atol=1e-9)
    np.testing.assert_allclose(p.pad_load, base.pad_load, rtol=1e-12)


def test_effects_combine(rocker, base):
    p = run(rocker, Effect("probe_gain", factor=1.1), Effect("fluid_inertia", added_mass=10.0))
    np.testing.assert_allclose(p.h, (base.h - OMEGA**2 * 10.0 * np.eye(2)) / 1.1, rtol=1e-9)


@pytest.mark.slow
def test_pad_bending_shapes_the_static_film_only(rocker, base):
    p = run(rocker, Effect("pad_bending", compliance_factor=1.0))
    half = run(rocker, Effect("pad_bending", compliance_factor=0.5))
    assert p.equilibrium.films[0].bent.any()
    assert abs(half.kyy - base.kyy) < abs(p.kyy - base.kyy)
    np.testing.assert_allclose(p.pad_load.sum(), base.pad_load.sum(), rtol=0.05)


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("soft_pivott", {}, "Did you mean 'soft_pivot'"),
        ("", {}, "is not known"),
        ("soft_pivot", {"pad": 1}, "'stiffness_factor' \\[1\\] is missing"),
        ("soft_pivot", {"pad": 1, "stifness_factor": 0.3}, "Did you mean 'stiffness_factor'"),
        ("soft_pivot", {"pad": 0, "stiffness_factor": 0.3}, "outside the physical range"),
        ("soft_pivot", {"pad": 1.5, "stiffness_factor": 0.3}, "whole number"),
        ("soft_pivot", {"pad": 1, "stiffness_factor": 0.0}, "outside the physical range"),
        ("soft_pivot", {"pad": 1, "stiffness_factor": math.nan}, "outside the physical range"),
        ("soft_pivot", {"pad": 1, "stiffness_factor": None}, "must be a number"),
        ("soft_pivot", {"pad": True, "stiffness_factor": 0.3}, "must be a number"),
        ("oil_viscosity", {"factor": "1.1 mm"}, "oil_viscosity.factor"),
        ("pad_offset", {"pad": 1, "radial_offset": "12"}, "no unit"),
    ],
)
def test_messages_name_the_effect_and_the_parameter(name, parameters, message):
    with pytest.raises(ValueError, match=message):
        Effect(name, **parameters)


def test_quantities_with_units_are_taken():
    assert Effect("pad_offset", pad=2, radial_offset="12 um").parameters["radial_offset"] == pytest.approx(12e-6)
    leaning = Effect("misalignment", angle="0.01 deg", direction="90 deg")
    assert leaning.parameters["direction"] == pytest.approx(math.pi / 2)


def test_pad_beyond_the_bearing_is_refused(rocker):
    with pytest.raises(EffectError, match="pad 6 does not exist; the bearing has 5 pads"):
        predict(rocker, LOAD, DOWN, SPEED, effects=[Effect("pad_offset", pad=6, radial_offset=1e-6)])


def test_effects_are_values():
    one, two = (Effect("soft_pivot", pad=5, stiffness_factor=0.3) for _ in range(2))
    assert len({one, two}) == 1
    assert pickle.loads(pickle.dumps(one)) == one
    assert repr(one) == "Effect('soft_pivot', pad=5, stiffness_factor=0.3)"
    with pytest.raises(TypeError):
        one.parameters["pad"] = 1


def test_file(tmp_path):
    path = tmp_path / "updated.effects.toml"
    path.write_text(
        '[[effects]]\nname = "soft_pivot"\npad = 5\nstiffness_factor = 0.3\n[effects.interval]\nlo = 0.2\n'
        '[[effects]]\nname = "pad_offset"\npad = 1\nradial_offset = "5 um"\n'
        '[[effects]]\nname = "series_compliance"\nxx = 1e-9\nxy = "2e-10 m/N"\nyy = 0.0\n',
        encoding="utf-8",
    )
    first, second, third = load_effects(path)
    assert first == Effect("soft_pivot", pad=5, stiffness_factor=0.3)
    assert second.parameters["radial_offset"] == pytest.approx(5e-6)
    assert third.parameters["xy"] == pytest.approx(2e-10)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("effects = 1 1", "cannot be read"),
        ('schema = "tpjb-effects/7"', "schema"),
        ("effects = 3", "must be a list"),
        ("[[effects]]\npad = 1", "effect 1: has no name"),
        ('[[effects]]\nname = "oil_viscosity"\nfaktor = 1.0', "effect 1: oil_viscosity: no parameter 'faktor'"),
    ],
)
def test_broken_file(tmp_path, text, message):
    path = tmp_path / "e.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(EffectError, match=message):
        load_effects(path)
    with pytest.raises(EffectError, match="no such file"):
        load_effects(tmp_path / "none.toml")


OWN = """
from model.effects import EffectKind, Parameter
KIND = EffectKind("{name}", "bearing", (Parameter("share", "1", "ratio", 0.0, 0.0, 1.0, 0.1),),
                  lambda setup, share: setup.change(added_mass=setup.added_mass + 100.0 * share), "made up")
"""


def test_effects_of_ones_own_are_registered_from_a_file(rocker, base, tmp_path, monkeypatch):
    monkeypatch.setattr("model.effects.registry._registered", {})  # other tests know the bundled ones only
    path = tmp_path / "own.py"
    path.write_text(OWN.format(name="sloshing"))
    (kind,) = load_library(path)
    assert kind.name == "sloshing"
    p = run(rocker, Effect("sloshing", share=0.1))
    np.testing.assert_allclose(p.h, base.h - OMEGA**2 * 10.0 * np.eye(2), rtol=1e-10)
    with pytest.raises(EffectError, match="its words name amount, no parameter"):
        register(replace(kind, words=EffectWords("oil sloshes by {amount}", "", "", "")))


@pytest.mark.parametrize(
    ("text", "message"),
    [("x = 1", "defines no effect"), ("1 / 0", "ZeroDivisionError"), (OWN.format(name="starvation"), "bundled")],
)
def test_files_that_bring_no_effect_are_refused(tmp_path, text, message):
    path = tmp_path / "own.py"
    path.write_text(text)
    with pytest.raises(EffectError, match=message):
        load_library(path)


def offsets(*values: float) -> Effect:
    return Effect("uneven_pads", **{f"offset_{k}": v for k, v in enumerate(values, start=1)})


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


def test_uneven_pads_know_no_rigid_shift(rocker, base):
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
    setup = Setup(changed_oil(rocker, supply_temperature=47.0), pivot_laws("kirk", rocker))
    oil = apply_effects(setup, [Effect("viscosity_law", factor=1.25)]).bearing.oil
    assert oil.viscosity(47.0) == pytest.approx(setup.bearing.oil.viscosity(47.0), rel=1e-12)
    ratio = oil.viscosity(57.0) / oil.viscosity(47.0)
    assert ratio == pytest.approx(math.exp(-12.5 * rocker.oil.viscosity_exponent), rel=1e-12)


def test_heat_that_is_lost_warms_no_film(rocker, base):
    most, cold = run(rocker, Effect("heat_loss", share=0.95)), run(rocker, thermal="isothermal")
    assert most.max_temperature - 40.0 == pytest.approx(0.05 * (base.max_temperature - 40.0), rel=0.3)
    np.testing.assert_allclose(most.h, cold.h, rtol=0.02, atol=1e6)


def test_heat_loss_acts_through_the_coupled_paths_alike(rocker):
    effects = [Effect("heat_loss", share=0.25)]
    plain = run(rocker, *effects)
    setup = apply_effects(Setup(rocker, pivot_laws("kirk", rocker)), effects).change(carryover=1e-12)
    coupled = predict_setup(setup, LOAD, DOWN, SPEED, OMEGA)
    np.testing.assert_allclose(coupled.h, plain.h, rtol=1e-6, atol=10.0)


@pytest.mark.slow
def test_pad_conduction_is_the_heat_paths_that_are_there(rocker, base):
    p = run(rocker, Effect("pad_conduction", back_convection=80.0))
    options = Options(conduction=True, isothermal_journal=True)
    np.testing.assert_allclose(p.h, run(changed_pads(rocker, back_convection=80.0), options=options).h, rtol=1e-10)
    assert p.max_temperature < base.max_temperature - 1.0


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
