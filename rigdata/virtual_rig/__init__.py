"""A virtual rig: writes whole campaigns in the export format from given physics, with noise and faults.

>>> import numpy as np
>>> from rigdata.virtual_rig import RigTruth, VirtualRig, write_campaign
>>> rig = VirtualRig(RigTruth.constant(k=np.diag([2e8, 4e8]), c=np.diag([4e5, 6e5])), seed=1)
>>> truth = write_campaign("campaign.h5", rig)  # doctest: +SKIP
"""

from rigdata.virtual_rig.campaign import CampaignTruth, CsvLayout, write_campaign
from rigdata.virtual_rig.instruments import (
    ChannelNoise,
    DryImperfections,
    Glitches,
    Instruments,
    Noise,
    Sensor,
    SensorError,
)
from rigdata.virtual_rig.rig import Fault, SimulatedRun, VirtualRig
from rigdata.virtual_rig.truth import (
    ClearanceSweep,
    DryTest,
    RigPlan,
    RigTruth,
    VirtualRigError,
    locus_points,
    operating_points,
)
