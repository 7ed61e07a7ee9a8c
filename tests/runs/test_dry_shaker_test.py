"""What the rig carries without its bearing, by a dry shaker test; a channel that tells nothing refuses it."""

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.rigs import closed_form as cf
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.baseline import dry_test

CARRIED = (4e7, 6e7)
RIG = cf.Rig(beside=CARRIED, frequencies=(25.0,), directions=(0.0, 60.0, 120.0), seconds=2.0)


def dry_campaign(folder, **changes):
    channels = cf.with_entries(cf.channels_of(RIG), "L1H", **changes)
    return dry_test(load_campaign(cf.write_rig(folder, RIG, channels)), PhasorSettings(), "mm-eiv")


def test_a_dry_test_says_what_the_rig_carries(tmp_path):
    found = dry_campaign(tmp_path)
    assert not found.conditions
    np.testing.assert_allclose(np.diag(found.stiffness.h[0]).real, CARRIED, rtol=0.02)


def test_a_dry_test_with_a_clipped_cell_is_refused(tmp_path):
    with pytest.raises(RigDataError, match=r"channel L1H.*clipped"):
        dry_campaign(tmp_path, fault=lambda values, *_: np.minimum(values, 0.6 * values.max() + 0.4 * values.mean()))
