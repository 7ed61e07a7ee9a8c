"""Records that read otherwise than they should."""

import math
from dataclasses import replace

import numpy as np

from model.effects.kind import PAD, Parameter, effect_on
from model.setup import Setup
from rigdata.arrays import FloatArray

_PROBE_GAIN = Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.03)
_CELL_GAIN = Parameter("factor", "1", "ratio", 1.0, 0.2, 5.0, 0.02)


def _misread(setup: Setup, matrix: FloatArray) -> Setup:
    """Displacement readings are a matrix (2, 2) times the truth, at every frequency."""
    return setup.change(instruments=setup.instruments.read_displacement(lambda omega: matrix))


@effect_on(
    "measurement",
    Parameter("delay", "s", "time", 0.0, -0.005, 0.005, 0.0001),
    source="Demodulator and anti-alias filters: 20 to 500 us",
    finding="force comes {delay} late against displacement",
    physics=(
        "A delay between the channels turns every phasor in proportion to the frequency. Stiffness passes into damping."
    ),
    on_the_rig="Damping is off by K times the delay at all loads.",
    check="filters and amplifiers of both sorts of channel",
)
def channel_delay(setup: Setup, delay: float) -> Setup:
    """Displacement channels are recorded this much later than force and acceleration channels."""
    late = setup.instruments.read_displacement(lambda omega: np.exp(-1j * omega * delay) * np.eye(2))
    return setup.change(instruments=late)


@effect_on(
    "measurement",
    _PROBE_GAIN,
    source="Eddy-current probes: 5 % for another target steel",
    finding="the probes read {factor:size} {factor:more|less} than true",
    physics=(
        "Sensitivity of eddy-current probes depends on the target's steel. Stiffness, damping, positions and "
        "clearance are off by the same factor."
    ),
    on_the_rig="The clearance polygon and all coefficients are off alike.",
    check="the probes' calibration on this shaft",
)
def probe_gain(setup: Setup, factor: float) -> Setup:
    """Displacement readings are factor times the truth."""
    return _misread(setup, factor * np.eye(2))


@effect_on(
    "measurement",
    Parameter("angle", "rad", "angle", 0.0, -1.6, 1.6, 0.035),
    source="Drilled bores: 1 to 3 deg",
    finding="the probes stand {angle} off their stated angle",
    physics="Displacements are then resolved along wrong axes. Direct terms leak into the cross-coupled ones.",
    on_the_rig="The clearance polygon is turned against the pads.",
    check="the angles of the probe holders",
)
def probe_rotation(setup: Setup, angle: float) -> Setup:
    """Both probes really stand at their stated angle + this."""
    # a probe at theta + angle reads d . e(theta + angle) = (R(-angle) d) . e(theta)
    return _misread(setup, np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]]))


@effect_on(
    "measurement",
    _CELL_GAIN,
    source="A parallel load path (hoses, leaf springs) takes 0.5 to 5 %",
    finding="the load cells read {factor:size} {factor:more|less} than true",
    physics=(
        "A wrong sensitivity, or a load path beside the cells, scales all forces. Stiffness and damping follow, "
        "positions do not."
    ),
    on_the_rig="All coefficients are off alike; positions and clearance agree.",
    check="the cells' calibration, and hoses or springs beside them",
)
def loadcell_gain(setup: Setup, factor: float) -> Setup:
    """Force readings of the cells are factor times the truth."""
    return setup.change(instruments=setup.instruments.read_cells(factor * np.eye(2)))


@effect_on(
    "measurement",
    Parameter("fraction", "1", "ratio", 0.0, -0.5, 0.5, 0.02),
    source="Leaf springs decouple to about 1 %",
    finding="the load cells hand {fraction} of each force to the other axis",
    physics=(
        "Each cell also feels the force across it. The static load then seems to turn, and cross-coupled terms appear."
    ),
    on_the_rig="The ratio of the measured load components changes with the load's direction.",
    check="decoupling of the cells: load one axis and read the other",
)
def loadcell_crosstalk(setup: Setup, fraction: float) -> Setup:
    """Each cell also reads this fraction of the other axis."""
    return setup.change(instruments=setup.instruments.read_cells(np.array([[1.0, fraction], [fraction, 1.0]])))


@effect_on(
    "measurement",
    Parameter("mass_error", "kg", "mass", 0.0, -500.0, 1000.0, 5.0),
    source="Hoses, plates and cells move along",
    finding="{mass_error:size} {mass_error:more|less} move with the housing than stated",
    physics=(
        "The inertia of the housing is taken off the cells' force with its mass. An error in it grows with the "
        "frequency squared."
    ),
    on_the_rig="Stiffness drifts with the excitation frequency like a mass does.",
    check="what hangs on the housing: hoses, plates, cells",
)
def housing_mass(setup: Setup, mass_error: float) -> Setup:
    """True housing mass = stated mass + mass_error."""
    return setup.change(instruments=setup.instruments.weigh_housing(mass_error))


@effect_on(
    "measurement",
    Parameter("probe", "1", "ratio", math.nan, 1, 2, options=(1, 2)),
    _PROBE_GAIN,
    source="Eddy-current probes: 5 % for another target steel, more for another driver",
    finding="probe {probe:0} reads {factor:size} {factor:more|less} than true",
    physics="One probe has another sensitivity. What moves along its axis is off, what moves across it is not.",
    on_the_rig="The clearance polygon is stretched along that probe, and direct coefficients part.",
    check="that probe's calibration on this shaft, its driver and its cable",
)
def one_probe_gain(setup: Setup, probe: float, factor: float) -> Setup:
    """Readings of one displacement probe are factor times the truth."""
    rows = np.array([[math.cos(a), math.sin(a)] for a in setup.instruments.probe_axes])
    return _misread(setup, np.linalg.solve(rows, np.where(np.arange(1, 3) == probe, factor, 1.0)[:, None] * rows))


@effect_on(
    "measurement",
    Parameter("cell", "1", "ratio", math.nan, 1, 2, options=(1, 2)),
    _CELL_GAIN,
    source="A parallel load path (hoses, leaf springs) takes 0.5 to 5 %",
    finding="cell {cell:0} reads {factor:size} {factor:more|less} than true",
    physics="One cell has another sensitivity, or a load path beside it. One row of the coefficients is off.",
    on_the_rig="Coefficients of one force direction are off alike; the loads that were set seem to turn.",
    check="that cell's calibration, and hoses or springs beside it",
)
def one_cell_gain(setup: Setup, cell: float, factor: float) -> Setup:
    """Readings of one load cell (1: X, 2: Y) are factor times the truth."""
    gains = np.where(np.arange(1, 3) == cell, factor, 1.0)
    return setup.change(instruments=setup.instruments.read_cells(np.diag(gains)))


@effect_on(
    "measurement",
    PAD,
    Parameter("offset", "K", "temperature difference", 0.0, -50.0, 50.0, 3.0),
    source="Thermocouples of class 2 are 2.5 K off, badly seated ones more",
    finding="the thermometer of {pad} reads {offset:size} too {offset:warm|cold}",
    physics="One thermometer is off, or sits elsewhere than stated. Nothing else of the bearing changes.",
    on_the_rig="One pad's temperature is off by the same amount at all points.",
    check="that thermometer at standstill beside the others, and where it sits",
)
def thermometer_offset(setup: Setup, pad: int, offset: float) -> Setup:
    """The thermometer of one pad reads this much more than the truth."""
    readings = (*setup.instruments.thermometers, (pad, offset))
    return setup.change(instruments=replace(setup.instruments, thermometers=readings))
