"""Pivot curves in files: `pivot_curves.csv` with the printed formula, and `pivots.toml`, which `tpjb predict` reads.

In `pivots.toml` each pad is a dense table of load, deflection and tangent stiffness made from its law. The table is
denser than any reader's interpolation can spoil; no parameters are written, so a reader needs to know no law.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigdata.arrays import FloatArray
from rigdata.problem import toml_value
from tpjb_ident.conditions import sentences
from tpjb_ident.errors import ArgumentError
from tpjb_ident.pivot.curve import Hysteresis, PivotCurve
from tpjb_ident.runtime.tables import write_text
from tpjb_ident.schema import SECANT, TANGENT

if TYPE_CHECKING:
    import pandas as pd

#: (pad, load [N]) -> (secant, tangent) stiffness [N/m].
Formula = Callable[[int, float], tuple[float, float]]
_ROWS, _BEYOND = 20, 1.6  # rows up to the largest measured load, and how far beyond it they go


def load_grid(curves: Sequence[PivotCurve]) -> FloatArray:
    """Round loads [N] to beyond the largest measured one (n,)."""
    largest = max(curve.valid_to for curve in curves)
    raw = largest / _ROWS
    decade = 10.0 ** np.floor(np.log10(raw))
    step = decade * next(m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * decade >= 0.99 * raw)
    return step * np.arange(1, int(_BEYOND * largest / step + 1e-9) + 1)


def pivot_table(
    curves: Sequence[PivotCurve], loads: FloatArray | None = None, formula: Formula | None = None
) -> pd.DataFrame:
    """Curves at given loads.

    Parameters
    ----------
    curves : sequence of PivotCurve
        One per pad.
    loads : (n,) ndarray, optional
        Pad loads [N]; default `load_grid`.
    formula : callable, optional
        ``formula(pad, load)`` gives the printed formula's (secant, tangent) stiffness [N/m]; adds the
        ``formula_*`` columns (paper: measured pivots are 2-3 times softer).

    Returns
    -------
    DataFrame
        ``pad``, ``force_N``, ``deflection_m``, ``stiffness_N_per_m`` (tangent) with ``_lo``, ``_hi`` (95 %),
        ``secant_N_per_m`` likewise, ``law``, ``extrapolated`` (outside the measured loads) and
        ``contact_complete``.

    Examples
    --------
    >>> pads = ti.load_bearing(rocker).pads
    >>> curves = ti.fit_pivots(ti.load_campaign(demo), [pad.pivot_angle for pad in pads])
    >>> list(ti.pivot_table(curves, np.array([1000.0, 2000.0])).columns[:4])
    ['pad', 'force_N', 'deflection_m', 'stiffness_N_per_m']
    """
    import pandas as pd

    if not curves:
        raise ArgumentError("curves must hold at least one PivotCurve")
    grid = load_grid(curves) if loads is None else np.asarray(loads, dtype=float)
    if not np.all(grid > 0.0):
        raise ArgumentError("loads must be positive: at zero load there is no stiffness to speak of")
    frames = []
    for curve in curves:
        columns = {"pad": curve.pad, "force_N": grid, "deflection_m": curve.deflection(grid)}
        for name, value, band in (
            (TANGENT, curve.stiffness, curve.stiffness_band),
            (SECANT, curve.secant, curve.secant_band),
        ):
            lo, hi = band(grid)
            columns |= {name: value(grid), f"{name}_lo": lo, f"{name}_hi": hi}
        extrapolated, complete = curve.is_extrapolated(grid), grid >= curve.onset_load
        columns |= {"law": curve.law.name, "extrapolated": extrapolated, "contact_complete": complete}
        if formula is not None:
            printed = np.array([formula(curve.pad, float(load)) for load in grid])
            columns |= {f"formula_{SECANT}": printed[:, 0], "formula_tangent_N_per_m": printed[:, 1]}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def pads_table(curves: Sequence[PivotCurve]) -> pd.DataFrame:
    """One row per pad: law, limits, directions, loop, status."""
    import pandas as pd

    rows = []
    no_loop = Hysteresis(math.nan, math.nan, math.nan, math.nan, (math.nan, math.nan))
    for curve in curves:
        loop = curve.hysteresis or no_loop
        rows.append(
            {
                "pad": curve.pad,
                "law": curve.law.name,
                "valid_from_N": curve.valid_from,
                "valid_to_N": curve.valid_to,
                "onset_N": curve.onset_load,
                "onset_N_se": curve.onset_load_se,
                "load_off_pad_deg": math.degrees(curve.load_direction.angle),
                "load_off_pad_deg_se": math.degrees(curve.load_direction.se),
                "displacement_off_pad_deg": math.degrees(curve.displacement_direction.angle),
                "displacement_off_pad_deg_se": math.degrees(curve.displacement_direction.se),
                "loop_energy_J": loop.energy,
                "loop_energy_J_se": loop.energy_se,
                "loss_factor": loop.loss_factor,
                "loss_factor_se": loop.loss_factor_se,
                "includes_housing": curve.includes_housing,
                "relative_calibration": curve.relative_calibration,
                "runs": ", ".join(curve.runs),
                "status": "; ".join(sentences(curve.status)) or "ok",
            }
        )
    return pd.DataFrame(rows)


_SCHEMA = "tpjb-pivots/1"
#: Loads of the table as shares of the largest measured one: the first, and the last in 160 and in all steps. Pads of a
#: loaded bearing press their pivots harder than a dry test does; beyond the table a pivot has the last stiffness.
_SMALLEST, _EXTRAPOLATE_TO, _STEPS, _ALL_STEPS = 5e-4, 2.5, 160, 190


def table_loads(curve: PivotCurve) -> FloatArray:
    """Loads of the table [N]: zero, then geometric steps (n,)."""
    growth = (_EXTRAPOLATE_TO / _SMALLEST) ** (np.arange(_ALL_STEPS) / (_STEPS - 1))
    return np.r_[0.0, _SMALLEST * curve.valid_to * growth]


def pivots_text(curves: Sequence[PivotCurve], source: str) -> str:
    """Text of `pivots.toml`."""
    if not curves:
        raise ArgumentError("curves must hold at least one PivotCurve")
    lines = [
        "# Measured pivot laws: pivot and housing together, as the probes on the housing see them.",
        f'schema = "{_SCHEMA}"',
        f"source = {toml_value(source)}",
        "includes_housing = true",
    ]
    for curve in sorted(curves, key=lambda c: c.pad):
        lines += ["", "[[pads]]", *(f"{name} = {toml_value(value)}" for name, value in pad_table(curve).items())]
    return "\n".join(lines) + "\n"


def write_pivots(path: str | Path, curves: Sequence[PivotCurve], source: str) -> Path:
    """Write `pivots.toml`, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Destination.
    curves : sequence of PivotCurve
        One per pad.
    source : str
        Id of the campaign.

    Returns
    -------
    Path
        The destination.

    Examples
    --------
    >>> pads = ti.load_bearing(rocker).pads
    >>> curves = ti.fit_pivots(ti.load_campaign(demo), [pad.pivot_angle for pad in pads])
    >>> laws = ti.load_pivots(ti.write_pivots("pivots.toml", curves, "demo"))
    >>> len(laws)
    5
    """
    target = Path(path)
    write_text(target, pivots_text(curves, source))
    return target


def pad_table(curve: PivotCurve) -> dict[str, Any]:
    """Numbers of one pad as they are in the file, rounded.

    What is made of them is what a reader of the file makes.
    """
    loads = table_loads(curve)
    positive = loads[1:]
    stiffness = curve.stiffness(positive)
    return {
        "pad": curve.pad,
        "law": curve.law.name,
        "valid_from_N": float(f"{curve.valid_from:.6g}"),
        "valid_to_N": float(f"{curve.valid_to:.6g}"),
        "relative_calibration": float(f"{curve.relative_calibration:.4g}"),
        "force_N": _rounded(loads, 9),
        "deflection_m": _rounded(np.r_[0.0, curve.deflection(positive)], 9),
        # at zero load Hertz's laws have no stiffness at all: the first value belongs to the first positive load
        TANGENT: _rounded(np.r_[stiffness[0], stiffness], 7),
        "stiffness_relative_se": _rounded(np.r_[0.0, curve.relative_stiffness_se(positive)], 3),
    }


def _rounded(values: FloatArray, digits: int) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]
