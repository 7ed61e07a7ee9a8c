"""`tpjb diagnose`: find the disagreement, name the missing effect, show on held-out points that the gap shrinks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tpjb_ident.cli.commands.identify import refuse_untrusted, write_identification
from tpjb_ident.cli.commands.predict import model_settings, pivot_choice
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_bearing, open_campaign, refuse_impossible, table_inputs
from tpjb_ident.cli.common.options import (
    BearingOption,
    Coefficients,
    EffectsFile,
    MaybeCampaign,
    Out,
    ReadingError,
    Thermal,
    WorkerCount,
    as_given,
    out_folder,
)
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import command_line, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from tpjb_ident.diagnose.campaign import Baseline, CampaignDiagnosis
    from tpjb_ident.diagnose.search.settings import DiagnoseSettings
    from tpjb_ident.dynamic.results.identification import Identification

Pivots = Annotated[str, typer.Option("--pivots", help="Where to start from: kirk, rigid, measured or a pivots.toml.")]
ModelTolerance = Annotated[
    float | None,
    typer.Option("--model-tolerance", help="What the model is trusted to, share of the direct coefficients [1.5 %]."),
]
ToleranceOptions = Annotated[
    list[str] | None,
    typer.Option("--tolerance", metavar="NAME=VALUE", help="How well something is known: viscosity=4%; repeatable."),
]
Library = Annotated[
    Path | None, typer.Option("--library", metavar="FILE.py", help="Effects of your own; the file's code is run.")
]


@guarded
def diagnose(
    campaign: MaybeCampaign = None,
    bearing: BearingOption = None,
    pivots: Pivots = "kirk",
    thermal: Thermal = "adiabatic",
    effects: EffectsFile = None,
    model_tolerance: ModelTolerance = None,
    tolerance: ToleranceOptions = None,
    coefficients: Coefficients = None,
    reading_error: ReadingError = None,
    library: Library = None,
    workers: WorkerCount = None,
    out: Out = None,
) -> None:
    """Name what the model lacks where it and the rig disagree.

    Says what is left, and so when it does not know. Writes diagnosis.json, updated.effects.toml (for
    `tpjb predict --effects` and `tpjb compare --effects`), report.html, and the identified coefficients.
    """
    options = as_given(locals())
    if (campaign is None) == (coefficients is None):
        raise BadInputError("diagnose: give a campaign, or --coefficients TABLE.csv with --bearing FILE; one of them.")
    if model_tolerance is not None and not 1e-4 <= model_tolerance <= 0.5:
        raise BadInputError(f"--model-tolerance {model_tolerance:g}: must lie between 0.0001 and 0.5 (0.015 is 1.5 %).")
    if library is not None:
        from model.effects.user_library import load_library

        load_library(library)
    settings = _settings(model_tolerance, tolerance or [], workers)
    start = pivots if pivots == "measured" else pivot_choice(pivots)
    model = model_settings("kirk", thermal, effects)
    files = {f.name: sha256(f) for f in (effects, library, start if isinstance(start, Path) else None) if f}
    from tpjb_ident.compare.measured_pivots import refuse_counted_twice
    from tpjb_ident.diagnose.campaign import Baseline

    refuse_counted_twice(start, model.effects, effects)
    baseline = Baseline(start, thermal, model.effects)
    target = out_folder(out, "diagnose")
    if coefficients is not None:
        _from_table(_Asked(baseline, settings, options, files, target), coefficients, bearing, reading_error)
    elif campaign is not None:
        _from_campaign(_Asked(baseline, settings, options, files, target), campaign, bearing)


@dataclass(frozen=True)
class _Asked:
    """What the options ask for, whatever the data come from."""

    baseline: Baseline
    settings: DiagnoseSettings
    options: dict[str, Any]
    files: dict[str, str]
    target: Path


def _settings(model_tolerance: float | None, stated: list[str], workers: int | None) -> DiagnoseSettings:
    from tpjb_ident.diagnose.forward.tolerances import Tolerances
    from tpjb_ident.diagnose.search.settings import DiagnoseSettings

    typed: dict[str, str | float] = {}
    for one in stated:
        name, equals, value = one.partition("=")
        if not equals or not value.strip():
            raise BadInputError(f"--tolerance {one!r}: write NAME=VALUE, such as viscosity=4%.")
        typed[name.strip()] = value.strip()
    if model_tolerance is not None:
        typed["model"] = model_tolerance
    return DiagnoseSettings(tolerances=Tolerances().states(typed, "command line"), workers=workers)


def _from_campaign(asked: _Asked, campaign: Path, bearing: Path | None) -> None:
    from tpjb_ident.diagnose.campaign import diagnose_campaign

    source = open_campaign(campaign)
    drawn, given = open_bearing(source, bearing)
    refuse_impossible(asked.baseline.effects, asked.options["effects"], drawn)
    inputs = source.fingerprint() | given | asked.files
    options = {**asked.options, "bearing": bearing or source.bearing_name}
    with output_folder(asked.target, "diagnose", (campaign,)) as folder:
        with progress("diagnosing") as show:
            result = diagnose_campaign(source, drawn, asked.baseline, asked.settings, show)
            write_identification(folder, found := _identified(result))
            then = _next(asked, result, str(campaign), bearing)
            _write(folder, asked, source, result, inputs, then)
        write_record(folder, asked.target, "diagnose", options, inputs)
    _show(source.id, asked, result, then)
    refuse_untrusted(found)


def _identified(result: CampaignDiagnosis) -> Identification:
    assert result.identification is not None  # a campaign was identified
    return result.identification


def _from_table(asked: _Asked, path: Path, bearing: Path | None, reading_error: str | None) -> None:
    from tpjb_ident.compare.coefficient_table import TableSource
    from tpjb_ident.diagnose.campaign import diagnose_table

    drawn, error, inputs = table_inputs("diagnose", path, bearing, reading_error)
    inputs |= asked.files
    refuse_impossible(asked.baseline.effects, asked.options["effects"], drawn)
    source = TableSource(path.stem)
    with output_folder(asked.target, "diagnose", (path,)) as folder:
        with progress("diagnosing") as show:
            result = diagnose_table(path, drawn, asked.baseline, asked.settings, error, show)
            then = _next(asked, result, f"--coefficients {path}", bearing)
            _write(folder, asked, source, result, inputs, then)
        write_record(folder, asked.target, "diagnose", asked.options, inputs)
    _show(source.id, asked, result, then)


def _write(  # type: ignore[no-untyped-def]
    folder: Path, asked: _Asked, source, result: CampaignDiagnosis, inputs: dict[str, str], then: str
) -> None:
    from tpjb_ident.report.diagnosis_page import write_diagnosis_report

    verdict = result.diagnosis.verdict
    write_text(folder / "diagnosis.json", verdict.to_json())
    before, measured = asked.baseline.effects, asked.baseline.from_measured
    write_text(folder / "updated.effects.toml", verdict.effects_toml(before, measured))
    if verdict.behaves_like:
        write_text(folder / "with-terms.effects.toml", verdict.terms_toml(before, measured))
    named = {name: getattr(value, "name", value) for name, value in asked.options.items()}
    write_diagnosis_report(folder, source, result, named, inputs, then)


def _next(asked: _Asked, result: CampaignDiagnosis, source: str, bearing: Path | None) -> str:
    from tpjb_ident.report.diagnosis_words import next_command

    return next_command(source, str(bearing or ""), result.diagnosis.verdict, str(asked.target))


def _show(name: str, asked: _Asked, result: CampaignDiagnosis, then: str) -> None:
    _show_verdict(name, result, then)
    print_line(f"Report: {asked.target / 'report.html'}")


def _show_verdict(name: str, result: CampaignDiagnosis, then: str) -> None:
    """Print the verdict, the effects with their intervals, and the gap, in the units that people read."""
    from tpjb_ident.diagnose.diagnose import before_and_after, median_deviations
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
