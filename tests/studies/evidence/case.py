"""One case, entry by entry: the gap on held-out points before and after, beside its controls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tests.studies.evidence.outcome import Row

if TYPE_CHECKING:
    import pandas as pd

#: Columns of residuals as they stand in a row.
RESIDUALS = ("model", "entry", "static_load_N", "excitation_Hz", "z")


def the_case(rows: Sequence[Row]) -> Row | None:
    """The last row that tells a case."""
    return next((row for row in reversed(rows) if row["kind"] == "case" and "gaps" in row), None)


def case_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Root mean square residual per observable by every model, in standard deviations for inference."""
    import pandas as pd

    case = the_case(rows)
    return pd.DataFrame([] if case is None else [{"observable": name, **by} for name, by in case["gaps"].items()])


def case_residuals(rows: Sequence[Row]) -> pd.DataFrame:
    """Residual of every coefficient before and after, as `plots.residual_map` takes it."""
    import pandas as pd

    case = the_case(rows)
    return pd.DataFrame([] if case is None else list(case["residuals"]), columns=list(RESIDUALS))
