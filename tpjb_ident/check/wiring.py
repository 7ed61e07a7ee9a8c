"""Which wiring fault of two sensors would explain what they show: swapped, inverted, ten times off."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.calibration import Channel
from rigdata.vector import inverse_directions


def plane_of(channels: Sequence[Channel]) -> FloatArray:
    """Matrix (2, m) from one reading per channel to X, Y."""
    return inverse_directions(tuple(float(c.axis or 0.0) for c in channels))


def repairs(channels: Sequence[Channel], scales: bool = False) -> Iterator[tuple[str, FloatArray]]:
    """Every simple mending of two channels' readings, as a matrix on X and Y, with the fault in words."""
    if len(channels) != 2:
        return
    first, second = (c.name for c in channels)
    faults = [
        (f"{first} and {second} were swapped", np.array([[0.0, 1.0], [1.0, 0.0]])),
        (f"{first} had the wrong sign", np.diag([-1.0, 1.0])),
        (f"{second} had the wrong sign", np.diag([1.0, -1.0])),
        (f"{first} and {second} both had the wrong sign", -np.eye(2)),
    ]
    for factor, size in ((0.1, "large"), (10.0, "small")) if scales else ():
        faults.append((f"{first} read ten times too {size}", np.diag([factor, 1.0])))
        faults.append((f"{second} read ten times too {size}", np.diag([1.0, factor])))
    plane = plane_of(channels)
    for words, matrix in faults:
        yield words, plane @ matrix @ np.linalg.inv(plane)


def explanation(
    tried: Iterable[tuple[str, FloatArray]], misfit: Callable[[FloatArray], float], limit: float, alike: int = 1
) -> str:
    """The fault whose mending leaves the least misfit; "" where none leaves less than `limit`.

    Where more than `alike` of them leave no more than twice the least, none is named: else the simplest, the first.
    """
    misfits = [(misfit(matrix), words) for words, matrix in tried]
    least = min((size for size, _ in misfits), default=np.inf)
    close = [words for size, words in misfits if size < limit and size <= 2 * least]
    return f"; as if {close[0]}" if 0 < len(close) <= alike else ""


def pointing(vector: FloatArray, wanted: float, within: float) -> Callable[[FloatArray], float]:
    """Angle [deg] between a vector (2,) that is mended and a direction [deg]; all `within` of it count alike."""

    def misfit(repair: FloatArray) -> float:
        mended = repair @ vector
        off = float(np.degrees(np.arctan2(mended[1], mended[0]))) - wanted
        return max(within / 2, abs((off + 180.0) % 360.0 - 180.0))

    return misfit


def definiteness(matrix: FloatArray) -> float:
    """Least over greatest eigenvalue of the symmetric part; 1 is isotropic, not above 0 impossible."""
    low, high = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    return float(low / high) if high > 0 else -1.0


def indefiniteness(matrix: FloatArray) -> float:
    """One over `definiteness`; infinite where a matrix is impossible."""
    return 1 / max(definiteness(matrix), 1e-9)
