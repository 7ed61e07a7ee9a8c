"""The stiffness under the housing, as identification finds it in records of a virtual rig that knows it."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments, RigPlan, RigTruth, VirtualRig, operating_points, write_campaign
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandRig, band_plans
from tpjb_ident.identification.identify import identify


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [(4e8, 6e8), (1.5e9, 8e8)])
def test_cell_stiffness_is_read_from_the_records(tmp_path, stiffness):
    plan = RigPlan(dynamic=operating_points([(5000.0, 40.0)]))
    instruments = replace(Instruments.like_paper(5, 3), cell_stiffness=stiffness)
    truth = RigTruth.constant(k=np.diag([2e8, 4e8]), c=np.diag([4e5, 6e5]))
    write_campaign(tmp_path / "c.h5", VirtualRig(truth=truth, instruments=instruments, plan=plan, seed=3))
    found = identify(load_campaign(tmp_path / "c.h5")).cell_stiffness
    assert found == pytest.approx(stiffness, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["random", "multisine"])
def test_cell_stiffness_is_read_from_runs_over_a_band(tmp_path, kind):
    write_band_campaign(tmp_path / "band.h5", BandRig(kind=kind, seconds=8.0), band_plans(), seed=4)
    found = identify(load_campaign(tmp_path / "band.h5")).cell_stiffness
    assert found == pytest.approx((4e8, 6e8), rel=0.03)
