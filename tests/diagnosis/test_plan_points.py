"""Points of a plan as quantities: every combination, any unit, a wrong one named."""

import math

import pint
import pytest

from rigdata.units import UnitError
from tpjb_ident.diagnosis.from_python import points_of
from tpjb_ident.errors import ArgumentError

U = pint.UnitRegistry(cache_folder=None)


def test_every_combination_in_any_unit():
    points = points_of(
        {"load": U.Quantity([2.5, 5.0], "kN"), "speed": U.Quantity(1320, "rpm"), "excitation": [100.0, 150.0]}
    )
    assert [(p.static_load, p.excitation) for p in points] == [
        (2500.0, 100.0), (2500.0, 150.0), (5000.0, 100.0), (5000.0, 150.0)]  # fmt: skip
    assert points[0].shaft_speed == pytest.approx(2 * math.pi * 22)
    assert points[0].static_load_direction == -math.pi / 2


def test_what_is_wrong_is_named():
    with pytest.raises(UnitError, match="points: load"):
        points_of({"load": U.Quantity(5, "m"), "speed": 138.0, "excitation": 157.0})
    with pytest.raises(ArgumentError, match="Did you mean 'speed'"):
        points_of({"load": 5000.0, "sped": 138.0, "excitation": 157.0})
    with pytest.raises(ArgumentError, match="excitation is missing"):
        points_of({"load": 5000.0, "speed": 138.0})
