"""`tpjb compare`: prediction beside measurement for rigid, Kirk and measured pivots, with a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.commands.identify import identify_settings, refuse_untrusted, write_identification
from tpjb_ident.cli.commands.predict import model_settings
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import Data, open_data, refuse_impossible
from tpjb_ident.cli.common.options import (
    BearingOption,
    Coefficients,
    EffectsFile,
    MaybeCampaign,
    Method,
    Norm,
    Out,
    ReadingError,
    Thermal,
    as_given,
    named,
    out_folder,
    refuse_unknown,
)
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import command_line, print_line, progress, table
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_table

if TYPE_CHECKING:
    from tpjb_ident.compare.comparison import CompareSettings, Comparison

Pivots = Annotated[
    str, typer.Option("--pivots", help='Pivot models to compare: some of "rigid, kirk, kirk-secant, measured".')
]


@guarded
def compare(
    campaign: MaybeCampaign = None,
    bearing: BearingOption = None,
    pivots: Pivots = "rigid, kirk, measured",
    thermal: Thermal = "adiabatic",
    effects: EffectsFile = None,
    coefficients: Coefficients = None,
    reading_error: ReadingError = None,
    method: Method = "mm-eiv",
    norm: Norm = None,
    out: Out = None,
) -> None:
    """Compare prediction and measurement, with a report.

    With rigid, Kirk and measured pivots: writes report.html, comparison, coefficients, estimators, windows,
    pivot_curves, locus and clearance tables, pivots.toml, and the figures as SVG and PNG.
    """
    options = as_given(locals())
    options["pivots"] = list(variants := _variants(pivots))
    model = model_settings("kirk", thermal, effects)
    from tpjb_ident.compare.comparison import CompareSettings
    from tpjb_ident.compare.measured_pivots import counts_from_measured

    settings = CompareSettings(variants, thermal, model.effects, from_measured=counts_from_measured(effects))
    data = open_data("compare", campaign, coefficients, bearing, reading_error)
    refuse_impossible(settings.effects, effects, data.bearing)
    options["bearing"] = data.bearing_name
    inputs = data.inputs | ({effects.name: sha256(effects)} if effects else {})
    target = out_folder(out, "compare")
    with output_folder(target, "compare", (data.path,)) as folder:
        result, then = _compared(data, settings, options, inputs, folder)
        write_record(folder, target, "compare", options, inputs)
    show_comparison(result, then)
    print_line(f"Report: {target / 'report.html'}")
    refuse_comparison(result)


def _compared(
    data: Data, settings: CompareSettings, options: dict[str, Any], inputs: dict[str, str], folder: Path
) -> tuple[Comparison, str]:
    """Compare, and write everything into the folder; also the command that comes next."""
    from tpjb_ident.compare.coefficient_table import TableSource

    source = data.source
    if isinstance(source, TableSource):
        from tpjb_ident.compare.comparison import compare_table, comparison_frame
        from tpjb_ident.report.comparison_page import write_report

        with progress("comparing") as show:
            result = compare_table(data.path, data.bearing, settings, data.reading_error, show)
        write_table(folder, "comparison", comparison_frame(result))
        then = next_command(result, data.typed, data.given)
        write_report(folder, result, options, inputs, then)
        return result, then
    from tpjb_ident.compare.comparison import compare_campaign, model_side
    from tpjb_ident.runtime.executors import background_job

    with background_job(model_side, source, data.bearing, settings) as model, progress("comparing") as show:
        from tpjb_ident.report.comparison_page import write_report  # loaded while the model is at work

        settings = replace(settings, identify=identify_settings(source, options["method"], options["norm"]))
        result = compare_campaign(source, data.bearing, settings, show, model)
        then = next_command(result, data.typed, data.given)
        show("writing tables", 0, 2)
        write_comparison(folder, result)
        show("drawing figures", 1, 2)
        write_report(folder, result, named(options), inputs, then)
    return result, then


def _variants(text: str) -> tuple[str, ...]:
    from tpjb_ident.compare.comparison import VARIANTS

    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    for name in names:
        refuse_unknown(name, VARIANTS, "--pivots", several=True)
    if not names:
        raise BadInputError(f"--pivots: is empty. Use some of {', '.join(VARIANTS)}.")
    return names


def write_comparison(folder: Path, result: Comparison) -> None:
    """Write every table and pivots.toml."""
    from tpjb_ident.compare.comparison import comparison_frame, locus_frame
    from tpjb_ident.compare.predictions import printed_formula
    from tpjb_ident.pivot import pivot_table, write_pivots

    write_identification(folder, result.identification)
    write_table(folder, "comparison", comparison_frame(result))
    if result.curves:
        formula = printed_formula(result.bearing)
        write_table(folder, "pivot_curves", pivot_table(result.curves, formula=formula))
        write_pivots(folder / "pivots.toml", result.curves, result.campaign.id)
    if result.clearance is not None:
        write_table(folder, "clearance", result.clearance.to_frame())
    if result.locus is not None:
        write_table(folder, "locus", result.locus.to_frame())
        write_table(folder, "locus_comparison", locus_frame(result))


def show_comparison(result: Comparison, then: str = "") -> None:
    """Print what to conclude, the command that comes next, and the median deviations with what belongs to them."""
    from tpjb_ident.compare.comparison import comparison_frame
    from tpjb_ident.compare.summary import deviations, summary_sentences
    from tpjb_ident.rounding import percent

    frame = comparison_frame(result)
    found = deviations(result, frame)
    first, *more = summary_sentences(result, frame)
    print_line(first)
    if then:
        command_line(then)
    rows = [
        [v.name, *(percent(d.median) for d in found if d.pivots == v.name)] for v in result.variants
    ]  # fmt: skip
    table(f"{result.campaign.id}: predicted / measured - 1, median", ["pivots", "kxx", "kyy", "cxx", "cyy"], rows)
    for sentence in more:
        print_line(sentence)


def next_command(result: Comparison, source: str, bearing: Path | None) -> str:
    """Command that comes next: a diagnosis where the model is off, an export where it is not."""
    from tpjb_ident.compare.summary import deviations, worth_a_diagnosis

    if worth_a_diagnosis(deviations(result)):
        return f"tpjb diagnose {source}" + (f" --bearing {bearing}" if bearing else "")
    return f"tpjb export {source} --to ross" if not source.startswith("--") else ""


def refuse_comparison(result: Comparison) -> None:
    """End with exit code 3 if a point is not to be trusted, on either side."""
    from tpjb_ident.compare.coefficient_table import TableSource

    if not isinstance(result.campaign, TableSource):
        refuse_untrusted(result.identification)
    bad = [
        f"{v.name}, {p.point.static_load / 1e3:g} kN" for v in result.variants for p in v.points
        if not p.prediction.converged
    ]  # fmt: skip
    if bad:
        raise NotTrustedError(f"the model did not converge at {len(bad)} points ({'; '.join(bad[:5])}).")
