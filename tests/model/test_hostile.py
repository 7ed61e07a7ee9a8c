"""Impossible and extreme input, and named conditions: a ValueError that names the argument or the number, or a status
of a name that can happen, with NaN; never a traceback, a warning (they are errors here) or a number without a word."""

import dataclasses
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing, BearingError, Material, Oil, Pivot
from model.conditions import KINDS, named, pads_of
from model.effects import Effect
from model.errors import OptionError
from model.film.attitudes import attitudes
from model.options import Options
from model.pivots import pivot_laws
from model.possible import BOUNDS, check_possible
from model.predict import predict
from model.prediction import Prediction
from model.setup import Setup
from model.statics import search
from model.statics.compiled import iteration
from model.statics.compiled.iteration import SINGULAR
from model.statics.conditions import overloaded_pads, unsupported
from tests.model.points import DOWN, SPEED
from tests.rigs.bearings import changed_oil, changed_pads
from tests.studies.random_bearings import fault

COARSE = (24, 4)


def oil(**changes: object) -> Callable[[Bearing], Bearing]:
    return lambda bearing: changed_oil(bearing, **changes)


def pads(**changes: object) -> Callable[[Bearing], Bearing]:
    return lambda bearing: changed_pads(bearing, **changes)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"load": -5.0}, "load must be zero or positive"),
        ({"load": math.nan}, "load must be zero or positive"),
        ({"load": math.inf}, "load must be zero or positive"),
        ({"load": None}, "load must be a number"),
        ({"load": 5 + 1j}, "load must be a number"),
        ({"load": True}, "load must be a number"),
        ({"load": np.array([1.0, 2.0])}, "load must be a number"),
        ({"load": "5 mm"}, "load: unit 'mm'"),
        ({"load_direction": math.inf}, "load_direction must be finite"),
        ({"load_direction": "down"}, "load_direction"),
        ({"speed": 0.0}, "speed must be positive"),
        ({"speed": -SPEED}, "`rotation` says which way"),
        ({"speed": None}, "speed is missing. Give"),
        ({"speed": "fast"}, "speed: 'fast' is not a number"),
        ({"pivots": None}, "pivots: need 5 pivot laws"),
        ({"excitation": 0.0}, "excitation must be a positive"),
        ({"excitation": []}, "excitation must be a positive"),
        ({"excitation": [10.0, -1.0]}, "excitation must be a positive"),
        ({"excitation": [10.0, math.nan]}, "excitation must be a positive"),
        ({"excitation": np.ones((2, 2))}, "excitation must be a positive"),
        ({"excitation": 1e200}, "excitation must be a positive"),
        ({"excitation": "fast"}, "excitation"),
        ({"thermal": "hot"}, "thermal must be"),
        ({"pivots": "soft"}, "pivots"),
        ({"pivots": 0.0}, "must be positive"),
        ({"mesh": (0, 0)}, "even numbers"),
        ({"mesh": (41, 4)}, "even numbers"),
        ({"mesh": (3, 4)}, "even numbers"),
        ({"mesh": (40, 3)}, "even numbers"),
        ({"mesh": (40, 0)}, "even numbers"),
        ({"mesh": (40.5, 4)}, "two whole numbers"),
        ({"mesh": "fine"}, "two whole numbers"),
        ({"options": {"conduction": True}}, "options must be"),
        ({"thermal": "thd", "options": Options(cavitation="jfo")}, "rupture by swift-stieber"),
        ({"options": Options(axial_tilt=True)}, "spheres"),
    ],
)
def test_bad_arguments_are_named(rocker, arguments, message):
    point = {"load": 5000.0, "load_direction": DOWN, "speed": SPEED, "mesh": COARSE} | arguments
    with pytest.raises(ValueError, match=message):
        predict(rocker, **point)


LAMINAR, HEAT = [{"turbulence": "ng-pan"}, {"cavitation": "jfo"}], {"perturbed_heat": True}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cavitation": "elrod"}, "cavitation must be one of swift-stieber, jfo"),
        ({"cavitation": None}, "cavitation must be one of swift-stieber, jfo"),
        ({"cavitation": "jfoo"}, "Did you mean 'jfo'?"),
        ({"turbulence": "ngpan"}, "turbulence must be one of none, ng-pan"),
        ({"turbulence": "ng-pan", "cavitation": "jfo"}, "ruptures by swift-stieber"),
        *(({"perturbed_heat": True} | other, "perturbed_heat is for laminar films") for other in LAMINAR),
        *(({"perturbed_bending": True} | other, "perturbed_bending is for") for other in (*LAMINAR, HEAT)),
        *(({"axial_tilt": True} | other, "axial_tilt is for") for other in (*LAMINAR, HEAT)),
    ],
)
def test_options_that_are_not_known_or_do_not_go_together_are_refused(options, message):
    with pytest.raises(OptionError, match=message):
        Options(**options)


def test_no_pads(rocker):
    with pytest.raises(ValueError, match="at least one pad"):
        predict(rocker.with_pads(()), 5000.0, DOWN, SPEED)


def sane(p: Prediction) -> None:
    """Converged and finite, balanced by pads that push; or a status, and NaN instead of numbers."""
    assert fault(p) == ""
    if p.converged:
        assert np.isfinite(p.position).all()
        assert (p.pad_load >= 0.0).all()
        assert p.min_film > 0.0


NARROW = pads(pad_clearance=2e-9, assembled_clearance=1e-9)
#: Those that have a name of their own are in `CASES`.
EXTREMES = {
    "no load": (pads(), {"load": 0.0}),
    "feather": (pads(), {"load": 1e-9}),
    "the smallest load": (pads(), {"load": 5e-324, "thermal": "isothermal"}),
    "absurd load": (pads(), {"load": 1e300}),
    "soft pivots": (pads(), {"pivots": 1e6}),
    "no pivots": (pads(), {"pivots": 1e-3}),
    "hard pivots": (pads(), {"pivots": 1e300}),
    "narrow": (NARROW, {}),
    "wide": (pads(pad_clearance=2e-2, assembled_clearance=1e-2), {}),
    "no preload": (pads(assembled_clearance=130e-6), {}),
    "negative preload": (pads(assembled_clearance=260e-6), {}),
    "interference": (pads(assembled_clearance=-30e-6), {}),
    "slivers": (pads(arc=2e-3), {}),
    "pivot at the leading edge": (pads(pivot_offset=0.01), {}),
    "pivot at the trailing edge": (pads(pivot_offset=0.99), {}),
    "pivot ahead of the middle": (pads(pivot_offset=0.4), {}),
    "water": (oil(viscosity_40=1e-6), {}),
    "honey": (oil(viscosity_40=1e3), {}),
    "steep oil": (oil(viscosity_exponent=50.0), {}),
    "hot as the sun": (oil(supply_temperature=1e4), {}),
    "oil that vanishes": (oil(thermal_expansion=10.0), {}),
    "no heat capacity": (oil(specific_heat=1e-3), {}),
    "one pad": (lambda b: b.with_pads(b.pads[:1]), {}),
    "two pads": (lambda b: b.with_pads(b.pads[:2]), {}),
    "all oil carried over": (pads(), {"effects": [Effect("hot_oil_carryover", fraction=0.98)]}),
    "film lost beside a journal that takes heat": (NARROW, {"options": Options(isothermal_journal=True)}),
    "film lost beside pads that take heat": (NARROW, {"load": 1e5, "options": Options(conduction=True)}),
    "stuck pads": (pads(), {"effects": [Effect("pivot_rotation", rotational_stiffness=1e6)]}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_end_in_a_number_or_a_status(rocker, monkeypatch, name):
    monkeypatch.setattr("model.predict.check_possible", lambda bearing: None)  # beyond what a bearing may have, too
    change, more = EXTREMES[name]
    sane(predict(change(rocker), **{"load": 5000.0, "load_direction": DOWN, "speed": SPEED, "mesh": COARSE} | more))


@pytest.mark.parametrize("speed", [1e-9, 1e-3, 1e4, 1e7])
def test_extreme_speeds(rocker, speed):
    sane(predict(rocker, 5000.0, DOWN, speed, 100.0, mesh=COARSE))


@pytest.mark.parametrize("share", [1.0, 0.7, 1.3])
@pytest.mark.parametrize("speed", [1e-28, 1e-22])
def test_a_shaft_that_hardly_turns_loses_its_films_and_no_power(rocker, monkeypatch, speed, share):
    def curve(*film):  # films below an atom are lost wherever the search begins
        known = attitudes(*film)
        return known._replace(load=share * known.load)

    monkeypatch.setattr(search, "attitudes", curve)
    p = predict(rocker, 5000.0, DOWN, speed, pivots="kirk", mesh=COARSE)
    sane(p)
    assert "film lost" in p.status
    assert math.isnan(p.power_loss)


def test_what_cannot_carry_says_that_all_pads_idle(rocker):
    p = predict(rocker, 5000.0, DOWN, SPEED, mesh=COARSE, effects=[Effect("starvation", arc_fraction=0.6)])
    assert {"no set of pads finds rest", "not converged", "idle pads 1, 2, 3, 4, 5"} <= set(p.status)
    assert np.isnan(p.h).all()
    assert p.max_temperature == 40.0
    assert math.isinf(p.min_film)


def with_number(bearing: Bearing, part: type, name: str, value: float) -> Bearing:
    if part is Bearing:
        if name == "journal_diameter" and math.isfinite(value):  # clearances go with the shaft
            bearing = changed_pads(bearing, assembled_clearance=1e-3 * value, pad_clearance=1.5e-3 * value)
        return replace(bearing, **{name: value})
    if part is Oil:
        return changed_oil(bearing, **{name: value})
    if part is Pivot:
        return replace(bearing, pivot=replace(bearing.pivot, **{name: value}))
    last = bearing.pads[-1]
    if part is Material:
        last = replace(last, babbitt=replace(last.babbitt, **{name: value}))
    else:
        last = replace(last, **{name: value})
    return bearing.with_pads((*bearing.pads[:-1], last))


def test_every_number_of_every_part_has_bounds():
    for part, bounds in BOUNDS.items():
        floats = {f.name for f in dataclasses.fields(part) if f.type == "float"}
        assert floats == set(bounds)


@pytest.mark.parametrize("flow", [0.0, -1e-3, math.nan])
def test_oil_flows_or_its_flow_is_not_stated(rocker, flow):
    with pytest.raises(BearingError, match="supply_flow"):
        check_possible(with_number(rocker, Oil, "supply_flow", flow))
    check_possible(with_number(rocker, Oil, "supply_flow", math.inf))


@pytest.mark.parametrize("part", BOUNDS)
def test_what_lies_beyond_is_refused_by_name_and_the_bounds_themselves_pass(rocker, part):
    for name, (least, most, _, *share) in BOUNDS[part].items():
        size = getattr(rocker, *share) if share else 1.0
        low, high = least * size, most * size
        for value in (low, high):
            check_possible(with_number(rocker, part, name, value))
        beyond = {math.nextafter(low, -math.inf), math.nextafter(high, math.inf), math.inf, -math.inf}
        for value in beyond - {high}:  # a bound may be infinite
            with pytest.raises(BearingError, match=name):
                check_possible(with_number(rocker, part, name, value))


def test_nan_passes_only_where_the_kind_of_pivot_has_no_such_size(rocker):
    assert math.isnan(rocker.pivot.sphere_diameter)
    with pytest.raises(BearingError, match="viscosity_40 is nan"):
        check_possible(with_number(rocker, Oil, "viscosity_40", math.nan))


def test_predict_refuses_before_it_computes(rocker):
    stiff = with_number(rocker, Material, "youngs_modulus", 1e300)
    with pytest.raises(BearingError, match=r"pad 5, babbitt: youngs_modulus is 1e\+300; no bearing has that"):
        predict(stiff, 5000.0, -math.pi / 2, 138.0, thermal="tehd")


def run(bearing: Bearing, load: float = 5000.0, **more: Any) -> Prediction:
    return predict(bearing, load, **{"speed": SPEED, "mesh": (24, 4)} | more)


CASES = {
    "all well": (lambda b: run(b), ()),
    "fully unloaded pads": (lambda b: run(b, 8750.0, pivots=2e8), ("idle pads 3, 4",)),
    "thin film": (lambda b: run(b, 5e4), ("overloaded pads 1",)),
    "high pressure": (lambda b: run(b, 1e6, thermal="isothermal", pivots="rigid"), ("overloaded pads 1",)),
    "flow back": (lambda b: run(b, 5e4), ("flow back at a leading edge",)),
    "one pad under the load": (lambda b: run(b.with_pads(b.pads[:1])), ("nothing holds the journal across its load",)),
    "nothing to push against": (
        lambda b: run(b.with_pads(b.pads[:1]), load_direction=1.5),
        ("no pads against the load", "not converged"),
    ),
    "film lost to heat": (lambda b: run(b, 1e5), ("film lost", "not converged")),
    "film lost at the pads' edges": (
        lambda b: run(b, effects=[Effect("misalignment", angle=2e-3, direction=0.0)]),
        ("film lost", "not converged"),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_every_condition_has_its_name(rocker, name):
    action, names = CASES[name]
    p = action(rocker)
    if not names:
        assert p.status == ()
    for one in names:
        assert one in p.status, p.status
    assert p.converged is ("not converged" not in p.status)
    # numbers where it converged, NaN where it did not: never a number without an equilibrium
    assert np.isfinite(p.h).all() == p.converged
    assert np.isnan(p.h).all() != p.converged
    if not p.converged:
        assert math.isnan(p.mesh_error)


def test_a_load_between_two_pads_is_held_and_one_beside_them_is_not(rocker):
    def alone(*numbers: int, direction: float, hold: float = 0.0) -> bool:
        bearing = rocker.with_pads(tuple(rocker.pads[k - 1] for k in numbers))
        setup = Setup(bearing, pivot_laws("kirk", bearing), rotational_stiffness=hold)
        return unsupported(setup, 5000.0 * np.array([math.cos(direction), math.sin(direction)]))

    low, high = rocker.pads[0].pivot_angle, rocker.pads[1].pivot_angle
    middle = 0.5 * (low + high)
    assert not alone(1, 2, direction=middle)
    assert not alone(1, 2, direction=low)
    assert alone(1, 2, direction=low - 0.01)
    assert alone(1, 2, direction=high + 0.01)
    assert alone(1, 2, direction=middle + math.pi)
    assert not alone(1, direction=low)
    assert alone(1, direction=low + 0.01)
    assert not alone(1, direction=low + 0.01, hold=1e3)  # a held pad pushes aside as well
    for direction in np.linspace(-3.0, 3.0, 13):
        assert not alone(1, 2, 3, 4, 5, direction=float(direction))
    bearing = rocker.with_pads(rocker.pads[:1])
    assert not unsupported(Setup(bearing, pivot_laws("kirk", bearing)), np.zeros(2))


def test_limits_of_a_pad_are_told_apart(rocker):
    films = run(rocker).equilibrium.films
    assert overloaded_pads(films) == []
    hot = films[1]
    kept = hot.work.temperature[3, 1]
    hot.work.temperature[3, 1] = 151.0
    assert overloaded_pads(films) == [2]
    hot.work.temperature[3, 1] = kept
    films[2].work.pressure[5, 0] = 46e6
    films[3].work.thickness[5, 0] = 2e-6
    assert overloaded_pads(films) == [3, 4]
    films[2].idle = films[3].idle = True  # what carries nothing is not overloaded
    assert overloaded_pads(films) == []


def test_singular_steps_are_named(rocker, monkeypatch):
    # no bearing is known that gets there: the guard is held by a search that says so
    def singular(*arrays: object) -> int:
        return SINGULAR

    monkeypatch.setattr(iteration, "iterate", singular)
    p = run(rocker)
    assert "singular" in p.status
    assert not p.converged


def test_every_condition_is_explained_where_the_model_is():
    text = (Path(__file__).parents[2] / "docs" / "model.md").read_text(encoding="utf-8")
    rows = "\n".join(line.split("|")[1] for line in text.splitlines() if line.startswith("| "))
    # `pads 2, 4 stand concentric` stands for its kind; after `..` in a row only what differs
    kinds = [re.escape(kind) for kind in KINDS]
    patterns = [re.sub(r"\\\{[a-z]+(:[^}]*)?\\\}", r"[\\d,. and]+", kind) for kind in kinds]
    tails = [kind.split("}")[-1].strip() for kind in KINDS]
    for kind, pattern, tail in zip(KINDS, patterns, tails, strict=True):
        assert re.search(rf"`({pattern}|\.\. {re.escape(tail)})`", rows), kind


def test_a_condition_names_its_pads_and_numbers():
    touching = named("pads {pads} touch", (5, 1))
    assert (touching, touching.severity, touching.pads) == ("pads 5 and 1 touch", "warning", (5, 1))
    assert named("heat runs away", number=41.6).detail.startswith("journal and films find rest with up to 42 %")
    status = (named("idle pads {pads}", [3]), named("pads {pads} cannot keep their load", [2, 4]))
    assert pads_of("pads {pads} cannot keep their load", status) == (2, 4)
    with pytest.raises(KeyError):
        named("idle pad {pads}")
