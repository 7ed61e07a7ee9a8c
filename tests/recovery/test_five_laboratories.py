"""Exports as six laboratories write them become a report with three commands and at most ten typed lines."""

from __future__ import annotations

import pytest

from rigdata.campaign import load_campaign
from tests.good_campaigns import rocker_rig
from tests.rigs.laboratories import LABORATORIES, MOST_LINES, through

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campaign(campaign_of):
    return load_campaign(campaign_of(rocker_rig(3)))


@pytest.mark.parametrize("laboratory", LABORATORIES, ids=lambda one: one.write.__name__)
def test_from_records_to_report_with_few_lines_by_hand(laboratory, campaign, tmp_path):
    for module in {"tdms": "nptdms", "uff": "pyuff"}.get(laboratory.write.__name__, "numpy").split():
        pytest.importorskip(module)
    found = through(laboratory, campaign, tmp_path)
    assert found["report"]
    assert found["commands"] == 3
    assert found["lines"] <= MOST_LINES
    assert found["worst"] < 0.1
