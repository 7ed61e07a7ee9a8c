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
from tpjb_ident.results.frequency_model import MODEL_COLUMNS, FrequencyModel
from tpjb_ident.results.point_result import PointResult, quality_cell
from tpjb_ident.schema import STATIC_KEY

if TYPE_CHECKING:
    import pandas as pd

_KEY_COLUMNS = (*STATIC_KEY, "excitation")
_PARTS = [f"h{entry}_{part}_N_per_m" for part in ("real", "imag") for entry in ENTRIES]
_FIGURES = (
    "coherence_x",
    "coherence_y",
    "method",
    "dof",
    "n_records",
    "n_averages",
    "resolution_Hz",
    "condition_number",
    "quality",
)
_LINE_COLUMNS = (
    *_KEY_COLUMNS,
    "excitation_Hz",
    *(name + ending for name in _PARTS for ending in ("", "_lo", "_hi", "_se", "_se_systematic")),
    *_FIGURES,
)
_MODEL_COLUMNS = (*_KEY_COLUMNS, "model", "supported", "method", *MODEL_COLUMNS, "quality")


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
    return pd.DataFrame(rows, columns=_LINE_COLUMNS)


def _line_row(result: BandResult, line: BandLine, method: str, est: DynamicStiffness) -> list[Any]:
    figures = [*line.coherence, method, float(np.min(est.dof)), len(result.runs), line.n_rows]
    figures += [result.resolution, est.condition, quality_cell(result.quality)]
    return [*result.key().values(), line.frequency, *est.figures()[:, :5].ravel(), *figures]


def models_frame(results: Sequence[BandResult]) -> pd.DataFrame:
    """One row per operating point and model: ``frf_models.csv``."""
    import pandas as pd

    rows = []
    for result in results:
        common = {**result.key(), "supported": result.supported, "method": result.method}
        common["quality"] = quality_cell(result.quality)
        rows += [{**common, "model": model.model, **model.columns()} for model in result.models.values()]
    return pd.DataFrame(rows, columns=_MODEL_COLUMNS)
