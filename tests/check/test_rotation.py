"""Which way the shaft turns, by the force at running speed: told where it is described wrongly, else silent."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rigdata.operating_point import ROTATIONS
from rigdata.virtual_rig import RigPlan, operating_points
from tests.good_campaigns import directions, rocker_rig
from tpjb_ident import load_campaign
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.check.observation import observe
from tpjb_ident.check.set_points import check_rotation

PLAN = RigPlan(dynamic=operating_points([(5000.0, 25.0)]), directions=directions(4))


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
