"""One operating point's broadband runs, read and transformed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.band_balance import band_balance
from tpjb_ident.dynamic.broadband.band_runs import BandGroup
from tpjb_ident.dynamic.broadband.line_plan import LinePlan, line_plan, line_rows
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.spectra.clock_rate import common_rates
from tpjb_ident.dynamic.broadband.spectra.run_spectra import (
    OPEN_ENDS,
    RunSpectra,
    SpectraSettings,
    run_clocks,
    run_spectra,
)
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.runs.baseline import Baseline
from tpjb_ident.dynamic.runs.left_out import LeftOut
from tpjb_ident.errors import BadInputError

#: Kinds that excite every frequency again and again: what a sweep does once tells nothing of clocks.
TELL_CLOCKS = ("multisine", "random", "impact")


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
    clearance : float or None
        Assembled [m], for the amplitude check.
    """

    mains: float = 50.0
    delays: dict[str, float] = field(default_factory=dict)
    correct: bool = True
    n_calibration: int = 400
    seed: int = 20190722
    clearance: float | None = None


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
        Of its reading, and of its accelerometers.
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


def read_point(
    group: BandGroup, housing_mass: float, settings: BandSettings, baseline: Baseline
) -> tuple[BandPoint | None, list[LeftOut]]:
    """Transform the runs of a group, and name those that cannot be used; None where there is no other.

    Parameters
    ----------
    group : BandGroup
    housing_mass : float
        [kg]
    settings : BandSettings
    baseline : Baseline
        Of the rig without its bearing.

    Raises
    ------
    BadInputError
        The records are too short for their band, or do not belong together.
    """
    spectra: list[RunSpectra] = []
    left = []
    chosen = _with_clocks(group, _spectra_settings(group, settings))
    for run in group.runs:
        try:
            spectra.append(run_spectra(run, housing_mass, chosen))
        except RigDataError as error:
            left.append(LeftOut(run.id, run.point, error))
    if not spectra:
        return None, left
    late, told = band_balance(_alike(spectra))
    # how late the cells are is not put right, as with sines, but stands in the interval
    spectra = [replace(s, start=float(np.hypot(s.start, late))) for s in spectra]
    return BandPoint(group, spectra, line_plan(spectra), baseline, told), left


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


def _alike(spectra: Sequence[RunSpectra]) -> Sequence[RunSpectra]:
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
