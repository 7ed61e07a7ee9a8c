"""What a band's runs say: h over frequency with intervals, the models over it, and how both become tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.dynamic.broadband.band_models import BandModel, BandPart
from tpjb_ident.dynamic.broadband.band_point import BandPoint
from tpjb_ident.dynamic.corrections.static_load import LoadMiss
from tpjb_ident.dynamic.estimators.stiffness import ENTRIES, DynamicStiffness
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, change_conditions
from tpjb_ident.dynamic.results.point_result import PointResult
from tpjb_ident.dynamic.results.quality import feeds_motion
from tpjb_ident.dynamic.runs.point_data import pad_means
from tpjb_ident.schema import KINDS, STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

_KEY_COLUMNS = (*STATIC_KEY, "excitation")


@dataclass(frozen=True)
class BandLine:
    """One line of the band."""

    frequency: float
    by_method: dict[str, DynamicStiffness] = field(repr=False)
    method: str
    coherence: FloatArray  #: (2,): of the force along X and Y with the displacements
    n_rows: int

    @property
    def stiffness(self) -> DynamicStiffness:
        """By the method that counts."""
        return self.by_method[self.method]


@dataclass(frozen=True)
class BandResult:
    """Dynamic stiffness over a band at one operating point."""

    point: OperatingPoint
    kind: str
    lines: tuple[BandLine, ...] = field(repr=False)
    models: dict[str, BandModel] = field(repr=False)
    supported: str
    quality: tuple[Condition, ...]
    runs: tuple[str, ...]
    period: float | None
    resolution: float
    points: tuple[PointResult, ...] = field(default=(), repr=False)

    @property
    def frequencies(self) -> FloatArray:
        """Of the lines, (n,) [Hz]."""
        return np.array([line.frequency for line in self.lines])

    @property
    def h(self) -> ComplexArray:
        """Dynamic stiffness over the lines, (n, 2, 2) [N/m]."""
        return np.array([line.stiffness.h for line in self.lines]).reshape(-1, 2, 2)

    @property
    def method(self) -> str:
        """The method that counts."""
        return self.lines[0].method if self.lines else "none"

    def half_width(self, level: float = 0.95) -> FloatArray:
        """Half the interval of Re and Im of the four entries, (n, 8) [N/m]."""
        return np.array([line.stiffness.half_width(level) for line in self.lines]).reshape(-1, 8)

    def key(self) -> dict[str, Any]:
        """Columns that name the result."""
        return dict(zip(_KEY_COLUMNS, (*self.point.static_key, self.kind)))


def frf_frame(results: Sequence[BandResult], every_method: bool = False) -> pd.DataFrame:
    """One row per line, by the method that counts (``frf.csv``) or by every method (``frf_estimators.csv``)."""
    import pandas as pd

    rows = []
    for result in results:
        for line in result.lines:
            chosen = line.by_method if every_method else {line.method: line.stiffness}
            rows += [_line_row(result, line, name, est) for name, est in chosen.items()]
    return pd.DataFrame(rows)


def _line_row(result: BandResult, line: BandLine, method: str, est: DynamicStiffness) -> dict[str, Any]:
    row: dict[str, Any] = {**result.key(), "excitation_Hz": line.frequency}
    half, se = est.half_width(), est.standard_error
    shared = np.zeros(8) if est.systematic is None else np.sqrt(np.diag(est.systematic))
    for part, offset in (("real", 0), ("imag", 4)):
        for j, entry in enumerate(ENTRIES):
            name, i = f"h{entry}_{part}_N_per_m", offset + j
            value = est.vector[i]
            row |= {name: value, f"{name}_lo": value - half[i], f"{name}_hi": value + half[i]}
            row |= {f"{name}_se": se[i], f"{name}_se_systematic": shared[i]}
    row.update(
        coherence_x=line.coherence[0],
        coherence_y=line.coherence[1],
        method=method,
        dof=float(np.min(est.dof)),
        n_records=len(result.runs),
        n_averages=line.n_rows,
        resolution_Hz=result.resolution,
        condition_number=est.condition,
        quality="; ".join(str(c) for c in result.quality) or "ok",
    )
    return row


def models_frame(results: Sequence[BandResult]) -> pd.DataFrame:
    """One row per operating point and model: ``frf_models.csv``."""
    import pandas as pd

    return pd.DataFrame([_model_row(result, model) for result in results for model in result.models.values()])


def _model_row(result: BandResult, model: BandModel) -> dict[str, Any]:
    row: dict[str, Any] = {
        **result.key(),
        "model": model.model,
        "supported": result.supported,
        "method": result.method,
        "n_frequencies": model.n_lines,
        "excitation_lowest_Hz": model.band[0],
        "excitation_highest_Hz": model.band[1],
        "chi_square": model.chi_square,
        "dof": model.spare,
        "probability": model.probability,
        "largest_misfit": model.misfit,
    }
    names = [column for kind in KINDS.values() for column in kind.columns]
    half, se = model.half_width(), model.standard_error
    for i, name in enumerate(names):
        fitted = i < len(model.parameters)
        value = model.parameters[i] if fitted else 0.0
        row |= {
            name: value,
            f"{name}_lo": value - half[i] if fitted else 0.0,
            f"{name}_hi": value + half[i] if fitted else 0.0,
            f"{name}_se": se[i] if fitted else 0.0,
            f"{name}_dof": model.dof[i] if fitted else np.inf,
        }
    row["quality"] = "; ".join(str(c) for c in result.quality) or "ok"
    return row


def band_points(
    point: BandPoint, result: BandResult, miss: LoadMiss, clearance: float | None
) -> tuple[tuple[PointResult, ...], FloatArray]:
    """Points of one band, and what the draws of systematic errors do to them, (n, 8 P) [N/m].

    The lines of a part alone tell its h; K-C-M only says how h changes within the part. So the points of a band are as
    independent of one another as runs with sines, whether or not a model over the whole band holds.
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
    table = {"random": part.covariance, "shared by all lines": np.cov(part.moved.T, bias=True)}
    rig = point.baseline.at(part.omega)
    if rig is not None:
        table["baseline"] = rig[1]
    if part.bracket.any():
        # a rectangle's standard deviation is half its width by the root of three
        table["no instrument"] = np.diag(part.bracket**2) / 3
    systematic = np.sum([v for name, v in table.items() if name != "random"], axis=0)
    condition = float(np.median([line.stiffness.condition for line in result.lines])) if result.lines else np.nan
    est = DynamicStiffness(
        part.h, part.omega, part.covariance, part.dof, f"band-{result.method}", np.ones((1, 2)), condition=condition
    )
    return replace(est, systematic=systematic), table
