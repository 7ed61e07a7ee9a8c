"""Errors that all lines of a point share, as draws: calibration, axes, delays, mass, load direction, runs' gains.

The sources, and what they do to one line, are those of the sine's path; the draws are the same at every line, so that
a model over the band gets what they leave of it and not the root of the number of lines less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, stdtrit

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.corrections.systematic_sources import (
    GainDraws,
    SystematicSources,
    apparent_change,
    gain_draws,
    paired_draws,
    systematic_sources,
)
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.estimate.noise import UNKNOWN_EXPONENT
from tpjb_ident.terms.load_turn import PLAUSIBLE

#: Probability of chance below which runs differ,
_DIFFERENT = 1e-3
#: and the relative difference that is too much for one bearing.
_TOO_MUCH = 0.05


@dataclass(frozen=True)
class RunScatter:
    """How runs differ."""

    size: float
    draws: FloatArray  #: (n, n_runs): standard normal numbers, one per run
    conditions: tuple[Condition, ...] = ()

    @property
    def gains(self) -> FloatArray:
        """Relative change of every run's force, (n, n_runs)."""
        return self.size * self.draws

    def changes(self, fit: LineFit) -> FloatArray:
        """Change of the eight entries of h in every draw, (n, 8) [N/m]."""
        if not self.size:
            return np.zeros((len(self.draws), 8))
        moved = np.einsum("nr,rik->nik", self.gains, fit.h @ fit.share).reshape(-1, 4)
        return np.concatenate([moved.real, moved.imag], axis=1)


@dataclass(frozen=True)
class SharedSources:
    """Draws of a campaign."""

    gains: GainDraws
    others: SystematicSources
    load: FloatArray  #: (n, 2, 4): standard normal numbers for how K and C follow the load

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of calibrations that the manifest does not state."""
        return self.gains.conditions()

    def changes(
        self, rows: LineRows, spectra: list[RunSpectra], est: DynamicStiffness, miss: LoadMiss, corrected: bool
    ) -> FloatArray:
        """Change of the eight entries of h in every draw, (n, 8) [N/m]."""
        data = _as_point_data(rows, spectra)
        plain = replace(est, weights=np.ones((len(rows.D), 2)))
        total = apparent_change(data, plain, self.gains)
        for change in self.others.changes(data, plain).values():
            total = total + change
        return total + self._load(est, miss, corrected) + self._start(est, max(s.start for s in spectra))

    def _start(self, est: DynamicStiffness, start: float) -> FloatArray:
        """What cells that start a little before or after the probes do."""
        turned = (1j * est.omega * start * est.h).ravel()
        shift = np.concatenate([turned.real, turned.imag])
        return np.asarray(self.load[:, 1, 3, None] * shift)

    def _load(self, est: DynamicStiffness, miss: LoadMiss, corrected: bool) -> FloatArray:
        """What loads off their set points may do: their direction, and their size where its slope is not known."""
        k, c = est.direct
        aside = float(np.sqrt(np.mean(miss.sideways**2))) if len(miss.sideways) else 0.0
        off = 0.0 if corrected else float(np.sqrt(np.mean(miss.size**2))) if len(miss.size) else 0.0
        size = np.repeat([k, c], 4) * PLAUSIBLE[0] * aside
        own = np.abs(est.vector) * UNKNOWN_EXPONENT * off
        return np.asarray(self.load.reshape(len(self.load), 8) * np.hypot(size, own))


def shared_sources(campaign: Campaign, n: int, seed: int) -> SharedSources:
    """Draw the sources of a campaign."""
    return SharedSources(
        gain_draws(campaign.channels, n, seed),
        systematic_sources(campaign, n, seed + 1),
        paired_draws(np.random.default_rng(seed + 2), n, 2, 4),
    )


def _as_point_data(rows: LineRows, spectra: list[RunSpectra]) -> PointData:
    """The rows in the form that the corrections of the sine's path take."""
    runs = tuple(s.phasors for s in spectra)
    point = replace(runs[0].point, excitation=rows.omega)
    return PointData(point, runs, (0,) * len(runs), rows.D, rows.F, rows.A, rows.run)


def slope_over_load(loads: list[float], h: list[ComplexArray], which: int) -> ComplexArray | None:
    """dh/d(ln W) (n_lines, 2, 2) of one of several loads, between its neighbours; None where there is one load."""
    order = list(np.argsort(loads))
    at = order.index(which)
    low, high = max(at - 1, 0), min(at + 1, len(order) - 1)
    step = np.log(loads[order[high]] / loads[order[low]]) if low < high else 0.0
    if not step > 0:
        return None
    return np.asarray((h[order[high]] - h[order[low]]) / step)


def run_scatter(fits: Sequence[LineFit], n: int) -> RunScatter:
    """What the lines of a point say of its runs together.

    Line by line such a difference drowns in noise; over all lines it is told to a fraction of a per cent. h takes a
    part of every run's gain, so what is left shows only some of it, and that with few degrees of freedom: both are
    worked out from the runs' own shares in h. Two runs are needed for h itself: only from the third on anything is
    known of it.
    """
    n_runs = len(fits[0].dof) if fits else 0
    draws = paired_draws(np.random.default_rng(n_runs), n, max(n_runs, 1))
    if n_runs < 2 or not fits:
        return RunScatter(0.0, draws)
    if n_runs == 2:
        text = "with two runs the interval holds how their repeats differ, not how runs do"
        return RunScatter(0.0, draws, (Condition("no-spare-direction", text),))
    power = np.sum([fit.apart.power for fit in fits], axis=0)
    gain = np.sum([fit.apart.left for fit in fits], axis=0) / power
    noise = np.sum([fit.apart.variance for fit in fits], axis=0) / power**2
    spare = 2 * (n_runs - 2)
    if not chdtrc(spare, float(np.sum(2 * np.abs(gain) ** 2 / noise))) < _DIFFERENT:
        return RunScatter(0.0, draws)
    shown = _left_of_gains(fits)
    # of gains with variance s^2 the residuals show s^2 tr(A^T A); Satterthwaite's degrees of freedom of that sum
    part = shown.T @ shown
    dof = float(np.trace(part) ** 2 / np.trace(part @ part))
    size = float(np.sqrt(np.sum(np.abs(gain) ** 2) / np.trace(part)))
    conditions: tuple[Condition, ...] = ()
    if size > _TOO_MUCH:
        conditions = (Condition("runs-disagree", f"runs differ by {100 * size:.1f} % in force over displacement"),)
    return RunScatter(size * float(stdtrit(dof, 0.975)) / 1.96, draws, conditions)


def _left_of_gains(fits: Sequence[LineFit]) -> FloatArray:
    """What a gain of every run's force leaves in the residuals' gains once h has taken its part, (2 n_runs, n_runs)."""
    n_runs = len(fits[0].dof)
    power = np.sum([fit.apart.power for fit in fits], axis=0)
    removed = np.zeros((n_runs, n_runs), dtype=complex)
    for fit in fits:
        turned = fit.h @ fit.share @ np.linalg.inv(fit.h)
        removed += np.einsum("sij,rji->rs", turned, fit.apart.force)
    remaining = np.eye(n_runs) - removed / power[:, None]
    return np.concatenate([remaining.real, remaining.imag])
