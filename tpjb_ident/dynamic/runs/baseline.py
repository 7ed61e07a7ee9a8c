"""The rig without its bearing: a dry shaker test's dynamic stiffness, taken off the dynamic runs.

What hoses, seals and cables carry past the film is in the cells' force too. The campaign's `baseline` runs measure it,
F = H_b D without oil; in the dynamic runs F_film = F - H_b D.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.estimate import estimate_table
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.runs.point_data import PointData, gather
from tpjb_ident.phasors.run_phasors import PhasorSettings, run_phasors


@dataclass(frozen=True)
class Baseline:
    """Dynamic stiffness of the rig alone, over the frequencies at which it was measured."""

    estimates: tuple[DynamicStiffness, ...] = ()
    conditions: tuple[Condition, ...] = ()  #: where no run gives an answer

    def at(self, omega: float) -> tuple[ComplexArray, FloatArray] | None:
        """H (2, 2) and its covariance (8, 8) at `omega` [rad/s], linear between frequencies; None outside them."""
        frequencies = np.array([est.omega for est in self.estimates])
        if not len(frequencies) or not 0.98 * frequencies[0] <= omega <= 1.02 * frequencies[-1]:
            return None
        k = int(np.clip(np.searchsorted(frequencies, omega), 1, max(len(frequencies) - 1, 1)))
        if len(frequencies) == 1:
            return self.estimates[0].h, self.estimates[0].covariance
        low, high = self.estimates[k - 1], self.estimates[k]
        t = float(np.clip((omega - low.omega) / (high.omega - low.omega), 0.0, 1.0))
        return (1 - t) * low.h + t * high.h, (1 - t) ** 2 * low.covariance + t**2 * high.covariance

    def taken_off(self, data: PointData) -> PointData:
        """The point's windows with the film's force alone."""
        rig = self.at(data.omega)
        return data if rig is None else replace(data, F=data.F - data.D @ rig[0].T, rig=rig[0])

    def missing(self, data: PointData) -> tuple[Condition, ...]:
        """Say where a campaign has baseline runs, but no answer of theirs at a point's frequency."""
        if self.at(data.omega) is not None:
            return ()
        if not self.estimates:
            return self.conditions
        low, high = (est.omega / (2 * np.pi) for est in (self.estimates[0], self.estimates[-1]))
        text = f"measured from {low:g} to {high:g} Hz: at this excitation the rig's own stiffness is still inside"
        return (Condition("baseline-missing", text),)

    def spread(self, data: PointData) -> dict[str, FloatArray]:
        """Covariance (8, 8) that the baseline's own errors leave in H [N^2/m^2], by source."""
        rig = self.at(data.omega)
        return {} if rig is None else {"baseline": rig[1]}


def measured_baseline(campaign: Campaign, settings: PhasorSettings, method: str) -> Baseline:
    """Baseline of a campaign from its runs of that kind."""
    runs = campaign.of_kind("baseline")
    if not runs:
        return Baseline()
    points = gather([run_phasors(run, campaign.housing_mass, settings) for run in runs])
    estimates = [estimate_table(phasor_table(p.D, p.F, p.run_index), p.omega, method) for p in points]
    good = sorted((est for est in estimates if np.isfinite(est.h).all()), key=lambda est: est.omega)
    bad = [f"{est.omega / (2 * np.pi):g} Hz" for est in estimates if not np.isfinite(est.h).all()]
    text = f"the baseline runs at {', '.join(bad)} give no answer: two directions are needed"
    return Baseline(tuple(good), (Condition("baseline-missing", text),) if bad else ())
