"""Runs beside one another: what drives them, what turns with the shaft and which way, one channel's gain in one."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import ROTATIONS, OperatingPoint
from rigdata.vector import directions
from rigdata.virtual_rig import Fault, RigPlan, operating_points
from tests.good_campaigns import DAMPING, PLAN, RUN, STIFFNESS, rocker_rig, stiff_rig, written
from tests.good_campaigns import directions as evenly
from tests.rigs.held_run import HeldReader, channels, run_of
from tests.seeds import seeds
from tpjb_ident import load_campaign
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.observation import excitation_line, observe
from tpjb_ident.check.probe_readings import check_shaft_lines
from tpjb_ident.check.run_gain import PointRuns, deviating_runs, dynamic_difference, gain_of_run
from tpjb_ident.check.set_points import check_excitation, check_places, check_rotation, check_static_loads
from tpjb_ident.conditions import Condition
from tpjb_ident.phasors.run_phasors import run_phasors


def observation(load, size, stated=0.0, force=0.0, displacement=45.0, frequency=25.0):
    """A run driven along `stated`, whose force and displacement act along other angles [deg]."""
    point = OperatingPoint(load, -np.pi / 2, 138.0, 2 * np.pi * frequency)
    run = SimpleNamespace(id="r", file="r.csv", point=point, excitation_direction=np.radians(stated))
    run.housing_mass = 30.0
    lines = {"displacement": 1e-6 * directions(np.radians(displacement)), "force": size * directions(np.radians(force))}
    lines["acceleration"] = np.zeros(2)
    return SimpleNamespace(
        run=run, report=Reporter(run), conditions=(), shows=lambda quantity: True,
        film_force=lines["force"], line=lines.get, names=lambda quantity: ["L1H", "L1V"],
        of=lambda quantity: [],
    )  # fmt: skip


def findings(runs):
    check_excitation(runs)
    return [[finding.key for finding in run.report.findings] for run in runs]


def test_strength_is_that_of_the_operating_point():
    """Of a rig whose drive is as strong at 250 N as at 8 kN, and one whose shaker fades with the frequency."""
    loads = [observation(load, 1000.0) for load in (250.0, 8000.0) for _ in range(4)]
    fading = [observation(5000.0, size, frequency=f) for size, f in ((1000.0, 20.0), (60.0, 90.0)) for _ in range(4)]
    assert findings(loads + fading) == [[]] * 16
    idle = [*(observation(8000.0, 1000.0) for _ in range(4)), observation(8000.0, 60.0)]
    assert findings(idle) == [[]] * 4 + [["no excitation"]]


@pytest.mark.parametrize(
    ("force", "displacement", "named"), [(26.0, 1.0, []), (4.0, 30.0, []), (26.0, 30.0, ["excitation direction"])]
)
def test_force_or_displacement_acts_along_the_stated_direction(force, displacement, named):
    assert findings([observation(5000.0, 1000.0, 0.0, force, displacement)]) == [named]


@pytest.mark.parametrize(
    ("cells", "shaft", "turned", "named"),
    [
        (0.0, 0.0, 0.0, False),  # a floating stator: the cells show the shaker's force
        (25.0, 90.0, 0.0, False),  # the shaft is shaken: its inertia turns the film's
        (25.0, 90.0, 60.0, True),
        (25.0, 0.0, 0.0, True),
    ],
)
def test_an_excitation_acts_as_the_shaker_does_whatever_the_film_makes_of_it(cells, shaft, turned, named):
    omega, film = 2 * np.pi * 60.0, np.diag([3e7, 9e7])
    runs = []
    for stated in (20.0, 65.0, 110.0):
        run = observation(5000.0, 1000.0, stated, stated + cells, frequency=60.0)
        lines = {"force": run.film_force}
        lines["displacement"] = np.linalg.solve(
            film - shaft * omega**2 * np.eye(2), 1000.0 * directions(np.radians(stated + turned))
        )
        run.film_force, run.line = film @ lines["displacement"], (lines | {"acceleration": np.zeros(2)}).get
        if not shaft:
            run.film_force = 1000.0 * directions(np.radians(stated + 25.0))
        runs.append(run)
    assert any(findings(runs)) == named


@pytest.mark.parametrize(("keyphasors", "named"), [([], ["on shaft line"]), (["KEY"], [])])
def test_what_turns_with_the_shaft_is_no_excitation_along_another_direction(keyphasors, named):
    run = observation(5000.0, 1000.0, 0.0, 26.0, 30.0)
    run.conditions = (Condition("1X on excitation line"),)
    run.run.of = lambda quantity: keyphasors
    assert findings([run]) == [named]


@pytest.mark.parametrize(
    ("loads", "mount", "gain", "zero", "named"),
    [
        ((3000.0, 6000.0), None, 0.0, 72.0, ["no static force"]),
        ((3000.0,), None, 0.0, 30.0, ["no static force"]),
        ((3000.0,), "floating", 0.0, 72.0, ["no static force"]),
        ((3000.0, 6000.0), "floating", 0.02, 0.0, ["no static force"]),
        ((3000.0, 6000.0), "cells", 0.02, 0.0, ["load size"]),
        ((3000.0,), "cells", 0.0, 72.0, ["load direction", "load size"]),
    ],
)
def test_a_zero_of_cells_that_carry_no_load_is_no_load_that_is_off(loads, mount, gain, zero, named):
    rng = np.random.default_rng(6)
    runs = []
    for load in [load for load in loads for _ in range(4)]:
        run = observation(load, 1000.0)
        run.run.kind = "dynamic"
        force = np.array([zero + 0.1 * rng.standard_normal(), -gain * load])
        run.mean = lambda quantity, force=force: force
        runs.append(run)
    assert check_static_loads(runs, mount) is (named != ["no static force"])
    keys = [{key.partition(";")[0] for key in run.report.keys} for run in runs]
    assert keys == [set(named)] * len(runs)


@pytest.mark.parametrize("seed", seeds(3))
@pytest.mark.parametrize("wrong", [(), (5,), (1, 3, 5, 7)])
def test_a_shaft_that_stands_as_under_another_load_is_named(seed, wrong):
    """Also where half of a load's runs do; a shaft that wanders as far as loads move it tells nothing."""
    rng = np.random.default_rng(seed)
    runs = []
    for k, load in enumerate(np.repeat([3000.0, 6000.0], 8)):
        run = observation(load, 1000.0)
        true = 6000.0 if k in wrong else load
        place = 1e-6 * np.array([0.2, -3.0 * true / 6000.0]) + 2e-8 * rng.standard_normal(2)
        run.spread, run.of = np.zeros((3, 2)), lambda quantity: [0, 1]
        run.plane = lambda quantity, values, place=place: place + 0j
        runs.append(run)
    check_places(runs)
    assert tuple(k for k, run in enumerate(runs) if run.report.keys) == wrong
    for run in runs:
        place = run.plane("displacement", None) + 2e-6 * rng.standard_normal(2)
        run.plane, run.report = (lambda quantity, values, place=place: place), Reporter(run.run)
    check_places(runs)
    assert not any(run.report.keys for run in runs)


def turning_run(load, frequency, size, twice=np.nan, motion=0.02, thrice=np.nan):
    """A run whose probes show `size`, `twice`, `thrice` as much as usual at the shaft's lines, some of it motion."""
    run = observation(load, 1000.0, frequency=frequency)
    stiffness = np.linalg.norm(run.film_force) / np.linalg.norm(run.line("displacement"))
    force = stiffness * motion * np.array([4e-6, 1e-6])
    first, second = [4e-6 * size, 3e-6, force[0], 0.0], [1e-6 * twice, 1e-6, force[1], 0.0]
    run.shaft_lines = np.array([first, second, [2e-7 * thrice, 2e-7, 0.0, 0.0]])
    run.lines = SimpleNamespace(floor=np.full(4, 1e-9))
    run.channels = [SimpleNamespace(name=name, axis=0.0) for name in ("X1A", "X1B", "L1H", "L1V")]
    run.pick, run.spread = {"displacement": [0, 1], "force": [2, 3], "acceleration": []}.get, np.zeros((3, 4))
    return run


@pytest.mark.parametrize(
    ("frequency", "load", "gain", "motion", "named"),
    [(35.0, 5e3, 0.5, 1.0, 4), (35.0, 5e3, 1.1, 1.0, 4), (25.0, 8e3, 0.5, 0.02, 4), (25.0, 8e3, 0.85, 1.0, 0)],
)
def test_a_probe_whose_range_changed_is_told_by_what_turns_with_the_shaft(frequency, load, gain, motion, named):
    """At one frequency of several also by motion, at one load of several by run-out, which no other film changes."""
    rng = np.random.default_rng(4)
    runs = []
    for place in [(5000.0, f) for f in (15.0, 25.0, 35.0, 45.0)] + [(2500.0, 25.0), (8000.0, 25.0)]:
        for _ in range(4):
            size = (1 + 0.003 * rng.standard_normal()) * (place[0] / 5000.0) ** (-0.2 * motion)
            runs.append(turning_run(*place, size * (gain if place == (load, frequency) else 1.0), motion=motion))
    check_shaft_lines(runs)
    reports = [finding for run in runs for finding in run.report.findings]
    assert len(reports) == named
    assert {finding.key for finding in reports} <= {"shaft line X1A"}


@pytest.mark.parametrize(
    ("sizes", "motion", "off"),
    [
        ((1.0, 0.97, 0.88), 0.0, (0.128, 0.097, 0.128)),  # it falls with the gap: any load may have the right one
        ((1.0, 1.0, 0.95), 0.0, (0.0, 0.0, 0.051)),
        ((1.0, 1.07), 0.0, (0.068, 0.068)),
        ((1.0, 1.04), 0.0, (0.039, 0.039)),  # also where both loads are off their middle by less than counts
        ((1.0, 0.97, 0.88), 0.1, (0.0, 0.0, 0.0)),  # the film may have moved the shaft by as much
        ((1.0, 1.01, 0.99), 0.0, (0.0, 0.0, 0.0)),
        ((1.0, 0.01), 0.0, (0.0, 0.0)),  # the shaft turns at another speed than is said
    ],
)
def test_run_out_that_changes_with_the_load_makes_a_gain_uncertain(sizes, motion, off):
    rng = np.random.default_rng(5)
    runs = [
        turning_run(load, frequency, np.nan, size * (1 + 0.001 * rng.standard_normal()), motion)
        for load, size in zip((2000.0, 6000.0, 10000.0), sizes)
        for frequency in (20.0, 35.0)
        for _ in range(4)
    ]
    check_shaft_lines(runs)
    shown = np.reshape([run.report.off.get("X1A", 0.0) for run in runs], (len(sizes), 8)).mean(axis=1)
    np.testing.assert_allclose(shown, 0.8 * np.array(off), atol=0.003)
    assert not any("X1B" in run.report.off for run in runs)


@pytest.mark.parametrize(
    ("sizes", "noise", "off"),
    [
        ((1.0, 0.85), 1e-9, (0.16, 0.16)),  # what 1X and 2X hide as motion
        ((1.0, 0.85), 1e-7, (0.0, 0.0)),  # of a line that noise may have made
    ],
)
def test_run_out_is_looked_at_where_there_is_no_motion(sizes, noise, off):
    rng, runs = np.random.default_rng(5), []
    for load, size in zip((2000.0, 6000.0), sizes):
        for _ in range(6):
            size = size * (1 + 0.001 * rng.standard_normal())
            runs.append(turning_run(load, 25.0, size, size, 1.0, size))
            runs[-1].lines.floor[:] = noise
    check_shaft_lines(runs)
    shown = np.reshape([run.report.off.get("X1A", 0.0) for run in runs], (2, 6)).mean(axis=1)
    np.testing.assert_allclose(shown, 0.8 * np.array(off), atol=0.004)


@pytest.mark.parametrize(("drift", "off"), [(0.12, 0.12), (0.01, 0.0)])
def test_run_out_that_grows_from_run_to_run_is_a_gain_that_drifts(drift, off):
    """Nothing tells when it was right: runs may be off by as much as they are from the middle of the farther load's."""
    rng, runs = np.random.default_rng(5), []
    for k in range(24):
        size = math.exp(drift * k / 23 + 0.001 * rng.standard_normal())
        runs.append(turning_run(2000.0 if k < 12 else 6000.0, 25.0, np.nan, np.nan, 0.0, size))
    check_shaft_lines(runs)
    shown = np.reshape([run.report.off.get("X1A", 0.0) / 0.8 for run in runs], (2, 12)).max(axis=1)
    np.testing.assert_allclose(shown, 0.76 * off, atol=0.004)


def test_half_of_the_runs_that_move_a_little_more_at_running_speed_show_no_gain():
    """At the other of two frequencies, say: the film answers what is out of balance otherwise."""
    runs = [turning_run(5000.0, 25.0, 1.0 if k < 4 else 1.14, motion=0.6) for k in range(8)]
    check_shaft_lines(runs)
    assert not any(run.report.off for run in runs)


def test_a_probe_that_was_put_elsewhere_is_another_one():
    runs = [turning_run(load, 25.0, 1.0, size, 0.0) for load, size in ((2000.0, 1.0), (6000.0, 0.6)) for _ in range(4)]
    for run in runs[4:]:
        run.channels[0].axis = 1.0
    check_shaft_lines(runs)
    assert not any(run.report.off for run in runs)


FOUR = RigPlan(dynamic=operating_points([(5000.0, 25.0)]), directions=evenly(4))


@pytest.fixture(scope="module", params=ROTATIONS)
def observations(request, campaign_of):
    path = campaign_of(rocker_rig(5, plan=FOUR.turning(rotation=request.param)), name=f"turns-{request.param}")
    return [observe(run) for run in load_campaign(path).runs]


def told(observations):
    check_rotation(observations)
    return [f.problem for o in observations for f in o.report.findings if f.key == "rotation"]


def described_as(observation, rotation):
    run = replace(observation.run, point=replace(observation.run.point, rotation=rotation))
    return replace(observation, run=run, report=observation.report.copy())


@pytest.mark.slow
def test_the_force_at_running_speed_tells_the_sense(observations):
    stated = observations[0].run.rotation
    other = ROTATIONS[stated == ROTATIONS[0]]
    sign = 1.0 if stated == ROTATIONS[0] else -1.0
    assert all(sign * o.shaft_force > math.log(3.0) for o in observations)
    assert told(observations) == []
    problems = told([described_as(o, other) for o in observations])
    assert len(problems) == len(observations)
    assert problems[0].severity == "warning"
    for candidate in ("rotation in [shaft]", "sign of a cell or probe", "two exchanged cells or probes"):
        assert candidate in problems[0].cure


@pytest.mark.slow
def test_few_clear_runs_or_runs_that_disagree_tell_nothing(observations):
    other = ROTATIONS[observations[0].run.rotation == ROTATIONS[0]]
    wrong = [described_as(o, other) for o in observations]
    assert told(wrong[:2]) == []
    blind = [replace(o, shaft_force=math.nan) for o in wrong[:2]]
    assert told([*blind, *wrong[2:]]) == []
    mixed = [replace(o, shaft_force=-o.shaft_force) for o in wrong[:2]]
    assert told([*mixed, *wrong[2:]]) == []
    assert np.isfinite([o.shaft_force for o in wrong]).all()


@pytest.mark.slow
def test_check_says_it_once(campaign_of):
    path = campaign_of(rocker_rig(5, plan=FOUR.turning(rotation="clockwise")), name="turns-clockwise")
    campaign = load_campaign(path)
    runs = tuple(replace(r, point=replace(r.point, rotation="counter-clockwise")) for r in campaign.runs)
    (problem,) = [p for p in check_campaign(replace(campaign, runs=runs)) if "goes round" in p.what]
    assert "so in 4 runs" in problem.what


OMEGA = 2 * math.pi * 25.0
H = STIFFNESS + 1j * OMEGA * DAMPING
#: Sizes of what turns with the shaft [m, N].
TURNING = np.array([1.5e-6, 1.2e-6, 30.0, 40.0])
PROBES = np.linalg.inv(np.array([[1.0, 1.0], [-1.0, 1.0]]) / math.sqrt(2.0)).T
LOAD = np.array([900.0, -4900.0])


def point(runs: int = 6, scatter: float = 0.0, seed: int = 1, softer: float = 0.0, heavier: float = 0.0) -> PointRuns:
    """Runs in evenly spread directions; run 2 may be softer or more heavily loaded."""
    rng = np.random.default_rng(seed)
    angles = np.pi / runs * np.arange(runs)
    force = 500.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(complex)
    load = np.tile(LOAD, (runs, 1)) * (1 + scatter * rng.standard_normal((runs, 1)))
    load[2] *= 1 + heavier
    stiffness = np.tile(H, (runs, 1, 1))
    stiffness[2] *= 1 - softer
    shaft = np.linalg.solve(stiffness, force[..., None])[..., 0]
    noise = rng.standard_normal((2, runs, 2)) + 1j * rng.standard_normal((2, runs, 2))
    to_probes = np.linalg.inv(PROBES).T
    four = ("X1A", "X1B", "L1H", "L1V")
    return PointRuns(
        phasors=np.hstack([(shaft + scatter * 1e-6 * noise[0]) @ to_probes, force * 0.9 + scatter * 300.0 * noise[1]]),
        loads=np.hstack([np.full((runs, 2), np.nan), load]),
        inertia=force * 0.1,
        probe_plane=PROBES,
        cell_plane=np.eye(2),
        turning=TURNING * (1 + 2 * scatter * rng.standard_normal((runs, 4))),
        channels=tuple(SimpleNamespace(name=name) for name in four),
    )


def spoilt(readings: PointRuns, run: int, channel: int, gain: float) -> PointRuns:
    """One channel reads `gain` times the truth."""
    changed = {}
    for name in ("phasors", "loads", "turning"):
        changed[name] = getattr(readings, name).copy()
        changed[name][run, channel] *= gain
    return replace(readings, **changed)


def wrong_gains(readings):
    """Gains that explain runs which differ."""
    return {run: gain for run, gain in deviating_runs(readings).items() if gain is not None}


@pytest.mark.parametrize("gain", [0.95, 0.97, 1.03, 1.05])
@pytest.mark.parametrize("channel", range(4))
def test_a_gain_in_one_run_comes_back(channel, gain):
    ((run, found),) = wrong_gains(spoilt(point(), 2, channel, gain)).items()
    assert (run, found.channels) == (2, (channel,))
    assert found.gain == pytest.approx(gain, rel=1e-9)
    assert 0 < found.error < 0.01


def test_what_turns_with_the_shaft_tells_a_gain_that_the_drive_leaves_to_chance():
    readings = spoilt(point(scatter=2e-3), 2, 0, 1.05)
    assert {run: gain.channels for run, gain in wrong_gains(readings).items()} == {2: (0,)}
    assert wrong_gains(replace(readings, turning=np.full((6, 4), np.nan))) == {}


def heavier(channel, share):
    """Run 2 with another mean of one cell."""
    readings = point(scatter=1e-3)
    loads = readings.loads.copy()
    loads[2, channel] *= share
    return replace(readings, loads=loads)


#: One run differs, or none, but no gain of one channel explains it.
NO_GAIN = {
    "4 runs without scatter": point(4),
    "6 runs without scatter": point(6),
    "9 runs without scatter": point(9),
    "less load": point(scatter=1e-3, heavier=-0.08),
    "more load": point(scatter=1e-3, heavier=0.03),
    "a tenth more load": point(scatter=1e-3, heavier=0.1),
    "less load, stiffer": point(heavier=-0.08, softer=0.048),
    "more load, softer": point(heavier=0.03, softer=-0.018),
    "a tenth more load, softer": point(heavier=0.1, softer=-0.06),
    "stiffer by 3 %": point(softer=-0.03),
    "softer by 2 %": point(softer=0.02),
    "softer by 3 %": point(softer=0.03),
    "cell's mean a twentieth more": heavier(3, 1.05),
    "gain of a loaded cell whose mean stays": replace(spoilt(point(), 2, 3, 1.05), loads=point().loads),
    "gain of a probe whose shaft line stays": replace(spoilt(point(), 2, 0, 1.05), turning=point().turning),
}


@pytest.mark.parametrize("readings", NO_GAIN.values(), ids=NO_GAIN)
def test_what_no_gain_explains_names_nothing(readings):
    assert wrong_gains(readings) == {}


@pytest.mark.parametrize("seed", seeds(8))
def test_a_bearing_that_wanders_from_run_to_run_is_learnt(seed):
    made = point(8, scatter=1e-3, seed=seed)
    share = 1 + 0.03 * np.random.default_rng(seed).standard_normal((8, 1))
    share[2] = 1.07
    readings = replace(
        made, phasors=made.phasors * np.hstack([share**0, share**0, share, share]), inertia=made.inertia * share
    )
    others = [0, 1, 3, 4, 5, 6, 7]
    steady, wandering = (dynamic_difference(some, 2, others, some.stiffness(others)) for some in (made, readings))
    # 1 % is what honest runs are credited with; these show some 3 % more
    assert 3 < np.trace(wandering.honest) / np.trace(steady.honest) < 30
    assert wrong_gains(readings) == {}


def test_a_gain_below_one_per_cent_is_no_fault():
    assert wrong_gains(spoilt(point(), 2, 3, 1.009)) == {}
    assert list(wrong_gains(spoilt(point(), 2, 3, 1.02))) == [2]


def test_runs_that_clearly_differ_are_named_with_those_that_differ_by_little():
    readings = spoilt(spoilt(point(9), 2, 3, 1.3), 5, 0, 0.95)
    assert {run: gain.channels for run, gain in wrong_gains(readings).items()} == {2: (3,), 5: (0,)}


def test_a_third_of_the_runs_at_most():
    readings = point(12)
    for run in (1, 4, 6):
        readings = spoilt(readings, run, 3, 1.04 if run != 4 else 0.95)
    assert sorted(wrong_gains(readings)) == [1, 4, 6]
    assert wrong_gains(spoilt(point(3), 2, 3, 1.04)) == {}


def test_one_direction_of_excitation_tells_nothing():
    readings = point()
    same = {n: np.tile(getattr(readings, n)[:1], (6, 1)) for n in ("phasors", "inertia")}
    alike = replace(readings, **same)
    assert np.isnan(alike.stiffness(range(6))).all()
    assert gain_of_run(spoilt(alike, 2, 3, 1.05), 2, [0, 1, 3, 4, 5]) is None
    assert wrong_gains(spoilt(alike, 2, 3, 1.05)) == {}


@pytest.mark.parametrize("seed", seeds(5))
def test_estimates_scatter_as_their_standard_errors_say(seed):
    others = [0, 1, 3, 4, 5]
    points = [point(scatter=2e-3, seed=100 * seed + i) for i in range(20)]
    gains = [gain_of_run(spoilt(readings, 2, 3, 1.05), 2, others) for readings in points]
    off = np.array([(g.gain - 1.05) / g.error for g in gains if g is not None])
    assert len(off) == 20
    assert 0.05 < np.sqrt(np.mean(off**2)) < 1.6


def test_a_speed_that_misses_its_set_point_leaks_nothing_into_the_line_wanted():
    time = np.arange(2000) / 1000.0
    wave = np.cos(2 * np.pi * 25 * time) + 3 * np.cos(2 * np.pi * 22.04 * time + 1)
    described = channels(("displacement", "force"))
    noise = 1e-5 * np.random.default_rng(1).standard_normal((4, 2000))
    run = run_of(HeldReader(dict(zip(described, wave + noise)), 1000.0), described)
    phasor = excitation_line(run_phasors(run), 0, list(described.values())).phasor
    assert np.abs(phasor - 1).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "told"), [(14e-6, False), (16e-6, True), (-60e-6, True)])
def test_a_probe_that_steps_within_an_operating_point_is_told(tmp_path, shift, told):
    plan = replace(PLAN, locus=(), dry=(), clearance=())
    path = written(tmp_path / "c.h5", stiff_rig(5, Fault("offset", RUN, "X1B", value=shift), plan=plan))
    found = [(p.run, p.place) for p in check_campaign(path) if "on average beside" in p.what]
    assert found == ([(RUN, "channel X1B")] if told else [])
