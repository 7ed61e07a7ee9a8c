"""What the records show when the instruments err: the dynamic stiffness and position that a faultless evaluation finds.

Instrument errors are linear maps, so this needs no records: the difference to the truth is what the errors alone
do, and a sharp test of whoever evaluates the records.
"""

from __future__ import annotations

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.virtual_rig.instruments import Instruments
from rigdata.virtual_rig.running import answer
from rigdata.virtual_rig.sensing import felt_direction


def apparent_stiffness(h: ComplexArray, frequency: float, instruments: Instruments) -> ComplexArray:
    """Dynamic stiffness (2, 2) [N/m] that the readings show for a true `h` at `frequency` [rad/s].

    Parameters
    ----------
    h : (2, 2) complex ndarray
        Dynamic stiffness [N/m].
    frequency : float
        [rad/s]
    instruments : Instruments
    """
    lines = [answer(frequency, force, h, instruments) for force in np.eye(2, dtype=complex)]
    seen = {}
    for quantity in ("displacement", "force", "acceleration"):
        phasors = np.stack([line.phasor(quantity) for line in lines], axis=1)
        seen[quantity] = reading_map(instruments, quantity, frequency) @ phasors
    oil_force = seen["force"] + instruments.housing_mass * seen["acceleration"]
    return oil_force @ np.linalg.inv(seen["displacement"])


def reading_map(instruments: Instruments, quantity: str, frequency: float) -> ComplexArray:
    """Map (2, 2) from true to stated X and Y of a quantity, phasors at `frequency` [rad/s]; first pair of sensors.

    Parameters
    ----------
    instruments : Instruments
    quantity : str
        ``"displacement"``, ``"force"`` or ``"acceleration"``.
    frequency : float
        [rad/s]
    """
    pair = instruments.of(quantity)[:2]
    stated = np.array([s.stated_direction for s in pair])
    felt = np.array(
        [s.error.gain * np.exp(-1j * frequency * s.error.delay) * felt_direction(s, instruments) for s in pair]
    )
    return np.linalg.solve(stated.astype(complex), felt)
