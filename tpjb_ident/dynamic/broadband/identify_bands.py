"""A campaign's broadband runs to h over frequency: the whole path, operating point by operating point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.campaign import Campaign
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.band_models import MODELS, BandModel, Shared, between, fit_band, supported
from tpjb_ident.dynamic.broadband.band_result import BandLine, BandResult
from tpjb_ident.dynamic.broadband.band_runs import BandGroup, band_groups, is_broadband
from tpjb_ident.dynamic.broadband.clock_rate import common_rates
from tpjb_ident.dynamic.broadband.findings import RunScatter, band_conditions, run_scatter
from tpjb_ident.dynamic.broadband.line_estimates import LineEstimates, estimate_line
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.line_plan import LinePlan, line_plan, line_rows
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.run_spectra import OPEN_ENDS, RunSpectra, SpectraSettings, run_clocks, run_spectra
from tpjb_ident.dynamic.broadband.shared_sources import SharedSources, shared_sources, slope_over_load
from tpjb_ident.dynamic.corrections.static_load import LoadMiss, campaign_zero, load_conditions, load_misses
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.baseline import Baseline
from tpjb_ident.errors import BadInputError

#: Kinds that excite every frequency again and again: what a sweep does once tells nothing of clocks.
TELL_CLOCKS = ("multisine", "random", "impact")
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class BandSettings:
    """Choices, as those for sines.

    Attributes
    ----------
    mains : float
        [Hz]; 0 for none.
    delays : dict
        Seconds by which a quantity's channels are recorded late, besides what the manifest says.
    correct : bool
        Bring every run to its set-point load where the campaign's loads tell the slope.
    n_calibration, seed : int
        Draws of what lines share, and their seed.
    """

    mains: float = 50.0
    delays: dict[str, float] = field(default_factory=dict)
    correct: bool = True
    n_calibration: int = 400
    seed: int = 20190722


@dataclass(frozen=True)
class BandPoint:
    """One group of runs, transformed.

    Attributes
    ----------
    group : BandGroup
    spectra : list of RunSpectra
    plan : LinePlan
    baseline : Baseline
        Of the rig without its bearing.
    conditions : tuple of Condition
        Of its reading.
    """

    group: BandGroup
    spectra: list[RunSpectra]
    plan: LinePlan
    baseline: Baseline
    conditions: tuple[Condition, ...] = ()

    @property
    def point(self) -> OperatingPoint:
        """Set points."""
        return self.group.point

    @property
    def mean_loads(self) -> FloatArray:
        """Mean cell force of every run, (n_runs, 2) [N]."""
        return np.array([s.mean_load for s in self.spectra])

    def rows(self, k: int, miss: LoadMiss | None = None, slope: ComplexArray | None = None) -> LineRows:
        """Rows of line `k`, without the rig's own stiffness, and at the set load where the slope over load is known.

        Parameters
        ----------
        k : int
        miss : LoadMiss, optional
        slope : (2, 2) complex ndarray, optional
            dh/d(ln W) [N/m].
        """
        rows = line_rows(self.spectra, self.plan, k, self.group.kind in OPEN_ENDS)
        F = rows.F
        rig = self.baseline.at(rows.omega)
        if rig is not None:
            F = F - rows.D @ rig[0].T
        if miss is not None and slope is not None:
            F = F - miss.size[rows.run][:, None] * (rows.D @ slope.T)
        return rows.with_force(F)


def identify_bands(
    campaign: Campaign, settings: BandSettings, progress: Progress, baseline: Baseline | None = None
) -> tuple[BandResult, ...]:
    """Identify every operating point of a campaign that was excited over a band.

    Parameters
    ----------
    campaign : rigdata.campaign.Campaign
    settings : BandSettings
    progress : callable
        Called as progress(text, done, total).
    baseline : Baseline, optional
        Of the rig without its bearing.

    Raises
    ------
    rigdata.problem.RigDataError
        A record cannot be used.
    BadInputError
        Records are too short for their band.
    """
    runs = tuple(run for run in campaign.of_kind("dynamic") if is_broadband(run))
    done, points = 0, []
    for group in band_groups(runs):
        progress(group.runs[0].id, done, len(runs))
        points.append(_read(group, campaign.housing_mass, settings, baseline or Baseline()))
        done += len(group.runs)
    zero = campaign_zero(points, _cell_zero(campaign))
    misses, common = load_misses(points, zero.force)
    first = [[estimate_line(point.rows(k), classic=False) for k in range(len(point.plan.bins))] for point in points]
    sources = shared_sources(campaign, settings.n_calibration, settings.seed)
    results = []
    for i, point in enumerate(points):
        slopes = _slopes(points, first, i) if settings.correct else None
        told = load_conditions(misses[i], common) + zero.conditions()
        results.append(_finish(point, misses[i], slopes, sources, told))
    return tuple(results)


def _read(group: BandGroup, housing_mass: float, settings: BandSettings, baseline: Baseline) -> BandPoint:
    """Transform the runs of a group; one that cannot be used is left out where others remain."""
    spectra, errors = [], []
    chosen = _with_clocks(group, _spectra_settings(group, settings))
    for run in group.runs:
        try:
            spectra.append(run_spectra(run, housing_mass, chosen))
        except RigDataError as error:
            errors.append(error)
    if errors and not spectra:
        raise errors[0]
    told = tuple(Condition("run-left-out", str(error).splitlines()[0]) for error in errors[:1])
    return BandPoint(group, _alike(spectra), line_plan(spectra), baseline, told)


def _with_clocks(group: BandGroup, settings: SpectraSettings) -> SpectraSettings:
    """The settings with the differences between clocks that the group's runs show together."""
    seen = []
    for run in group.runs if group.kind in TELL_CLOCKS else ():
        try:
            seen.append(run_clocks(run, settings))
        except RigDataError:  # its own transform says so
            continue
    reach = 2 * np.pi * group.band[1] * (settings.seconds or 0.0)
    return replace(settings, clocks=common_rates(seen, reach))


def _spectra_settings(group: BandGroup, settings: BandSettings) -> SpectraSettings:
    seconds = min(run.length / run.sample_rate for run in group.runs)
    return SpectraSettings(group.band, seconds, settings.mains, settings.delays)


def _alike(spectra: list[RunSpectra]) -> list[RunSpectra]:
    """Runs with the same bins.

    Raises
    ------
    BadInputError
        Some of them are periodic and others not, or their periods differ.
    """
    first = spectra[0]
    for other in spectra[1:]:
        same = len(other.frequencies) == len(first.frequencies)
        if not same or np.abs(other.frequencies / first.frequencies - 1).max() > 1e-3:
            told = [f"{s.phasors.run} {'none' if s.period is None else f'{s.period:.4g} s'}" for s in (first, other)]
            raise BadInputError(
                f"runs at {first.phasors.point} repeat with different periods ({', '.join(told)}); "
                "excite the runs of one point with one period, or list them as different kinds of excitation"
            )
    return spectra


def _cell_zero(campaign: Campaign) -> float:
    cells = [c for c in campaign.channels.values() if c.quantity == "force"]
    return float(max((c.zero_uncertainty for c in cells), default=0.0))


def _slopes(points: list[BandPoint], first: list[list[LineEstimates]], i: int) -> ComplexArray | None:
    """dh/d(ln W) at the lines of point `i` (n_lines, 2, 2) by the campaign's other loads; None where there are none."""
    mine = points[i]
    same = [
        j
        for j, other in enumerate(points)
        if other.group.kind == mine.group.kind
        and other.point.static_load_direction_deg == mine.point.static_load_direction_deg
        and other.point.shaft_speed_hz == mine.point.shaft_speed_hz
        and other.point.static_load > 0
    ]
    curves = [_over(mine.plan.frequencies, points[j].plan.frequencies, first[j]) for j in same]
    known = [(j, curve) for j, curve in zip(same, curves) if curve is not None]
    if i not in [j for j, _ in known]:
        return None
    loads = [points[j].point.static_load for j, _ in known]
    return slope_over_load(loads, [curve for _, curve in known], [j for j, _ in known].index(i))


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
    point: BandPoint,
    miss: LoadMiss,
    slopes: ComplexArray | None,
    sources: SharedSources,
    told: tuple[Condition, ...],
) -> BandResult:
    every = [
        (k, point.rows(k, miss, None if slopes is None else slopes[k])) for k in range(len(point.plan.frequencies))
    ]
    estimates = [(k, rows, estimate_line(rows)) for k, rows in every]
    good = [line for _, _, line in estimates if line.usable]
    scatter = run_scatter([line.fit for line in good], sources.load)
    # a model takes all lines with an answer: which of them stand clear of the noise is chance in part
    used = [(rows, line) for _, rows, line in estimates if line.usable or (line.fit.found and line.method != "hv")]
    both = [_line(point, rows, line, (miss, slopes is not None), sources, scatter) for rows, line in used]
    shared = Shared(np.array([change for _, change in both]), scatter.gains)
    models = _models([rows for rows, _ in used], good[0].method, shared) if good else {}
    lines = [finished for (finished, _), (_, line) in zip(both, used) if line.usable]
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
        band_conditions(point.spectra, [line for _, _, line in estimates], lines),
    )
    width = 2 * point.plan.half_width or 1 / (point.spectra[0].period or np.inf)
    ids = tuple(s.phasors.run for s in point.spectra)
    kind = point.group.kind
    chosen = supported(models) if models else "raw H"
    return BandResult(
        point.point, kind, tuple(lines), models, chosen, quality, ids, point.spectra[0].period, float(width)
    )


def _models(rows: list[LineRows], method: str, shared: Shared) -> dict[str, BandModel]:
    """Models over the band by name; without an instrument, the middle between H1 and H2, and an interval over both."""
    found: dict[str, BandModel] = {}
    instrument = {"periods": "periods", "iv": "command"}.get(method)
    for name in MODELS:
        ways = [instrument] if instrument else ["displacement", "force"]
        fits = [fit_band(rows, name, way, shared) for way in ways]
        known = [fit for fit in fits if fit is not None]
        if len(known) == len(ways):
            found[name] = known[0] if instrument else between(known[0], known[1])
    return found


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
    seen = change + scatter.changes(line.fit)
    rig = point.baseline.at(line.omega)
    if line.method == "hv":
        # a rectangle from H1 to H2 has the standard deviation of its half width by the root of three
        seen = seen + sources.load.reshape(len(change), 8) * line.bracket / np.sqrt(3)
    systematic = np.cov(seen.T, bias=True) + (0.0 if rig is None else rig[1])
    found = {name: _stiffness(line.omega, fit, name) for name, fit in line.fits.items() if fit.found}
    found = {name: replace(est, systematic=systematic) for name, est in found.items()}
    frequency = line.omega / (2 * np.pi)
    return BandLine(frequency, found, line.method, line.coherence, line.n_rows), change


def _stiffness(omega: float, fit: LineFit, method: str) -> DynamicStiffness:
    return DynamicStiffness(
        fit.h, omega, fit.covariance(), fit.real_dof, method, np.empty((0, 2)), condition=fit.condition
    )
