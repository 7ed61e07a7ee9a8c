"""Fixtures that several folders of tests share."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

# how long an example takes says how busy the machine is, nothing about the code
hypothesis.settings.register_profile(
    "shared machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("shared machine")
ROOT = Path(__file__).resolve().parent.parent


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is imported and collected lives to the end: the garbage collector need not walk it time and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def checkout() -> Path:
    """Folder of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def rocker_file() -> Path:
    """Bearing file of the reference paper's rocker-backed bearing."""
    return ROOT / "model" / "bearings" / "rocker.toml"


@pytest.fixture(scope="session")
def small_campaign(tmp_path_factory) -> Path:
    """HDF5 campaign of a linear bearing: two loads, three directions, three locus runs, one sweep, no dry tests."""
    from dataclasses import replace

    from rigdata.virtual_rig import ClearanceSweep, operating_points
    from tests.good_campaigns import SMALL_PLAN, rocker_rig, written

    plan = replace(
        SMALL_PLAN,
        dynamic=operating_points([(2500.0, 25.0), (5000.0, 25.0)]),
        dry=(),
        clearance=(ClearanceSweep(seconds=8.0),),
    )
    text = '=HYPERLINK("http://example.invalid")<script>alert(1)</script>'
    rig = rocker_rig(3, plan=plan, campaign="small <b>&", description=text)
    return written(tmp_path_factory.mktemp("campaign") / "small.h5", rig)
