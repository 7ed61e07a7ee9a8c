"""Gains of one channel in one run: how often `check` and `identify` find them, and what they must not blame."""

from dataclasses import replace

import numpy as np
import pytest

import rigdata
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import Fault, Noise
from rigdata.virtual_rig.truth import load_vector
from tests.good_campaigns import DAMPING, PLAN, RUN, STIFFNESS, directions, stiff_rig
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings

SHORT = replace(PLAN, locus=(), dry=())
SPEED_MISS = Noise.like_samples().speed_miss


def found(path) -> list[tuple[str | None, str]]:
    return [(p.run, p.place) for p in check_campaign(path) if p.severity != "note"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("channel", "gain", "least"),
    [("X1A", 1.03, 2), ("X1A", 1.05, 2), ("X1B", 0.95, 2), ("L1H", 1.05, 2), ("L1V", 0.97, 2)],
)
def test_small_gains_are_named_at_their_run_and_channel(campaign_of, channel, gain, least):
    places = []
    for seed in (71, 72):
        fault = Fault("scaled", RUN, channel, value=gain)
        path = campaign_of(stiff_rig(seed, fault, plan=SHORT))
        told = check_campaign(path)
        assert {p.run for p in told} <= {RUN}
        places += [p for p in told if p.place == f"channel {channel}" or f"{channel} read" in p.what]
    assert len(places) >= least


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
