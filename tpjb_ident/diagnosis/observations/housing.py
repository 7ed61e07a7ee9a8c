"""Housing: its mass from the manifest, and the stiffness of the cells under it as the records show it.

The housing stands on the load cells: a_h = -omega^2 F_cell / K. Effects on the force side (a wrong mass, a wrong cell
gain) act through that stiffness, which no manifest states.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from model.setup import Setup
from rigdata.manifest.manifest import MAINS_FREQUENCIES
from tpjb_ident.dynamic.broadband.run_spectra import SpectraSettings, run_spectra
from tpjb_ident.dynamic.records.run_data import RunPhasors
from tpjb_ident.dynamic.records.run_phasors import run_phasors
from tpjb_ident.dynamic.records.windows import RecordTooShortError

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from rigdata.run import Run

#: Runs that are looked at: those of the highest frequencies, where the housing shakes most.
RUNS = 8
#: Beyond, the housing does not move as far as accelerometers can tell [N/m].
STIFF = 1e13


def with_housing(setup: Setup, campaign: Campaign) -> Setup:
    """Tell a model the rig's housing mass and cell stiffness; what the campaign does not show stays as assumed."""
    instruments = setup.instruments
    if math.isfinite(campaign.housing_mass):
        instruments = replace(instruments, housing_mass=campaign.housing_mass)
    found = cell_stiffness(campaign)
    if found is not None:
        instruments = replace(instruments, cell_stiffness=found)
    return setup.change(instruments=instruments)


def cell_stiffness(campaign: Campaign) -> tuple[float, float] | None:
    """Estimate the stiffness between housing and frame in X and Y [N/m].

    Accelerations are regressed on cell forces, -a / omega^2 = F / K, run by run; the median over runs counts.
    """
    runs = sorted(campaign.of_kind("dynamic"), key=lambda run: -run.point.excitation)[:RUNS]
    if not any(c.quantity == "acceleration" for c in campaign.channels.values()):
        return None
    mass = campaign.housing_mass if math.isfinite(campaign.housing_mass) else 0.0
    rows = []
    for run in runs:
        try:
            band = None if run.excitation_kind == "sine" else run.band
            found = run_phasors(run, mass) if band is None else _over_band(run, band, mass, campaign.mains)
        except RecordTooShortError:
            continue
        if found.acceleration is None:
            continue
        lines = len(found.lines.excitation)
        omega = 2 * np.pi * np.array([line.frequency for line in found.lines.excitation])
        force, acceleration = found.cell_force.phasors[:, :lines], found.acceleration.phasors[:, :lines]
        power = np.sum(np.abs(force) ** 2, axis=(0, 1))
        slope = np.sum((np.conj(force) * -acceleration / omega[:, None] ** 2).real, axis=(0, 1))
        # an axis that the run does not excite says nothing
        rows.append(np.where(power > 0.05 * power.max(), slope / np.maximum(power, 1e-300), np.nan))
    if not rows:
        return None
    table = np.array(rows)
    if np.any(np.all(np.isnan(table), axis=0)):
        return None
    x, y = (float(v) for v in np.nanmedian(table, axis=0))
    return tuple(1.0 / max(c, 1.0 / STIFF) for c in (x, y))  # type: ignore[return-value]


def _over_band(run: Run, band: tuple[float, float], housing_mass: float, mains: float | None) -> RunPhasors:
    """Phasors of a run that is excited over a band; `cell_stiffness` needs them at no common bins."""
    return run_spectra(run, housing_mass, SpectraSettings(band, None, mains or MAINS_FREQUENCIES[0], {})).phasors
