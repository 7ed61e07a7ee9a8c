"""`tpjb diagnose`: find the disagreement, name the missing effect, show on held-out points that the gap shrinks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.commands.identify import refuse_untrusted, write_identification
from tpjb_ident.cli.commands.predict import model_settings, pivot_choice
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import Data, open_data, refuse_impossible
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
    named,
    out_folder,
)
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import Progress, command_line, print_line, progress, table
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from tpjb_ident.compare.static_tests import StaticTests
    from tpjb_ident.diagnosis.campaign import Baseline, CampaignDiagnosis
    from tpjb_ident.diagnosis.search.settings import DiagnoseSettings
    from tpjb_ident.diagnosis.verdict.verdict import Verdict

    Ahead = Callable[[], StaticTests | None] | None

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
    from tpjb_ident.diagnosis.campaign import Baseline

    refuse_counted_twice(start, model.effects, effects)
    baseline = Baseline(start, thermal, model.effects)
    data = open_data("diagnose", campaign, coefficients, bearing, reading_error)
    refuse_impossible(model.effects, effects, data.bearing)
    inputs = data.inputs | files
    target = out_folder(out, "diagnose")
    with output_folder(target, "diagnose", (data.path,)) as folder:
        with _static_tests_beside(data, workers) as ahead, progress("diagnosing") as show:
            result = _diagnosed(data, baseline, settings, show, ahead)
            if result.identification is not None:
                write_identification(folder, result.identification)
            _write_verdict(folder, baseline, result.diagnosis.verdict)
            then = _next(data, result, target)
            from tpjb_ident.report.diagnosis_page import write_diagnosis_report

            write_diagnosis_report(folder, data.source, result, named(options), inputs, then)
        write_record(folder, target, "diagnose", options | {"bearing": data.bearing_name}, inputs)
    _show_verdict(data.source.id, result, then)
    print_line(f"Report: {target / 'report.html'}")
    if result.identification is not None:
        refuse_untrusted(result.identification)


def _settings(model_tolerance: float | None, stated: list[str], workers: int | None) -> DiagnoseSettings:
    from tpjb_ident.diagnosis.forward.tolerances import Tolerances
    from tpjb_ident.diagnosis.search.settings import DiagnoseSettings

    typed: dict[str, str | float] = {}
    for one in stated:
        name, equals, value = one.partition("=")
        if not equals or not value.strip():
            raise BadInputError(f"--tolerance {one!r}: write NAME=VALUE, such as viscosity=4%.")
        typed[name.strip()] = value.strip()
    if model_tolerance is not None:
        typed["model"] = model_tolerance
    return DiagnoseSettings(tolerances=Tolerances().states(typed, "command line"), workers=workers)


@contextmanager
def _static_tests_beside(data: Data, workers: int | None) -> Iterator[Ahead]:
    """Measure the static tests in a copy of this process while it identifies; None where there is no second core."""
    from tpjb_ident.compare.coefficient_table import TableSource
    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.runtime.executors import background_job, cores, forks

    if isinstance(data.source, TableSource) or workers == 1 or cores() < 2 or not forks():
        yield None
        return
    with background_job(measure_static, data.source, data.bearing) as ahead:
        yield ahead


def _diagnosed(
    data: Data, baseline: Baseline, settings: DiagnoseSettings, show: Progress, ahead: Ahead
) -> CampaignDiagnosis:
    from tpjb_ident.compare.coefficient_table import TableSource
    from tpjb_ident.diagnosis.campaign import diagnose_campaign, diagnose_table

    if isinstance(data.source, TableSource):
        return diagnose_table(data.path, data.bearing, baseline, settings, data.reading_error, show)
    return diagnose_campaign(data.source, data.bearing, baseline, settings, show, ahead)


def _next(data: Data, result: CampaignDiagnosis, target: Path) -> str:
    from tpjb_ident.report.diagnosis_words import next_command

    return next_command(data.typed, str(data.given or ""), result.diagnosis.verdict, str(target))


def _write_verdict(folder: Path, baseline: Baseline, verdict: Verdict) -> None:
    write_text(folder / "diagnosis.json", verdict.to_json())
    before, measured = baseline.effects, baseline.from_measured
    write_text(folder / "updated.effects.toml", verdict.effects_toml(before, measured))
    if verdict.behaves_like:
        write_text(folder / "with-terms.effects.toml", verdict.terms_toml(before, measured))


def _show_verdict(name: str, result: CampaignDiagnosis, then: str) -> None:
    """Print the verdict, the effects with their intervals, and the gap, in the units that people read."""
    from tpjb_ident.diagnosis.diagnose import before_and_after, median_deviations
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
