"""A campaign's broadband runs to h over frequency: the whole path, operating point by operating point."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.check.redundant_channels import widened
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.band_models import MODELS, BandModel, SharedErrors, between, fit_band, supported
from tpjb_ident.dynamic.broadband.band_point import BandPoint, BandSettings, band_groups, is_broadband, read_point
from tpjb_ident.dynamic.broadband.band_result import BandLine, BandResult, band_points
from tpjb_ident.dynamic.broadband.line_estimates import STRONG, LineEstimates, estimate_line
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra
from tpjb_ident.dynamic.broadband.shared_sources import (
    RunScatter,
    SharedSources,
    run_scatter,
    shared_sources,
    slope_over_load,
)
from tpjb_ident.dynamic.corrections.cell_zero import cell_zero_uncertainty
from tpjb_ident.dynamic.corrections.static_load import LoadMiss, campaign_zero, load_conditions, load_misses
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.baseline import Baseline
from tpjb_ident.dynamic.runs.checked_runs import campaign_verdicts, check_conditions
from tpjb_ident.dynamic.runs.excluded_runs import LISTED, ExcludedRun, named_runs

Progress = Callable[[str, int, int], None]
#: Share of the lines that must be told from noise.
_LEAST_LINES = 0.5
#: Condition number of the directions of motion from which errors are strongly amplified.
_ILL_CONDITIONED = 30.0
#: Coherence below which a band is doubted where no instrument speaks for it.
_LOW_COHERENCE = 0.9


@dataclass(frozen=True)
class IdentifiedBands:
    """What a campaign's broadband runs give."""

    results: tuple[BandResult, ...]
    changes: FloatArray = field(repr=False)  #: (n, 8 P), N/m
    conditions: tuple[Condition, ...] = ()


def identify_bands(
    campaign: Campaign, settings: BandSettings, progress: Progress, baseline: Baseline | None = None
) -> IdentifiedBands:
    """Identify every operating point of a campaign that was excited over a band."""
    runs = tuple(run for run in campaign.of_kind("dynamic") if is_broadband(run))
    seen = list(_observed(runs, progress))
    checked = campaign_verdicts(campaign, seen)
    remaining = [
        ExcludedRun(r.id, r.point, RigDataError(checked.unusable[r.id])) for r in runs if r.id in checked.unusable
    ]
    points: list[BandPoint] = []
    for group in band_groups(tuple(run for run in runs if run.id not in checked.unusable)):
        point, bad = read_point(group, campaign.housing_mass, settings, baseline or Baseline())
        remaining += bad
        points += [] if point is None else [point]
    if not points:
        raise remaining[0].error
    zero = campaign_zero(points, cell_zero_uncertainty(campaign))
    misses, common = load_misses(points, zero.force)
    first = [[estimate_line(point.rows(k), classic=False) for k in range(len(point.plan.bins))] for point in points]
    channels = widened(campaign.channels, checked.gains)
    sources = shared_sources(replace(campaign, channels=channels), settings.n_calibration, settings.seed)
    results, changes = [], []
    for i, point in enumerate(points):
        slopes = _slopes(points, first, i) if settings.correct else None
        conditions = load_conditions(misses[i], common) + zero.conditions()
        conditions += check_conditions(checked, [s.phasors.run for s in point.spectra]) + _without(point, remaining)
        result = _finish(point, misses[i], slopes, sources, conditions)
        band, moved = band_points(point, result, misses[i], settings.clearance)
        results.append(replace(result, points=band))
        changes.append(moved if len(band) else np.empty((len(sources.load), 0)))
    joint = np.concatenate(changes, axis=1)
    return IdentifiedBands(
        tuple(results), joint, named_runs(remaining, len(runs)) + _lost(points, remaining) + sources.conditions()
    )


def _observed(runs: tuple[Run, ...], progress: Progress) -> Iterator[Observation]:
    for done, run in enumerate(runs):
        progress(run.id, done, len(runs))
        yield observe(run)


def _without(point: BandPoint, left: Sequence[ExcludedRun]) -> tuple[Condition, ...]:
    """Name the runs of a point that take no part."""
    members = [excluded.run for excluded in left if replace(excluded.point, excitation=0.0) == point.point]
    return (Condition("run-left-out", f"without {', '.join(members)}, which cannot be used"),) if members else ()


def _lost(points: Sequence[BandPoint], left: Sequence[ExcludedRun]) -> tuple[Condition, ...]:
    """Name the operating points that have no run left."""
    kept = [point.point for point in points]
    lost = [excluded for excluded in left if replace(excluded.point, excitation=0.0) not in kept]
    if not lost:
        return ()
    places = dict.fromkeys(f"{excluded.point.static_load / 1e3:g} kN" for excluded in lost)
    runs = ", ".join(excluded.run for excluded in lost[:LISTED]) + (", ..." if len(lost) > LISTED else "")
    return (Condition("point-lost", f"no usable run over a band at {'; '.join(places)}: {runs}"),)


def _slopes(points: list[BandPoint], first: list[list[LineEstimates]], i: int) -> ComplexArray | None:
    """dh/d(ln W) at the lines of point `i` (n_lines, 2, 2) by the campaign's other loads; None where there are none."""
    mine = points[i]
    neighbours = [
        j
        for j, point in enumerate(points)
        if point.group.kind == mine.group.kind
        and point.point.static_key[1:] == mine.point.static_key[1:]
        and point.point.static_load > 0
    ]
    curves = [_over(mine.plan.frequencies, points[j].plan.frequencies, first[j]) for j in neighbours]
    usable = [(j, curve) for j, curve in zip(neighbours, curves) if curve is not None]
    if i not in [j for j, _ in usable]:
        return None
    loads = [points[j].point.static_load for j, _ in usable]
    return slope_over_load(loads, [curve for _, curve in usable], [j for j, _ in usable].index(i))


def _over(at: FloatArray, frequencies: FloatArray, estimates: list[LineEstimates]) -> ComplexArray | None:
    """Dynamic stiffness of usable lines, interpolated to other frequencies."""
    good = [k for k, line in enumerate(estimates) if line.usable]
    if len(good) < 2:
        return None
    h = np.array([estimates[k].fit.h for k in good]).reshape(-1, 4)
    f = frequencies[good]
    columns = [np.interp(at, f, column.real) + 1j * np.interp(at, f, column.imag) for column in h.T]
    return np.stack(columns, axis=1).reshape(-1, 2, 2)


def _finish(
    point: BandPoint, miss: LoadMiss, slopes: ComplexArray | None, sources: SharedSources, told: tuple[Condition, ...]
) -> BandResult:
    every = [
        (k, point.rows(k, miss, None if slopes is None else slopes[k])) for k in range(len(point.plan.frequencies))
    ]
    estimates = [(k, rows, estimate_line(rows)) for k, rows in every]
    good = [line for _, _, line in estimates if line.usable]
    scatter = run_scatter([line.fit for line in good], len(sources.load))
    # a model takes all lines with an answer: which of them stand clear of the noise is chance in part
    used = [(rows, line) for _, rows, line in estimates if line.usable or (line.fit.found and line.method != "hv")]
    fits = [_line(point, rows, line, (miss, slopes is not None), sources, scatter) for rows, line in used]
    shared = SharedErrors(np.array([change for _, change in fits]), scatter.gains)
    models = _models([rows for rows, _ in used], good[0].method, shared) if good else {}
    lines = [finished for (finished, _), (_, line) in zip(fits, used) if line.usable]
    bare = [
        line for line in lines if point.baseline.estimates and point.baseline.at(2 * np.pi * line.frequency) is None
    ]
    missing = (Condition("baseline-missing", f"at {len(bare)} of {len(lines)} lines of the band"),) if bare else ()
    quality = merged(
        told,
        point.conditions,
        missing,
        *(s.phasors.conditions for s in point.spectra),
        scatter.conditions,
        _band_conditions(point.spectra, [line for _, _, line in estimates], lines),
    )
    width = 2 * point.plan.half_width or 1 / (point.spectra[0].period or np.inf)
    ids = tuple(s.phasors.run for s in point.spectra)
    kind = point.group.kind
    chosen = supported(models) if models else "raw H"
    return BandResult(
        point.point, kind, tuple(lines), models, chosen, quality, ids, point.spectra[0].period, float(width)
    )


def _models(rows: list[LineRows], method: str, shared: SharedErrors) -> dict[str, BandModel]:
    """Models over the band by name; without an instrument, the middle between H1 and H2, and an interval over both."""
    table: dict[str, BandModel] = {}
    instrument = {"periods": "periods", "iv": "command"}.get(method)
    for name in MODELS:
        ways = [instrument] if instrument else ["displacement", "force"]
        fits = [fit_band(rows, name, way, shared) for way in ways]
        band_models = [fit for fit in fits if fit is not None]
        if len(band_models) == len(ways):
            table[name] = band_models[0] if instrument else between(band_models[0], band_models[1])
    return table


def _line(
    point: BandPoint,
    rows: LineRows,
    line: LineEstimates,
    load: tuple[LoadMiss, bool],
    sources: SharedSources,
    scatter: RunScatter,
) -> tuple[BandLine, FloatArray]:
    """One line with all its uncertainties, and what the draws of those that lines share do to it."""
    best = _stiffness(line.omega, line.fit, line.method)
    change = sources.changes(rows, point.spectra, best, *load)
    shifts = change + scatter.changes(line.fit)
    rig = point.baseline.at(line.omega)
    if line.method == "hv":
        # a rectangle from H1 to H2 has the standard deviation of its half width by the root of three
        shifts = shifts + sources.load.reshape(len(change), 8) * line.bracket / np.sqrt(3)
    systematic = np.cov(shifts.T, bias=True) + (0.0 if rig is None else rig[1])
    table = {name: _stiffness(line.omega, fit, name) for name, fit in line.fits.items() if fit.found}
    table = {name: replace(est, systematic=systematic) for name, est in table.items()}
    frequency = line.omega / (2 * np.pi)
    return BandLine(frequency, table, line.method, line.coherence, line.n_rows), change


def _stiffness(omega: float, fit: LineFit, method: str) -> DynamicStiffness:
    return DynamicStiffness(
        fit.h, omega, fit.covariance(), fit.real_dof, method, np.empty((0, 2)), condition=fit.condition
    )


def _band_conditions(
    spectra: Sequence[RunSpectra], estimates: Sequence[LineEstimates], lines: Sequence[BandLine]
) -> tuple[Condition, ...]:
    """Conditions of one operating point."""
    flags = []
    conditions = np.array([line.fit.condition for line in estimates])
    if len(estimates) and np.median(conditions) > 1e6:
        text = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
        flags.append(Condition("fewer-than-two-directions", text))
    elif len(lines) < _LEAST_LINES * len(estimates):
        text = f"{len(lines)} of {len(estimates)} lines stand {STRONG:g} times (F ratio) above the noise"
        flags.append(Condition("excitation-too-weak", text))
    elif np.median(conditions) > _ILL_CONDITIONED:
        text = f"condition number {np.median(conditions):.0f} (median over the band)"
        flags.append(Condition("ill-conditioned", text))
    if spectra[0].disturbances:
        held = [d for d in spectra[0].disturbances if _inside(spectra[0], d.frequency)]
        if held:
            named = ", ".join(f"{d.name} {d.frequency:.4g} Hz" for d in held[:6])
            more = f" and {len(held) - 6} more" if len(held) > 6 else ""
            flags.append(Condition("lines-left-out", f"{named}{more}"))
    if lines and lines[0].method == "hv":
        low = float(np.median([line.coherence.min() for line in lines]))
        text = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {low:.3f})"
        flags.append(Condition("no-instrument", text))
        if low < _LOW_COHERENCE:
            flags.append(Condition("low-coherence", f"{low:.2f}, median over the band"))
    if spectra[0].phasors.acceleration is None and spectra[0].phasors.housing_mass > 0:
        flags.append(Condition("inertia-not-corrected", "no accelerometers"))
    return tuple(flags)


def _inside(spectra: RunSpectra, frequency: float) -> bool:
    return bool(spectra.frequencies[0] <= frequency <= spectra.frequencies[-1])
