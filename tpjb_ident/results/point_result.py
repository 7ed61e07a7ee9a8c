"""What a campaign says about one operating point, with everything needed to believe it or not."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.columns import place_of
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.linearity import AmplitudeSlope
from tpjb_ident.runs.point_data import RunsOfPoint, pad_means


@dataclass(frozen=True)
class WindowVerdict:
    """One window that lost its weight."""

    run: str
    time: float
    weight: float
    direction: float
    reason: str


@dataclass(frozen=True)
class PointResult:
    """Dynamic stiffness of one operating point.

    Attributes
    ----------
    point : OperatingPoint
        Set points.
    stiffness : DynamicStiffness
        By the default method.
    by_method : dict of str to DynamicStiffness
    static_load_measured : float
        Mean load that the cells show [N].
    position, position_se : (2,) ndarray
        Mean displacement (from the probes' zero) over the runs and its standard error [m].
    temperatures : dict of int to float
        Mean film temperature per pad [K].
    n_records, n_windows : int
    outlier_fraction : float
        Share of windows with (nearly) no weight.
    coherence : float
        Smaller of the two force axes' multiple coherences with the displacements.
    amplitude : float
        Largest displacement amplitude of a direction [m].
    quality : tuple of Condition
        Everything that a reader of the numbers should know; empty when all is well.
    rejected : tuple of WindowVerdict
    runs : tuple of str
    load_miss : (n_runs,) complex ndarray or None
        How far each run's static load was off: relative size + i turn [rad].
    linearity : AmplitudeSlope
        Change of h with amplitude, where directions were run at several; NaN where not.
    inertia_corrected : bool
        Whether the housing's inertia was added to the cells' force.
    clearance : float or None
        Assembled clearance, where the campaign carries a bearing [m].
    budget : dict of str to (8, 8) ndarray
        Covariance of the default method's H by source [N^2/m^2]; the interval is their sum.
    scattering : tuple of str
        Sources that scatter from run to run; all others are common to the runs.
    """

    point: OperatingPoint
    stiffness: DynamicStiffness
    by_method: dict[str, DynamicStiffness]
    static_load_measured: float
    position: FloatArray
    position_se: FloatArray
    temperatures: dict[int, float]
    n_records: int
    n_windows: int
    outlier_fraction: float
    coherence: float
    amplitude: float
    quality: tuple[Condition, ...]
    rejected: tuple[WindowVerdict, ...]
    runs: tuple[str, ...]
    load_miss: ComplexArray | None = None
    linearity: AmplitudeSlope = field(default_factory=AmplitudeSlope)
    inertia_corrected: bool = False
    clearance: float | None = None
    budget: dict[str, FloatArray] = field(default_factory=dict)
    scattering: tuple[str, ...] = ("random", "load miss", "load direction", "mains")

    def __str__(self) -> str:
        flags = f" ({', '.join(str(q) for q in self.quality)})" if self.quality else ""
        place = place_of(self.point.static_load, self.point.excitation_hz)
        return f"{place}: {self.stiffness.direct_coefficients()}{flags}"

    def __repr__(self) -> str:
        return f"<PointResult: {self}>"


def by_static_point(points: Sequence[PointResult]) -> list[list[int]]:
    """Places of the points that have a stiffness, those of one load and speed together."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, p in enumerate(points):
        if np.isfinite(p.stiffness.h).all():
            groups.setdefault(p.point.static_key, []).append(i)
    return list(groups.values())


def quality_cell(conditions: Sequence[str]) -> str:
    """Names for a cell of a column ``quality``."""
    return "; ".join(conditions) or "ok"


def of_runs(recorded: RunsOfPoint, temperatures: Sequence[dict[int, float]]) -> dict[str, Any]:
    """What a point's result has of its runs, by name; `temperatures` of every run by pad [K]."""
    positions, runs = recorded.mean_positions, len(recorded.names)
    error = positions.std(axis=0, ddof=1) / np.sqrt(runs) if runs > 1 else np.full(2, np.nan)
    return {
        "static_load_measured": float(np.linalg.norm(recorded.mean_loads.mean(axis=0))),
        "position": positions.mean(axis=0),
        "position_se": error,
        "temperatures": pad_means(temperatures),
        "n_records": runs,
        "runs": recorded.names,
        "inertia_corrected": not recorded.inertia,
    }
