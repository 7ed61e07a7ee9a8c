"""The rig without its bearing, from a dry shaker test.

What hoses, seals and cables carry past the film is in the cells' force too. The campaign's `baseline` runs measure it,
F = H_b D without oil; in the dynamic runs F = (H + H_b) D.
"""

from dataclasses import dataclass, field

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from tpjb_ident.check.observation import observe
from tpjb_ident.conditions import Condition, holding
from tpjb_ident.estimate.equation import RigStiffness
from tpjb_ident.estimators.estimate import estimate_table
from tpjb_ident.estimators.r_matrix import phasor_table
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.phasors.run_phasors import run_phasors
from tpjb_ident.runs.point_data import gather


@dataclass(frozen=True, repr=False)
class DryTest:
    """What a campaign's dry shaker test says."""

    stiffness: RigStiffness = field(default_factory=RigStiffness)
    conditions: tuple[Condition, ...] = ()  #: where no run gives an answer

    def missing(self, omega: float) -> tuple[Condition, ...]:
        """Say where a campaign has baseline runs, but no answer of theirs at `omega` [rad/s]."""
        if self.stiffness.known(np.array([omega]))[0]:
            return ()
        if not len(self.stiffness.omega):
            return self.conditions
        low, high = self.stiffness.omega[[0, -1]] / (2 * np.pi)
        text = f"measured from {low:g} to {high:g} Hz: at this excitation the rig's own stiffness is still inside"
        return (Condition("baseline-missing", text),)


def dry_test(campaign: Campaign, settings: PhasorSettings, method: str) -> DryTest:
    """Dry test of a campaign from its baseline runs."""
    runs = campaign.of_kind("baseline")
    if not runs:
        return DryTest()
    for run in runs:
        errors = [f.problem for f in observe(run).report.findings if f.problem.severity == "error"]
        if errors:  # clipped or dead: there is no dry test without its channels
            raise RigDataError(errors)
    points = gather([run_phasors(run, campaign.housing_mass, settings) for run in runs])
    estimates = [estimate_table(phasor_table(p.D, p.F, p.run_index), p.omega, method) for p in points]
    good = sorted((est for est in estimates if np.isfinite(est.covariance).all()), key=lambda est: est.omega)
    bad = [f"{est.omega / (2 * np.pi):g} Hz" for est in estimates if not np.isfinite(est.covariance).all()]
    text = f"the baseline runs at {', '.join(bad)} give no answer: two directions are needed"
    conditions = holding((bad, "baseline-missing", text))
    if not good:
        return DryTest(conditions=conditions)
    parts = (np.array([getattr(est, name) for est in good]) for name in ("omega", "h", "covariance"))
    return DryTest(RigStiffness(*parts), conditions)
