"""What one run says at a line: phasors of all channels, alike in what moved them, with the covariance of their noise.

Of a periodic excitation the mean over the periods, whose noise the periods show. Of any other the response to an
instrument, by the local polynomial method: over a few bins the response and what the record's ends leak into its
transform are straight lines, the excitation is not (Pintelon, Schoukens, Vandersteen and Barbe 2010,
doi:10.1016/j.ymssp.2009.08.003). The instrument is the command. Without one it is the displacement: all noise is then
taken to be the force's, as H1 does.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.bands.run_spectra import OPEN_ENDS, RunSpectra, run_spectra
from tpjb_ident.errors import BadInputError
from tpjb_ident.estimate.noise import unbiased_noise
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.point_data import ExcludedRun, RunsOfPoint

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


def line_response(runs: Sequence[RunSpectra], bins: IntArray, method: str, ends: bool) -> LineResponse:
    """Response over the bins of a line; the `method` is "periods", "iv" by the command, or "hv" by the displacement.

    Runs are taken together where there is no instrument of their own: each moves the shaft along one line, and what it
    shows across that is noise.
    """
    if method == "periods":
        rows, start = runs[0].z[:, bins[0]], runs[0].start
        n, mean, time = len(rows), rows.mean(axis=0), start - start.mean()
        remaining, spread = rows - mean, max(float(time @ time), 1e-300)
        slope, size = time @ remaining / spread, np.array([1 / spread])
        return LineResponse(mean[None], float(n), _outer(remaining), n - 1.0, slope[None], size, float(n))
    z = np.concatenate([run.z[0, bins] for run in runs])
    sources = [_sources(run, method) for run in runs]
    u = np.concatenate([source[bins] for source, _ in sources])
    by_time = np.concatenate([source[bins] for _, source in sources])
    return _regressed(z, u, by_time, nuisance(runs, bins, u, ends))


def nuisance(runs: Sequence[RunSpectra], bins: IntArray, sources: ComplexArray, ends: bool) -> ComplexArray:
    """Columns that a line's bins hold besides the response to `sources` (runs n, k): its slope over their places.

    And what the `ends` of each run's record leak into them: straight lines.
    """
    place = runs[0].frequencies[bins] - runs[0].frequencies[bins].mean()
    place /= max(np.abs(place).max(), 1e-300)
    sloped = np.tile(place, len(runs))[:, None] * sources
    if not ends:
        return sloped
    return np.concatenate([sloped, np.kron(np.eye(len(runs)), np.vander(place, 2, increasing=True))], axis=1)


def _sources(run: RunSpectra, method: str) -> tuple[ComplexArray, ComplexArray]:
    """What drives the run (n_bins, k), and its product with time [s] over the record."""
    assert run.by_time is not None
    parts = run, run.by_time
    if method == "iv":
        commands = [part.command[0] for part in parts if part.command is not None]
        # in directions in which the command acts: what rests would be noise alone
        power, along = np.linalg.eigh((commands[0].T @ commands[0].conj()).real)
        first, by_time = (command @ along[:, power > _AT_REST * power[-1]] for command in commands)
    else:
        first, by_time = (part.displacement[0] for part in parts)
    return first, by_time


def one_phase_set(runs: Sequence[RunSpectra]) -> bool:
    """Whether too few runs of a periodic excitation have phases of their own for its distortion to show."""
    different: list[ComplexArray] = []
    for run in runs:
        mean = run.displacement.mean(axis=0)
        wave = mean @ np.linalg.eigh((mean.T @ mean.conj()).real)[1][:, -1]
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
    independent = np.abs(np.diag(triangle)) > _NOTHING * max(np.abs(triangle).max(), 1e-300)
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
    reach = int(np.ceil(0.5 * _FREEDOM / max(freedom.mean(), 1e-9)))
    noises, totals = [], []
    for k in range(len(freedom)):
        near = slice(max(k - reach, 0), k + reach + 1)
        total = max(freedom[near].sum(), 1.0)
        noises.append(unbiased_noise(residual[near].sum(axis=0) / total, total))
        totals.append(total)
    return noises, np.array(totals)


#: Condition number of the motions' power from which they are along one line.
_ONE_LINE = 1e12


@dataclass(frozen=True)
class ClassicLine:
    """One line by the methods of analysers."""

    h: dict[str, ComplexArray]  #: (2, 2) by method, N/m; none where the rows do not tell it
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int


def classic_line(spectra: Sequence[RunSpectra], bins: IntArray, ends: bool) -> ClassicLine:
    """H1, H2, Hv and coherence over all rows of a line: periods, or bins."""
    rows = np.concatenate(
        [np.concatenate([s.displacement[:, bins], s.force[:, bins]], axis=2).reshape(-1, 4) for s in spectra]
    )
    used = 0  # columns that slope and leakage take
    if spectra[0].period is None:
        basis = np.linalg.qr(nuisance(spectra, bins, rows[:, :2], ends))[0]
        rows, used = orthogonal(rows, basis), basis.shape[1]
    S, n, freedom = rows.T @ rows.conj(), len(rows), len(rows) - used - 2
    size = np.sqrt(np.diag(S).real)
    if freedom < 1 or not (size > 0).all() or not np.linalg.cond(S[:2, :2] / np.outer(size, size)[:2, :2]) < _ONE_LINE:
        return ClassicLine({}, np.full(2, np.nan), n)
    h1, h2 = S[2:, :2] @ np.linalg.inv(S[:2, :2]), S[2:, 2:] @ np.linalg.inv(S[:2, 2:])
    signal = np.linalg.eigh(S / np.outer(size, size))[1][:, 2:] * size[:, None]
    noise = (freedom + 2) / freedom * np.diag(S[2:, 2:] - h1 @ S[:2, 2:]).real
    h = {"h1": h1, "h2": h2, "hv": signal[2:] @ np.linalg.inv(signal[:2])}
    return ClassicLine(h, np.clip(1 - noise / size[2:] ** 2, 0.0, 1.0), n)


#: Lines over a band where a record resolves more, and bins that a line takes at least.
_LINES, _BINS = 60, 12
#: Bins of a line that must be left when those of shaft and mains are gone.
_LEAST_BINS = 8
#: Lines that a band must give.
_LEAST_LINES = 4


@dataclass(frozen=True)
class BandPoint(RunsOfPoint):
    """Runs at one operating point, excited alike and transformed."""

    kind: str
    bins: tuple[IntArray, ...]  #: of every line: one of a period, or some neighbouring ones of a whole record

    @property
    def frequencies(self) -> FloatArray:
        """Of the lines, (n_lines,) [Hz]."""
        return np.array([self.runs[0].frequencies[bins].mean() for bins in self.bins])

    @property
    def resolution(self) -> float:
        """Width of a line [Hz]."""
        return max(map(len, self.bins), default=1) / self.runs[0].length

    @property
    def method(self) -> str:
        """What tells noise from motion: the periods, the command, or nothing."""
        if self.runs[0].period is not None:
            return "periods"
        return "iv" if all(s.command is not None for s in self.runs) else "hv"

    @property
    def members(self) -> list[list[int]]:
        """Runs that are taken together: each by itself, all of them where nothing tells noise from motion."""
        places = list(range(len(self.runs)))
        return [places] if self.method == "hv" else [[place] for place in places]

    @property
    def open(self) -> bool:
        """Whether the records may begin and end in motion."""
        return self.kind in OPEN_ENDS


def read_points(
    runs: Sequence[Run], settings: PhasorSettings, fast: Mapping[str, float]
) -> tuple[list[BandPoint], list[ExcludedRun]]:
    """Transform runs, those of one operating point and kind of excitation together, and name those of no use.

    `fast`: rates of the channels' clocks by name, relative.
    """
    groups = defaultdict(list)
    for run in runs:
        groups[*run.point.static_key, run.excitation_kind].append(run)
    points, unusable = [], []
    for key in sorted(groups, key=repr):
        first, spectra = groups[key][0], []
        bands = np.array([run.band for run in groups[key] if run.band is not None])
        band = low, high = float(bands[:, 0].max()), float(bands[:, 1].min())
        if not low < high:
            text = f"runs at {first.point} have no common excitation_band"
            raise RigDataError(Problem("error", first.file, "excitation_band", text, "Check the bands", first.id))
        seconds = min(run.length / run.sample_rate for run in groups[key])
        for run in groups[key]:
            try:
                spectra.append(run_spectra(run, band, seconds, settings, fast))
            except RigDataError as error:
                unusable.append(ExcludedRun(run.id, run.point, error))
        if spectra:
            _refuse_unlike(spectra)
            point, bins = replace(first.point, excitation=0.0), bins_of_lines(spectra)
            points.append(BandPoint(point, tuple(spectra), first.excitation_kind, bins))
    return points, unusable


def _refuse_unlike(spectra: Sequence[RunSpectra]) -> None:
    """Runs of one point have the same bins."""
    first = spectra[0]
    for spectrum in spectra[1:]:
        is_same = len(spectrum.frequencies) == len(first.frequencies)
        if not is_same or np.abs(spectrum.frequencies / first.frequencies - 1).max() > 1e-3:
            sentences = [f"{s.run} {'none' if s.period is None else f'{s.period:.4g} s'}" for s in (first, spectrum)]
            raise BadInputError(
                f"runs at {first.point} repeat with different periods ({', '.join(sentences)}); "
                "excite the runs of one point with one period, or list them as different kinds of excitation"
            )


def bins_of_lines(spectra: Sequence[RunSpectra]) -> tuple[IntArray, ...]:
    """Bins of the lines of runs that have the same bins."""
    free = ~np.any([s.disturbed for s in spectra], axis=0)
    if spectra[0].period is not None:
        return tuple(np.flatnonzero(free)[:, None])
    n = len(free)
    count = n // max(_BINS, math.ceil(n / _LINES))
    if count < _LEAST_LINES:
        have = spectra[0].length
        need = have * _LEAST_LINES * _BINS / max(n, 1)
        raise BadInputError(
            f"run {spectra[0].run}: {have:.3g} s resolve {n} bins of its band, {_LEAST_LINES * _BINS} are "
            f"needed; record {need:.3g} s or excite a wider band"
        )
    lines = [part[free[part]] for part in np.array_split(np.arange(n), count)]
    return tuple(part for part in lines if len(part) >= _LEAST_BINS)
