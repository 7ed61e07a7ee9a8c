"""The stiffness under the housing, as identification finds it in records of a virtual rig that knows it."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments, RigPlan, RigTruth, VirtualRig, operating_points, write_campaign
from tests.rigs import closed_form as cf
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandRig, band_plans
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify

CONTRADICT = {"accelerometers-contradict-cells"}


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "named"),
    [({}, set()), ({"gain": -1.0}, CONTRADICT), ({"late": 3e-3}, CONTRADICT)],
    ids=["right", "inverted", "late"],
)
def test_a_foundation_with_a_resonance_is_a_support_and_wrong_accelerometers_are_none(tmp_path, wrong, named):
    """At 25, 40 and 55 Hz beside 44 Hz no one spring makes the accelerations of the cells' forces."""
    rig = cf.Rig(foundation=(2000.0, 1.5e8), frequencies=(25.0, 40.0, 55.0), seconds=2.0)
    result = identify(load_campaign(cf.write_rig(tmp_path, rig, cf.with_entries(cf.channels_of(rig), "A1", **wrong))))
    assert {str(flag) for point in result.points for flag in untrusted(point.quality)} == named
    assert wrong or result.cell_stiffness is None
    for point in result.points if not wrong else ():
        h = rig.film.h(np.array([point.point.excitation_hz]), 5000.0)[0].ravel()
        off = np.abs(point.stiffness.vector - np.concatenate([h.real, h.imag]))
        assert (off < 1.5 * point.stiffness.half_width()).all()
