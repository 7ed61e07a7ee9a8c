"""Named conditions: every status can happen, and says so by name; nothing fails without a word."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from model.bearing import Bearing
from model.conditions import KINDS, named, pads_of
from model.effects import Effect
from model.pivots import pivot_laws
from model.predict import predict
from model.prediction import Prediction
from model.setup import Setup
from model.statics.compiled import iteration
from model.statics.compiled.iteration import SINGULAR
from model.statics.conditions import overloaded_pads, unsupported
from tests.model.points import SPEED


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
    "nothing carries": (
        lambda b: run(b, effects=[Effect("starvation", arc_fraction=0.6)]),
        ("not converged", "idle pads 1, 2, 3, 4, 5"),
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
