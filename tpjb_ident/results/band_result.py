"""What a band's runs say: h over frequency with intervals, the models over it, and how both become tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.conditions import Condition
from tpjb_ident.estimators.stiffness import ENTRIES, DynamicStiffness
from tpjb_ident.results.frequency_model import FrequencyModel
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.schema import STATIC_KEY

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
    models: dict[str, FrequencyModel] = field(repr=False)
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


def _model_row(result: BandResult, model: FrequencyModel) -> dict[str, Any]:
    row = {**result.key(), "model": model.model, "supported": result.supported, "method": result.method}
    quality = "; ".join(str(c) for c in result.quality) or "ok"
    return {**row, **model.columns(), "quality": quality}
