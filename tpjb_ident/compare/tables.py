"""Tables of other programs: coefficients in the place of a campaign, predictions that stand beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from model.bearing import Bearing
from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.coefficient_table import (
    ERRORS,
    VALUES,
    TableSource,
    described,
    partners,
    points_of,
    read_coefficients,
    read_rows,
)
from tpjb_ident.compare.comparison import VARIANTS, CompareSettings, Comparison, possible_variants
from tpjb_ident.compare.predictions import ModelSettings, Progress, predict_points
from tpjb_ident.conditions import KINDS, Condition
from tpjb_ident.errors import BadInputError
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.identification import Identification
from tpjb_ident.results.point_result import PointResult
from tpjb_ident.rounding import listed

_METHOD = "table"


def compare_table(
    path: Path,
    bearing: Bearing | None,
    settings: CompareSettings | None = None,
    reading_error: float | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Predict the operating points of a table of coefficients with every pivot model but measured ones.

    Without a bearing nothing is predicted here: tables of other programs are put beside it.
    """
    settings = settings or CompareSettings()
    rows = read_coefficients(path, reading_error)
    points = points_of(rows)
    frames = {}
    remarks: list[str] = []
    if bearing is not None:
        names, remarks = possible_variants(settings.variants, (), bearing)
        for name in names:
            model = ModelSettings(name, settings.thermal, settings.effects)
            frames[name] = pd.DataFrame(predict_points(bearing, points, model, progress))
    results = tuple(map(_point, points, rows[VALUES].to_numpy(), rows[ERRORS].to_numpy(), rows["status"]))
    identification = Identification(path.stem, _METHOD, results, np.zeros((1, 8 * len(points))))
    source = TableSource(path.stem)
    return Comparison(source, bearing, settings, identification, (), None, None, frames, None, tuple(remarks))


def _point(point: OperatingPoint, values: FloatArray, errors: FloatArray, status: str) -> PointResult:
    """A row as if it had been identified; what it does not hold is NaN."""
    omega = point.excitation
    h, errors = values[:4].astype(complex).reshape(2, 2), errors * np.repeat([1.0, omega], 4)
    h.imag = omega * values[4:].reshape(2, 2)  # a sum would lose a stiffness that stands without its damping
    stiffness = DynamicStiffness(h, omega, np.diag(errors**2), np.full(8, np.inf), _METHOD, np.zeros((0, 2)))
    nowhere = np.full(2, np.nan)
    quality = tuple(Condition(name) for name in status.split("; ") if name in KINDS)
    return PointResult(
        point, stiffness, {_METHOD: stiffness}, point.static_load, nowhere, nowhere, {}, n_records=0,
        n_windows=0, outlier_fraction=0.0, coherence=np.nan, amplitude=np.nan, quality=quality, rejected=(), runs=(),
    )  # fmt: skip


#: What set points are rounded by in tables.
_ROUNDED = (0.01, 1.0, 0.005)
_TOLERANCES = "its load within 1 %, direction within 1 deg, speed and excitation within 0.5 %, the same rotation"
#: Points and lines that a remark lists.
_MOST = 6


def read_predictions(paths: Sequence[Path]) -> dict[str, pd.DataFrame]:
    """Read tables of predictions; each is called by its file's name, which its frame's attributes hold."""
    tables = {}
    for path in paths:
        name = path.stem if path.stem not in VARIANTS else path.name
        if name in tables:
            raise BadInputError(f"--prediction {path}: another table is called {name!r} too. Rename one of the files.")
        tables[name] = read_rows(path)
        tables[name].attrs["file"] = path.name
    return tables


def with_predictions(comparison: Comparison, tables: Mapping[str, pd.DataFrame]) -> Comparison:
    """Put tables beside the predictions of a comparison, and say which points and rows have no partner."""
    measured = comparison.identification.to_frame()
    points = described(measured)
    predictions, remarks = dict(comparison.predictions), list(comparison.remarks)
    for name, rows in tables.items():
        nearest = partners(measured, rows, _ROUNDED)
        unmet = rows[~rows.index.isin(nearest)]
        if len(unmet) == len(rows):
            raise BadInputError(
                f"--prediction {rows.attrs['file']}: no row meets an operating point ({_TOLERANCES}). Its first row is "
                f"{described(rows)[0]}; the first measured point is {points[0]}. Check units and signs of its columns."
            )
        met = rows.reindex(nearest).reset_index(drop=True)  # no row has the number -1
        predictions[name] = met.assign(
            converged=met["converged"].ne(False),
            pivot_extrapolated=False,
            status=met["status"].fillna("no row of the table"),
        )
        alone = described(measured[nearest < 0])
        lines = [f"line {line} ({point})" for line, point in zip(unmet["line"], described(unmet), strict=True)]
        head = f"{rows.attrs['file']} predicts {len(points) - len(alone)} of {len(points)} points"
        parts = [head]
        for words, places in (("without a row", alone), ("rows that meet no point", lines)):
            parts += [f"{words}: {listed(places, _MOST, '; ')}"] if places else []
        remarks.append("; ".join(parts) + ".")
    if tables:
        remarks.append(f"A row of a table meets a point where it has {_TOLERANCES}; nothing is interpolated.")
    return replace(comparison, predictions=predictions, remarks=tuple(remarks))
