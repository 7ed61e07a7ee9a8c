"""Runs beside one another: what drives them, what turns with the shaft, and which way it turns."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import ROTATIONS, OperatingPoint
from rigdata.vector import directions
from rigdata.virtual_rig import RigPlan, operating_points
from tests.good_campaigns import directions as evenly
from tests.good_campaigns import rocker_rig
from tpjb_ident import load_campaign
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.observation import observe
from tpjb_ident.check.run_gain import check_shaft_lines
from tpjb_ident.check.set_points import check_excitation, check_rotation


def observation(load, size, stated=0.0, force=0.0, displacement=45.0, frequency=25.0):
    """A run driven along `stated`, whose force and displacement act along other angles [deg]."""
    point = OperatingPoint(load, -np.pi / 2, 138.0, 2 * np.pi * frequency)
    run = SimpleNamespace(id="r", file="r.csv", point=point, excitation_direction=np.radians(stated))
    lines = {"displacement": 1e-6 * directions(np.radians(displacement)), "force": size * directions(np.radians(force))}
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
    ("frequency", "load", "gain", "named"),
    [(35.0, 5000.0, 0.5, 4), (35.0, 5000.0, 1.1, 4), (25.0, 8000.0, 0.5, 4), (25.0, 8000.0, 0.85, 0)],
)
def test_a_probe_whose_range_changed_is_told_by_what_turns_with_the_shaft(frequency, load, gain, named):
    """At one frequency of several by little, at one load of several by what no change of the film explains."""
    rng = np.random.default_rng(4)
    runs = []
    for place in [(5000.0, f) for f in (15.0, 25.0, 35.0, 45.0)] + [(2500.0, 25.0), (8000.0, 25.0)]:
        for _ in range(4):
            run = observation(place[0], 1000.0, frequency=place[1])
            size = 4e-6 * (1 + 0.003 * rng.standard_normal()) * (place[0] / 5000.0) ** -0.2
            run.shaft_lines = np.array([[size * (gain if place == (load, frequency) else 1.0), 3e-6], [np.nan, np.nan]])
            run.channels, run.pick = [SimpleNamespace(name="X1A"), SimpleNamespace(name="X1B")], lambda quantity: [0, 1]
            runs.append(run)
    check_shaft_lines(runs)
    reports = [finding for run in runs for finding in run.report.findings]
    assert len(reports) == named
    assert {finding.key for finding in reports} <= {"shaft line X1A"}


PLAN = RigPlan(dynamic=operating_points([(5000.0, 25.0)]), directions=evenly(4))


@pytest.fixture(scope="module", params=ROTATIONS)
def observations(request, campaign_of):
    path = campaign_of(rocker_rig(5, plan=PLAN.turning(rotation=request.param)), name=f"turns-{request.param}")
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
    path = campaign_of(rocker_rig(5, plan=PLAN.turning(rotation="clockwise")), name="turns-clockwise")
    campaign = load_campaign(path)
    runs = tuple(replace(r, point=replace(r.point, rotation="counter-clockwise")) for r in campaign.runs)
    (problem,) = [p for p in check_campaign(replace(campaign, runs=runs)) if "goes round" in p.what]
    assert "so in 4 runs" in problem.what
