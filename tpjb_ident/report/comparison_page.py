"""The report of a comparison: answer, figures, tables, flags, and how it was made."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rigdata.arrays import FloatArray
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.columns import amount, size, symbol
from tpjb_ident.compare.comparison import Comparison
from tpjb_ident.compare.predictions import printed_formula
from tpjb_ident.compare.summary import agreements, closest, farthest, number_inside, summary_sentences
from tpjb_ident.conditions import Condition
from tpjb_ident.pivot.curve import PivotCurve
from tpjb_ident.pivot.tables import Formula
from tpjb_ident.report.drawing.picture import DIRECT, MODEL_LABELS, point_labels, points_table
from tpjb_ident.report.page import Page, Section, Table, table_of, write_page
from tpjb_ident.report.sections import (
    budget_table,
    coefficient_cells,
    coefficient_sections,
    evidence_section,
    flags_line,
    pivot_panels,
    position_panels,
    set_up_section,
    tested_facts,
    values_table,
)
from tpjb_ident.results.identification import Identification
from tpjb_ident.rounding import deviation, fixed, signed, with_interval
from tpjb_ident.schema import DAMPING, KINDS, STIFFNESS, coefficient_column


def write_report(
    folder: Path,
    comparison: Comparison,
    settings: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None,
    then: str = "",
    note: str = "",
) -> Path:
    """Write report.html and its figures.

    Parameters
    ----------
    folder : Path
        Existing folder.
    comparison : Comparison
    settings : mapping, optional
        How it was made, for the reader; default: the comparison's own settings.
    inputs : mapping of str to str, optional
        SHA-256 of the inputs; default: of the campaign's files.
    then : str
        The command that comes next.
    note : str
        What a reader has to know before all else, such as that the records are computed.

    Returns
    -------
    Path
        report.html; the figures lie beside it in ``figures`` as SVG and PNG.

    Examples
    --------
    >>> from pathlib import Path
    >>> settings = ti.CompareSettings(variants=("kirk",), thermal="isothermal")
    >>> page = ti.write_report(Path("."), ti.compare_campaign(demo, rocker, settings))
    >>> page.name
    'report.html'
    """
    frame = comparison.table
    points, flagged = comparison.identification.points, _flagged(comparison)
    campaign, best = comparison.campaign, closest(agreements(frame))
    page = Page(
        title=f"{campaign.id}: predicted and measured dynamic coefficients",
        subtitle=campaign.description,
        sentences=summary_sentences(comparison),
        facts=tested_facts(campaign, comparison.bearing, points) | ({"Note": note} if note else {}),
        key_table=deviations_table(frame),
        values=values_table(points),
        flags=flags_line([[flag for _, flag in flagged]], len(points)),
        lead="kyy" if best is None else farthest(best),
        then=then,
        sections=_sections(comparison, frame, flagged),
        settings=settings or {"campaign": campaign.id, **vars(comparison.settings)},
        inputs=campaign.fingerprint() if inputs is None else inputs,
    )
    return write_page(folder, page)


def deviations_table(table: pd.DataFrame) -> Table:
    """How far predictions of a table of comparison.csv are off, by pivot model."""
    rows = []
    for name, agreement in agreements(table).iterrows():
        medians = agreement["median"].items()
        cells = [f"{deviation(median)} ({deviation(agreement['worst', k])})" for k, median in medians]
        rows.append([MODEL_LABELS.get(str(name), str(name)), *cells, number_inside(agreement)])
    return Table(
        "Predicted / measured - 1: median (largest); inside: predictions within the measured 95 % interval",
        ["", *DIRECT, "inside"],
        rows,
    )


def _sections(comparison: Comparison, frame: pd.DataFrame, flagged: Sequence[tuple[str, Condition]]) -> list[Section]:
    campaign: Any = comparison.campaign
    evidence = []
    tables = [measured_table(comparison.identification)]
    if comparison.has_records:
        evidence.append(evidence_section(campaign, comparison.identification))
        tables.append(budget_table(comparison.identification))
    note = (
        "Intervals are 95 %, random and calibration errors together. Outliers is the share of record windows "
        "that got no weight."
    )
    bearing, polygon, predicted = comparison.bearing, comparison.clearance, {}
    angles, drawn = np.zeros((2, 0)) if bearing is None else np.array([bearing.pivot_angles, bearing.clearances])
    if comparison.loci is not None:
        for name, rows in comparison.loci.groupby("pivots", sort=False):
            predicted[str(name)] = rows[["x_m_predicted", "y_m_predicted"]].to_numpy()
    clearances = [] if polygon is None else [clearance_table(polygon, drawn)]
    places = position_panels(polygon, (angles, drawn), comparison.locus, predicted)
    return [
        *coefficient_sections(frame),
        _pivot_section(comparison),
        Section("Clearance and shaft centre locus", panels=places, tables=clearances),
        *evidence,
        Section("Operating points", [note], tables=[*tables, _predicted_table(frame)]),
        Section("Quality flags", tables=[_flag_table(flagged)]),
        set_up_section(comparison),
    ]


def _pivot_section(comparison: Comparison) -> Section:
    heading = "Pivots, from the dry tests"
    if not comparison.curves:
        return Section(heading)
    formula = printed_formula(comparison.bearing)
    note = (
        "The dry test sees pivot, pad back and housing seat together. Its tangent stiffness is what small vibrations "
        "feel; the formula as printed is a secant, about 10 % below its own tangent for line contact, a third below it "
        "for a sphere."
    )
    table = pivot_stiffness_table(comparison.curves, formula)
    return Section(heading, [note], pivot_panels(comparison.curves, formula), [table])


def measured_table(result: Identification) -> Table:
    """K and C of every point with intervals."""
    frame = result.to_frame()
    cells: dict[str, Iterable[str]] = {
        "point": point_labels(frame),
        **coefficient_cells(frame, (STIFFNESS, DAMPING)),
        "windows": frame["n_windows"].map(str),
        "outliers": (100.0 * frame["outlier_fraction"]).map("{:.0f} %".format),
        "flags": frame["quality"].str.replace("; ", ", "),
    }
    return table_of(f"Measured ({result.method})", cells)


def _predicted_table(frame: pd.DataFrame) -> Table:
    """Direct coefficients predicted with every pivot model, and how far off each is."""
    ordered = frame.sort_values(["static_load_N", "excitation_Hz"], kind="stable")
    cells: dict[str, Iterable[str]] = {"point": point_labels(ordered), "pivots": ordered["pivots"]}
    for name in DIRECT:
        kind, column = KINDS[name[0]], coefficient_column(name)
        cells[f"{name}, {kind.display_unit}"] = (ordered[f"{column}_predicted"] / kind.display_scale).map(fixed)
        cells[f"{name} off by"] = (ordered[f"{column}_ratio"] - 1.0).map(deviation)
    extrapolated = ordered["pivot_extrapolated"].astype(bool)
    cells["remark"] = ordered["status"].mask(extrapolated, "beyond the measured pivot load")
    return table_of("Predicted", cells)


def _flag_table(flagged: Sequence[tuple[str, Condition]]) -> Table:
    """Flags in plain words; what says the same stands in one row."""
    columns = ["flag", "what it means", "where", "found"]
    places = defaultdict(list)
    for place, flag in flagged:
        places[flag].append((place, flag.detail))
    rows = []
    for flag, occurrences in places.items():
        points, details = zip(*occurrences, strict=True)
        rows.append([flag, flag.meaning, "; ".join(points), "; ".join(filter(None, dict.fromkeys(details)))])
    return Table("Flags", columns, rows)


def _flagged(comparison: Comparison) -> list[tuple[str, Condition]]:
    """Every flag of points, pivot curves, polygon and locus, and where it stands."""
    identified = comparison.identification
    labels = point_labels(points_table(identified.points))
    parts = [(place, p.quality) for place, p in zip(labels, identified.points, strict=True)]
    parts.append(("campaign", identified.conditions))
    parts += [(f"pivot of pad #{c.pad}", c.status) for c in comparison.curves]
    tests = {"clearance": comparison.clearance, "locus": comparison.locus}
    parts += [(name, test.status) for name, test in tests.items() if test is not None]
    flagged = []
    for place, conditions in parts:
        flagged += [(place, condition) for condition in conditions]
    return flagged


def pivot_stiffness_table(curves: Sequence[PivotCurve], formula: Formula | None) -> Table:
    """Tangent stiffness at the load that all pads were tested at, and half of it, beside the printed formula's."""
    columns = ["pad", "law"]
    rows = [[f"#{curve.pad}", curve.law.name] for curve in curves]
    full = min((curve.valid_to for curve in curves), default=0.0)
    for load in (0.5 * full, full):
        columns.append(f"at {amount(load, 'load', '.4g')}, {symbol('stiffness')}")
        columns += [] if formula is None else ["of Kirk's tangent"]
        for curve, row in zip(curves, rows, strict=True):
            value = float(curve.stiffness(load))
            low, high = (float(end) for end in curve.stiffness_band(load))
            remark = " (extrapolated)" if curve.is_extrapolated(load) else ""
            row.append(with_interval(value, low, high, size("stiffness")) + remark)
            if formula is not None:
                row.append(f"{100 * value / formula(curve.pad, load)[1]:.0f} %")
    return Table("Measured tangent stiffness, 95 %", columns, rows)


def clearance_table(polygon: ClearancePolygon, drawn: FloatArray) -> Table:
    """Clearance per pad at zero push load beside the drawing's; intervals hold the error of the probes' gains."""
    unit = size("length")
    digits = 2 if unit < 1e-5 else 4
    halves = 1.96 * polygon.clearance_error
    rows = []
    for k, (drawing, value, half) in enumerate(zip(drawn, polygon.clearance, halves, strict=True)):
        measured = with_interval(value, value - half, value + half, unit)
        difference = signed((value - drawing) / unit, digits)
        pushed = fixed(polygon.clearance_pushed[k] / unit, digits)
        rows.append([f"#{k + 1}", f"{drawing / unit:.4g}", measured, difference, pushed])
    name = symbol("length")
    under = f"under {amount(polygon.push_load, 'force', '.3g')}, {name}"
    columns = ["pad", f"drawing, {name}", f"measured, {name}", f"difference, {name}", under]
    return Table("Assembled clearance, cold, 95 %", columns, rows)
