"""All bands of a campaign as blocks of the measurement equation and their solve: points are lines, blocks runs at them.

First h of every line, then h of the parts of each band: one equation and one set of blocks; only what the points share
differs. Scatter, weights and what the sensors share are found with the lines, whose h is free, and stay. A part's lines
share one departure from the curve of K-C-M that is nearest to the band's lines: it need not hold over the band, only
bend h within the part.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.bands.film_products import film_products
from tpjb_ident.bands.responses import BandPoint, ClassicLine, classic_line, line_response, one_phase_set, pooled_noise
from tpjb_ident.bands.run_spectra import RunSpectra
from tpjb_ident.estimate.arrowhead import MODELS, Shape, complex_matrix, least_squares, power_columns, real_numbers
from tpjb_ident.estimate.equation import Blocks, Rig, Sensor, adjoint, alive, film_force, stacked, vector
from tpjb_ident.estimate.noise import GAIN_OR_LOAD, UNKNOWN_EXPONENT, slopes_over_load
from tpjb_ident.estimate.scatter import Scatter
from tpjb_ident.estimate.solve import Solution
from tpjb_ident.estimate.statistics import student_widening
from tpjb_ident.estimate.term import worth_stating
from tpjb_ident.identification.campaign_solution import channel_columns
from tpjb_ident.phasors.run_data import places_of
from tpjb_ident.runs.static_load import StaticLoads, missed_load
from tpjb_ident.terms.distortion import band_change, line_scatter
from tpjb_ident.terms.registry import solve, solved_as_learnt
from tpjb_ident.terms.run_gain import RunGain

#: F ratio from which an excitation tells the displacements from their noise,
STRONG = 10.0
#: and coherence of the force with the displacements where nothing else tells signal from noise.
_LEAST_COHERENCE = 0.5
#: Noise that responses have at least, of the run's largest: one without an instrument may have none.
_LEAST = 1e-8


@dataclass(frozen=True, repr=False)
class BandBlocks:
    """Blocks of all bands, a point a line: L lines, B bands."""

    points: tuple[BandPoint, ...]
    loads: StaticLoads
    blocks: Blocks
    omega: FloatArray  #: (L,), rad/s: of every line
    driven: BoolArray  #: (L,): whether an excitation stands above the noise in one direction
    clear: BoolArray  #: (L,): and in both
    classic: list[ClassicLine]  #: L of them: every line by the methods of analysers
    turning: FloatArray  #: (B,): relative scatter of the film's force from run to run with the shaft's angle

    @property
    def band(self) -> IntArray:
        """Band of every line, (L,)."""
        return self.blocks.band


def band_blocks(points: Sequence[BandPoint], rig: Rig, loads: StaticLoads, clearance: float | None) -> BandBlocks:
    """Responses of all runs."""
    rows = []
    calibrations: list[dict[Hashable, int]] = [{} for _ in rig.channels]
    operating: list[OperatingPoint] = []
    runs: list[str] = []
    films = [_film(point, clearance) for point in points]
    for point, miss, (_, uneven, _) in zip(points, loads.misses, films):
        first = len(operating)
        frequencies = point.frequencies.tolist()
        operating += [replace(point.point, excitation=2 * np.pi * round(f, 2)) for f in frequencies]
        for members in point.members:
            spectra = [point.runs[r] for r in members]
            names = [s.run for s in spectra]
            places = _places(spectra[0], rig.channels)
            channels = [None if k < 0 else spectra[0].channels[k] for k in places]
            row = channel_columns(channels, calibrations)
            row |= {"run": len(runs), "miss": missed_load(miss, members), "temperature": spectra[0].temperature}
            row["film_temperature"] = np.mean([s.film_temperature for s in spectra])
            for place, response in enumerate(_run_rows(point, spectra, places)):
                bins = point.bins[place]
                at = {"point": first + place, "omega": 2 * np.pi * frequencies[place]}
                at["uneven"] = uneven[members[0], bins].mean(axis=0)
                is_driven = spectra[0].driven[bins].any()
                rows += [values | row | at for values in response if is_driven]
            runs.append(", ".join(names))
    bent, _, turning = zip(*films)
    band = np.repeat(np.arange(len(points)), [len(point.bins) for point in points])
    blocks = stacked(operating, runs, len(rig), rows, np.array(bent)[band], band)
    weak, strong = _strengths(rig, blocks).T
    driven = strong > STRONG
    classic = []
    for point in points:
        classic += [classic_line(point.runs, bins, point.open) for bins in point.bins]
    coherent = np.array([line.coherence.min() for line in classic])
    quiet = np.array([point.method == "hv" for point in points])[band]
    return BandBlocks(
        tuple(points),
        loads,
        blocks.part(np.flatnonzero(driven[blocks.point])),
        2 * np.pi * np.concatenate([point.frequencies for point in points]),
        driven,
        np.where(quiet, np.nan_to_num(coherent) > _LEAST_COHERENCE, weak > STRONG),
        classic,
        np.array(turning),
    )


def _film(point: BandPoint, clearance: float | None) -> tuple[float, FloatArray, float]:
    """What a film that is not linear may do to H, to every line (n_runs, n_bins, 2), and to lines run by run."""
    periodic = point.method == "periods"
    # two tones make nothing of one another that falls on them
    pair = periodic and max(s.driven.sum() for s in point.runs) < 3
    # alike in all runs: more than the two that h needs do not average it away
    repeats = np.sqrt(max(len(point.runs), 2) / 2) if periodic and not pair and one_phase_set(point.runs) else 0.0
    film = film_products(point.runs)
    change, scatter = film.change, film.scatter
    if not film.seen:  # without a clearance nothing is stated
        rms, peak = np.max([(s.rms, s.peak) for s in point.runs], axis=0) / (clearance or np.inf)
        stated = band_change("pair" if pair else point.kind, rms, peak, _one_sided(point.runs))
        scatter = np.fmin(scatter, (line_scatter(rms) if film.even else stated) / np.sqrt(2))
        change = np.fmin(change, stated)
    uneven = np.hypot(repeats * scatter, film.turning / np.sqrt(2))
    return worth_stating(change + film.orbit), uneven, film.turning


def _one_sided(runs: Sequence[RunSpectra]) -> float:
    """How far runs together drive to one side, along X or Y: what one of them does the other way takes back."""
    sides = np.array([run.sides for run in runs])
    along, side = np.abs(sides[:, 0]).sum(axis=0), np.abs(sides[:, 1].sum(axis=0))
    return float(np.max(side / np.maximum(along, 0.1 * along.max())))


def _places(spectra: RunSpectra, sensors: Sequence[Sensor]) -> IntArray:
    """Place of every sensor's channel in a run (m,); -1 of one that it lacks, or that shows nothing beside its like."""
    places = np.array(places_of(sensors, spectra.channels))
    largest = np.append(np.abs(spectra.z).max(axis=(0, 1)), 0.0)
    return np.where(alive(sensors, largest[places]), places, -1)


def _run_rows(point: BandPoint, runs: Sequence[RunSpectra], places: IntArray) -> list[list[dict[str, object]]]:
    """Columns of the responses of one run, group by group; `places` (m,) of the sensors' channels."""
    responses = [line_response(runs, bins, point.method, point.open) for bins in point.bins]
    least = _LEAST * np.max([np.abs(r.z).max(axis=0) for r in responses if len(r.z)], axis=0)
    time = 0.5 * len(runs[0].start) * runs[0].length
    groups = []
    for response, noise, freedom in zip(responses, *pooled_noise(responses)):
        # a sensor without a channel has the last place, where there is nothing
        single = np.pad(noise + response.count * np.diag(least**2), (0, 1))[np.ix_(places, places)]
        covariance = single / response.count
        z, slope = (np.pad(rows, ((0, 0), (0, 1)))[:, places] for rows in (response.z, response.slope))
        row = {"noise": covariance, "dof": freedom, "time": time, "windows": response.repeats}
        moving = zip(z, slope, response.slope_size)
        groups.append([row | {"z": a, "slope": change, "slope_noise": single * size} for a, change, size in moving])
    return groups


def _strengths(rig: Rig, blocks: Blocks) -> FloatArray:
    """F ratios of every line's weaker and stronger direction of motion over its noise, (L, 2)."""
    probes = rig.pick("displacement")
    plane = np.linalg.pinv(blocks.along[:, probes] * blocks.present[:, probes, None])
    noise = plane @ blocks.noise[:, probes][:, :, probes] @ adjoint(plane)
    size = np.sqrt(np.maximum(np.einsum("nii->n", noise).real / 2, 1e-300))
    white = np.nan_to_num(vector(rig, blocks, "displacement")) / size[:, None]
    return np.linalg.eigvalsh(line_products(blocks, white, white)) / 2


def line_products(blocks: Blocks, first: ComplexArray, second: ComplexArray) -> ComplexArray:
    """Sums of first times conjugate second (n, 2) by line, (L, 2, 2)."""
    table = np.zeros((len(blocks.points), 2, 2), complex)
    np.add.at(table, blocks.point, first[:, :, None] * second.conj()[:, None, :])
    return table


#: Parts of a band whose h becomes a point.
_PARTS = 8
#: Scatter of the runs' gains before the runs tell it; that of a good rig, and the freedom that it counts as.
_FIRST, _USUAL = 0.01, (5e-4, 4.0)
#: Rounds in which the runs tell their scatter.
_ROUNDS = 3
#: A line whose h goes this far from least squares, of its size, is not told from noise.
_RUN_AWAY = 3.0
#: Condition number of a line's motions from which its runs move the shaft along one line.
ONE_LINE = 1e6


@dataclass(frozen=True, repr=False)
class BandSolution(BandBlocks):
    """All bands of a campaign, solved."""

    solution: Solution  #: of the lines
    usable: BoolArray  #: (L,): lines that the excitation tells
    parts: tuple[IntArray, ...]  #: lines of every part: h is that at the middle one
    part: Solution
    condition: FloatArray  #: (L,): condition number of the motions
    run_scatter: float  #: of the runs' gains

    def usable_of(self, b: int) -> IntArray:
        """Lines of a band with an answer."""
        return np.flatnonzero(self.usable & (self.band == b))

    def bracket(self, lines: IntArray) -> ComplexArray:
        """Half of what H2 lies above H1 at some lines (2, 2) [N/m], between which H is if nothing tells noise."""
        blind = [k for k in lines if self.usable[k] and self.points[self.band[k]].method == "hv"]
        halves = [0.5 * (self.classic[k].h["h2"] - self.classic[k].h["h1"]) for k in blind]
        return np.mean(halves, axis=0) if halves else np.zeros((2, 2), complex)


def solve_bands(rig: Rig, data: BandBlocks) -> BandSolution:
    """Solve all bands."""
    crude, condition = _crude(rig, data)
    used = data.driven & (condition < ONE_LINE)
    usable = used & data.clear
    lines, size = _lines(rig, data, np.where(usable[:, None, None], crude, np.nan))
    away = np.abs(lines.h - crude).max(axis=(1, 2))
    usable &= away < _RUN_AWAY * np.abs(crude).max(axis=(1, 2))
    parts = _parts(data, used, usable)
    part = _part_solution(data, lines, parts, usable)
    return BandSolution(
        **vars(data), solution=lines, usable=usable, parts=parts, part=part, condition=condition, run_scatter=size
    )


def _lines(rig: Rig, data: BandBlocks, start: ComplexArray) -> tuple[Solution, float]:
    """H of the lines, with the rig as they show it, and the scatter of the runs' gains."""
    by_load, spare = _own_scatter(rig, data, start)
    lines = np.arange(len(data.omega))
    # lines of one run stand for many runs: none is judged
    shape = Shape(lines, scatter=replace(Scatter.none(len(lines), len(data.blocks)), judges=False))

    def solved(rig: Rig, size: float) -> Solution:
        blocks = replace(data.blocks, gain_scatter=np.hypot(by_load, size * spare))
        return solve(rig, blocks, start, shape)

    size, widening = _FIRST, 1.0
    for _ in range(_ROUNDS if spare.any() else 0):
        solution = solved(rig, size)
        term = next(t for t in solution.terms if isinstance(t, RunGain))
        size, freedom = term.scatter(solution.fitted[term.name], by_load, _USUAL)
        widening = student_widening(freedom)
    return solved_as_learnt(rig, lambda rig: solved(rig, size * widening)), size * float(spare.any())


def _own_scatter(rig: Rig, data: BandBlocks, h: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Scatter that a run's gain has by its missed load, which may be one, or do what nothing tells, by block (n,).

    And one for every run whose point has more than the two runs that h needs, else zero: what the film makes of the
    shaft's turning on the lines themselves differs from run to run as well, and would pass for a gain.
    """
    blocks = data.blocks
    alone = ~(slopes_over_load(blocks.points, h)[1] & rig.to_set_point)
    by_load = np.hypot(GAIN_OR_LOAD, UNKNOWN_EXPONENT * alone[blocks.point]) * np.abs(blocks.miss.real)
    band = blocks.band[blocks.point]
    runs = np.array([len(np.unique(blocks.run[band == b])) for b in range(len(data.turning))])
    return by_load, np.where((runs > 2) & (data.turning < _FIRST), 1.0, 0.0)[band]


def _crude(rig: Rig, data: BandBlocks) -> tuple[ComplexArray, FloatArray]:
    """H of every line by least squares (L, 2, 2), and the condition number of its motions (L,)."""
    D, F = vector(rig, data.blocks, "displacement"), film_force(rig, data.blocks)
    usable = np.isfinite(D).all(axis=1) & np.isfinite(F).all(axis=1)
    used = data.blocks.part(np.flatnonzero(usable))
    DD, FD = line_products(used, D[usable], D[usable]), line_products(used, F[usable], D[usable])
    condition = np.sqrt(np.linalg.cond(DD))
    h = np.full(DD.shape, np.nan + 0j)
    regular = condition < ONE_LINE
    h[regular] = FD[regular] @ np.linalg.inv(DD[regular])
    return h - rig.bare.at(data.omega), condition


def _parts(data: BandBlocks, used: BoolArray, usable: BoolArray) -> tuple[IntArray, ...]:
    """Parts of all bands; few tones are no band: each that is told is a point."""
    parts = []
    for b in range(len(data.turning)):
        lines = np.flatnonzero(used & (data.band == b))
        if len(lines) < 2 * MODELS["K-C-M"]:
            parts += [lines[k : k + 1] for k in np.flatnonzero(usable[lines])]
        else:
            parts += np.array_split(lines, min(_PARTS, len(lines) // 2))
    return tuple(parts)


def _part_solution(data: BandBlocks, lines: Solution, parts: Sequence[IntArray], usable: BoolArray) -> Solution:
    """The solve of the parts, a group each, from the curve of K-C-M nearest to the `usable` lines of a band."""
    start = np.full_like(lines.h, np.nan)
    columns = power_columns(data.omega / np.median(data.omega), MODELS["K-C-M"])
    for b in np.unique(data.band[usable]):
        mine = data.band == b
        numbers = least_squares(columns[usable & mine], real_numbers(lines.h[usable & mine]))
        start[mine] = complex_matrix(columns[mine] @ numbers)
    group, count = np.full(len(start), len(parts)), len(parts) + 1  # the last of those that are in no part
    for q, part in enumerate(parts):
        group[part] = q
        if len(part) == 1:  # a tone by itself has no curve but its own h
            start[part] = lines.h[part]
    start[group == len(parts)] = np.nan
    shape = Shape(group, None, count, lines.scatter.fixed(count, lines.scatter.weights), lines.fitted)
    return solve(lines.rig, lines.blocks, start, shape)
