"""What the static tests would show: dry load-deflection curves and the clearance polygon.

They are cold and without rotation: `clearance_change` does not act on them, the pivots, the structure and the
instruments do.
"""

import numpy as np

from model.setup import Setup
from rigdata.arrays import FloatArray


def dry_curve(setup: Setup, pad: int, load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Force [N] and displacement [m] along a pad's direction as cells and probes read a dry test: `load` (n,) [N]."""
    law = setup.pivots[pad - 1]
    normal = np.array(setup.bearing.pads[pad - 1].normal)
    deflection = np.array([law.deflection(w) for w in load.tolist()]) + (normal @ setup.structure @ normal) * load
    displacement = normal @ setup.instruments.displacement_map(0.0).real @ normal
    force = normal @ setup.instruments.force_map(0.0).real @ normal
    return load * force, deflection * displacement


def polygon_sides(setup: Setup, push_load: float) -> tuple[FloatArray, FloatArray]:
    """Distance of every pad's side from the bearing centre [m] and direction of its normal [rad], as probes read them.

    Of a cold clearance sweep with a push load [N], under which pivots and structure give way.
    """
    towards = np.array([pad.normal for pad in setup.bearing.pads])
    normals = towards @ np.linalg.inv(setup.instruments.displacement_map(0.0).real)
    distance = np.array(setup.bearing.clearances)
    distance += [law.deflection(push_load) for law in setup.pivots]
    distance += push_load * np.sum(towards @ setup.structure * towards, axis=1)
    return distance / np.hypot(*normals.T), np.arctan2(normals[:, 1], normals[:, 0])
