"""Clearance sweeps of the virtual rig, and polygons by hand: clearance per pad, centre, side angles, refusals."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata.campaign import load_campaign
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from rigdata.vector import directions
from rigdata.virtual_rig import ClearanceSweep, DryTest, Fault, Noise, RigPlan
from tests.clearance.cases import ANGLES, CLEARANCE, OtherRun, bearing_centre, rig, sphere
from tpjb_ident.clearance.measure import _inseparable, coldest_first, measure_clearance, measure_run, pairs_frame
from tpjb_ident.clearance.polygon import find_centre as find_centre_of
from tpjb_ident.clearance.sweep import _settled
from tpjb_ident.compare.static_tests import bearing_problems
from tpjb_ident.conditions import sentences
from tpjb_ident.pivot.fit import fit_pivots


def find_centre(angles, distances, covariance, gains=((0.0,),)):
    """Centre of probes whose gains are known exactly."""
    return find_centre_of(angles, distances, covariance, np.ones((len(angles), 1)) * gains)


WHOLE = rig(
    RigPlan(dry=tuple(DryTest(p) for p in range(1, 6)), clearance=(ClearanceSweep(), ClearanceSweep(push=800.0)))
)


@pytest.fixture(scope="session")
def opened(campaign_of):
    """Gives the campaign of a rig."""
    return lambda rig: load_campaign(campaign_of(rig))


@pytest.fixture(scope="module")
def whole(opened):
    """Campaign with dry tests and two sweeps, and its curves."""
    source = opened(WHOLE)
    return source, fit_pivots(source, ANGLES)


@pytest.fixture(scope="module")
def measured(whole):
    """Both sweeps, the lighter push first."""
    source, curves = whole
    return tuple(measure_run(run, ANGLES, curves) for run in source.of_kind("clearance"))


def test_clearance_and_centre_with_one_pad_off(whole):
    source, curves = whole
    found = measure_clearance(source, ANGLES, curves)
    assert found.push_load == pytest.approx(200.0, rel=0.02)
    assert found.clearance == pytest.approx(CLEARANCE, abs=0.3e-6)
    assert found.clearance_pushed == pytest.approx(CLEARANCE + sphere(1, 200.0), abs=0.3e-6)
    assert np.all(np.abs(found.centre - bearing_centre(WHOLE)) < 4 * np.sqrt(np.diag(found.centre_covariance)))
    assert any(s.startswith("irregular: pad #3 +") for s in sentences(found.status))
    assert found.fitted_angle == pytest.approx(ANGLES, abs=2e-3)
    assert found.pivot_scale == pytest.approx(1.0, abs=0.08)
    frame = found.to_frame()
    needed = {"pad", "clearance_m", "clearance_m_se", "clearance_pushed_m", "clearance_pushed_m_se"}
    assert needed <= set(frame.columns)
    assert "µm (se)" in str(found)


def test_pads_that_stand_further_out_than_they_are_bored_have_negative_preload(whole):
    """Pad #3 stands 6 um further out than the others, and is bored 5 um smaller."""
    source, curves = whole
    bored = [SimpleNamespace(pivot_angle=angle, pad_clearance=83e-6, assembled_clearance=80e-6) for angle in ANGLES]
    bored[2].pad_clearance = 78e-6
    bearing = SimpleNamespace(pads=bored, pivot_angles=ANGLES, clearances=(80e-6,) * len(ANGLES))
    named = [p for p in bearing_problems(source, bearing) if p.place == "preload"]
    assert [p.severity for p in named] == ["warning", "warning"]
    for problem in named:
        assert re.search(r"negative preload: #3 -0\.(10|09)\d$", problem.what)
    polygon = measure_clearance(source, ANGLES, curves)
    assert polygon.negative_preloads([80e-6, 80e-6, 86e-6, 80e-6, 80e-6]) == ""


@pytest.mark.parametrize("turned", [(0.0, 0.0), (7.0, 0.0), (0.0, -24.0)])
def test_a_probe_that_stands_elsewhere_is_told_by_the_sides_and_read_there(whole, measured, turned):
    source, _ = whole
    (run,) = (run for run in source.runs if run.id == measured[0].run)
    channels = dict(run.channels)
    for probe, angle in zip(run.of("displacement"), turned, strict=True):
        channels[probe.name] = replace(probe, axis=probe.axis - np.radians(angle))
    shown = measure_run(replace(run, channels=channels), ANGLES)
    assert shown.clearance == pytest.approx(measured[0].clearance, abs=0.6e-6)
    words = [condition.detail for condition in shown.status if condition == "probe-turned"]
    told = [float(text.partition(" stood ")[2].partition(" deg")[0]) for text in words]
    assert told == ([pytest.approx(sum(turned), abs=0.3)] if any(turned) else [])


def test_two_push_loads_give_the_radial_stiffness_and_a_hot_sweep_what_the_bearing_grew(whole, measured, opened):
    source, curves = whole
    light, heavy = measured
    assert coldest_first(source.of_kind("clearance"))[0].id == light.run
    warm = replace(heavy, run="warm", temperature=light.temperature + 20.0, clearance=light.clearance + 5e-6)
    grown = replace(measure_clearance(opened(rig(clearance=CLEARANCE + 6e-6)), ANGLES, curves), run="grown")
    assert np.abs(grown.centre - light.centre).max() < 1e-6
    frame = pairs_frame(light, [heavy, warm, grown])
    assert dict(frame.groupby("run")["compared"].first()) == {
        heavy.run: "push load", "warm": "condition", "grown": "push load"}  # fmt: skip
    push, hot, same = (frame[frame["run"] == name] for name in (heavy.run, "warm", "grown"))
    true = (heavy.push_load - light.push_load) / (sphere(1, heavy.push_load) - sphere(1, light.push_load))
    assert push["stiffness_N_per_m"].to_numpy() == pytest.approx(true, rel=0.15)
    assert np.all(push["stiffness_N_per_m_se"] < 0.1 * true)
    assert push["load_N"].to_numpy() == pytest.approx(500.0, rel=0.02)
    assert hot["change_m"].to_numpy() == pytest.approx(5e-6)
    # another condition, or a push that hardly differs, tells nothing of the stiffness
    assert hot["stiffness_N_per_m"].isna().all()
    assert same["stiffness_N_per_m"].isna().all()
    assert np.mean(same["change_m"]) == pytest.approx(6e-6, abs=0.15e-6)
    assert same["change_m"].to_numpy() == pytest.approx(6e-6, abs=0.3e-6)
    assert np.all((same["change_m_se"] > 0.0) & (same["change_m_se"] < 0.4e-6))
    assert light.temperature == pytest.approx(273.15 + 24.0, abs=1.0)


def test_the_cold_sweep_counts_however_small_the_hot_ones_push(whole):
    source, _ = whole
    light, heavy = source.of_kind("clearance")
    warm = OtherRun(light, id="warm", mean_temperature=lambda: light.mean_temperature() + 20.0)
    assert coldest_first([warm, heavy])[0].id == heavy.id
    assert coldest_first([warm])[0].id == "warm"


def test_the_push_below_the_dry_tests_is_marked_as_extrapolated(measured):
    light, _ = measured
    assert any(s == "give-extrapolated" and "all pads hold" in s.detail for s in light.status)


def test_a_turning_shafts_runout_averages_out(whole):
    """The sweep of a turning shaft: 1.1 um of runout on top, found again as on the shaft at rest."""
    source, curves = whole
    run = source.of_kind("clearance")[0]
    speed = 2 * np.pi * 22.0

    def runout(time):
        turn = 1.0009 * speed * time  # the set point is missed by as much as on the samples
        return 1.1e-6 * np.column_stack([np.cos(turn), np.sin(turn)])

    point = OperatingPoint(run.point.static_load, run.point.static_load_direction, speed)
    spun = OtherRun(run, runout, id="turning", point=point)
    still, turning = (measure_run(r, ANGLES, curves) for r in (run, spun))
    assert turning.clearance == pytest.approx(still.clearance, abs=0.1e-6)
    assert np.all(turning.clearance_se < 2 * still.clearance_se + 1e-8)


def test_without_curves_zero_load_is_extrapolated(whole):
    source, _ = whole
    found = measure_clearance(source, ANGLES)
    assert np.all(np.abs(found.clearance - CLEARANCE) < 4 * found.clearance_se)
    assert found.clearance == pytest.approx(CLEARANCE, abs=0.6e-6)
    assert "give-from-sweep" in found.status


@pytest.mark.parametrize("missing", [1, 2, 4])
def test_a_pad_without_a_dry_test_deflects_as_the_sweep_says(whole, missing):
    """Taken for rigid it drew the polygon off by 0.2 to 3.6 um, at a stated error of 0.1 to 0.3."""
    source, curves = whole
    known = [curve for curve in curves if curve.pad != missing]
    found, best = measure_clearance(source, ANGLES, known), measure_clearance(source, ANGLES, curves)
    assert np.all(np.abs(found.clearance - CLEARANCE) < 4 * found.clearance_se)
    assert found.clearance == pytest.approx(best.clearance, abs=0.15e-6)
    (told,) = (s.detail for s in found.status if s == "give-from-sweep")
    assert f"of pads #{missing}," in told
    assert any(s == "give-extrapolated" and f"#{missing}" not in s.detail for s in found.status)


def test_a_converter_of_coarse_steps_shows_corners_that_stand_still():
    """The step hides how pivots deflect: most pieces of a corner stay where they are, and that is no way to it."""
    place = np.zeros((40, 2))
    place[:5, 0] = 1e-5 * np.arange(5, 0, -1)
    place[20:, 1] = 0.75e-6
    corner = np.ones((40, 2), dtype=bool)
    expected = np.ones(40, dtype=bool)
    expected[:7] = expected[18:22] = False  # on its way, and what stands beside a step
    np.testing.assert_array_equal(_settled(0.1 * np.arange(40), place, corner), expected)


@pytest.mark.parametrize(("gain", "refused"), [(1.005, False), (1.1, True)])
def test_a_third_probe_that_contradicts_two_is_refused(whole, gain, refused):
    source, _ = whole
    run = source.of_kind("clearance")[0]
    third = replace(run.channels["X1A"], name="X1C", axis=0.5 * np.pi)
    reading = gain * run.vector("displacement").values[:, 1]

    def record(name):
        return SimpleNamespace(values=reading) if name == "X1C" else run.record(name)

    more = OtherRun(run, channels={**run.channels, "X1C": third}, record=record)
    if refused:
        with pytest.raises(RigDataError, match="X1C contradict one another"):
            measure_run(more, ANGLES)
    else:
        assert len(measure_run(more, ANGLES).clearance) == len(ANGLES)


def test_a_polygon_says_how_far_the_probes_gains_are_known(whole):
    source, _ = whole
    run = source.of_kind("clearance")[0]
    channels = {n: replace(c, uncertainty=0.01) if c.quantity == "displacement" else c for n, c in run.channels.items()}
    found = measure_run(OtherRun(run, channels=channels), ANGLES).relative_calibration
    assert found[0] == pytest.approx(0.01 / np.sqrt(2))  # between two probes
    assert np.all((found >= found[0] - 1e-12) & (found < 0.01))


def test_unequal_probes_are_made_alike_and_their_difference_is_in_the_interval(opened):
    source = opened(rig(clearance=(80e-6,) * 5, faults=(Fault("scaled", channel="X1A", value=1.03),)))
    found = measure_clearance(source, ANGLES)
    (words,) = [s.detail for s in found.status if s == "probe-gains-differ"]
    assert "X1A read" in words
    assert "more than X1B" in words
    # uncorrected, the sides stand up to 1.6 um from one another: no pad is worn
    assert "irregular" not in found.status
    assert np.ptp(found.clearance) < 0.6e-6
    assert found.fitted_angle == pytest.approx(ANGLES, abs=2e-3)
    errors = 1.96 * np.hypot(found.clearance_se, found.relative_calibration * found.clearance)
    assert np.all(np.abs(found.clearance - 80e-6) < errors)
    # a diagnosis asks what the probes read: the plane stretched by 3 % along one of them
    pushed, turned = found.as_read
    assert np.ptp(pushed) > 1e-6
    assert np.max(np.abs(turned - ANGLES)) == pytest.approx(0.015, rel=0.2)


def test_a_sweep_of_three_or_four_pads_says_what_it_leaves_open():
    for number, expected in (
        (3, "only their mean"),
        (4, "tells which: pad #1 +8.0 µm, pad #2 -8.0 µm, pad #3 +8.0 µm"),
    ):
        angles = np.radians([-90.0, 0.0, 90.0, 180.0][:number]) * (1.0 if number == 4 else 4.0 / 3.0)
        for off in (8e-6, 0.0):
            distance, covariance = 80e-6 + off * (np.arange(number) == 2), np.eye(number) * 1e-16
            sides = SimpleNamespace(pads=np.arange(number), covariance=covariance)
            centre = find_centre(angles, distance, covariance)
            details = [condition.detail for condition in _inseparable(sides, centre, np.zeros((number, 2)))]
            assert len(details) == (off > 0.0 or number == 3)
            assert all(expected in detail for detail in details)


def test_a_clean_sweep_is_measured_to_a_tenth_of_a_micrometre(opened):
    clean = rig(noise=Noise.none(), clearance=(80e-6,) * 5)
    found = measure_clearance(opened(clean), ANGLES)
    assert found.clearance == pytest.approx(80e-6, abs=0.2e-6)
    assert found.centre == pytest.approx(bearing_centre(clean), abs=0.05e-6)


FAULTS = {
    "probes exchanged": Fault("swapped", channel="X1A", other="X1B"),
    "cells exchanged": Fault("swapped", channel="L1H", other="L1V"),
    "probe reversed": Fault("inverted", channel="X1A"),
    "cell dead": Fault("dead", channel="L1V"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_sweep_that_is_none_is_refused(opened, name):
    source = opened(rig(faults=(FAULTS[name],)))
    with pytest.raises(RigDataError, match=r"clearance run|stuck, clipped or dead"):
        measure_clearance(source, ANGLES)


def test_no_sweep_is_an_error(opened):
    source = opened(rig(RigPlan(dry=(DryTest(1),))))
    with pytest.raises(RigDataError, match="no run of kind clearance"):
        measure_clearance(source, ANGLES)


SMALL = np.eye(5) * (1e-8) ** 2
MICRO = st.floats(-50e-6, 50e-6)


@settings(max_examples=30)
@given(x=MICRO, y=MICRO, offset=st.floats(2e-6, 30e-6), pad=st.integers(0, 4), sign=st.sampled_from([-1, 1]))
def test_one_pad_off_is_found_exactly(x, y, offset, pad, sign):
    clearance = np.full(5, 80e-6)
    clearance[pad] += sign * offset
    found = find_centre(ANGLES, clearance + directions(ANGLES) @ [x, y], SMALL)
    # square within the measurement error: a few hundredths of a micrometre remain
    assert found.position == pytest.approx([x, y], abs=8e-8)
    assert found.clearance == pytest.approx(80e-6, abs=8e-8)


def test_differences_within_the_error_are_averaged():
    clearance = 80e-6 + np.array([1.0, -0.5, 0.2, -0.9, 0.4]) * 1e-8
    square = np.linalg.lstsq(np.column_stack([directions(ANGLES), np.ones(5)]), clearance, rcond=None)[0]
    assert find_centre(ANGLES, clearance, SMALL).position == pytest.approx(square[:2], abs=1e-12)


@pytest.mark.parametrize("degrees", [(-90, 0, 90, 180), (-45, 45, 135, 225), (-90, -30, 30, 150)])
@pytest.mark.parametrize("pad", range(4))
def test_of_four_pads_any_may_be_off_and_the_error_reaches_to_each(degrees, pad):
    angles = np.radians(degrees)
    clearance = np.full(4, 80e-6)
    clearance[pad] += 8e-6
    found = find_centre(angles, clearance, np.eye(4) * 1e-16)
    n = directions(angles)
    # the sides stand at the clearances: the true centre is zero
    assert found.suspects[pad] == pytest.approx(8e-6, abs=1e-9)
    if degrees[3] - degrees[0] == 270:
        assert found.suspects == pytest.approx(8e-6 * (-1.0) ** (np.arange(4) - pad), abs=1e-9)
    errors = 1.96 * np.sqrt(np.einsum("ki,ij,kj->k", n, found.covariance, n))
    assert np.all(np.abs(n @ found.position) <= errors)
    assert errors.max() < 1.25 * np.abs(found.suspects).max()
    five = find_centre(ANGLES, np.full(5, 80e-6), SMALL)
    assert not five.covariance.any()
    assert not five.suspects.any()


@pytest.mark.parametrize(
    ("off", "is_open"),
    [
        ([0.0, 0.0, 25.0, 0.0, 0.0], False),
        ([0.3, -0.2, 0.1, -0.3, 0.2], False),
        ([0.0, 3.0, -1.0, 1.0, -2.0], True),
        ([0.0, 3.0, 0.0, 2.0, -2.0], True),
    ],
)
@pytest.mark.parametrize("ratio", [1.0, 0.998])
def test_pads_of_which_none_alone_explains_the_sweep_leave_the_centre_in_doubt(off, is_open, ratio):
    """Of 100, 103, 99, 101, 98 um one was told as worn by 3.7 um, and nothing held that all may stand off by some."""
    angles = ANGLES[0] + 2.0 * np.pi * np.arange(len(off)) / len(off)
    n, share = directions(angles), np.cos(angles[:, None] - np.radians([45.0, 135.0])) ** 2
    distance = (100e-6 + 1e-6 * np.array(off)) * (share @ [ratio, 1.0])
    found = find_centre(angles, distance, np.eye(len(off)) * 1e-16, 0.5e-6 * share)
    half = 1.96 * np.sqrt(np.sum(n @ found.doubt * n, axis=1))
    assert (half.max() > 1e-6) == is_open
    if is_open:  # the bearing's own centre is at zero
        assert np.all(np.abs(n @ found.position) < half)


@pytest.mark.parametrize(("scatter", "held"), [(0.0, 0.9), (1.5, 0.9), (2.5, 0.83)])
def test_intervals_of_pads_that_differ_as_they_are_made_hold_them(scatter, held):
    """Of five pads four are alike by chance now and then: 60 % of the intervals held, about a centre 3 um off."""
    rng = np.random.default_rng(3)
    n, share = directions(ANGLES), np.cos(ANGLES[:, None] - np.radians([45.0, 135.0])) ** 2
    inside = []
    for _ in range(100):
        clearance = 80e-6 + 1e-6 * scatter * rng.standard_normal(5)
        gain, noise = 1.0 + share @ rng.normal(0.0, 0.005, 2), 1e-7 * rng.standard_normal(5)
        distance = clearance * gain + n @ rng.normal(0.0, 2e-5, 2) + noise
        found = find_centre_of(ANGLES, distance, np.eye(5) * 1e-14, 0.005 * 80e-6 * share)
        variance = 1e-14 + np.sum((0.005 * 80e-6 * share) ** 2, axis=1) + np.sum(n @ found.doubt * n, axis=1)
        inside.append(np.abs(distance - n @ found.position - clearance) < 1.96 * np.sqrt(variance))
    assert held <= np.mean(inside)


@pytest.mark.parametrize("angles", [ANGLES[:2], np.zeros(5)])
def test_pads_that_do_not_surround_the_shaft_are_refused(angles):
    with pytest.raises(ValueError, match="around the shaft"):
        find_centre(angles, np.full(len(angles), 80e-6), np.eye(len(angles)) * 1e-16)
