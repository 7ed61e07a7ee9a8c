"""The rig without its bearing: a dry shaker test's dynamic stiffness, taken off the dynamic runs.

What hoses, seals and cables carry past the film is in the cells' force too. The campaign's `baseline` runs measure it,
F = H_b D without oil; in the dynamic runs F_film = F - H_b D.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.campaign import Campaign
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.estimate import estimate_table
from tpjb_ident.dynamic.estimators.r_matrix import phasor_table
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.records.run_phasors import PhasorSettings, run_phasors
from tpjb_ident.dynamic.runs.point_data import PointData, gather


@dataclass(frozen=True)
class Baseline:
    """Dynamic stiffness of the rig alone, over the frequencies at which it was measured."""

    estimates: tuple[DynamicStiffness, ...] = ()
    conditions: tuple[Condition, ...] = field(default=())

    def at(self, omega: float) -> tuple[ComplexArray, FloatArray] | None:
        """H (2, 2) and its covariance (8, 8) at `omega` [rad/s], linear between frequencies; None outside them."""
        known = np.array([est.omega for est in self.estimates])
        if not len(known) or not 0.98 * known[0] <= omega <= 1.02 * known[-1]:
            return None
        k = int(np.clip(np.searchsorted(known, omega), 1, max(len(known) - 1, 1)))
        if len(known) == 1:
            return self.estimates[0].h, self.estimates[0].covariance
        low, high = self.estimates[k - 1], self.estimates[k]
        t = float(np.clip((omega - low.omega) / (high.omega - low.omega), 0.0, 1.0))
        return (1 - t) * low.h + t * high.h, (1 - t) ** 2 * low.covariance + t**2 * high.covariance

    def taken_off(self, data: PointData) -> PointData:
        """The point's windows with the film's force alone."""
        found = self.at(data.omega)
        return data if found is None else replace(data, F=data.F - data.D @ found[0].T)

    def missing(self, data: PointData) -> tuple[Condition, ...]:
        """Say where a campaign has a baseline, but not at a point's frequency."""
        if not self.estimates or self.at(data.omega) is not None:
            return ()
        low, high = (est.omega / (2 * np.pi) for est in (self.estimates[0], self.estimates[-1]))
        told = f"measured from {low:g} to {high:g} Hz: at this excitation the rig's own stiffness is still inside"
        return (Condition("baseline-missing", told),)

    def spread(self, data: PointData) -> dict[str, FloatArray]:
        """Covariance (8, 8) that the baseline's own errors leave in H [N^2/m^2], by source."""
        found = self.at(data.omega)
        return {} if found is None else {"baseline": found[1]}


def measured_baseline(campaign: Campaign, settings: PhasorSettings, method: str) -> Baseline:
    """Baseline of a campaign from its runs of that kind."""
    runs = campaign.of_kind("baseline")
    if not runs:
        return Baseline()
    points = gather([run_phasors(run, campaign.housing_mass, settings) for run in runs])
    found = [estimate_table(phasor_table(p.D, p.F, p.run_index), p.omega, method) for p in points]
    good = sorted((est for est in found if np.isfinite(est.h).all()), key=lambda est: est.omega)
    bad = [f"{est.omega / (2 * np.pi):g} Hz" for est in found if not np.isfinite(est.h).all()]
    told = f"the baseline runs at {', '.join(bad)} give no answer: two directions are needed"
    return Baseline(tuple(good), (Condition("baseline-missing", told),) if bad else ())
