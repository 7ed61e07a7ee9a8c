"""Locus runs of the virtual rig: mean positions from the bearing centre, repeats, set points, the polygon as a wall."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.problem import RigDataError
from rigdata.virtual_rig import Fault, Instruments, RigPlan, RigTruth, locus_points
from tests.clearance.cases import ANGLES, SWEEP, OtherRun, rig
from tpjb_ident.clearance import locus
from tpjb_ident.clearance.locus import measure_locus
from tpjb_ident.clearance.measure import measure_clearance

K = np.diag([1.2e8, 1.0e8])


@pytest.fixture(scope="module")
def opened(campaign_of):
    """Gives the campaign with these points of a locus and, unless told otherwise, a clearance sweep."""

    def make(points, k=K, clearance=SWEEP.clearance, **changes):
        truth = RigTruth.constant(k, np.diag([4e5, 6e5]), pivot_stiffness=6e8)
        plan, instruments = RigPlan(locus=points, clearance=clearance), Instruments.like_paper(seed=2)
        stated = {"plan": plan, "truth": truth, "instruments": instruments, "seed": 9}
        return load_campaign(campaign_of(rig(**(stated | changes))))

    return make


def true_position(direction, load=5000.0, k=K):
    return np.linalg.solve(k, load * np.array([np.cos(direction), np.sin(direction)]))


@pytest.fixture(scope="module")
def campaign(opened):
    return opened(locus_points(6))


@pytest.fixture(scope="module")
def raw(campaign):
    """Positions without a polygon."""
    return measure_locus(campaign)


@pytest.fixture(scope="module")
def polygon(campaign):
    return measure_clearance(campaign, ANGLES)


def test_positions_from_the_bearing_centre(campaign, polygon):
    found = measure_locus(campaign, polygon)
    assert len(found.points) == 6
    for point in found.points:
        # where the load really stood: the set point is missed by 0.3 % and 0.2 deg
        error = point.position - true_position(point.load_direction, point.load)
        assert np.all(np.abs(error) < 4.5 * np.sqrt(np.diag(point.covariance)))
        assert np.abs(error).max() < 1e-6
    assert "drift-unknown" in found.status
    frame = found.to_frame()
    needed = ["static_load_direction_deg", "x_m", "y_m", "x_m_se", "y_m_se"]
    assert set(needed) <= set(frame.columns)
    assert frame.static_load_direction_deg.iloc[0] == pytest.approx(-90.0)
    assert "6 positions" in str(found)


@pytest.mark.parametrize("channel", ["X1A", "X1B"])
def test_tables_hold_a_gain_that_the_sweep_doubts(opened, channel):
    """A probe 20 % high was named, and positions and clearances stood nine half-intervals off."""
    truth = RigTruth.constant(K, np.diag([4e5, 6e5]), pivot_stiffness=6e8, clearance=(80e-6,) * 5)
    source = opened(locus_points(6), truth=truth, faults=(Fault("scaled", channel=channel, value=1.2),))
    polygon = measure_clearance(source, ANGLES)
    assert "probe-gains-differ" in polygon.status
    table = polygon.to_frame()
    assert np.all(np.abs(table.clearance_m - 80e-6) < 1.96 * table.clearance_m_se)
    assert np.all(np.abs(table.clearance_m - 80e-6) > 3.0 * polygon.clearance_se)
    table = measure_locus(source, polygon).to_frame()
    directions = np.radians(table.static_load_direction_measured_deg)
    true = np.array([true_position(*pair) for pair in zip(directions, table.static_load_measured_N, strict=True)])
    for place, error, axis in ((table.x_m, table.x_m_se, true[:, 0]), (table.y_m, table.y_m_se, true[:, 1])):
        assert np.all(np.abs(place - axis) < 1.96 * error + 0.3e-6)


def test_without_a_polygon_positions_are_raw_and_say_so(campaign, polygon, raw):
    assert raw.centre.tolist() == [0.0, 0.0]
    assert "no-centre" in raw.status
    assert raw.points[0].point == campaign.of_kind("locus")[0].point
    both = measure_locus(campaign, polygon)
    shift = raw.points[2].position - both.points[2].position
    assert shift == pytest.approx(both.centre)


class Repeated:
    """A campaign with runs done again; `offsets` (n, 2) [m] move what is read in every run."""

    def __init__(self, campaign, again, offsets):
        runs = campaign.of_kind("locus")
        self.channels, runs = campaign.channels, [*runs, *(runs[k] for k in again)]
        self.runs = [OtherRun(r, lambda time, o=o: o, id=f"l-{k}") for k, (r, o) in enumerate(zip(runs, offsets))]

    def of_kind(self, kind):
        return self.runs if kind == "locus" else ()


def test_a_repeated_direction_shows_the_drift(campaign):
    # the last run done again as the first one, with the shaft found 4 um further on: a campaign of seven runs
    found = measure_locus(Repeated(campaign, [0], np.outer(np.arange(7) == 6, [4e-6, -2e-6])))
    assert found.drift * 6 == pytest.approx([4e-6, -2e-6], abs=0.3e-6)
    points = {p.run: p for p in found.points}
    assert points["l-6"].position == pytest.approx(points["l-0"].position, abs=0.3e-6)
    # what the correction itself is unsure of grows from run to run
    assert points["l-6"].covariance[0, 0] > 1.4 * points["l-0"].covariance[0, 0]
    (said,) = [s.detail for s in found.status if s == "scatter-unknown"]
    assert "do not hold how well the shaft comes back" in said


@pytest.mark.parametrize("size", [0.6e-6, 3e-6, 30e-6])
@pytest.mark.parametrize("before", [1, 3, 6])
def test_a_zero_that_jumps_between_two_runs_is_no_steady_drift(campaign, size, before):
    """Taken off as a drift in proportion to the run, 30 um in the middle left positions 24 half-intervals off."""
    still = {p.run: p for p in measure_locus(Repeated(campaign, [0], np.zeros((7, 2)))).points}
    found = measure_locus(Repeated(campaign, [0], np.outer(np.arange(7) >= before, [size, 0.2 * size])))
    for point in found.points:
        half = 1.96 * np.sqrt(np.diag(point.covariance + still[point.run].covariance))
        assert np.all(np.abs(point.position - still[point.run].position) < half)
    if size > 1e-6:
        (words,) = [s.detail for s in found.status if s == "misfit"]
        assert f"likely at one go before l-{before}" in words


@pytest.mark.slow
def test_intervals_hold_how_well_the_shaft_comes_back_where_repeats_tell_it(campaign, monkeypatch):
    """Of positions that scatter by half a micrometre from run to run, beside a drift, 95 % intervals hold 95 %."""
    source, rng, inside = Repeated(campaign, [0, 1, 2, 3], np.zeros((10, 2))), np.random.default_rng(3), []
    records = {run.id: locus._read(run, {}) for run in source.runs}
    truth = {name: record.position for name, record in records.items()}
    for _ in range(40):
        offsets = np.outer(np.arange(10), [1e-7, -2e-7]) + 5e-7 * rng.standard_normal((10, 2))
        moved = {name: replace(r, position=r.position + o) for (name, r), o in zip(records.items(), offsets)}
        monkeypatch.setattr(locus, "_read", lambda run, _, moved=moved: moved[run.id])
        found = measure_locus(source)
        assert not {"drift-unknown", "scatter-unknown"} & set(found.status)
        first = [p for p in found.points if p.run in {f"l-{k}" for k in range(6)}]
        inside += [np.abs(p.position - truth[p.run]) < 1.96 * np.sqrt(np.diag(p.covariance)) for p in first]
    assert 0.93 < np.mean(inside) < 0.98


@pytest.mark.parametrize("way", ["jump", "drift"])
def test_a_shaft_that_moves_within_a_record_is_known_no_better_than_it_moves(campaign, way):
    steady, source = (Repeated(campaign, [], np.zeros((6, 2))) for _ in range(2))
    run = source.runs[2]

    def moved(time):
        since = (time - time[0]) / (time[-1] - time[0])
        return np.outer(since > 0.5 if way == "jump" else since, [7e-6, -4e-6])

    source.runs[2] = OtherRun(run, moved, id="l-2")
    found = measure_locus(source)
    (words,) = [s.detail for s in found.status if s == "misfit"]
    assert "l-2 " in words
    still, moving = ({p.run: p for p in measure_locus(s).points}["l-2"] for s in (steady, source))
    assert np.all(np.abs(moving.position - still.position) < 1.96 * np.sqrt(np.diag(moving.covariance)))
    assert "misfit" not in measure_locus(steady).status


def test_a_repeat_under_a_turned_load_is_no_drift(campaign, monkeypatch):
    source = Repeated(campaign, [0, 1], np.zeros((8, 2)))
    records = {run.id: locus._read(run, {}) for run in source.runs}
    centre = np.mean([r.position for r in records.values()], axis=0)
    for name, turn in (("l-6", 0.02), ("l-7", 0.015)):
        cos, sin = np.cos(turn), np.sin(turn)
        place = centre + np.array([[cos, -sin], [sin, cos]]) @ (records[name].position - centre)
        records[name] = replace(records[name], position=place, direction=records[name].direction + turn)
    monkeypatch.setattr(locus, "_read", lambda run, channels: records[run.id])
    known = {"centre": centre, "centre_covariance": np.zeros((2, 2)), "centre_doubt": 0.0, "clearance": np.full(5, 1.0)}
    found = measure_locus(source, SimpleNamespace(**known, angles=ANGLES, sensors={}))
    # turned by about a degree the shaft stands 0.8 um aside
    assert np.abs(found.drift).max() * 7 < 0.1e-6


def test_a_zero_that_moved_since_the_sweep_is_named_and_in_the_interval(campaign, polygon):
    moved = measure_locus(Repeated(campaign, [], np.full((6, 2), [12e-6, 9e-6])), polygon)
    (words,) = [s.detail for s in moved.status if s == "misfit"]
    assert "go around a place 15 µm from the centre" in words
    for point in moved.points:
        error = np.abs(point.position - true_position(point.load_direction, point.load))
        assert np.all(error < 1.96 * np.sqrt(np.diag(point.covariance)))
    assert "misfit" not in measure_locus(campaign, polygon).status


def test_loads_off_their_set_point_are_named(opened):
    heavier = Fault("wrong_load", run="l-*-02", value=1.2)
    source = opened(locus_points(4), faults=(heavier,), clearance=())
    found = measure_locus(source)
    status = next(s.detail for s in found.status if s == "load-off-set-point")
    assert "-02" in status
    assert "-01" not in status


def test_a_position_behind_the_wall_is_named(opened):
    source = opened(locus_points(4), k=0.2 * K)
    found = measure_locus(source, measure_clearance(source, ANGLES))
    assert "outside-polygon" in found.status


@pytest.mark.parametrize("rate", [11.0, 22.0])
def test_a_logger_too_slow_for_what_turns_with_the_shaft_shows_no_positions_of_metres(campaign_of, rate):
    """A line at a multiple of the rate stands still, as the mean does: both at once were of any size."""
    truth = RigTruth.constant(K, np.diag([4e5, 6e5]))
    plan = RigPlan(locus=locus_points(3), dynamic_rate=rate, locus_seconds=9.0)
    for point in measure_locus(load_campaign(campaign_of(rig(plan, truth=truth, seed=9)))).points:
        assert np.hypot(*point.position) < 0.01  # from the probes' zero, a gap away


def test_no_locus_is_an_error(opened):
    source = opened(())
    with pytest.raises(RigDataError, match="no runs of kind locus"):
        measure_locus(source)


def test_records_of_three_tenths_of_a_second_have_intervals_that_hold(campaign_of):
    """They show no noise over seconds: the scatter within each counts, and no half of one stands apart."""
    truth = RigTruth.constant(K, np.diag([4e5, 6e5]))
    plan = RigPlan(locus=locus_points(6), locus_seconds=0.3)
    found = measure_locus(load_campaign(campaign_of(rig(plan, truth=truth, seed=9))))
    assert "misfit" not in found.status
    places = np.array([point.position for point in found.points])
    errors = places - [true_position(point.load_direction, point.load) for point in found.points]
    limits = 4.0 * np.sqrt([np.diag(point.covariance) for point in found.points])
    assert np.all(np.abs(errors - errors.mean(axis=0)) < limits)
