"""Numbers that no bearing has are refused with their name; all that a bearing may have passes."""

import dataclasses
import math
from dataclasses import replace

import pytest

from model.bearing import Bearing, BearingError, Material, Oil, Pivot
from model.possible import BOUNDS, check_possible
from model.predict import predict


def with_number(bearing: Bearing, part: type, name: str, value: float) -> Bearing:
    if part is Bearing:
        return replace(bearing, **{name: value})
    if part is Oil:
        return replace(bearing, oil=replace(bearing.oil, **{name: value}))
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
    for name, (low, high, _) in BOUNDS[part].items():
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
