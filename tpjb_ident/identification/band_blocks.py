"""All bands of a campaign as blocks of the measurement equation: a point a group of bins, a block a run's response."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from tpjb_ident.bands.responses import line_response, one_phase_set, pooled_noise, stands_out, tones
from tpjb_ident.bands.run_spectra import OPEN_ENDS, RunSpectra
from tpjb_ident.estimate.blocks import Blocks, Rig, Sensor, stacked, vector
from tpjb_ident.estimate.sensors import alive, axes_of
from tpjb_ident.identification.band_point import BandPoint
from tpjb_ident.identification.campaign_blocks import calibration_numbers
from tpjb_ident.identification.point_means import warm_gain
from tpjb_ident.runs.static_load import LoadMiss
from tpjb_ident.terms.distortion import band_change, line_scatter

#: F ratio from which an excitation tells the displacements from their noise.
STRONG = 10.0
#: Noise that responses have at least, of the run's largest: one without an instrument may have none.
_LEAST = 1e-8


@dataclass(frozen=True)
class BandBlocks:
    """Blocks of all bands, and what belongs together."""

    blocks: Blocks = field(repr=False)
    omega: FloatArray  #: (P,), rad/s: of every point
    line: IntArray  #: (P,): number of its line, counted over all bands
    band: IntArray  #: (L,): band of every line
    line_omega: FloatArray  #: (L,), rad/s
    driven: BoolArray  #: (L,): whether an excitation stands above the noise
    strength: FloatArray  #: (L,): F ratio of the weaker direction of motion
    bent: FloatArray = field(default_factory=lambda: np.zeros(0))  #: (B,): share by which the motion may change H
    uneven: FloatArray | None = None  #: (B,): relative scatter of the lines' film force, in one phase set

    def with_film(self, points: Sequence[BandPoint], clearance: float) -> BandBlocks:
        """With what a film that is not linear may do to H and, in one phase set of a multi-sine, to single lines."""
        bent, scatter = np.zeros(len(points)), np.zeros(len(points))
        for b, point in enumerate(points):
            rms, peak = (max(getattr(s, name) for s in point.spectra) / clearance for name in ("rms", "peak"))
            one_sided = max(s.one_sided for s in point.spectra)
            # two tones make nothing of one another that falls on them
            pair = point.method == "periods" and tones(point.spectra) < 3
            bent[b] = band_change("pair" if pair else point.group.kind, rms, peak, one_sided)
            if point.method == "periods" and not pair and one_phase_set(point.spectra):
                # alike in all runs: more than the two that h needs do not average it away
                scatter[b] = line_scatter(rms) * np.sqrt(max(len(point.spectra), 2) / 2)
        return replace(self, bent=bent, uneven=scatter)


def band_blocks(
    points: Sequence[BandPoint],
    sensors: Sequence[Sensor],
    misses: Sequence[LoadMiss],
    temperatures: Mapping[str, float],
    instruments: Sequence[str],
) -> BandBlocks:
    """Responses of all runs; `instruments` by band."""
    rows: list[dict[str, object]] = []
    known: list[list[Hashable]] = [[] for _ in sensors]
    lines: list[int] = []
    bands: list[int] = []
    runs: list[str] = []
    omega: list[float] = []
    line_omega: list[float] = []
    operating: list[OperatingPoint] = []
    for b, (point, miss, instrument) in enumerate(zip(points, misses, instruments)):
        first = len(omega)
        groups = [(k, bins) for k, parts in enumerate(point.plan.groups) for bins in parts]
        for k, bins in groups:
            f = float(point.spectra[0].frequencies[bins].mean())
            omega.append(2 * np.pi * f)
            operating.append(replace(point.point, excitation=2 * np.pi * round(f, 2)))
            lines.append(len(line_omega) + k)
        line_omega += [2 * np.pi * float(f) for f in point.plan.frequencies]
        bands += [b] * len(point.plan.groups)
        for members in _members(point):
            spectra = [point.spectra[r] for r in members]
            warmth = [temperatures.get(s.phasors.run, np.nan) for s in spectra]
            channels = _described(spectra[0], sensors)
            row = {"calibration": calibration_numbers(channels, known), "along": axes_of(channels)}
            row |= {"run": len(runs), "temperature": warmth[0], "miss": miss.of(members)}
            for place, response in _run_rows(point, spectra, channels, warmth[0], instrument):
                rows.append(response | row | {"point": first + place, "omega": omega[first + place]})
            runs.append(", ".join(s.phasors.run for s in spectra))
    blocks = stacked(operating, runs, len(sensors), rows)
    of_point = np.array(lines, dtype=np.intp)
    driven = np.zeros(len(line_omega), dtype=bool)
    np.logical_or.at(driven, of_point[blocks.point], np.array([row["stands"] for row in rows], dtype=bool))
    return BandBlocks(
        blocks.part(np.flatnonzero(driven[of_point[blocks.point]])),
        np.array(omega),
        of_point,
        np.array(bands, dtype=np.intp),
        np.array(line_omega),
        driven,
        _strengths(sensors, blocks, of_point[blocks.point], len(line_omega)),
    )


def _members(point: BandPoint) -> list[list[int]]:
    """Runs that are taken together: each by itself, all of them where nothing tells noise from motion."""
    runs = range(len(point.spectra))
    return [list(runs)] if point.method == "hv" else [[r] for r in runs]


def _described(spectra: RunSpectra, sensors: Sequence[Sensor]) -> list[Channel | None]:
    """The run's channel of every sensor; None of one that it lacks, or that shows nothing beside its like."""
    largest = np.abs(spectra.phasors.z).max(axis=(0, 1))
    table = {(c.name, c.quantity): (c, size) for c, size in zip(spectra.phasors.channels, largest)}
    known = [table.get((sensor.name, sensor.quantity), (None, 0.0)) for sensor in sensors]
    shown = alive(sensors, np.array([size for _, size in known]))
    return [channel if own else None for (channel, _), own in zip(known, shown)]


def _run_rows(
    point: BandPoint,
    runs: Sequence[RunSpectra],
    channels: Sequence[Channel | None],
    temperature: float,
    instrument: str,
) -> list[tuple[int, dict[str, object]]]:
    """Place of its group and columns of every response of one run."""
    m = len(channels)
    spectra = runs[0]
    names = [channel.name for channel in spectra.phasors.channels]
    order = [names.index(channel.name) for channel in channels if channel is not None]
    present = np.array([channel is not None for channel in channels])
    warm = None if np.isnan(temperature) else temperature
    gain = np.array([1.0 if c is None else warm_gain(c, warm) for c in channels])
    ends = point.group.kind in OPEN_ENDS
    groups = [bins for parts in point.plan.groups for bins in parts]
    responses = [line_response(runs, bins, instrument, ends) for bins in groups]
    noises, freedoms = pooled_noise(responses)
    least = _LEAST * np.max([np.abs(r.z).max(axis=0) for r in responses if len(r.z)], axis=0)
    time = 0.5 * len(spectra.phasors.start) * spectra.phasors.length
    rows: list[tuple[int, dict[str, object]]] = []
    for place, (response, noise, freedom) in enumerate(zip(responses, noises, freedoms)):
        single = np.zeros((m, m), complex)
        single[np.ix_(present, present)] = (noise + response.count * np.diag(least**2))[np.ix_(order, order)]
        single /= np.outer(gain, gain)
        covariance = np.asarray(single / response.count, complex)
        z, slope = np.zeros((2, len(response.z), m), complex)
        z[:, present], slope[:, present] = response.z[:, order], response.slope[:, order]
        row = {"present": present, "noise": covariance, "dof": freedom, "time": time, "windows": response.repeats}
        row["stands"] = stands_out(np.asarray(z / gain), covariance, freedom, present)
        for values, change, size in zip(z / gain, slope / gain, response.slope_size):
            rows.append((place, row | {"z": values, "slope": change, "slope_noise": single * size}))
    return rows


def _strengths(sensors: Sequence[Sensor], blocks: Blocks, line: IntArray, lines: int) -> FloatArray:
    """F ratio of every line's weaker direction of motion over its noise, (L,); `line` (n,) of the blocks."""
    probes = Rig(tuple(sensors), 1.0).of("displacement")
    motion = np.nan_to_num(vector(Rig(tuple(sensors), 1.0), blocks, "displacement"))
    strength = np.zeros(lines)
    white = np.zeros((len(blocks), 2), complex)
    for b in range(len(blocks)):
        seen = probes[blocks.present[b, probes]]
        plane = np.linalg.pinv(blocks.along[b, seen])
        noise = plane @ blocks.noise[b][np.ix_(seen, seen)] @ plane.T
        white[b] = motion[b] / np.sqrt(max(float(np.trace(noise).real) / 2, 1e-300))
    for k in range(lines):
        rows = white[line == k]
        if len(rows) > 1:
            strength[k] = float(np.linalg.svd(rows, compute_uv=False)[-1] ** 2) / 2
    return strength
