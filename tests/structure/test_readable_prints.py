"""What `print` says of a bearing, a pad, a prediction and an operating point: one line a person reads."""

from __future__ import annotations

import math

from model.bearing_file import load_bearing
from model.predict import predict
from rigdata import OperatingPoint


def test_bearing_and_pad(rocker_file):
    bearing = load_bearing(rocker_file)
    assert str(bearing) == (
        "Rocker-backed five-pad bearing: 5 pads, 99.86 x 69.6 mm, Cb 80 um, preload 0.385 (pad #1), rocker pivots, "
        "oil ISO VG 46 at 40 degC"
    )
    assert str(bearing.pads[0]) == "pad at -90 deg, 63.5 deg of arc, Cb 80 um, preload 0.385"
    assert "0 pads" in str(bearing.with_pads(()))


def test_prediction(rocker_file):
    p = predict(load_bearing(rocker_file), 5000.0, speed=2 * math.pi * 22, thermal="isothermal")
    assert str(p).startswith("5000 N at -90 deg, 22 Hz: shaft at (")
    assert f"thinnest film {1e6 * p.min_film:.3g} um" in str(p)
    assert str(p).endswith("all well")


def test_operating_point():
    point = OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 2 * math.pi * 25)
    assert str(point) == "5000 N at -90 deg, shaft 22 Hz, excited at 25 Hz"
    assert str(OperatingPoint(500.0)) == "500 N at -90 deg, shaft at rest"
