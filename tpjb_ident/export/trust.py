"""What speaks against a row of coefficients: flags that forbid trust, signs that no film has, no convergence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tpjb_ident.condition_kinds import ERRORS
from tpjb_ident.schema import KINDS, coefficient_column


def doubts(row: Mapping[str, Any]) -> str:
    """Say why a row of coefficients is not to be trusted.

    A film's direct stiffness and damping are positive by the sign convention of CONTRIBUTING; a wrong polarity of a
    probe or cell turns the sign of one or of all of them.

    Parameters
    ----------
    row : mapping of str to value
        A row of coefficients.csv or prediction.csv.

    Returns
    -------
    str
        Empty if nothing forbids trust.
    """
    quality = row.get("quality")
    found = [name for name in quality.split("; ") if name in ERRORS] if isinstance(quality, str) else []
    if row.get("converged") is False or str(row.get("converged")) == "False":
        found.append("the model did not converge")
    for name in ("kxx", "kyy", "cxx", "cyy"):
        column = coefficient_column(name)
        value, high = float(row[column]), float(row.get(f"{column}_hi", math.nan))
        kind = KINDS[name[0]]
        if (high if math.isfinite(high) else value) < 0:
            size = f"{value / kind.display_scale:.4g} {kind.display_unit}"
            found.append(f"{name} is negative ({size}): check polarity and axes of probes and cells")
    return "; ".join(found)
