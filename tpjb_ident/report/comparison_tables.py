"""Tables of the comparison's report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from tpjb_ident.arrays import FloatArray
from tpjb_ident.report.drawing.colours import VARIANT_LABEL
from tpjb_ident.report.page import Table
from tpjb_ident.rounding import fixed, percent, signed, with_interval
from tpjb_ident.schema import DAMPING, ENTRIES, KINDS, STIFFNESS, coefficient_column

if TYPE_CHECKING:
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.compare.pivot_formula import Formula
    from tpjb_ident.conditions import Condition
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.results.point_result import PointResult
    from tpjb_ident.pivot import PivotCurve

DIRECT = ("kxx", "kyy", "cxx", "cyy")
#: Loads at which pivot stiffness is tabled [N].
PIVOT_LOADS = (2000.0, 4000.0)


def point_label(p: PointResult) -> str:
    """Load and excitation of a point, in words."""
    return f"{p.point.static_load / 1e3:g} kN, {p.point.excitation_hz:g} Hz"


def measured_table(result: Identification) -> Table:
    """K and C of every point with intervals."""
    rows = []
    for p in result.points:
        lo, hi = p.stiffness.interval()
        omega = p.stiffness.omega
        cells = [with_interval(p.stiffness.vector[i], lo[i], hi[i], 1e6) for i in range(4)]
        cells += [with_interval(p.stiffness.vector[i] / omega, lo[i] / omega, hi[i] / omega, 1e3) for i in range(4, 8)]
        share = f"{100 * p.outlier_fraction:.0f} %"
        flags = ", ".join(str(c) for c in p.quality) or "ok"
        rows.append([point_label(p), *cells, str(p.n_windows), share, flags])
    named = [f"{kind.symbol}{e}, {kind.display_unit}" for kind in (STIFFNESS, DAMPING) for e in ENTRIES]
    columns = ["point", *named, "windows", "outliers", "flags"]
    return Table(f"Measured ({result.method})", columns, rows, frozenset({0, len(columns) - 1}))


def predicted_table(frame: pd.DataFrame) -> Table:
    """Direct coefficients predicted with every pivot model, and how far off each is."""
    rows = []
    ordered = frame.sort_values(["static_load_N", "excitation_Hz"], kind="stable")
    for _, row in ordered.iterrows():
        cells = []
        for name in DIRECT:
            column = coefficient_column(name)
            cells.append(fixed(row[f"{column}_predicted"] / KINDS[name[0]].display_scale))
            cells.append(percent(row[f"{column}_ratio"] - 1.0))
        remark = "beyond the measured pivot load" if row["pivot_extrapolated"] else row["status"]
        label = f"{row['static_load_N'] / 1e3:g} kN, {row['excitation_Hz']:g} Hz"
        rows.append([label, VARIANT_LABEL[row["pivots"]], *cells, remark or ""])
    columns = ["point", "pivots"]
    for name in DIRECT:
        columns += [f"{name}, {KINDS[name[0]].display_unit}", "off by"]
    columns.append("remark")
    return Table("Predicted", columns, rows, frozenset({0, 1, len(columns) - 1}))


def flag_table(comparison: Comparison) -> Table:
    """Every flag of points, pivot curves, polygon and locus, in plain words; what says the same stands in one row."""
    identified = comparison.identification
    parts: list[tuple[str, Sequence[Condition]]] = [(point_label(p), p.quality) for p in identified.points]
    parts.append(("campaign", identified.conditions))
    parts += [(f"pivot of pad #{c.pad}", c.status) for c in comparison.curves]
    if comparison.clearance is not None:
        parts.append(("clearance", comparison.clearance.status))
    if comparison.locus is not None:
        parts.append(("locus", comparison.locus.status))
    rows = [[where, str(c), c.detail, c.meaning] for where, status in parts for c in status]
    return Table("Flags", ["flag", "what it means", "where", "found"], _gathered(rows), frozenset(range(4)))


def _gathered(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """One row per flag and meaning, with every place; what was found where it differs from place to place."""
    kept: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for where, name, found, means in rows:
        kept.setdefault((name, means), []).append((where, found))
    out = []
    for (name, means), places in kept.items():
        details = list(dict.fromkeys(found for _, found in places if found))
        out.append([name, means, "; ".join(where for where, _ in places), "; ".join(details)])
    return out


def pivot_points_table(curves: Sequence[PivotCurve], formula: Formula | None) -> Table:
    """Tangent stiffness of every pad at two loads beside the printed formula's."""
    columns = ["pad", "law"]
    for load in PIVOT_LOADS:
        columns += [f"at {load / 1e3:g} kN, MN/m", "of Kirk's tangent"]
    rows = []
    for curve in curves:
        cells = []
        for load in PIVOT_LOADS:
            value = float(curve.stiffness(load))
            low, high = (float(v) for v in curve.stiffness_band(load))
            beyond = " (extrapolated)" if bool(curve.is_extrapolated(load)) else ""
            cells.append(with_interval(value, low, high, 1e6) + beyond)
            cells.append(f"{100 * value / formula(curve.pad, load)[1]:.0f} %" if formula else "–")
        rows.append([f"#{curve.pad}", curve.law.name, *cells])
    return Table("Measured tangent stiffness, 95 %", columns, rows, frozenset({0, 1}))


def clearance_table(polygon: ClearancePolygon, drawn: FloatArray) -> Table:
    """Clearance per pad beside the drawing's, in µm."""
    rows = []
    for k, drawing in enumerate(drawn):
        value, half = polygon.clearance[k], 1.96 * polygon.clearance_se[k]
        rows.append([
            f"#{k + 1}", fixed(1e6 * drawing), with_interval(value, value - half, value + half, 1e-6),
            signed(1e6 * (value - drawing)),
            fixed(1e6 * polygon.clearance_pushed[k], 2),
        ])  # fmt: skip
    columns = ["pad", "drawing, µm", "measured, µm", "difference, µm", f"under {polygon.push_load:.0f} N, µm"]
    return Table("Assembled clearance, cold, 95 %", columns, rows)
