"""Errors that all lines of a point share: calibration, axes, delays, mass, the load's direction, as draws over them.

The sources, and what they do to one line, are those of the sine's path; the draws are the same at every line, so that
a model over the band gets what they leave of it and not the root of the number of lines less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.campaign import Campaign
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.spectra.run_spectra import RunSpectra
from tpjb_ident.dynamic.corrections.calibration_uncertainty import GainDraws, apparent_change, gain_draws
from tpjb_ident.dynamic.corrections.load_direction import PLAUSIBLE
from tpjb_ident.dynamic.corrections.static_load import UNKNOWN_EXPONENT, LoadMiss
from tpjb_ident.dynamic.corrections.systematic_sources import SystematicSources, systematic_sources
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData


@dataclass(frozen=True)
class SharedSources:
    """Draws of a campaign.

    Attributes
    ----------
    gains : GainDraws
    others : SystematicSources
    load : (n, 2, 4) ndarray
        Standard normal numbers for how K and C follow the load.
    """

    gains: GainDraws
    others: SystematicSources
    load: FloatArray

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of calibrations that the manifest does not state."""
        return self.gains.conditions()

    def changes(
        self, rows: LineRows, spectra: list[RunSpectra], est: DynamicStiffness, miss: LoadMiss, corrected: bool
    ) -> FloatArray:
        """Change of the eight entries of h in every draw, (n, 8) [N/m].

        Parameters
        ----------
        rows : LineRows
        spectra : list of RunSpectra
            Of its runs.
        est : DynamicStiffness
            At this line.
        miss : LoadMiss
            Of the runs' static loads.
        corrected : bool
            Whether their sizes were put right.
        """
        data = as_point_data(rows, spectra)
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
    """Draw the sources of a campaign.

    Parameters
    ----------
    campaign : rigdata.campaign.Campaign
    n : int
        Draws, in pairs of opposite sign.
    seed : int
    """
    half = np.random.default_rng(seed + 2).standard_normal((max(n // 2, 1), 2, 4))
    return SharedSources(
        gain_draws(campaign.channels, n, seed),
        systematic_sources(campaign, n, seed + 1),
        np.concatenate([half, -half]),
    )


def as_point_data(rows: LineRows, spectra: list[RunSpectra]) -> PointData:
    """The rows in the form that the corrections of the sine's path take.

    Parameters
    ----------
    rows : LineRows
    spectra : list of RunSpectra
    """
    runs = tuple(s.phasors for s in spectra)
    point = replace(runs[0].point, excitation=rows.omega)
    return PointData(point, runs, (0,) * len(runs), rows.D, rows.F, rows.A, rows.run)


def slope_over_load(loads: list[float], h: list[ComplexArray], which: int) -> ComplexArray | None:
    """dh/d(ln W) (n_lines, 2, 2) of one of several loads, between its neighbours; None where there is one load.

    Parameters
    ----------
    loads : list of float
        [N]
    h : list of (n_lines, 2, 2) complex ndarray
        At each load, at the same frequencies.
    which : int
        Place of the load.
    """
    order = list(np.argsort(loads))
    at = order.index(which)
    low, high = max(at - 1, 0), min(at + 1, len(order) - 1)
    step = np.log(loads[order[high]] / loads[order[low]]) if low < high else 0.0
    if not step > 0:
        return None
    return np.asarray((h[order[high]] - h[order[low]]) / step)
