"""What one run says at a line: phasors of all channels, alike in what moved them, with the covariance of their noise.

Of a periodic excitation the mean over the periods, whose noise the periods show. Of any other the response to an
instrument, by the local polynomial method: over a few bins the response and what the record's ends leak into its
transform are straight lines, the excitation is not (Pintelon, Schoukens, Vandersteen and Barbe 2010,
doi:10.1016/j.ymssp.2009.08.003). The instrument is the command. Without one it is the displacement: all noise is then
taken to be the force's, as H1 does.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.bands.run_spectra import RunSpectra
from tpjb_ident.estimate.noise import unbiased_noise

#: A direction of the command with less than this share of its power is at rest.
_AT_REST = 1e-3
#: Part of a response that is not told from leakage and slope.
_NOTHING = 1e-9
#: Degrees of freedom of a noise from which it is taken by itself; below, neighbouring lines join in.
_FREEDOM = 65.0
#: Phase sets that show the distortion of a multi-sine, and likeness from which two are one.
_SETS, _ALIKE = 3, 0.6


@dataclass(frozen=True)
class LineResponse:
    """One run at the bins of one line."""

    z: ComplexArray  #: (k, m), SI: k responses whose noise has one covariance
    count: float  #: that covariance is the noise of a row over this
    residual: ComplexArray  #: (m, m): sum of what is left, times its own conjugate
    freedom: float  #: complex degrees of freedom of the residual
    slope: ComplexArray  #: (k, m), 1/s: change of the responses over time
    slope_size: FloatArray  #: (k,), 1/s^2: its covariance is the noise of a row times this
    repeats: float  #: rows that tell it


def line_response(runs: Sequence[RunSpectra], bins: IntArray, instrument: str, ends: bool) -> LineResponse:
    """Response over the bins of a line; `instrument` is "periods", "command" or "displacement".

    Runs are taken together where there is no instrument of their own: each moves the shaft along one line, and what it
    shows across that is noise.
    """
    if instrument == "periods":
        return _over_periods(runs[0].phasors.z[:, bins[0]], runs[0].phasors.start)
    z = np.concatenate([run.phasors.z[0, bins] for run in runs])
    sources = [_sources(run, instrument) for run in runs]
    u, by_time = (np.concatenate([part[bins] for part in parts]) for parts in zip(*sources))
    return _regressed(z, u, by_time, nuisance(runs, bins, u, ends))


def _over_periods(rows: ComplexArray, start: FloatArray) -> LineResponse:
    """Mean of the periods' phasors (n, m) and how they move; `start` (n,) [s]."""
    n, mean = len(rows), rows.mean(axis=0)
    time = start - start.mean()
    remaining, spread = rows - mean, max(float(time @ time), 1e-300)
    slope = time @ remaining / spread
    return LineResponse(mean[None], float(n), _outer(remaining), n - 1.0, slope[None], np.array([1 / spread]), float(n))


def nuisance(runs: Sequence[RunSpectra], bins: IntArray, sources: ComplexArray, ends: bool) -> ComplexArray:
    """Columns that a line's bins hold besides the response to `sources` (runs n, k): its slope over their places.

    And what the `ends` of each run's record leak into them: straight lines.
    """
    place = runs[0].frequencies[bins] - runs[0].frequencies[bins].mean()
    place /= max(float(np.abs(place).max()), 1e-300)
    sloped = np.tile(place, len(runs))[:, None] * sources
    if not ends:
        return sloped
    return np.concatenate([sloped, np.kron(np.eye(len(runs)), np.vander(place, 2, increasing=True))], axis=1)


def _sources(run: RunSpectra, instrument: str) -> tuple[ComplexArray, ComplexArray]:
    """What drives the run (n_bins, k), and its product with time [s] over the record."""
    assert run.by_time is not None
    parts = run, run.by_time
    if instrument == "command":
        along = _driven(run)
        first, by_time = (part.command[0] @ along for part in parts if part.command is not None)
    else:
        first, by_time = (part.D[0] for part in parts)
    return first, by_time


def _driven(run: RunSpectra) -> FloatArray:
    """Directions (2, k) in which the command acts: what rests would be noise alone."""
    assert run.command is not None
    power, along = np.linalg.eigh((run.command[0].T @ run.command[0].conj()).real)
    return along[:, power > _AT_REST * power[-1]]


def one_phase_set(runs: Sequence[RunSpectra]) -> bool:
    """Whether too few runs of a periodic excitation have phases of their own for its distortion to show."""
    means = [run.D.mean(axis=0) for run in runs]
    waves = [mean @ np.linalg.eigh((mean.T @ mean.conj()).real)[1][:, -1] for mean in means]
    different: list[ComplexArray] = []
    for wave in waves:
        if all(_likeness(wave, earlier) < _ALIKE for earlier in different):
            different.append(wave)
    return len(different) < _SETS


def _likeness(wave: ComplexArray, second: ComplexArray) -> float:
    """Share in which phases (n,) differ by no more than a time, 0 to 1."""
    product = wave * second.conj()
    return float(np.abs(np.fft.fft(product, 4 * len(product))).max() / max(float(np.abs(product).sum()), 1e-300))


def _regressed(z: ComplexArray, u: ComplexArray, by_time: ComplexArray, besides: ComplexArray) -> LineResponse:
    """Responses of rows (b, m) to sources (b, k), apart from their slope and from what the ends leak (b, j).

    `by_time` (b, k): the sources' product with time; the part of the rows that goes with it is what moves.
    """
    basis = np.linalg.qr(besides)[0]
    q, triangle = np.linalg.qr(orthogonal(u, basis))
    independent = np.abs(np.diag(triangle)) > _NOTHING * max(float(np.abs(triangle).max()), 1e-300)
    q, triangle, by_time = q[:, independent], triangle[np.ix_(independent, independent)], by_time[:, independent]
    fitted = np.concatenate([basis, q], axis=1)
    remaining = orthogonal(z, fitted)
    moving, moved = np.linalg.qr(orthogonal(by_time, fitted))
    share = triangle @ np.linalg.pinv(moved)
    freedom, size = float(len(z) - fitted.shape[1]), np.sum(np.abs(share) ** 2, axis=1)
    slope = share @ (moving.conj().T @ remaining)
    return LineResponse(q.conj().T @ z, 1.0, _outer(remaining), max(freedom, 0.0), slope, size, freedom)


def orthogonal(rows: ComplexArray, basis: ComplexArray) -> ComplexArray:
    """Rows (b, m) without their part in orthonormal columns (b, j)."""
    return rows - basis @ (basis.conj().T @ rows)


def _outer(rows: ComplexArray) -> ComplexArray:
    return rows.T @ rows.conj()


def pooled_noise(responses: list[LineResponse]) -> tuple[list[ComplexArray], FloatArray]:
    """Noise of a row at every line of one run with its neighbours (m, m), and its degrees of freedom (n,)."""
    residual = np.array([r.residual for r in responses])
    freedom = np.array([r.freedom for r in responses])
    reach = int(np.ceil(0.5 * _FREEDOM / max(float(freedom.mean()), 1e-9)))
    noises, totals = [], []
    for k in range(len(freedom)):
        near = slice(max(k - reach, 0), k + reach + 1)
        total = max(float(freedom[near].sum()), 1.0)
        noises.append(unbiased_noise(residual[near].sum(axis=0) / total, total))
        totals.append(total)
    return noises, np.array(totals)
