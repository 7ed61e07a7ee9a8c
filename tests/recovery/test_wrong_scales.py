"""Wrong scales: of probes in all runs, and of one channel in one run; what finds them, and what must not be blamed."""

from dataclasses import replace

import numpy as np
import pytest

import rigdata
from rigdata.campaign import load_campaign
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import ClearanceSweep, Fault, Noise
from rigdata.virtual_rig.truth import load_vector
from tests.command_line import tpjb
from tests.good_campaigns import (
    DAMPING,
    PLAN,
    ROCKER_DAMPING,
    ROCKER_STIFFNESS,
    RUN,
    SMALL_PLAN,
    STIFFNESS,
    directions,
    rocker_rig,
    stiff_rig,
)  # fmt: skip
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.clearance.measure import measure_run
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings

CLEARANCE = 80e-6
ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
SWEEP = replace(SMALL_PLAN, dynamic=(), locus=(), dry=())


#: Static loads in six directions, dry tests of all pads and a sweep: what tells of single sensors.
ALL_ROUND = replace(PLAN, directions=directions(4), clearance=(ClearanceSweep(seconds=30.0),))


def described(source, name, **changes):
    """The campaign with another description of one channel."""

    def changed(channels):
        return {n: replace(c, **changes) if n == name else c for n, c in channels.items()}

    runs = tuple(replace(run, channels=changed(run.channels)) for run in source.runs)
    return replace(source, channels=changed(source.channels), runs=runs)


def gain(channel, value):
    return Fault("scaled", "*", channel, value=value)


@pytest.fixture
def campaign(campaign_of):
    return lambda *faults, plan=SMALL_PLAN: load_campaign(campaign_of(rocker_rig(3, *faults, plan=plan)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "sweep", "says"),
    [
        ((gain("X1*", 10.0),), True, "X1A travels"),
        ((gain("X1*", 0.1),), True, "X1A travels"),
        ((gain("X1B", 10.0),), True, "X1B travels"),
        # ten times as much drives these probes to the end of their range, where clipping leaves the runs out
        ((gain("X1*", 7.0),), False, "would move the shaft by more than"),
    ],
)
def test_probes_ten_times_off_make_every_point_doubtful(campaign, faults, sweep, says):
    plan = SMALL_PLAN if sweep else replace(SMALL_PLAN, clearance=())
    source = campaign(*faults, plan=replace(plan, dry=(), locus=()))
    found = identify(source, IdentifySettings(methods=(), method="ols", clearance=CLEARANCE))
    (told,) = (c for c in found.points[0].quality if c == "probes-contradict-clearance")
    assert says in told.detail


@pytest.mark.slow
def test_good_probes_are_not_doubted(campaign, tmp_path):
    source = campaign()
    found = identify(source, IdentifySettings(methods=(), method="ols", clearance=CLEARANCE))
    assert "probes-contradict-clearance" not in found.points[0].quality
    polygon = measure_run(source.of_kind("clearance")[0], ANGLES)
    assert "probe-gains-differ" not in polygon.status
    assert tpjb("check", source.path, "--out", tmp_path / "o").exit_code == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "channel", "value", "code", "says"),
    [
        ("check", "X1A", 1.1, 0, "X1A read 10.0 % more"),
        ("check", "X1B", 1.03, 0, "X1A read 2.9 % less"),
        ("check", "X1A", 0.95, 0, "less"),
        ("check", "X1*", 0.1, 2, "the bearing file says 80 µm"),
        ("pivot", "X1A", 1.1, 0, "the sides stand as if X1A read 10.0 %"),
    ],
)
def test_unequal_gains_show_in_the_angles_of_the_polygon(campaign, tmp_path, command, channel, value, code, says):
    plan = SWEEP if command == "check" else replace(SMALL_PLAN, dynamic=(), locus=())
    source = campaign(gain(channel, value), plan=plan)
    out = tpjb(command, source.path, "--out", tmp_path / "o")
    told = " ".join(out.output.split())
    assert out.exit_code == code, out.output
    if code == 2 or command == "pivot":
        assert says in told
    else:
        assert "warning" in told
        assert "X1A read" in told.replace(":", "")  # by the sides already, from 5 % on
        polygon = measure_run(source.of_kind("clearance")[0], ANGLES)
        (sentence,) = (s.sentence() for s in polygon.status if s == "probe-gains-differ")
        assert says in sentence


SHORT = replace(PLAN, locus=(), dry=())
SPEED_MISS = Noise.like_samples().speed_miss


def found(path) -> list[tuple[str | None, str]]:
    return [(p.run, p.place) for p in check_campaign(path) if p.severity != "note"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "gain", "seed"),
    [("X1A", 1.03, 71), ("X1A", 1.05, 72), ("X1B", 0.95, 71), ("L1H", 1.05, 72), ("L1V", 0.97, 71)],
)
def test_small_gains_are_named_at_their_run_and_channel(campaign_of, channel, gain, seed):
    path = campaign_of(stiff_rig(seed, Fault("scaled", RUN, channel, value=gain), plan=SHORT))
    told = check_campaign(path)
    assert {p.run for p in told} == {RUN}
    assert [p for p in told if p.place == f"channel {channel}" or f"{channel} read" in p.what]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(81, 85))
def test_runs_that_each_have_a_temperature_of_their_own_are_not_blamed(campaign_of, seed):
    """Stiffness scatters by 1 %, damping by 2 %, positions by 0.5 um from run to run."""

    def warm(point: OperatingPoint) -> float:
        return (point.shaft_speed_hz / 22.0 - 1) / SPEED_MISS if point.shaft_speed > 0 else 0.0

    def stiffness(point: OperatingPoint):
        share = 0.01 * warm(point)
        return (1 - share) * STIFFNESS + 1j * point.excitation * (1 - 2 * share) * DAMPING

    def position(point: OperatingPoint):
        return np.linalg.solve(STIFFNESS, load_vector(point)) + 0.5e-6 * warm(point) * np.array([0.6, 0.8])

    plan = replace(SHORT, directions=directions((4, 6, 8)[seed % 3]))
    assert found(campaign_of(stiff_rig(seed, plan=plan, stiffness=stiffness, position=position))) == []


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "says"), [(None, None), (("X1A", 1.05), "X1A read"), (("L1V", 0.95), "L1V read")])
def test_identify_names_the_run_and_the_channel(campaign_of, fault, says):
    faults = () if fault is None else (Fault("scaled", RUN, fault[0], value=fault[1]),)
    path = campaign_of(stiff_rig(4, *faults, plan=SHORT))
    (point,) = identify(rigdata.load_campaign(path), IdentifySettings(methods=())).points
    told = [c.detail for c in point.quality if c == "run-gain-off"]
    if says is None:
        assert told == []
    else:
        assert [text.startswith(RUN) and says in text for text in told] == [True]


def errors(frame):
    """Errors of K and C over half their intervals, (8,)."""
    ratios = []
    for kind, unit, truth in (("k", "N_per_m", ROCKER_STIFFNESS), ("c", "Ns_per_m", ROCKER_DAMPING)):
        for entry, true in zip(("xx", "xy", "yx", "yy"), truth.ravel(), strict=True):
            name = f"{kind}{entry}_{unit}"
            low, high = frame[f"{name}_lo"].iloc[0], frame[f"{name}_hi"].iloc[0]
            ratios.append(abs(frame[name].iloc[0] - true) / ((high - low) / 2))
    return np.array(ratios)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "trusted", "says"),
    [
        ("X1B", {"axis": np.radians(150.0)}, True, "X1B stands -15"),
        ("X1A", {"axis": np.radians(37.0)}, True, "X1A stands +8"),
        ("X1A", {"gain": 1 / 1.3}, True, "X1A reads -2"),
        ("X1B", {"axis": np.radians(170.0)}, False, "X1B"),
        ("X1A", {"gain": 0.5}, False, "X1A reads -5"),
        ("L1H", {"gain": 2.0}, False, "L1H reads +10"),
        ("L1V", {"axis": np.radians(80.0)}, True, "L1V stands +10"),
        ("L1V", {"axis": np.radians(60.0)}, False, "L1V stands +30"),
        ("L1V", {"axis": np.radians(90.0)}, True, ""),
    ],
)
def test_a_sensor_that_other_runs_contradict_widens_the_intervals_or_forbids_trust(
    campaign_of, name, changes, trusted, says
):
    source = load_campaign(campaign_of(rocker_rig(3, plan=ALL_ROUND)))
    changes = {k: v * source.channels[name].gain if k == "gain" else v for k, v in changes.items()}
    result = identify(described(source, name, **changes))
    quality = result.points[0].quality
    assert says in " ".join(condition.detail for condition in quality)
    assert all(condition.severity != "error" for condition in quality) == trusted
    assert not trusted or errors(result.to_frame()).max() < 1.3
    assert says or "records-doubtful" not in quality
