"""`tpjb diagnose`: find the disagreement, name the missing effect, show on held-out points that the gap shrinks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.commands.identify import refuse_untrusted, write_identification
from tpjb_ident.cli.commands.predict import model_settings, pivot_choice
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_bearing, open_campaign
from tpjb_ident.cli.common.options import BearingOption, CampaignPath, EffectsFile, Out, Thermal, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import command_line, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from tpjb_ident.diagnose.campaign import CampaignDiagnosis

Pivots = Annotated[str, typer.Option("--pivots", help="Where to start from: kirk, rigid, measured or a pivots.toml.")]
ModelTolerance = Annotated[
    float, typer.Option("--model-tolerance", help="What the model is trusted to, share of the direct coefficients.")
]


@guarded
def diagnose(
    campaign: CampaignPath,
    bearing: BearingOption = None,
    pivots: Pivots = "kirk",
    thermal: Thermal = "adiabatic",
    effects: EffectsFile = None,
    model_tolerance: ModelTolerance = 0.015,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes [default: all cores].")] = None,
    out: Out = None,
) -> None:
    """Name what the model lacks where it and the rig disagree.

    Says so when it does not know. Writes diagnosis.json, updated.effects.toml (for `tpjb predict --effects` and
    `tpjb compare --effects`), report.html, and the identified coefficients.
    """
    source = open_campaign(campaign)
    if not 1e-4 <= model_tolerance <= 0.5:
        raise BadInputError(f"--model-tolerance {model_tolerance:g}: must lie between 0.0001 and 0.5 (0.015 is 1.5 %).")
    start = pivots if pivots == "measured" else pivot_choice(pivots)
    model = model_settings("kirk", thermal, effects)
    drawn, given = open_bearing(source, bearing)
    from tpjb_ident.diagnose.campaign import Baseline, diagnose_campaign
    from tpjb_ident.diagnose.observations.tolerance import Tolerance
    from tpjb_ident.diagnose.search.settings import DiagnoseSettings
    from tpjb_ident.report.diagnosis_page import write_diagnosis_report
    from tpjb_ident.report.diagnosis_words import next_command

    settings = DiagnoseSettings(tolerance=Tolerance.scaled(model_tolerance), workers=workers)
    files = [f for f in (effects, start if isinstance(start, Path) else None) if f]
    inputs = source.fingerprint() | given | {f.name: sha256(f) for f in files}
    options = {"campaign": campaign, "bearing": bearing or source.bearing_name, "pivots": pivots, "thermal": thermal,
               "effects": effects, "model_tolerance": model_tolerance}  # fmt: skip
    target = out_folder(out, "diagnose")
    with output_folder(target, "diagnose", (campaign,)) as folder:
        with progress("diagnosing") as show:
            result = diagnose_campaign(source, drawn, Baseline(start, thermal, model.effects), settings, show)
            verdict = result.diagnosis.verdict
            write_identification(folder, result.identification)
            write_text(folder / "diagnosis.json", verdict.to_json())
            write_text(folder / "updated.effects.toml", verdict.effects_toml(model.effects))
            named = {name: getattr(value, "name", value) for name, value in options.items()}
            write_diagnosis_report(folder, source, result, named, inputs)
        write_record(folder, target, "diagnose", options, inputs)
    show_verdict(source.id, result, next_command(str(campaign), str(bearing or ""), verdict, str(target)))
    print_line(f"Report: {target / 'report.html'}")
    refuse_untrusted(result.identification)


def show_verdict(name: str, result: CampaignDiagnosis, then: str) -> None:
    """Print the verdict, the effects with their intervals, and the gap, in the units that people read.

    Parameters
    ----------
    name : str
        Of the campaign.
    result : CampaignDiagnosis
    then : str
        The command that comes next.
    """
    from tpjb_ident.report.diagnosis_coefficients import before_and_after, median_deviations
    from tpjb_ident.report.diagnosis_words import parameter_rows, verdict_sentences

    verdict = result.diagnosis.verdict
    off = median_deviations(before_and_after(result.diagnosis, result.identification))
    first, *more = verdict_sentences(name, verdict, off)
    print_line(first)
    command_line(then)
    for sentence in more:
        print_line(sentence)
    if verdict.effects:
        table("Effects, with 95 % intervals", ["effect", "parameter", "value"], parameter_rows(verdict), words=(0, 1))
