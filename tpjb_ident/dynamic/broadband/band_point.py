"""One operating point's broadband runs: which belong together, read and transformed, accelerometers against cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.clock_rate import common_rates
from tpjb_ident.dynamic.broadband.line_rows import LinePlan, LineRows, line_plan, line_rows
from tpjb_ident.dynamic.broadband.run_spectra import OPEN_ENDS, RunSpectra, SpectraSettings, run_clocks, run_spectra
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.instruments.housing_balance import BalanceRun, balances
from tpjb_ident.dynamic.runs.baseline import Baseline
from tpjb_ident.dynamic.runs.excluded_runs import ExcludedRun
from tpjb_ident.errors import BadInputError

#: Kinds that excite every frequency again and again: what a sweep does once tells nothing of clocks.
_TELL_CLOCKS = ("multisine", "random", "impact")
_SINE = "sine"
#: Parts of the band that are judged one by one: a lag shows at the top, a sign everywhere.
_PARTS = 8
#: Lines that a part has at least.
_LEAST = 6


@dataclass(frozen=True)
class BandGroup:
    """Runs at one operating point, excited alike."""

    point: OperatingPoint
    kind: str
    band: tuple[float, float]
    runs: tuple[Run, ...]


@dataclass(frozen=True)
class BandSettings:
    """Choices, as those for sines."""

    mains: float = 50.0
    delays: dict[str, float] = field(default_factory=dict)
    correct: bool = True
    n_calibration: int = 400
    seed: int = 20190722
    clearance: float | None = None


@dataclass(frozen=True)
class BandPoint:
    """One group of runs, transformed."""

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

        `slope` (2, 2) [N/m].
        """
        rows = line_rows(self.spectra, self.plan, k, self.group.kind in OPEN_ENDS)
        F = rows.F
        rig = self.baseline.at(rows.omega)
        if rig is not None:
            F = F - rows.D @ rig[0].T
        if miss is not None and slope is not None:
            F = F - miss.size[rows.run][:, None] * (rows.D @ slope.T)
        return rows.with_force(F)


def read_point(
    group: BandGroup, housing_mass: float, settings: BandSettings, baseline: Baseline
) -> tuple[BandPoint | None, list[ExcludedRun]]:
    """Transform the runs of a group, and name those that cannot be used; None where there is no other."""
    spectra: list[RunSpectra] = []
    remaining = []
    seconds = min(run.length / run.sample_rate for run in group.runs)
    chosen = _with_clocks(group, SpectraSettings(group.band, seconds, settings.mains, settings.delays))
    for run in group.runs:
        try:
            spectra.append(run_spectra(run, housing_mass, chosen))
        except RigDataError as error:
            remaining.append(ExcludedRun(run.id, run.point, error))
    if not spectra:
        return None, remaining
    late, conditions = _band_balance(_alike(spectra))
    # how late the cells are is not put right, as with sines, but stands in the interval
    spectra = [replace(s, start=float(np.hypot(s.start, late))) for s in spectra]
    return BandPoint(group, spectra, line_plan(spectra), baseline, conditions), remaining


def _with_clocks(group: BandGroup, settings: SpectraSettings) -> SpectraSettings:
    """The settings with the differences between clocks that the group's runs show together."""
    clocks = []
    for run in group.runs if group.kind in _TELL_CLOCKS else ():
        try:
            clocks.append(run_clocks(run, settings))
        except RigDataError:  # its own transform says so
            continue
    reach = 2 * np.pi * group.band[1] * (settings.seconds or 0.0)
    return replace(settings, clocks=common_rates(clocks, reach))


def _alike(spectra: Sequence[RunSpectra]) -> Sequence[RunSpectra]:
    """Runs with the same bins."""
    first = spectra[0]
    for spectrum in spectra[1:]:
        same = len(spectrum.frequencies) == len(first.frequencies)
        if not same or np.abs(spectrum.frequencies / first.frequencies - 1).max() > 1e-3:
            sentences = [
                f"{s.phasors.run} {'none' if s.period is None else f'{s.period:.4g} s'}" for s in (first, spectrum)
            ]
            raise BadInputError(
                f"runs at {first.phasors.point} repeat with different periods ({', '.join(sentences)}); "
                "excite the runs of one point with one period, or list them as different kinds of excitation"
            )
    return spectra


def is_broadband(run: Run) -> bool:
    """Whether a run is excited over a band, not by a sine."""
    return getattr(run, "excitation_kind", _SINE) != _SINE


def band_groups(runs: tuple[Run, ...]) -> list[BandGroup]:
    """Group broadband runs by operating point and kind of excitation, sorted."""
    groups: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        groups.setdefault((*run.point.static_key, run.excitation_kind), []).append(run)
    return [_group(groups[key]) for key in sorted(groups, key=repr)]


def _group(runs: list[Run]) -> BandGroup:
    bands = [run.band for run in runs if run.band is not None]
    low, high = max(b[0] for b in bands), min(b[1] for b in bands)
    first = runs[0]
    if not low < high:
        text = f"runs at {first.point} have no common excitation_band"
        raise RigDataError(Problem("error", first.file, "excitation_band", text, "Check the bands", first.id))
    return BandGroup(replace(first.point, excitation=0.0), first.excitation_kind, (low, high), tuple(runs))


def _band_balance(spectra: Sequence[RunSpectra]) -> tuple[float, tuple[Condition, ...]]:
    """By how much the cells are late [s], zero where that is not clear, and what to say of the accelerometers.

    The housing is a mass on springs at every line, so neighbouring lines tell the same ratio once each is brought to
    one frequency by its square. A period's line counts by its repeats, a bin of a whole record by what the others
    scatter.
    """
    if spectra[0].phasors.acceleration is None:
        return 0.0, ()
    free = np.flatnonzero(~np.any([s.taken for s in spectra], axis=0))
    parts = np.array_split(free, min(_PARTS, max(len(free) // _LEAST, 1)))
    verdicts = balances([run for part in parts for s in spectra for run in _lines(s, part.tolist())])
    conditions = merged(*(verdicts[f].conditions for f in sorted(verdicts, reverse=True)))
    if "accelerometers-contradict-cells" in conditions:  # where the housing's inertia is larger
        conditions = tuple(c for c in conditions if c != "accelerometers-doubtful")
    lags = [verdict.phase / (2 * np.pi * f) for f, verdict in verdicts.items()]
    return max(lags, default=0.0), conditions


def _lines(spectra: RunSpectra, part: Sequence[int]) -> list[BalanceRun]:
    """Every line of a part of the band, brought to the part's middle: acceleration grows with the square."""
    if not len(part):
        return []
    middle = float(np.median(spectra.frequencies[list(part)]))
    mass, windows = spectra.phasors.housing_mass, len(spectra.D)
    blocks = []
    for k in part:
        scaled = spectra.A[:, k] * (middle / spectra.frequencies[k]) ** 2
        A, mean_A, F = scaled.mean(axis=0), spectra.A[:, k].mean(axis=0), spectra.F[:, k].mean(axis=0)
        variance = float(np.sum(np.abs(scaled - A) ** 2)) / max(4 * (windows - 1), 1)
        share = float(mass * np.linalg.norm(mean_A) / max(float(np.linalg.norm(F)), 1e-300))
        blocks.append(BalanceRun(middle, F - mass * mean_A, A, share, mass, variance, windows))
    return blocks
