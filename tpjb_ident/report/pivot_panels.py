"""Pivot stiffness over load beside the printed formula (the paper's Fig. 12), and the load steps behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tpjb_ident.report.figure import LIGHT, PAD_STYLE, Panel, add_legend, new_panel

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.pivot import PivotCurve

GROUP = "Pivots, from the dry tests"


def pivot_panels(curves: Sequence[PivotCurve], table: pd.DataFrame) -> list[Panel]:
    """Draw the tangent stiffness of every pad, and its load steps.

    Parameters
    ----------
    curves : sequence of PivotCurve
    table : DataFrame
        As pivot_curves.csv.
    """
    return [_stiffness(table), _steps(curves)] if curves else []


def _stiffness(table: pd.DataFrame) -> Panel:
    figure, axes = new_panel("load on the pad, kN", "tangent stiffness, MN/m")
    held = table[~table["extrapolated"]]
    for pad in sorted({int(number) for number in held["pad"].to_numpy()}):
        rows = held[held["pad"] == pad]
        colour, dashes, _ = PAD_STYLE[(pad - 1) % len(PAD_STYLE)]
        load = rows["force_N"] / 1e3
        axes.fill_between(
            load, rows["stiffness_N_per_m_lo"] / 1e6, rows["stiffness_N_per_m_hi"] / 1e6,
            color=LIGHT[colour], alpha=0.2, linewidth=0,
        )  # fmt: skip
        axes.plot(
            load, rows["stiffness_N_per_m"] / 1e6, color=LIGHT[colour], linestyle=dashes, linewidth=1.6,
            label=f"pad #{pad}",
        )  # fmt: skip
    if "formula_tangent_N_per_m" in table:
        printed = table[table["force_N"] <= held["force_N"].max()].drop_duplicates("force_N")
        for column, dashes, label in (("tangent", "-", "Kirk, tangent"), ("secant", (0, (5, 2)), "Kirk, as printed")):
            axes.plot(
                printed["force_N"] / 1e3, printed[f"formula_{column}_N_per_m"] / 1e6, color=LIGHT["grey"],
                linestyle=dashes, linewidth=1.4, label=label,
            )  # fmt: skip
    axes.set_ylim(bottom=0.0)
    add_legend(axes, columns=3)
    return Panel("pivot-stiffness", "Pivot tangent stiffness over load, 95 % bands", figure, GROUP)


def _steps(curves: Sequence[PivotCurve]) -> Panel:
    figure, axes = new_panel("deflection, µm", "load on the pad, kN")
    for curve in curves:
        colour, dashes, marker = PAD_STYLE[(curve.pad - 1) % len(PAD_STYLE)]
        used = curve.steps.weight > 0
        axes.plot(
            1e6 * curve.steps.deflection[used], curve.steps.load[used] / 1e3, linestyle="none", marker=marker,
            markersize=4, color=LIGHT[colour], label=f"pad #{curve.pad}",
        )  # fmt: skip
        load = np.linspace(0.0, curve.valid_to, 60)[1:]
        deflection = curve.deflection(load) + _onset_shift(curve)
        axes.plot(1e6 * deflection, load / 1e3, color=LIGHT[colour], linestyle=dashes, linewidth=1.1)
    add_legend(axes, columns=3)
    return Panel("pivot-steps", "Load steps and fitted laws, pivot and housing together", figure, GROUP)


def _onset_shift(curve: PivotCurve) -> float:
    """Where the law's own zero lies on the steps' scale [m]: their median difference in full contact."""
    used = (curve.steps.weight > 0) & (curve.steps.load >= max(curve.onset_load, curve.valid_from))
    if not used.any():
        return 0.0
    return float(np.median(curve.steps.deflection[used] - curve.deflection(curve.steps.load[used])))
