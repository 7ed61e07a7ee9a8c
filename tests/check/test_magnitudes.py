"""Bounds of physics on the sizes of a run: rigs of every size pass, descriptions that are far off do not."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.operating_point import OperatingPoint
from tests.check.test_campaign import restated
from tests.good_campaigns import SMALL_PLAN, rocker_rig
from tests.phasors.phasor_cases import vector_channels
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.magnitudes import Sizes, check_magnitudes, check_sizes, check_travel, check_weight
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings

DEMO = Path(__file__).resolve().parents[2] / "rigdata" / "samples" / "demo.h5"


@pytest.fixture(scope="module")
def demo():
    """A dynamic run of the demo."""
    return load_campaign(DEMO).of_kind("dynamic")[0]


def random_rig(rng: np.random.Generator, demo) -> Sizes:
    """A bearing of 50 to 500 mm under 0.05 to 5 MPa, on cells or hanging free, excited by a share of its load."""
    diameter, length = rng.uniform(0.05, 0.5), rng.uniform(0.4, 1.0)
    clearance = diameter * rng.uniform(0.5e-3, 1.2e-3)
    load = 10 ** rng.uniform(math.log10(5e4), math.log10(5e6)) * diameter**2 * length
    stiffness = rng.uniform(2.0, 20.0) * load / clearance
    dynamic = stiffness * math.hypot(1.0, rng.uniform(0.3, 5.0))
    omega = 2 * math.pi * rng.uniform(5.0, 200.0)
    motion = max(load * rng.uniform(0.02, 0.2) / dynamic, 5e-8)  # less is lost in the noise of any probe
    film = motion * dynamic
    cells = load / rng.uniform(2e-5, 3e-4)  # give way by 20 to 300 um under the static load
    mass = 25.0 * (diameter / 0.11) ** 3
    is_free = rng.random() < 0.3
    acceleration = omega**2 * (motion if is_free else film / cells)
    static = 0.0 if is_free else load
    force = abs(film - mass * acceleration) if is_free else film
    run = replace(demo, point=OperatingPoint(load, -math.pi / 2, 2 * math.pi * 22, omega))
    return Sizes(Reporter(run), motion, force, acceleration, film, static)


def judged(check, sizes, *more):
    """Keys and severities of what one check says of the sizes of a run."""
    sizes = replace(sizes, report=Reporter(sizes.report.run))
    check([sizes] if more else sizes, *more)
    return [(finding.key, finding.problem.severity) for finding in sizes.report.findings]


def test_rigs_of_every_size_pass(demo):
    rng = np.random.default_rng(1)
    for _ in range(3000):
        sizes = random_rig(rng, demo)
        assert judged(check_sizes, sizes) == [], sizes


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "acceleration", "severity"), [(3000, 0.05, "warning"), (3000, 0.5, "error")])
def test_a_stator_too_heavy_for_its_loads_is_an_error_where_its_inertia_decides(demo, mass, acceleration, severity):
    run = replace(demo, housing_mass=mass)
    rig = Sizes(Reporter(run), 1e-6, 2000.0, acceleration, 2000.0, run.point.static_load)
    assert judged(check_weight, rig, 5000.0) == [("weight", severity)]
    light = replace(rig, report=Reporter(replace(run, housing_mass=30.0)))
    assert judged(check_weight, light, 5000.0) == []
    assert judged(check_weight, replace(rig, static=0.0), 5000.0) == [("weight", "warning")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "key", "severity"),
    [
        ({"motion": 9e-9}, "no motion", "error"),
        ({"motion": 2.9e-8}, "no motion", "warning"),
        ({"motion": 3.1e-8}, None, ""),
        ({"motion": 1e-4}, "beyond clearance", "warning"),
        ({"motion": 3e-4}, "beyond clearance", "error"),
        ({"acceleration": 2.6}, "soft cells", "error"),
        ({"acceleration": 2.4}, None, ""),
        ({"acceleration": 2.6, "static": 0.0}, None, ""),
        ({"acceleration": 2.6, "motion": 4e-5}, None, ""),
        ({"acceleration": 2e-4}, "stiff cells", "warning"),
    ],
)
def test_each_bound_at_its_place(demo, changes, key, severity):
    run = replace(demo, point=OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 157.0796))
    good = Sizes(Reporter(run), 5e-6, 1e3, 0.02, 1e3, 5000.0)
    sizes = replace(good, **changes)
    assert judged(check_sizes, sizes) == ([] if key is None else [(key, severity)])


@pytest.mark.parametrize(
    ("travel", "notes", "told"),
    [
        (1.9e-8, [], [("still B", "error")]),
        (9e-8, [], [("still B", "warning")]),
        (9e-8, ["no noise"], []),
        (2e-7, [], []),
        (1.1e-3, [], [("travel B", "warning")]),
    ],
)
def test_a_probe_moves_as_a_turning_shaft_lets_it(demo, travel, notes, told):
    spread = np.array([[0.0, 0.0], [1e-6, travel / 2], [5e-6, travel]])
    described = vector_channels(("displacement",))
    names = [replace(channel, name=name) for channel, name in zip(described, "AB")]
    observation = Observation(demo, Reporter(demo), tuple(names), spread=spread)
    for note in notes:
        observation.report.ask(note)
    check_travel(observation, is_sine=True)
    assert [(f.key, f.problem.severity) for f in observation.report.findings[len(notes) :]] == told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "factor", "severity"),
    [
        (("X1A", "X1B"), 1000.0, "error"),
        (("X1A", "X1B"), 0.01, "error"),
        (("X1A",), 1000.0, "error"),
        (("A1H", "A1V"), 0.01, "error"),
    ],
)
def test_check_and_identify_both_name_a_description_that_is_far_off(small_campaign, names, factor, severity):
    campaign = restated(load_campaign(small_campaign), names, lambda c: replace(c, gain=c.gain / factor))
    assert severity in {p.severity for p in check_campaign(campaign)}
    points = identify(campaign, IdentifySettings(methods=(), method="ols")).points
    assert all("records-contradicted" in p.quality for p in points)


@pytest.mark.parametrize(
    ("mass", "static", "told"),
    [(30.0, 0.0, []), (0.062, 0.0, [("light", "error")]), (0.062, 5000.0, [("light", "warning")])],
)
def test_a_stator_lighter_than_pads_is_named(demo, mass, static, told):
    run = replace(demo, point=OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 157.0796), housing_mass=mass)
    sizes = Sizes(Reporter(run), 5e-6, 1e3, 0.02, 1e3, static)
    assert judged(lambda sizes: check_weight([sizes], 5000.0), sizes) == told


def test_a_stator_heavier_than_its_loads_and_another_rate_are_named(campaign_of):
    campaign = load_campaign(campaign_of(rocker_rig(3, plan=replace(SMALL_PLAN, dry=(), locus=(), clearance=()))))
    observations = [observe(run) for run in campaign.runs]
    count = sum(len(o.report.findings) for o in observations)
    check_magnitudes(observations)
    assert sum(len(o.report.findings) for o in observations) == count
    heavy = [replace(o, report=Reporter(replace(o.run, housing_mass=1600.0))) for o in observations]
    check_magnitudes(heavy)
    findings = [finding for o in heavy for finding in o.report.findings]
    assert {(finding.key, finding.problem.severity) for finding in findings} == {("weight", "warning")}
    assert len(findings) == len(heavy)
    slow = replace(campaign.runs[0], reader=replace(campaign.runs[0].reader, stated_rate=4000.0))
    of_campaign = replace(observations[0], run=slow)
    before = len(of_campaign.report.findings)
    check_magnitudes([of_campaign])
    assert len(of_campaign.report.findings) == before  # the file's own rate wins over [acquisition]
    off = replace(observations[0], run=replace(slow, stated=slow.stated | {"sample_rate"}))
    check_magnitudes([off])
    assert off.report.findings[-1].problem.what.startswith("the file shows 1000 Hz, the manifest states 4000 Hz")
