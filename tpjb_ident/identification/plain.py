"""The paper's own way, plain: Eq. (13)-(15) on stated windows, solved by statsmodels' RLM, with its own errors.

Every window of the stated length gives one phasor per channel by a least-squares sine of the set frequency and a mean.
No other line is fitted, nothing is looked for, weighted or corrected; the inertia of the housing is added to the cells'
force where there are accelerometers, as Eq. (13) wants the film's force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.campaign import Campaign
from tpjb_ident.bands.run_spectra import is_broadband
from tpjb_ident.estimate.arrowhead import real_numbers
from tpjb_ident.estimators.estimate import RlmSettings, rlm_fit
from tpjb_ident.estimators.r_matrix import r_matrix
from tpjb_ident.phasors.lines import Line, LineSet
from tpjb_ident.phasors.run_phasors import extract
from tpjb_ident.results.point_result import quality_cell
from tpjb_ident.runs.point_data import PointData, gather
from tpjb_ident.schema import POINT_KEY, with_endings

if TYPE_CHECKING:
    import pandas as pd

#: Columns of ``plain.csv`` besides the point's and the coefficients'.
_FIGURES = ("norm", "window_s", "n_records", "n_windows", "status")


@dataclass(frozen=True)
class PlainSettings:
    """How the plain solution is made."""

    window: float = 0.5
    norm: str = "huber"


@dataclass(frozen=True, repr=False)
class PlainPoint:
    """One operating point, solved as printed."""

    data: PointData
    h: ComplexArray  #: (2, 2) complex, N/m
    standard_error: np.ndarray  #: (8,), N/m: statsmodels' own, of Re and Im of h
    status: tuple[str, ...]


def plain_points(campaign: Campaign, settings: PlainSettings) -> list[PlainPoint]:
    """Solve every operating point of a campaign as the paper prints it."""
    runs = []
    for run in campaign.of_kind("dynamic"):
        if not is_broadband(run):
            lines = LineSet((Line("excitation", run.point.excitation_hz),), (), (), run.point.shaft_speed_hz)
            runs.append(extract(run, lines, window=settings.window))
    return [_solved(data, settings) for data in gather(runs)]


def _solved(data: PointData, settings: PlainSettings) -> PlainPoint:
    D, F = data.D[data.whole], data.F[data.whole]
    if np.linalg.matrix_rank(D) < 2:
        return PlainPoint(data, np.full((2, 2), np.nan + 0j), np.full(8, np.nan), ("fewer-than-two-directions",))
    # statsmodels' tolerance is absolute: the system is brought to order one, and its answer back
    displacement, force = float(np.abs(D).max()), float(np.abs(F).max())
    fit = rlm_fit(D / displacement, F / force, RlmSettings(settings.norm))
    scale = force / displacement
    error = np.sqrt(np.diag(fit.covariance)) * scale
    return PlainPoint(data, fit.h * scale, error, tuple(str(c) for c in fit.conditions))


def plain_frame(points: Sequence[PlainPoint], settings: PlainSettings) -> pd.DataFrame:
    """One row per operating point: ``plain.csv``."""
    import pandas as pd

    rows = []
    for p in points:
        point = p.data.point
        factor = np.repeat([1.0, 1 / point.excitation], 4)
        numbers = np.stack([real_numbers(p.h) * factor, p.standard_error * factor], axis=1)
        figures = (settings.norm, settings.window, len(p.data.runs), p.data.whole.sum(), quality_cell(p.status))
        rows.append([*point.key, *numbers.ravel(), *figures])
    return pd.DataFrame(rows, columns=[*POINT_KEY, *with_endings("", "_se"), *_FIGURES])


def write_r_matrices(path: Path, points: Sequence[PlainPoint]) -> None:
    """Write R and f of Eq. (15), one group per point, with the run of every window, as HDF5."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["equation"] = "F = R h, Eq. (15): h = hxx, hxy, hyx, hyy; rows 2 k and 2 k + 1 are window k"
        for number, p in enumerate(points):
            group = file.create_group(f"point-{number:03d}")
            group.attrs.update(zip(POINT_KEY, p.data.point.key))
            group.attrs["runs"] = p.data.names
            whole = p.data.whole
            rows = (*r_matrix(p.data.D[whole], p.data.F[whole]), p.data.run_index[whole])
            for name, values in zip(("R", "f", "run_index"), rows):
                group.create_dataset(name, data=values, track_times=False)
