"""Noise of a displacement channel over seconds: white, 1/f, walk and drift; learnt from the records themselves.

A staircase test lasts some ten seconds, in which a probe drifts by a tenth of a micrometre or more. Drift
grows with time and so does the load: taken for deflection it makes a stiff pivot several per cent softer or
stiffer. What tells them apart is that drift goes on during the holds. A covariance with a drift term uses
exactly that, and widens the interval by what is left; averages with a standard deviation over the square
root of n would be blind to it.

A drift is straight, with a bend; a walk has a rate that changes all the time, as in a draught: over ten seconds it
goes further than the 1/f noise that looks like it over one.

The four levels are estimated by restricted maximum likelihood (Patterson and Thompson, Biometrika 58,
1971, 545-554), pooled over all series of a campaign: the probes are the same in each.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from rigdata.arrays import FloatArray
from tpjb_ident.errors import BadInputError

DRIFT_RATE = 1.0e-8  # [m/s], centre of the prior
DRIFT_OVER_FLICKER = 0.7  # [1/sqrt(s)], drift rate to be expected over the square root of the 1/f power density
_BEND = 0.5  # of a drift: half of what its rate at either end differs by from that in the middle, standard deviation
_WAVES = 8  # half cosines over a record that stand for the slowest part of a walk, which no stationary noise resembles
_WALK_OVER_FLICKER = 0.2  # [1/sqrt(s)], walk to be expected over the square root of the 1/f power density
_PINNED = 0.01  # of ln(drift rate): as good as given
# time constants [s] of the exponentially correlated processes whose sum has a 1/f spectrum from some 5 mHz
# to 5 Hz
_FLICKER_TIMES = 0.05 * 4.0 ** np.arange(7)
# power density [1/Hz] at 1 Hz of the sum of unit processes
_FLICKER_GAIN = float(np.sum(4.0 * _FLICKER_TIMES / (1.0 + (2.0 * np.pi * _FLICKER_TIMES) ** 2)))


@dataclass(frozen=True)
class NoiseModel:
    """Levels of the four kinds of noise."""

    white: float  #: [m^2 s]
    flicker: float  #: [m^2]
    drift: float  #: [m/s]
    walk: float = 0.0  #: [m/sqrt(s)]

    def covariance(self, time: FloatArray, duration: FloatArray) -> FloatArray:
        """Covariance of block averages, (m, m); `time`, `duration` (m,) [s]."""
        return np.diag(self.white / duration) + self.slow_covariance(time, duration)

    def slow_covariance(self, time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
        """All but the white noise, (m, m); `time` (m,) [s]; of averages where `duration` (m,) [s] is given."""
        centred = time - np.mean(time)
        bent = 2.0 * _BEND * (centred**2 - np.mean(centred**2)) / max(np.ptp(time), 1e-300)
        drift = self.drift * np.column_stack([centred, bent])
        slow = self.flicker * flicker_kernel(time, duration) + drift @ drift.T
        return slow + self.walk**2 * walk_kernel(time, duration)

    def mean_variance(self, duration: float) -> float:
        """Variance of one average over `duration` seconds about the run's own level [m^2]."""
        time = (np.arange(40) + 0.5) * duration / 40
        return self.white / duration + self.flicker * float(np.mean(flicker_kernel(time)))


def walk_kernel(time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
    """Covariance (m, m) about its mean of a walk of one metre per square root of a second; of averages if `duration`.

    `time` (m,) [s], `duration` (m,) [s].
    """
    span = max(np.ptp(time), 1e-300)
    share = (time - np.min(time)) / span
    square = 0.5 * share**2
    kernel = span * (1.0 / 3.0 + square[:, None] + square - np.maximum(share[:, None], share))
    # the later of two moments within an average comes a sixth of it after its middle
    return kernel if duration is None else kernel - np.diag(duration / 6.0)


def _walk_columns(time: FloatArray) -> FloatArray:
    """Columns (m, k) that sum up, with random factors, to a walk of one metre per square root of a second at `time`."""
    span = max(np.ptp(time), 1e-300)
    waves = np.pi * np.arange(1, _WAVES + 1)
    return np.cos((time[:, None] - np.min(time)) / span * waves) * np.sqrt(2.0 * span) / waves


def flicker_kernel(time: FloatArray, duration: FloatArray | None = None) -> FloatArray:
    """Covariance (m, m) of 1/f noise of unit power density at 1 Hz; of averages where `duration` is given.

    `time` (m,) [s], `duration` (m,) [s].
    """
    lag = np.abs(time[:, None] - time[None, :])
    kernel = np.zeros_like(lag)
    for tau in _FLICKER_TIMES:
        term = np.exp(-lag / tau)
        if duration is not None:
            x = duration / tau
            # variance of the average of an exponentially correlated process over x time constants
            np.fill_diagonal(term, 2.0 / x * (1.0 + np.expm1(-x) / x))
        kernel += term
    return kernel / _FLICKER_GAIN


@dataclass(frozen=True)
class NoiseSeries:
    """One series from which noise is learnt."""

    time: FloatArray  #: `time`, `duration` (m,), s: blocks
    duration: FloatArray
    values: FloatArray  #: (m,), m: block averages
    mean: FloatArray  #: (m, p)


def _rotated(series: Sequence[NoiseSeries], unit: float) -> list[tuple[FloatArray, FloatArray]]:
    """Series of one shape together, k of them, each in the basis in which white and 1/f noise are both diagonal.

    Every level that the search tries costs a few products of small matrices for all of them together. Gives spectra
    (k, m, 2) over the white noise, of the 1/f noise and (all but diagonal there) of a walk's quick part; and signal,
    drift, the walk's slow part and values (k, m, p + 10).
    """
    groups = defaultdict(list)
    for samples in series:
        root = np.sqrt(samples.duration)
        kernel = flicker_kernel(samples.time, samples.duration) * np.outer(root, root)
        spectrum, basis = np.linalg.eigh(kernel)
        waves = _walk_columns(samples.time)
        quick = (walk_kernel(samples.time, samples.duration) - waves @ waves.T) * np.outer(root, root)
        spectra = np.column_stack([spectrum, np.sum(basis * (quick @ basis), axis=0)])
        scale = np.maximum(np.max(np.abs(samples.mean), axis=0), 1e-300)
        mean, _ = np.linalg.qr((samples.mean / scale) * root[:, None])
        drift = samples.time - np.mean(samples.time)
        slow = np.column_stack([drift, waves]) * root[:, None]
        columns = np.column_stack([mean, slow, samples.values / unit * root])
        groups[samples.mean.shape].append((np.maximum(spectra, 0.0), basis.T @ columns))
    stacks = (zip(*alike) for alike in groups.values())
    return [(np.stack(spectra), np.stack(columns)) for spectra, columns in stacks]


def _minus_log_likelihood(spectra: FloatArray, columns: FloatArray, levels: FloatArray) -> float:
    """Sum over series of one shape; white, 1/f, drift and walk `levels` (4,) in the unit of `_rotated`."""
    white, flicker, drift, walk = levels
    variance = white + spectra @ [flicker, walk**2]
    p = columns.shape[2] - _WAVES - 2
    scale = np.r_[np.ones(p), drift, np.full(_WAVES, walk), 1.0]
    gram = np.swapaxes(columns, 1, 2) @ (columns / variance[..., None]) * np.outer(scale, scale)
    # drift and walk are random columns: Woodbury takes them out of every product at once
    u = gram[:, p:-1]
    inner = np.eye(_WAVES + 1) + u[:, :, p:-1]
    gram = gram - np.swapaxes(u, 1, 2) @ np.linalg.solve(inner, u)
    xx, xy, yy = gram[:, :p, :p], gram[:, :p, -1], gram[:, -1, -1]
    log_det = np.log(variance).sum() + np.linalg.slogdet(inner)[1].sum() + np.linalg.slogdet(xx)[1].sum()
    explained = np.sum(xy * np.linalg.solve(xx, xy[..., None])[..., 0])
    return 0.5 * float(log_det + yy.sum() - explained)


def estimate_noise(
    series: Sequence[NoiseSeries], drift_rate: float = DRIFT_RATE, learn_drift: bool = True
) -> NoiseModel:
    """Estimate the noise levels common to several series."""
    usable = [s for s in series if len(s.time) > s.mean.shape[1] + 2]
    if not usable:
        raise BadInputError("no series is long enough to learn noise from: record longer holds")
    white = float(np.median([_white_level(s) for s in usable]))
    unit = np.sqrt(white)
    rotated = _rotated(usable, unit)
    prior = np.log(drift_rate / unit)
    spread = np.r_[5.0, 5.0, np.full(2, 1.0 if learn_drift else _PINNED)]

    def objective(logs: FloatArray) -> float:
        levels = np.exp(np.clip(logs, -30.0, 30.0))
        # probes that flicker more drift and walk more; beyond that, a level that the data do not feel (no 1/f at all)
        # must not run away to minus infinity
        drift = 0.5 * np.log(np.exp(2.0 * prior) + DRIFT_OVER_FLICKER**2 * levels[1])
        expected = np.array([0.0, 0.0, drift, np.log(_WALK_OVER_FLICKER) + 0.5 * logs[1]])
        likelihood = sum(_minus_log_likelihood(*alike, levels) for alike in rotated)
        return likelihood + 0.5 * float(np.sum(((logs - expected) / spread) ** 2))

    corner = np.array([-0.5, -0.5, prior, -2.0])
    simplex = np.vstack([corner, corner + 1.4 * np.eye(4)])  # a factor of four in each level
    options = {"xatol": 0.05, "fatol": 0.05, "maxiter": 250, "initial_simplex": simplex}
    solution = optimize.minimize(objective, corner, method="Nelder-Mead", options=options)
    return NoiseModel(*(np.exp(solution.x) * [white, white, unit, unit]).tolist())


def _white_level(series: NoiseSeries) -> float:
    """Rough white level [m^2 s] from second differences of neighbouring blocks."""
    second = np.diff(series.values, 2) * np.sqrt(np.median(series.duration) / 6.0)
    # a noise-free record (a simulation): anything far below the signal will do
    least = max(1e-6 * np.ptp(series.values), 1e-15) ** 2 * np.median(series.duration)
    return float(max(np.median(second**2) / 0.455, least))
