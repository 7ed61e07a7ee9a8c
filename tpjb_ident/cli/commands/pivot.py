"""`tpjb pivot`: dry load steps in, pivot stiffness curves out."""

from pathlib import Path

from tpjb_ident.cli.command import Command, command


@command("tpjb pivot {DEMO}")
def pivot(c: Command, campaign: Path, bearing: Path | None = None) -> None:
    """Fit the pivot stiffness curves to the dry tests.

    Writes pivot_curves and pivot_pads (.csv, .parquet), pivots.toml, which `tpjb predict --pivots` reads, and figures.
    """
    from tpjb_ident.compare.predictions import printed_formula
    from tpjb_ident.compare.static_tests import bearing_problems, implausible_pivots
    from tpjb_ident.pivot.fit import fit_pivots
    from tpjb_ident.pivot.tables import pads_table, pivot_table, write_pivots
    from tpjb_ident.report.comparison_page import pivot_stiffness_table
    from tpjb_ident.report.sections import pivot_panels

    source = c.open(campaign)
    drawing = c.bearing_of(source)
    with c.results("fitting pivot curves"):
        curves = fit_pivots(source, drawing.pivot_angles, on_refusal="few")
        formula = printed_formula(drawing)
        c.table("pivot_curves", pivot_table(curves, formula=formula))
        c.table("pivot_pads", pads_table(curves))
        write_pivots(c.folder / "pivots.toml", curves, source.id)
        c.draw(pivot_panels(curves, formula))
    tested = {run.pad or 0 for run in source.of_kind("dry_pivot")}
    c.print(f"{source.id}: {len(curves)} of {len(tested)} pads with dry tests have a pivot curve.")
    c.show_table(pivot_stiffness_table(curves, formula), source.id)
    c.next("compare" if source.of_kind("dynamic") else "check", campaign)
    without = tested - {curve.pad for curve in curves}
    refused = [f"pad #{pad}: has no curve, its records were refused" for pad in sorted(without)]
    refused += implausible_pivots(curves, formula)
    refused += c.warn_of(bearing_problems(source, drawing))  # what is wrong with the probes is wrong with the curves
    c.judge({f"pad #{curve.pad}": curve.status for curve in curves}, refused)
