"""What the clearance sweeps say of the probes that the dynamic runs are measured with; every sweep is read once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import RigDataError
from rigdata.run import Run
from rigdata.vector import inverse_directions
from tpjb_ident.arrays import FloatArray
from tpjb_ident.check.run_gains import swept_centre

#: Readings below which a sweep says nothing of a probe.
FEWEST = 100


@dataclass(frozen=True)
class SweptProbe:
    """One probe in one clearance sweep.

    Attributes
    ----------
    run, name : str
    half_travel : float
        Half of the way between its 1 and 99 % quantiles [m]; NaN where it has too few readings.
    centre : float or None
        What it reads at the bearing's centre [m]; None where the load does not go around.
    """

    run: str
    name: str
    half_travel: float
    centre: float | None


def swept_probes(campaign: Campaign) -> tuple[SweptProbe, ...]:
    """Every probe in every clearance sweep that can be read.

    Parameters
    ----------
    campaign : Campaign
    """
    return tuple(probe for run in campaign.of_kind("clearance") for probe in _of_sweep(run))


def _of_sweep(run: Run) -> list[SweptProbe]:
    probes = [n for n, c in run.channels.items() if c.quantity == "displacement"]
    cells = [n for n, c in run.channels.items() if c.quantity == "force"]
    readings = {name: values for name in (*probes, *cells) if (values := _values(run, name)) is not None}
    load = _load(run, [readings[n] for n in cells if n in readings])
    found = []
    for name in probes:
        if name not in readings:
            continue
        values = readings[name]
        known = values[np.isfinite(values)]
        low, high = np.quantile(known, [0.01, 0.99]) if len(known) >= FEWEST else (np.nan, np.nan)
        centre = swept_centre(load, values) if load is not None and len(load) == len(values) else None
        found.append(SweptProbe(run.id, name, 0.5 * float(high - low), centre))
    return found


def _values(run: Run, name: str) -> FloatArray | None:
    try:
        return run.record(name).values
    except RigDataError:  # a damaged sweep is no matter of the dynamic runs
        return None


def _load(run: Run, readings: list[FloatArray]) -> FloatArray | None:
    """X and Y of the load (n, 2); None unless two cells in different directions give it."""
    cells = [c for c in run.channels.values() if c.quantity == "force"]
    if len(cells) != 2 or len(readings) != 2 or len(readings[0]) != len(readings[1]):
        return None
    plane = inverse_directions(tuple(float(c.axis or 0.0) for c in cells))
    return np.stack(readings, axis=1) @ plane.T if np.isfinite(plane).all() else None
