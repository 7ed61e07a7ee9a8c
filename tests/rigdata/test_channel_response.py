"""Filters, delays and measured responses of channels, and vectors from channels along any axes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata.calibration import Channel, ChannelResponse, parse_filter, parse_response_table
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError
from rigdata.run import speed_from_pulses
from rigdata.units import UnitError
from rigdata.vector import directions, vector_rows
from tests.manifests import SET_POINT, manifest

FORCE = {
    "quantity": "force",
    "axis": "0 deg",
    "unit": "N",
    "axis_uncertainty": "0.5 deg",
    "delay": "0.2 ms",
    "delay_uncertainty": "20 us",
    "filter": "butterworth 2 low 400 Hz",
    "clock": "B",
    "zero_uncertainty": "50 N",
}
MANIFEST = manifest(
    {"F": FORCE, "CMD": {"quantity": "command", "axis": "0 deg"}, "KEY": {"quantity": "keyphasor"}},
    {"id": "r", "kind": "dynamic", "excitation": "random", "excitation_band": "5..120 Hz", **SET_POINT},
    {"id": "b", "kind": "baseline", "excitation_frequency": "25 Hz"},
    housing={"mass": "30 kg", "mass_uncertainty": "0.5 kg"},
    acquisition={"mains": "60 Hz"},
)


@pytest.mark.parametrize("family", ["bessel", "butterworth"])
def test_a_corner_is_where_the_amplitude_has_fallen_by_3_db(family):
    low = parse_filter(f"{family} 4 low 800 Hz").at(np.array([800.0, 1e-3]))
    assert np.abs(low) == pytest.approx([math.sqrt(0.5), 1.0], rel=1e-6)
    assert np.abs(parse_filter(f"{family} 2 high 5 Hz").at(np.array([5.0]))) == pytest.approx(math.sqrt(0.5))


@pytest.mark.parametrize("text", ["", "bessel", "chebyshev 4 low 8 Hz", "bessel 0 low 8 Hz", "bessel 4 low 8 kg"])
def test_what_is_no_filter_is_refused(text):
    with pytest.raises(UnitError):
        parse_filter(text)


def test_a_measured_response_is_linear_between_its_lines():
    table = parse_response_table("frequency_Hz, gain, phase_deg\n10, 1.0, -10\n30, 0.8, -30\n")
    assert table.at(np.array([20.0]))[0] == pytest.approx(0.9 * np.exp(-1j * math.radians(20)))
    assert np.isnan(table.at(np.array([40.0]))[0])
    with pytest.raises(UnitError, match="rise"):
        parse_response_table("10, 1, 0\n10, 1, 0\n")


def test_a_delay_turns_the_phase_back():
    assert ChannelResponse((), 1e-3).at(np.array([25.0]))[0] == pytest.approx(np.exp(-2j * math.pi * 0.025))


def test_a_manifest_states_what_is_known_of_channels():
    manifest = parse_manifest(MANIFEST)
    force = manifest.channels["F"]
    assert (manifest.mains, manifest.mass_uncertainty) == (60.0, 0.5)
    assert (force.axis_uncertainty, force.delay_uncertainty) == pytest.approx((math.radians(0.5), 2e-5))
    assert (force.clock, force.zero_uncertainty, force.response.delay) == ("B", 50.0, 2e-4)
    assert force.response.filters[0].corner == 400.0
    assert manifest.runs[0].band == (5.0, 120.0)
    assert [run.kind for run in manifest.runs] == ["dynamic", "baseline"]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"60 Hz"', '"55 Hz"', "mains"),
        ("butterworth 2 low", "butterworth two low", "whole number"),
        ('"5..120 Hz"', '"120..5 Hz"', "excitation_band"),
        ('"5..120 Hz"', '"5 Hz"', "excitation_band"),
        ('"20 us"', '"-20 us"', "delay_uncertainty"),
        ('filter = "butterworth 2 low 400 Hz"', 'filter_table = "x.csv"', "filter_table"),
    ],
)
def test_what_is_stated_wrongly_is_named(old, new, told):
    with pytest.raises(RigDataError, match=told):
        parse_manifest(MANIFEST.replace(old, new))


def test_pulses_tell_the_speed():
    time = np.arange(4000) / 2000
    turns = 20.0 * time + 0.5 * time**2
    readings = np.where(turns % 1.0 < 0.08, 5.0, 0.0) + 0.01 * np.sin(300 * time)
    speed = speed_from_pulses(readings, time) / (2 * math.pi)
    np.testing.assert_allclose(speed[200:-200], (20.0 + time)[200:-200], rtol=0.01)
    assert np.isnan(speed_from_pulses(readings[:20], time[:20])).all()


def solve(axes, *samples, **calibration):
    """X and Y (n, 2) of samples, one reading per axis each."""
    channels = [Channel(f"C{i}", "displacement", axis=axis, **calibration) for i, axis in enumerate(axes)]
    return vector_rows(channels, list(np.array(samples, dtype=float).T)).T


def test_two_planes_of_probes_tell_the_place_at_the_mid_plane_as_far_as_all_have_values():
    axes, planes = np.radians([45, 135, 45, 135]), np.array([0.04, 0.04, -0.025, -0.025])
    channels = [Channel(f"C{i}", "displacement", axis=a, plane=p) for i, (a, p) in enumerate(zip(axes, planes))]
    readings = directions(axes) @ np.array([3.0, 4.0]) + planes * (directions(axes) @ np.array([20.0, -10.0]))
    three = np.where([True, True, True, False], readings, np.nan)
    rows = vector_rows(channels, list(np.array([readings, three, readings]).T)).T
    np.testing.assert_allclose(rows[[0, 2]], [[3.0, 4.0]] * 2, rtol=1e-5)
    along = rows[1] @ directions(axes[0])
    assert along == pytest.approx(np.array([3.0, 4.0]) @ directions(axes[0]), rel=1e-5)  # both planes have this axis
    one = [replace(channel, plane=0.04) for channel in channels]
    plain = [replace(channel, plane=0.0) for channel in channels]
    np.testing.assert_array_equal(*(vector_rows(chosen, list(readings[:, None])) for chosen in (one, plain)))


@settings(max_examples=40, deadline=None)
@given(st.floats(-7, 7), st.floats(0.1, 3.0), st.floats(-1, 1), st.floats(-1, 1))
def test_any_two_angles(first, between, x, y):
    axes = np.array([first, first + between])
    readings = np.cos(axes) * x + np.sin(axes) * y
    assert solve(axes, readings)[0] == pytest.approx([x, y], abs=1e-9)
    calibrated = solve(axes, -(readings - 0.5) / 2.0, gain=2.0, polarity=-1, zero=0.5)
    assert calibrated[0] == pytest.approx([x, y], abs=1e-9)


def test_three_directions_least_squares():
    axes = np.radians([0.0, 60.0, 120.0])
    readings = np.array([1.0, 1.0, 0.5])
    expected = np.linalg.lstsq(np.stack([np.cos(axes), np.sin(axes)], 1), readings, rcond=None)[0]
    assert solve(axes, readings)[0] == pytest.approx(expected)


def test_missing_values_and_overflows():
    nan = np.nan
    samples = [[1.0, 2.0, nan], [1.0, -9.9e37, np.sqrt(2.0)], [1.0, nan, nan], [nan, 1e99, np.inf]]
    solved = solve(np.radians([0.0, 90.0, 45.0]), *samples)
    assert solved[0] == pytest.approx([1.0, 2.0])
    assert solved[1] == pytest.approx([1.0, 1.0])
    assert np.isnan(solved[2:]).all()


def test_collinear_gives_no_value():
    assert np.isnan(solve([0.0, np.pi], [1.0, -1.0])).all()
