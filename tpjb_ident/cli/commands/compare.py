"""`tpjb compare`: prediction compared with measurement for rigid, Kirk and measured pivots, with a report."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import identified, identify_settings, write_identification
from tpjb_ident.cli.inputs import model_settings, open_source, parse_share
from tpjb_ident.cli.options import known_names
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import deviation

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import Comparison
    from tpjb_ident.compare.difference import Side
    from tpjb_ident.compare.predictions import Progress


@command(
    "tpjb compare {DEMO}",
    'tpjb compare {DEMO} --pivots "kirk, measured" --thermal tehd',
    "tpjb compare {DEMO} --prediction xltrc.csv --prediction sheet.csv",
    "tpjb compare before.h5 after.h5",
)
def compare(
    c: Command,
    campaign: Path | None = None,
    other: Path | None = None,
    bearing: Path | None = None,
    pivots: str = "rigid, kirk, measured",
    thermal: str = "adiabatic",
    effects: Path | None = None,
    coefficients: Path | None = None,
    reading_error: str | None = None,
    method: str = "mm-eiv",
    norm: str | None = None,
    prediction: list[Path] | None = None,
) -> None:
    """Compare prediction and measurement, or two campaigns.

    With rigid, Kirk and measured pivots: report.html, tables of comparison, coefficients, estimators, windows, pivot
    curves, locus and clearance, pivots.toml, figures. Two campaigns of one rig (before and after an overhaul), or
    their folders of results: difference, pivot_difference, clearance_difference and report.html.
    """
    if campaign is not None and other is not None:
        if prediction:
            raise BadInputError("--prediction: belongs to one campaign. Leave it or the second campaign out.")
        _compare_two(c, campaign, other)
        return
    from tpjb_ident.compare.comparison import VARIANTS, CompareSettings, compare_campaign, model_side
    from tpjb_ident.compare.predictions import counts_from_measured
    from tpjb_ident.compare.summary import agreements, closest, is_off
    from tpjb_ident.compare.tables import compare_table, read_predictions, with_predictions
    from tpjb_ident.runtime.executors import background_job

    c.options["pivots"] = variants = known_names(pivots, VARIANTS, "--pivots")
    tables = read_predictions([c.file(path) for path in prediction or ()])
    source, drawing, typed = open_source(c, bool(tables))
    model = model_settings(c, "kirk", drawing)
    settings = CompareSettings(variants, thermal, model.effects, from_measured=counts_from_measured(effects))
    with c.results():
        job = background_job(model_side, source, drawing, settings) if coefficients is None else nullcontext()
        with job as ahead, c.progress("comparing") as show:
            import tpjb_ident.report.comparison_page  # noqa: F401  (loaded while the model is at work)

            if coefficients is None:
                settings = replace(settings, identify=identify_settings(c, source))
                result = compare_campaign(source, drawing, settings, show, ahead)
            else:
                share = parse_share(reading_error, "--reading-error")
                result = compare_table(coefficients, drawing, settings, share, show)
            result = with_predictions(result, tables)
            best = closest(agreements(result.table))
            if best is None or not is_off(best):
                if campaign is not None:
                    c.next("export", campaign, "--to", "ross")
            elif drawing is not None:
                c.next("diagnose", *typed)
            write_comparison(c, result, show)
    show_comparison(c, result)


def _compare_two(c: Command, *paths: Path) -> None:
    """Hold two campaigns against each other."""
    from tpjb_ident.compare.difference import difference_of, difference_sentences
    from tpjb_ident.compare.summary import DIRECT
    from tpjb_ident.report.difference_page import write_difference_report

    with c.results():
        sides = [_side(c, path) for path in paths]
        if sides[0].name == sides[1].name:
            sides = [replace(side, name=f"{side.name} ({path})") for side, path in zip(sides, paths)]
        difference = difference_of(*sides)
        for name, frame in difference.tables.items():
            c.table(name, frame)
        on_records = difference.b.campaign is not None and not difference.b.coefficients.empty
        c.next(*(("diagnose", paths[1]) if on_records else ("view", c.target)))
        c.distrust(difference.doubt)
        write_difference_report(c.folder, difference, c.origin)
    points = difference.points
    with c.conclusion(difference_sentences(difference)):
        title = f"{difference.a.name} and {difference.b.name}: changed?"
        names = " ".join(f"{name}_changed" for name in DIRECT)
        c.show_frame(title, points, f"static_load_N excitation_Hz {names}", "difference.csv")


def _side(c: Command, path: Path) -> Side:
    """One of two campaigns, identified, or a folder of results as it is."""
    from tpjb_ident.compare.difference import measured_side, recorded_side

    if (path / "coefficients.csv").is_file():
        c.file(path / "coefficients.csv")
        return recorded_side(path)
    from tpjb_ident.compare.static_tests import measure_static

    campaign = c.open(path)
    identification = identified(c, campaign) if campaign.of_kind("dynamic") else None
    drawing = c.bearing_of(campaign) if c.has_bearing(campaign) else None
    return measured_side(campaign, identification, None if drawing is None else measure_static(campaign, drawing))


def write_comparison(c: Command, result: Comparison, show: Progress, note: str = "") -> None:
    """Write every table, pivots.toml and the report; whether a point is not to be trusted, on either side, is noted."""
    from tpjb_ident.compare.predictions import printed_formula
    from tpjb_ident.pivot.tables import pivot_table, write_pivots
    from tpjb_ident.report.comparison_page import write_report

    c.distrust(result.doubt)
    show("writing tables", 0, 2)
    if result.has_records:
        write_identification(c, result.identification)
    c.table("comparison", result.table)
    if result.curves:
        c.table("pivot_curves", pivot_table(result.curves, formula=printed_formula(result.bearing)))
        write_pivots(c.folder / "pivots.toml", result.curves, result.campaign.id)
    if result.clearance is not None:
        c.table("clearance", result.clearance.to_frame())
    if result.locus is not None and result.loci is not None:
        c.table("locus", result.locus.to_frame())
        c.table("locus_comparison", result.loci)
    show("drawing figures", 1, 2)
    write_report(c.folder, result, **c.origin, note=note)


def show_comparison(c: Command, result: Comparison) -> None:
    """Print what to conclude, and how far each pivot model is off."""
    from tpjb_ident.compare.summary import DIRECT, agreements, number_inside, summary_sentences

    rows = []
    for name, agreement in agreements(result.table).iterrows():
        rows.append([str(name), *map(deviation, agreement["median"]), number_inside(agreement)])
    columns = [*words("pivots"), *DIRECT, "inside"]
    with c.conclusion(summary_sentences(result)):
        c.show(f"{result.campaign.id}: predicted / measured - 1, median", columns, rows)
