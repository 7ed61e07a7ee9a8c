"""Samples of a run, calibrated: one channel, or two as X and Y."""

import math
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray


@dataclass(frozen=True)
class Record:
    """A calibrated time series in SI units.

    Attributes
    ----------
    name : str
        Channel name, as in the manifest.
    quantity : str
        ``"displacement"`` [m], ``"force"`` [N], ``"acceleration"`` [m/s^2], ``"temperature"`` [K],
        ``"pressure"`` [Pa] or ``"speed"`` [rad/s].
    values : (n,) ndarray
        SI values; NaN where the export had no value.
    time : (n,) ndarray
        Seconds; not necessarily equidistant (jitter, gaps).
    rate : float
        Nominal sample rate [Hz].
    axis : float or None
        Direction of the positive reading [rad, counter-clockwise from +X].

    Examples
    --------
    >>> Record("X1A", "displacement", np.zeros(3), np.array([0.0, 0.1, 0.2]), rate=10.0, axis=np.pi / 4)
    <Record X1A: displacement at 45 deg, 3 samples at 10 Hz>
    """

    name: str
    quantity: str
    values: FloatArray
    time: FloatArray
    rate: float
    axis: float | None = None

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        towards = "" if self.axis is None else f" at {math.degrees(self.axis):g} deg"
        return f"<Record {self.name}: {self.quantity}{towards}, {len(self)} samples at {self.rate:g} Hz>"


@dataclass(frozen=True)
class VectorRecord:
    """Two channels of one quantity, turned into the bearing frame.

    Attributes
    ----------
    quantity : str
        As in `Record`.
    values : (n, 2) ndarray
        X and Y components, SI; NaN rows where either channel has no value.
    time : (n,) ndarray
        Seconds.
    rate : float
        Nominal sample rate [Hz].
    names : tuple of str
        The channels it was made from, two as a rule.

    Examples
    --------
    >>> force = ti.load_campaign(demo).run("d-05000-25-01").vector("force")
    >>> force.names, force.values.shape
    (('L1H', 'L1V'), (2000, 2))
    """

    quantity: str
    values: FloatArray = field(repr=False)
    time: FloatArray = field(repr=False)
    rate: float
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.values)

    def at(self, time: FloatArray) -> FloatArray:
        """Values (n, 2) at times (n,) [s]: between its own samples where another device took those, NaN beyond them."""
        if self.time is time or np.array_equal(self.time, time):
            return self.values
        return np.stack([np.interp(time, self.time, column, np.nan, np.nan) for column in self.values.T], axis=1)
