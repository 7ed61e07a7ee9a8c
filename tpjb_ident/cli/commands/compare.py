"""`tpjb compare`: prediction compared with measurement for rigid, Kirk and measured pivots, with a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.command import Command, command
from tpjb_ident.cli.common.identification import identify_settings, refuse_untrusted, write_identification
from tpjb_ident.cli.common.inputs import model_settings, open_source, parse_share, refuse_impossible
from tpjb_ident.cli.common.options import DEMO, named, refuse_unknown
from tpjb_ident.columns import Column, amount, words
from tpjb_ident.errors import BadInputError, NotTrustedError

if TYPE_CHECKING:
    from model.bearing import Bearing
    from tpjb_ident.compare.comparison import CompareSettings, Comparison
    from tpjb_ident.compare.difference import Difference, Side


@command(
    f"tpjb compare {DEMO}",
    f'tpjb compare {DEMO} --pivots "kirk, measured" --thermal tehd',
    f"tpjb compare {DEMO} --prediction xltrc.csv --prediction sheet.csv",
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
    """Compare prediction and measurement, or two campaigns, with a report.

    With rigid, Kirk and measured pivots: report.html, tables of comparison, coefficients, estimators, windows, pivot
    curves, locus and clearance, pivots.toml, figures. Two campaigns of one rig (before and after an overhaul), or
    their folders of results: difference, pivot_difference, clearance_difference and report.html.
    """
    if campaign is not None and other is not None:
        if prediction:
            raise BadInputError("--prediction: belongs to one campaign. Leave it or the second campaign out.")
        _compare_two(c, (campaign, other), bearing, method, norm)
        return
    c.options["pivots"] = variants = _variants(pivots)
    model = model_settings(c, "kirk", thermal, effects)
    from tpjb_ident.compare.comparison import CompareSettings, compare_campaign, comparison_frame, model_side
    from tpjb_ident.compare.predictions import counts_from_measured
    from tpjb_ident.compare.tables import read_predictions, with_predictions
    from tpjb_ident.runtime.executors import background_job

    settings = CompareSettings(variants, thermal, model.effects, from_measured=counts_from_measured(effects))
    tables = read_predictions([c.file(path) for path in prediction or ()])
    source, drawing = open_source(c, campaign, coefficients, bearing, bool(tables))
    refuse_impossible(settings.effects, effects, drawing)
    typed = str(campaign or f"--coefficients {coefficients}")
    with c.results() as folder:
        if coefficients is not None:
            from tpjb_ident.report.comparison_page import write_report

            result = with_predictions(_compared_table(c, coefficients, drawing, settings, reading_error), tables)
            c.table("comparison", comparison_frame(result))
            following = next_command(result, typed, bearing)
            write_report(folder, result, named(c.options), c.inputs, following)
        else:
            with background_job(model_side, source, drawing, settings) as ahead, c.progress("comparing") as show:
                from tpjb_ident.report.comparison_page import write_report  # loaded while the model is at work

                settings = replace(settings, identify=identify_settings(c, source, method, norm))
                result = with_predictions(compare_campaign(source, drawing, settings, show, ahead), tables)
                following = next_command(result, typed, bearing)
                show("writing tables", 0, 2)
                write_comparison(c, result)
                show("drawing figures", 1, 2)
                write_report(folder, result, named(c.options), c.inputs, following)
    show_comparison(c, result, following)
    refuse_comparison(result)


def _compared_table(
    c: Command, path: Path, drawing: Bearing, settings: CompareSettings, reading_error: str | None
) -> Comparison:
    """Predictions held against a table of coefficients."""
    from tpjb_ident.compare.tables import compare_table

    share = parse_share(reading_error, "--reading-error")
    with c.progress("comparing") as show:
        return compare_table(path, drawing, settings, share, show)


def _compare_two(c: Command, paths: tuple[Path, Path], bearing: Path | None, method: str, norm: str | None) -> None:
    """Hold two campaigns against each other."""
    from tpjb_ident.compare.difference import difference_of

    with c.results() as folder:
        a, b = (_side(c, path, bearing, method, norm) for path in paths)
        difference = difference_of(a, b)
        from tpjb_ident.report.difference_page import write_difference_report

        for name in ("points", "pivots", "clearance"):
            frame = getattr(difference, name)
            if len(frame):
                c.table("difference" if name == "points" else f"{name.rstrip('s')}_difference", frame)
        following = f"tpjb diagnose {paths[1]}" if b.campaign is not None else f"tpjb view {c.target}"
        write_difference_report(folder, difference, named(c.options), c.inputs, following)
    _show_difference(c, difference)
    c.next(following)
    if difference.points.empty:
        raise NotTrustedError("the two have no operating point in common. Their set points are in the message above.")
    bad = difference.untrusted_points()
    if bad:
        raise NotTrustedError(f"{len(bad)} points have a flag that forbids trust: {'; '.join(bad[:5])}.")


def _side(c: Command, path: Path, bearing: Path | None, method: str, norm: str | None) -> Side:
    """One of two campaigns, identified, or a folder of results as it is."""
    from tpjb_ident.compare.difference import measured_side, recorded_side

    if (path / "coefficients.csv").is_file():
        c.file(path / "coefficients.csv")
        return recorded_side(path)
    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.identification.identify import identify

    campaign = c.open(path)
    settings = identify_settings(c, campaign, method, norm)
    with c.progress(f"identifying {campaign.id}") as show:
        identification = identify(campaign, settings, show)
    drawing = c.bearing_of(campaign, bearing) if bearing is not None or campaign.bearing_text else None
    return measured_side(campaign, identification, None if drawing is None else measure_static(campaign, drawing))


def _show_difference(c: Command, difference: Difference) -> None:
    """Print what changed: sentences, and how many coefficients of every point."""
    from tpjb_ident.compare.difference import difference_sentences

    first, *more = difference_sentences(difference)
    c.print(first)
    rows = []
    for row in difference.points.to_dict("records"):
        judged = {str(name)[:3]: verdict for name, verdict in row.items() if str(name).endswith("_changed")}
        changed = [name for name, verdict in judged.items() if verdict == "yes"]
        cells = [str(list(judged.values()).count(verdict)) for verdict in ("yes", "no", "cannot tell")]
        rows.append([row["static_load_N"], row["excitation_Hz"], *cells, ", ".join(changed)])
    columns = [Column("load {load}"), Column("exc. {frequency}"), "changed", "same", "cannot tell", *words("which")]
    c.show(f"{difference.a.name} and {difference.b.name}", columns, rows, file="difference.csv")
    for line in more:
        c.print(line)


def _variants(text: str) -> tuple[str, ...]:
    from tpjb_ident.compare.comparison import VARIANTS

    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    for name in names:
        refuse_unknown(name, VARIANTS, "--pivots", several=True)
    if not names:
        raise BadInputError(f"--pivots: is empty. Use some of {', '.join(VARIANTS)}.")
    return names


def write_comparison(c: Command, result: Comparison) -> None:
    """Write every table and pivots.toml."""
    from tpjb_ident.compare.comparison import comparison_frame, locus_frame
    from tpjb_ident.compare.predictions import printed_formula
    from tpjb_ident.pivot import pivot_table, write_pivots

    write_identification(c, result.identification)
    c.table("comparison", comparison_frame(result))
    if result.curves:
        c.table("pivot_curves", pivot_table(result.curves, formula=printed_formula(result.bearing)))
        write_pivots(c.folder / "pivots.toml", result.curves, result.campaign.id)
    if result.clearance is not None:
        c.table("clearance", result.clearance.to_frame())
    if result.locus is not None:
        c.table("locus", result.locus.to_frame())
        c.table("locus_comparison", locus_frame(result))


def show_comparison(c: Command, result: Comparison, following: str = "") -> None:
    """Print what to conclude, the command that comes next, and the median deviations with what belongs to them."""
    from tpjb_ident.compare.comparison import comparison_frame
    from tpjb_ident.compare.summary import deviations, summary_sentences
    from tpjb_ident.rounding import percent

    frame = comparison_frame(result)
    medians = {variant.name: [variant.name] for variant in result.variants}
    for deviation in deviations(result, frame):
        medians[deviation.pivots].append(percent(deviation.median))
    conclusion, *more = summary_sentences(result, frame)
    c.print(conclusion)
    if following:
        c.next(following)
    columns = [*words("pivots"), "kxx", "kyy", "cxx", "cyy"]
    c.show(f"{result.campaign.id}: predicted / measured - 1, median", columns, list(medians.values()))
    for line in more:
        c.print(line)


def next_command(result: Comparison, source: str, bearing: Path | None) -> str:
    """Command that comes next: a diagnosis where the model is off, an export where it is not."""
    from tpjb_ident.compare.summary import deviations, worth_a_diagnosis

    if worth_a_diagnosis(deviations(result)):
        if result.bearing is None:
            return ""
        return f"tpjb diagnose {source}" + (f" --bearing {bearing}" if bearing else "")
    return f"tpjb export {source} --to ross" if not source.startswith("--") else ""


def refuse_comparison(result: Comparison) -> None:
    """End with exit code 3 if a point is not to be trusted, on either side."""
    from tpjb_ident.compare.coefficient_table import TableSource

    if not isinstance(result.campaign, TableSource):
        refuse_untrusted(result.identification)
    bad = []
    for variant in result.variants:
        points = [p for p in variant.points if not p.converged]
        bad += [f"{variant.name}, {amount(p.point.static_load, 'load')}" for p in points]
    if bad:
        raise NotTrustedError(f"the model did not converge at {len(bad)} points ({'; '.join(bad[:5])}).")
