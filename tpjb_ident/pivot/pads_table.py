"""One row per pad: law, range, contact, directions, loop (`pivot_pads.csv`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.conditions import sentences
from tpjb_ident.pivot.curve import PivotCurve

if TYPE_CHECKING:
    import pandas as pd


def pads_table(curves: Sequence[PivotCurve]) -> pd.DataFrame:
    """What a curve says beside its values.

    Parameters
    ----------
    curves : sequence of PivotCurve

    Returns
    -------
    DataFrame
        ``pad``, ``law`` and its posterior share, ``valid_from_N``, ``valid_to_N``, ``onset_N`` with ``_se`` (zero: the
        shaft was in contact from the start), angles of load and displacement off the pad [deg] with ``_se``,
        ``loop_energy_J`` and ``loss_factor`` with ``_se`` (empty without unloading), ``includes_housing``,
        ``relative_calibration``, ``status``.
    """
    import pandas as pd

    rows = []
    for curve in curves:
        loop = curve.hysteresis
        rows.append(
            {
                "pad": curve.pad,
                "law": curve.law.name,
                "law_share": float(sum(w for f, w in zip(curve.fits, curve.weights) if f.name == curve.law.name)),
                "valid_from_N": curve.valid_from,
                "valid_to_N": curve.valid_to,
                "onset_N": curve.onset_load,
                "onset_N_se": curve.onset_load_se,
                "load_off_pad_deg": math.degrees(curve.load_direction.angle),
                "load_off_pad_deg_se": math.degrees(curve.load_direction.se),
                "displacement_off_pad_deg": math.degrees(curve.displacement_direction.angle),
                "displacement_off_pad_deg_se": math.degrees(curve.displacement_direction.se),
                "loop_energy_J": math.nan if loop is None else loop.energy,
                "loop_energy_J_se": math.nan if loop is None else loop.energy_se,
                "loss_factor": math.nan if loop is None else loop.loss_factor,
                "loss_factor_se": math.nan if loop is None else loop.loss_factor_se,
                "includes_housing": curve.includes_housing,
                "relative_calibration": curve.relative_calibration,
                "runs": ", ".join(curve.runs),
                "status": "; ".join(sentences(curve.status)) or "ok",
            }
        )
    return pd.DataFrame(rows)
