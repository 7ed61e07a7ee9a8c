"""Measured pivot curves as laws that the model takes: exactly what `predict --pivots pivots.toml` would read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.model_guard import check_model

check_model()

from model.pivots import PivotLaw, measured_pivots  # noqa: E402  (only once it is known to be ours)

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve


def measured_laws(curves: Sequence[PivotCurve], n_pads: int, source: str = "") -> tuple[PivotLaw, ...]:
    """Turn measured curves into pivot laws, pad #1 first.

    Parameters
    ----------
    curves : sequence of PivotCurve
        One per pad.
    n_pads : int
    source : str
        Id of the campaign.

    Raises
    ------
    model.bearing.BearingError
        A pad has no curve.
    """
    from tpjb_ident.pivot.pivots_toml import pad_table

    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    return measured_pivots([pad_table(curve) for curve in curves], source or "the dry tests", n_pads)
