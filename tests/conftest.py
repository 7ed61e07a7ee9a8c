"""Fixtures that several folders of tests share."""

from __future__ import annotations

import math
from pathlib import Path

import hypothesis
import numpy as np
import pytest

# how long an example takes says how busy the machine is, nothing about the code
hypothesis.settings.register_profile(
    "shared machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("shared machine")
ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def checkout() -> Path:
    """Folder of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def rocker_file() -> Path:
    """Bearing file of the reference paper's rocker-backed bearing."""
    return ROOT / "model" / "bearings" / "rocker.toml"


@pytest.fixture(scope="session")
def small_campaign(tmp_path_factory, rocker_file) -> Path:
    """HDF5 campaign of a linear bearing: two loads, three directions, three locus runs, one sweep, no dry tests."""
    from rigdata.virtual_rig import (
        ClearanceSweep,
        Instruments,
        Noise,
        RigPlan,
        RigTruth,
        Timing,
        VirtualRig,
        locus_points,
        operating_points,
        write_campaign,
    )

    k, c = np.array([[1.0e8, 2e6], [1e6, 2.0e8]]), np.array([[5e5, 1e4], [1e4, 7e5]])
    rig = VirtualRig(
        truth=RigTruth.constant(k, c, bearing_name="rocker.toml", bearing_text=rocker_file.read_text("utf-8")),
        plan=RigPlan(
            dynamic=operating_points([(2500.0, 25.0), (5000.0, 25.0)]),
            directions=tuple(math.radians(60.0 * i) for i in range(3)),
            locus=locus_points(3, load=1000.0),
            clearance=(ClearanceSweep(seconds=8.0),),
            timing=Timing(dynamic_seconds=1.0),
        ),
        instruments=Instruments.like_paper(5, 3),
        noise=Noise.like_samples(),
        seed=3,
        campaign="small <b>&",
        description='=HYPERLINK("http://example.invalid")<script>alert(1)</script>',
    )
    path = tmp_path_factory.mktemp("campaign") / "small.h5"
    write_campaign(path, rig)
    return path
