"""Statistics of one channel's raw readings, gathered block by block."""

import math
from dataclasses import dataclass, field

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import OVERFLOW

_LEVELS = 100


@dataclass
class ChannelStatistics:
    """Counts over all samples so far; feed it with `add`."""

    samples: int = 0
    missing: int = 0
    low: float = math.inf
    high: float = -math.inf
    repeats: int = 0
    longest_flat: int = 0
    flat_start: int = 0
    blocks: list[FloatArray] = field(default_factory=list, repr=False)
    _last: float = math.nan
    _flat: int = 0

    def add(self, readings: FloatArray) -> None:
        """Take the next block, (n,) readings as the file holds them."""
        if len(readings) == 0:
            return
        with np.errstate(invalid="ignore"):  # a signalling NaN is a missing value as well
            valid = np.abs(readings) < OVERFLOW
        values = readings if valid.all() else readings[valid]
        self.missing += len(readings) - len(values)
        if len(values):
            self.low = min(self.low, float(values.min()))
            self.high = max(self.high, float(values.max()))
            self.blocks.append(values if not self.samples else values[:: max(1, len(values) // 10_000)])
        # equal neighbours; a missing value ends a stretch
        present = np.where(valid, readings, np.nan)
        repeated = present == np.concatenate([[self._last], present[:-1]])
        self.repeats += int(np.count_nonzero(repeated))
        starts = np.append(-self._flat, np.flatnonzero(~repeated))
        lengths = np.diff(starts, append=len(present))
        best = np.argmax(lengths)
        if len(values) and lengths[best] > self.longest_flat:
            self.longest_flat = int(lengths[best])
            self.flat_start = self.samples + int(starts[best])
        self._last, self._flat = float(present[-1]), int(lengths[-1])
        self.samples += len(readings)

    @property
    def values(self) -> int:
        """Samples with a value."""
        return self.samples - self.missing

    @property
    def constant(self) -> bool:
        """Whether all readings are equal."""
        return self.values > 0 and self.low == self.high

    def expected_flat(self) -> float:
        """Longest stretch of equal readings that the other samples let one expect.

        Coarse converters repeat readings: with a share p of repeats, the longest stretch among n samples
        is about log(n) / -log(p).
        """
        remainder = max(self.values - self.longest_flat, 1)
        share = min(max((self.repeats - self.longest_flat + 1) / remainder, 1e-6), 1.0 - 1.0 / remainder)
        return math.log(max(self.values, 2)) / -math.log(share) if share > 0 else 1.0

    def clipped_share(self) -> float:
        """Share of samples that sit flat at an extreme reading, 0 where nothing looks clipped.

        Clipping shows as several separate stretches of equal readings right at the highest or lowest
        level, much more of them than in the levels next to it; a sine has about 2.4 times as many in
        its last level as in the one before.
        """
        if self.high <= self.low:
            return 0.0
        readings = np.concatenate(self.blocks)
        width = (self.high - self.low) / _LEVELS
        return max(_flat_share(readings, self.high, width), _flat_share(-readings, -self.low, width))


def _flat_share(readings: FloatArray, top: float, width: float) -> float:
    at_top = readings == top
    count = np.count_nonzero(at_top)
    starts = np.count_nonzero(np.diff(at_top.astype(int), prepend=0) > 0)
    if count < 20 or starts < 3 or 2 * count < 3 * starts or count < 0.005 * len(readings):
        return 0.0
    # At least the next level that occurs, however coarse the converter.
    below = min(top - width, np.max(readings[~at_top]))
    near = np.count_nonzero(readings >= below) - count
    return count / len(readings) if count >= 4 * near else 0.0
