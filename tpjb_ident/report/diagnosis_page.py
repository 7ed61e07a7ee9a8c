"""The report of a diagnosis: verdict, residuals before and after, candidates, how it was made."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.report.diagnosis_evidence import evidence_sections
from tpjb_ident.report.diagnosis_panels import GROUP, diagnosis_panels
from tpjb_ident.report.diagnosis_words import effect_rows, verdict_sentences
from tpjb_ident.report.figure import save_panels
from tpjb_ident.report.page import Page, Section, Table, render_page
from tpjb_ident.runtime.tables import write_text

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from tpjb_ident.diagnose.campaign import CampaignDiagnosis
    from tpjb_ident.diagnose.verdict.verdict import Verdict


def write_diagnosis_report(
    folder: Path,
    campaign: Campaign,
    result: CampaignDiagnosis,
    settings: Mapping[str, Any],
    inputs: Mapping[str, str],
) -> Path:
    """Write report.html and its figures into an existing folder."""
    page = diagnosis_page(campaign, result, settings, inputs)
    texts = save_panels([panel for section in page.sections for panel in section.panels], folder / "figures")
    path = folder / "report.html"
    write_text(path, render_page(page, texts))
    return path


def diagnosis_page(
    campaign: Campaign, result: CampaignDiagnosis, settings: Mapping[str, Any], inputs: Mapping[str, str]
) -> Page:
    """Gather the content of the report; see `write_diagnosis_report`."""
    verdict = result.diagnosis.verdict
    answer, *more = verdict_sentences(campaign.id, verdict)
    return Page(
        title=f"{campaign.id}: what the model lacks",
        subtitle=f"{result.setup.bearing.name}{': ' + campaign.description if campaign.description else ''}",
        answer=answer,
        more=more,
        key_table=_effects_table(verdict) if verdict.effects else _gap_table(verdict),
        sections=_sections(result),
        settings={k: str(v) for k, v in settings.items()},
        inputs=dict(inputs),
    )


def _effects_table(verdict: Verdict) -> Table:
    return Table(
        "Effects added to the model", ["effect", "parameter", "value", "95 % interval", "unit"], effect_rows(verdict),
        frozenset({0, 1, 4}),
    )  # fmt: skip


def _gap_table(verdict: Verdict) -> Table:
    rows = [[name.replace("_", " "), f"{value:.3f}"] for name, value in verdict.gap.items()]
    return Table("Gap: root mean square of (measured - predicted) / sigma", ["", "sigma"], rows)


def _sections(result: CampaignDiagnosis) -> list[Section]:
    verdict = result.diagnosis.verdict
    note = (
        "Sigma joins measurement noise and the stated model tolerance. Held-out points are whole operating points that "
        "no fit has seen: an upper load, an upper frequency and every fifth locus direction."
    )
    places = [[d.observable, d.where, f"{d.size_sigma:.2f}", f"{100 * d.share:.1f} %"] for d in verdict.disagreement]
    tried = [[c.name, f"{-c.score:.3f}", f"{c.heldout_gap:.2f}"] for c in verdict.candidates]
    sections = [
        Section(
            GROUP,
            notes=[note],
            panels=diagnosis_panels(result.diagnosis),
            tables=[
                Table(
                    "Largest shares of the squared gap",
                    ["observable", "where", "size, sigma", "share"],
                    places,
                    frozenset({0, 1}),
                )
            ],
        )
    ]
    sections += evidence_sections(verdict)
    if tried:
        text = "Chi-square per element is the whitened misfit of the training points with calibration errors left free."
        columns = ["explanation", "chi-square per element", "held-out gap"]
        sections.append(Section("Explanations that were fitted", [text], tables=[Table("Best first", columns, tried)]))
    if verdict.effects:
        sections.append(Section("The gap", tables=[_gap_table(verdict)]))
    return sections
