"""`tpjb diagnose`: find the disagreement, name the missing effect, show on held-out points that the gap shrinks."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import write_identification
from tpjb_ident.cli.inputs import model_settings, open_source, parse_share, pivot_choice
from tpjb_ident.columns import words
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings


@command("tpjb diagnose {DEMO}", "tpjb diagnose {DEMO} --pivots measured --out found")
def diagnose(
    c: Command,
    campaign: Path | None = None,
    bearing: Path | None = None,
    pivots: str = "kirk",
    thermal: str = "adiabatic",
    effects: Path | None = None,
    model_tolerance: str | None = None,
    tolerance: list[str] | None = None,
    coefficients: Path | None = None,
    reading_error: str | None = None,
    library: Path | None = None,
    workers: int | None = None,
) -> None:
    """Name what the model lacks where it and the rig disagree.

    Says what remains, and says so when nothing explains it. Writes diagnosis.json, updated.effects.toml (for
    `tpjb predict --effects` and `tpjb compare --effects`), report.html, and the identified coefficients.
    """
    settings = _settings(model_tolerance, tolerance or (), workers)
    if library is not None:
        from model.effects.registry import load_library

        load_library(c.file(library))
    start = pivots if pivots == "measured" else pivot_choice(c)
    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.diagnosis.campaign import Baseline, diagnose_campaign, diagnose_table
    from tpjb_ident.runtime.executors import background_job, cores, forks

    source, drawing, typed = open_source(c)
    baseline = Baseline(start, thermal, model_settings(c, start, drawing).effects)
    with c.results():
        is_quicker = coefficients is None and workers != 1 and cores() > 1 and forks()  # in a copy of this process
        job = background_job(measure_static, source, drawing) if is_quicker else nullcontext()
        with job as ahead, c.progress("diagnosing") as show:
            if coefficients is None:
                result = diagnose_campaign(source, drawing, baseline, settings, show, ahead)
            else:
                error = parse_share(reading_error, "--reading-error")
                result = diagnose_table(coefficients, drawing, baseline, settings, error, show)
        if result.identification is not None:
            write_identification(c, result.identification)
        verdict = result.diagnosis.verdict
        before = baseline.effects, baseline.from_measured
        write_text(c.folder / "diagnosis.json", verdict.to_json())
        write_text(c.folder / "updated.effects.toml", verdict.effects_toml(*before))
        if verdict.behaves_like:
            write_text(c.folder / "with-terms.effects.toml", verdict.terms_toml(*before))
        from tpjb_ident.report import diagnosis_page as page

        c.next(*page.next_command(typed, verdict, c.target))
        c.distrust(result.doubt)
        page.write_diagnosis_report(c.folder, source, result, c.origin)
    with c.conclusion(result.summary().splitlines()):
        if verdict.effects:
            columns = [*words("effect", "parameter"), "value"]
            c.show("Effects, with 95 % intervals", columns, page.parameter_rows(verdict))


def _settings(model_tolerance: str | None, tolerances: Sequence[str], workers: int | None) -> DiagnoseSettings:
    from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
    from tpjb_ident.diagnosis.forward.tolerances import Tolerances

    typed = {}
    for text in tolerances:
        name, _, value = text.partition("=")
        if not value.strip():
            raise BadInputError(f"--tolerance {text!r}: write NAME=VALUE, such as viscosity=4%.")
        typed[name.strip()] = value.strip()
    if model_tolerance is not None:
        typed["model"] = model_tolerance
    return DiagnoseSettings(tolerances=Tolerances().states(typed, "command line"), workers=workers)
