"""What the rig carries without its bearing, by a dry shaker test; a channel that tells nothing refuses it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.rigs.campaign_file import write_campaign
from tests.rigs.field_rig import Device, Plan, Rig
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.baseline import dry_test

CARRIED = (4e7, 6e7)
PLANS = [Plan(f"b-{k}", 5000.0, 25.0, 60.0 * k, dry=True) for k in range(3)]


def dry_campaign(path, **devices):
    rig = replace(Rig(), seconds=2.0, baseline=CARRIED, devices=devices)
    write_campaign(path, rig, PLANS, seed=3)
    return dry_test(load_campaign(path), PhasorSettings(), "mm-eiv")


def test_a_dry_test_says_what_the_rig_carries(tmp_path):
    found = dry_campaign(tmp_path / "dry.h5")
    assert not found.conditions
    np.testing.assert_allclose(np.diag(found.stiffness.h[0]).real, CARRIED, rtol=0.02)


def test_a_dry_test_with_a_clipped_cell_is_refused(tmp_path):
    clipped = Device(reading=lambda values, *_: np.minimum(values, 0.6 * values.max() + 0.4 * values.mean()))
    with pytest.raises(RigDataError, match=r"channel F1.*clipped"):
        dry_campaign(tmp_path / "dry.h5", F1=clipped)
