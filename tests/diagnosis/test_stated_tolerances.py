"""What may be off is stated: in the bearing file, on the command line, by default; each with its source."""

import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect, apply_effects, kind_of
from model.possible import KEYS
from tests.diagnosis.rocker_case import ROCKER, points, rocker_setup
from tpjb_ident.diagnosis.forward.forward import Forward
from tpjb_ident.diagnosis.forward.nuisance import OWN_NUMBERS, nuisances, shifted
from tpjb_ident.diagnosis.forward.tolerances import DEFAULTS, Tolerances
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import planned_observations
from tpjb_ident.errors import BadInputError


def bearing_with(lines: str):
    return load_bearing(ROCKER.read_text(encoding="utf-8") + "\n[tolerances]\n" + lines + "\n")


def test_the_command_line_wins_over_the_bearing_file_and_that_over_defaults():
    typed = Tolerances().states({"viscosity": "4 %"}, "command line")
    found = typed.layered(bearing_with('viscosity = "2 %"\nclearance_scatter = "3 um"'))
    assert (found["viscosity"], found.stated["viscosity"].source) == (pytest.approx(0.04), "command line")
    assert (found["clearance_scatter"], found.stated["clearance_scatter"].source) == (3e-6, "bearing file")
    assert (found["film_heat"], found.stated["film_heat"].source) == (DEFAULTS["film_heat"], "default")


def test_a_bearing_file_states_every_tolerance():
    texts = {"ratio": "2 %", "length": "3 um", "temperature difference": "1 K", "angle": "0.1 deg"}
    kinds = KEYS["keys"]["tolerances"]
    assert list(kinds) == sorted(DEFAULTS, key=list(kinds).index)
    lines = [f'{name} = "{texts[kinds[name].partition(",")[0]]}"' for name in DEFAULTS]
    stated = Tolerances().layered(bearing_with("\n".join(lines))).stated
    assert {tolerance.source for tolerance in stated.values()} == {"bearing file"}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("viscosty", "4 %", "viscosity"),
        ("viscosity", "4 um", "ratio"),
        ("viscosity", "-4 %", "below zero"),
        ("viscosity", "4", "50 % and more"),
        ("viscosity", 4.0, "50 % and more"),
        ("clearance_scatter", "-1 um", "below zero"),
    ],
)
def test_a_tolerance_that_cannot_be_is_refused(name, value, said):
    with pytest.raises(BadInputError, match=said):
        Tolerances().states({name: value}, "command line")


def test_a_tolerance_of_nothing_leaves_its_nuisance_out():
    setup = rocker_setup()
    some = {n.name for n in nuisances((), setup, Tolerances())}
    less = {n.name for n in nuisances((), setup, Tolerances().states({"film_heat": 0.0}, "command line"))}
    assert some - less == {"film_heat"}


def test_nuisances_change_what_they_say():
    setup = rocker_setup()
    bearing = setup.bearing
    known = nuisances((), setup, Tolerances())
    size = tuple(
        2.0 if n.name in {"viscosity", "clearance_scatter"} and n.place in {"", "pad 3"} else 0.0 for n in known
    )
    bent = shifted(setup, known, size).bearing
    assert bent.oil.viscosity_40 == pytest.approx(bearing.oil.viscosity_40 * math.exp(0.1))
    shifts = [b.assembled_clearance - a.assembled_clearance for a, b in zip(bearing.pads, bent.pads, strict=True)]
    assert np.allclose(shifts, [0.0, 0.0, 4e-6, 0.0, 0.0], atol=1e-12)


def test_a_tolerance_that_an_effect_says_does_what_the_effect_does():
    drawn = rocker_setup()
    oil = replace(drawn.bearing.oil, supply_temperature=50.0)  # where an exponent about 40 °C is another one
    setup = drawn.change(bearing=replace(drawn.bearing, oil=oil))
    said = [n for n in nuisances((), setup, Tolerances()) if n.effect]
    assert {n.effect.split()[0] for n in said} == set(OWN_NUMBERS) - {"thermometer_offset"}
    for nuisance in said:
        name, *where = nuisance.effect.split()
        number = OWN_NUMBERS[name]
        parameter = kind_of(name).parameters[-1].name
        place = {where[0]: int(where[1])} if where else {}
        size = number.change(number.parameter(-nuisance.sigma))
        assert size == pytest.approx(-nuisance.sigma)
        effect = Effect(name, **place, **{parameter: number.parameter(size)})
        changed, other = nuisance.change(setup, size), apply_effects(setup, [effect])
        for seen in ("displacement_map", "force_map"):
            assert np.array_equal(getattr(changed.instruments, seen)(9.0), getattr(other.instruments, seen)(9.0))
        assert changed.change(instruments=setup.instruments) == other.change(instruments=setup.instruments)


def test_a_thermometer_has_its_own_number():
    setup, layout = rocker_setup(), Layout(points([5000.0], 5))
    elements = planned_observations(setup, layout).elements
    listed = [n for n in nuisances(elements, setup, Tolerances()) if n.name == "thermometer"]
    assert [n.effect for n in listed] == [f"thermometer_offset pad {k}" for k in range(1, 6)]
    forward = Forward(setup, layout, elements)
    shown = forward([Effect("thermometer_offset", pad=2, offset=0.5)]) - forward()
    assert np.allclose(shown, listed[1].column, atol=1e-9)
