"""A band as operating points like those of sines: K and C in parts of it, for all that takes coefficients.

The lines of a part alone tell its h; K-C-M only says how h changes within the part. So the points of a band are as
independent of one another as runs with sines, whether or not a model over the whole band holds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import merged
from tpjb_ident.dynamic.broadband.band_models import BandPart
from tpjb_ident.dynamic.broadband.band_point import BandPoint
from tpjb_ident.dynamic.broadband.band_result import BandResult
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, change_conditions
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.results.quality import feeds_motion
from tpjb_ident.dynamic.runs.point_data import pad_means


def band_points(
    point: BandPoint, result: BandResult, miss: LoadMiss, clearance: float | None
) -> tuple[tuple[PointResult, ...], FloatArray]:
    """Points of one band, and what the draws of systematic errors do to them, (n, 8 P) [N/m].

    Parameters
    ----------
    point : BandPoint
    result : BandResult
        Its lines and models.
    miss : LoadMiss
        How far the runs' static loads were off.
    clearance : float or None
        Assembled [m].
    """
    models = [model for model in result.models.values() if model.parts]
    if not models:
        return (), np.empty((0, 0))
    parts = models[-1].parts
    points = tuple(_point(part, point, result, miss, clearance) for part in parts)
    return points, np.concatenate([part.moved for part in parts], axis=1)


def _point(
    part: BandPart, point: BandPoint, result: BandResult, miss: LoadMiss, clearance: float | None
) -> PointResult:
    low, high = (omega * (1 + edge) / (2 * np.pi) for omega, edge in zip(part.span, (-1e-9, 1e-9)))
    inside = [line for line in result.lines if low <= line.frequency <= high]
    est, budget = _estimate(part, point, result)
    positions = np.array([s.position for s in point.spectra])
    amplitude = max(s.amplitude for s in point.spectra)
    n_rows = sum(line.n_rows for line in inside)
    bent = change_conditions(FilmChange(), 0.0, est, amplitude, clearance)
    return PointResult(
        point=replace(point.point, excitation=2 * np.pi * round(part.omega / (2 * np.pi), 3)),
        stiffness=est,
        by_method={est.method: est},
        static_load_measured=float(np.linalg.norm(point.mean_loads.mean(axis=0))),
        position=positions.mean(axis=0),
        position_se=positions.std(axis=0, ddof=1) / np.sqrt(len(positions))
        if len(positions) > 1
        else np.full(2, np.nan),
        temperatures=pad_means([s.temperatures for s in point.spectra]),
        n_records=len(point.spectra),
        n_windows=n_rows,
        outlier_fraction=0.0,
        coherence=float(np.median([line.coherence.min() for line in inside])) if inside else float("nan"),
        amplitude=amplitude,
        quality=merged(result.quality, feeds_motion(est), bent),
        rejected=(),
        runs=result.runs,
        load_miss=miss,
        inertia_corrected=point.spectra[0].phasors.acceleration is not None,
        clearance=clearance,
        budget=budget,
    )


def _estimate(part: BandPart, point: BandPoint, result: BandResult) -> tuple[DynamicStiffness, dict[str, FloatArray]]:
    """The part's h with all its uncertainties, and these by source."""
    found = {"random": part.covariance, "shared by all lines": np.cov(part.moved.T, bias=True)}
    rig = point.baseline.at(part.omega)
    if rig is not None:
        found["baseline"] = rig[1]
    if part.bracket.any():
        # a rectangle's standard deviation is half its width by the root of three
        found["no instrument"] = np.diag(part.bracket**2) / 3
    systematic = np.sum([v for name, v in found.items() if name != "random"], axis=0)
    condition = float(np.median([line.stiffness.condition for line in result.lines])) if result.lines else np.nan
    est = DynamicStiffness(
        part.h, part.omega, part.covariance, part.dof, f"band-{result.method}", np.ones((1, 2)), condition=condition
    )
    return replace(est, systematic=systematic), found
