"""The report of a comparison: answer, figures, tables, flags, and how it was made."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.compare.pivot_formula import printed_formula
from tpjb_ident.compare.positions import predicted_locus
from tpjb_ident.compare.summary import Deviation, deviations, summary_sentences
from tpjb_ident.compare.tables import comparison_frame
from tpjb_ident.report.comparison_tables import (
    clearance_table,
    flag_table,
    measured_table,
    pivot_points_table,
    predicted_table,
)
from tpjb_ident.report.drawing.colours import VARIANT_LABEL
from tpjb_ident.report.laboratory_sections import budget_table, evidence_section, set_up_section
from tpjb_ident.report.page import Page, Section, Table, grouped, write_page
from tpjb_ident.report.panels import coefficient_panels, pivot_panels, position_panels
from tpjb_ident.rounding import percent

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import Comparison


def write_report(
    folder: Path,
    comparison: Comparison,
    settings: Mapping[str, Any] | None = None,
    inputs: Mapping[str, str] | None = None,
    then: str = "",
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

    Returns
    -------
    Path
        report.html; the figures lie beside it in ``figures`` as SVG and PNG.
    """
    frame = comparison_frame(comparison)
    answer, *more = summary_sentences(comparison, frame)
    campaign, bearing = comparison.campaign, comparison.bearing
    own = {} if isinstance(campaign, TableSource) else campaign.fingerprint()
    described = f": {campaign.description}" if campaign.description else ""
    page = Page(
        title=f"{campaign.id}: predicted and measured dynamic coefficients",
        subtitle=f"{bearing.name}{described}",
        answer=answer,
        more=more,
        then=then,
        key_table=_key_table(deviations(comparison, frame)),
        sections=_sections(comparison, frame),
        settings={name: _setting(value) for name, value in (settings or _own_settings(comparison)).items()},
        inputs=dict(own if inputs is None else inputs),
    )
    return write_page(folder, page)


def _setting(value: Any) -> str:
    if value is None:
        return "none"
    return ", ".join(str(v) for v in value) if isinstance(value, (list, tuple)) else str(value)


def _own_settings(comparison: Comparison) -> dict[str, str]:
    chosen = comparison.settings
    return {
        "campaign": comparison.campaign.id,
        "pivot models": ", ".join(v.name for v in comparison.variants),
        "thermal": chosen.thermal,
        "effects": ", ".join(str(e) for e in chosen.effects) or "none",
        "estimator": comparison.identification.method,
    }


def _key_table(found: tuple[Deviation, ...]) -> Table:
    names = ("kxx", "kyy", "cxx", "cyy")
    rows = []
    for variant in dict.fromkeys(d.pivots for d in found):
        own = {d.coefficient: d for d in found if d.pivots == variant}
        cells = [f"{percent(own[n].median)} ({percent(own[n].worst)})" for n in names]
        inside, n = sum(own[name].inside for name in names), sum(own[name].n for name in names)
        rows.append([VARIANT_LABEL[variant], *cells, f"{inside} of {n}"])
    return Table(
        "Predicted against measured: median deviation (largest single one)",
        ["", *names, "inside the 95 % interval"],
        rows,
    )


def _sections(comparison: Comparison, frame: pd.DataFrame) -> list[Section]:
    sections = [*grouped(coefficient_panels(frame)), *_pivot_sections(comparison), *_position_sections(comparison)]
    campaign = comparison.campaign
    table = isinstance(campaign, TableSource)
    evidence = None if isinstance(campaign, TableSource) else evidence_section(campaign, comparison.identification)
    sections += [] if evidence is None else [evidence]
    sections.append(
        Section(
            "Operating points",
            notes=[
                "Intervals are 95 %, random and calibration errors together. Outliers is the share of record windows "
                "that got no weight."
            ],
            tables=[
                measured_table(comparison.identification),
                *([] if table else [budget_table(comparison.identification)]),
                predicted_table(frame),
            ],
        )
    )
    flags = flag_table(comparison)
    text = [] if flags.rows else ["No flags: nothing about the records calls for caution."]
    sections.append(Section("Quality flags", notes=text, tables=[flags] if flags.rows else []))
    sections.append(set_up_section(comparison))
    return sections


def _pivot_sections(comparison: Comparison) -> list[Section]:
    if not comparison.curves:
        return []
    formula = printed_formula(comparison.bearing)
    note = (
        "The dry test sees pivot, pad back and housing seat together. Its tangent stiffness is what small vibrations "
        "feel; the formula as printed is a secant, about 10 % below its own tangent for line contact, a third below it "
        "for a sphere."
    )
    return [
        Section(
            "Pivots, from the dry tests",
            notes=[note],
            panels=pivot_panels(comparison.curves, formula),
            tables=[pivot_points_table(comparison.curves, formula)],
        )
    ]


def _position_sections(comparison: Comparison) -> list[Section]:
    drawn = (
        np.array([pad.pivot_angle for pad in comparison.bearing.pads]),
        np.array([pad.assembled_clearance for pad in comparison.bearing.pads]),
    )
    predicted = {v.name: predicted_locus(comparison, v) for v in comparison.variants if len(v.locus)}
    panels = position_panels(comparison.clearance, drawn, comparison.locus, predicted)
    if not panels:
        return []
    tables = [] if comparison.clearance is None else [clearance_table(comparison.clearance, drawn[1])]
    return [Section("Clearance and shaft centre locus", panels=panels, tables=tables)]
