"""`tpjb pivot`: dry load steps in, pivot stiffness curves out."""

from __future__ import annotations

from typing import Any

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_bearing, open_campaign
from tpjb_ident.cli.common.options import BearingOption, CampaignPath, Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import note_line, print_line, progress, table
from tpjb_ident.conditions import untrusted
from tpjb_ident.errors import NotTrustedError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table

#: Conditions of the campaign rather than of one pad.
ABOUT_ALL = ("runs-refused",)


@guarded
def pivot(campaign: CampaignPath, bearing: BearingOption = None, out: Out = None) -> None:
    """Fit the pivot stiffness curves to the dry tests.

    Writes pivot_curves and pivot_pads (.csv, .parquet), pivots.toml, which `tpjb predict --pivots` reads, and figures.
    """
    from tpjb_ident.compare.predictions import printed_formula
    from tpjb_ident.pivot import PivotSettings, fit_pivots, pads_table, pivot_table, write_pivots
    from tpjb_ident.report.figure import save_panels
    from tpjb_ident.report.panels import pivot_panels

    source = open_campaign(campaign)
    drawn, given = open_bearing(source, bearing)
    target = out_folder(out, "pivot")
    with output_folder(target, "pivot", (campaign,)) as folder:
        with progress("fitting pivot curves"):
            curves = fit_pivots(source, [pad.pivot_angle for pad in drawn.pads], PivotSettings(on_refusal="few"))
        formula = printed_formula(drawn)
        write_table(folder, "pivot_curves", pivot_table(curves, formula=formula))
        write_table(folder, "pivot_pads", pads_table(curves))
        write_pivots(folder / "pivots.toml", curves, source.id)
        with progress("drawing figures"):
            save_panels(pivot_panels(curves, formula), folder / "figures")
        write_record(folder, target, "pivot", {"campaign": campaign, "bearing": bearing or source.bearing_name},
                     source.fingerprint() | given)  # fmt: skip
    _show_curves(curves, source.id, formula)
    print_line(f"Results: {target}")
    from tpjb_ident.compare.static_tests import bearing_problems

    for problem in bearing_problems(source, drawn):  # what is wrong with the probes is wrong with the curves
        note_line("warning", str(problem))
    for sentence in dict.fromkeys(c.sentence() for curve in curves for c in curve.status if c in ABOUT_ALL):
        note_line("note", sentence)
    for curve in curves:
        for condition in curve.status:
            if condition not in ABOUT_ALL:
                note_line("note", f"pad #{curve.pad}: {condition.sentence()}")
    bad = [f"pad {c.pad}: {condition.sentence()}" for c in curves for condition in untrusted(c.status)]
    without = sorted({run.pad or 0 for run in source.of_kind("dry_pivot")} - {curve.pad for curve in curves})
    bad += [f"pad {pad}: has no curve, its records were refused" for pad in without]
    if bad:
        raise NotTrustedError("; ".join(bad))


def _show_curves(curves: Any, name: str, formula: Any = None) -> None:
    """Print the tangent stiffness of every pad at half and at full measured load, and the share of Kirk's formula."""
    rows = []
    for curve in curves:
        cells = [f"#{curve.pad}"]
        for load in (0.5 * curve.valid_to, curve.valid_to):
            low, high = (float(v) for v in curve.stiffness_band(load))
            cells += [f"{load / 1e3:.2f}", f"{float(curve.stiffness(load)) / 1e6:.0f}",
                      f"{low / 1e6:.0f}..{high / 1e6:.0f}"]  # fmt: skip
        if formula is not None:
            one = 0.01 * formula(curve.pad, curve.valid_to)[1]
            low, high = (float(v) for v in curve.stiffness_band(curve.valid_to))
            cells.append(f"{float(curve.stiffness(curve.valid_to)) / one:.0f} ({low / one:.0f}..{high / one:.0f})")
        rows.append([*cells, curve.law.name])
    headings = ["load kN", "MN/m", "95 %"]
    headings = ["pad", *headings, *headings, *(["of Kirk, %"] if formula is not None else []), "law"]
    table(f"{name}: tangent stiffness of the pivots", headings, rows, words=(0, len(headings) - 1))
