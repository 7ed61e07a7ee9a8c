"""The report of a diagnosis: verdict, residuals before and after, candidates, how it was made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.compare.effect_words import Estimate, finding, label_in_words, shown_unit, words_of
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.diagnose import before_and_after, median_deviations
from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.report.diagnosis_words import in_words, observable, parameter_rows, place, verdict_sentences
from tpjb_ident.report.drawing.residual_frame import residual_frame
from tpjb_ident.report.figure import Panel, panel
from tpjb_ident.report.laboratory_sections import flags_line, tested_facts, values_table
from tpjb_ident.report.page import Page, Section, Table, grouped, write_page
from tpjb_ident.report.panels import coefficient_panels
from tpjb_ident.report.plots.gap import gap
from tpjb_ident.report.plots.residual_map import residual_map
from tpjb_ident.report.plots.residual_series import residual_series
from tpjb_ident.rounding import fixed, signed

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from tpjb_ident.compare.coefficient_table import TableSource
    from tpjb_ident.diagnosis.campaign import CampaignDiagnosis
    from tpjb_ident.diagnosis.diagnose import Diagnosis
    from tpjb_ident.diagnosis.verdict.verdict import Assumption, Remainder, Verdict

#: The gaps of a verdict in words; each is another question.
_GAPS = {
    "before": "all points, model as stated",
    "after": "all points, with what was added, all else as stated",
    "heldout_before": "points that no fit has seen, model as stated",
    "heldout_after": "points that no fit has seen, with what was added, all else as stated",
    "touched_before": "along what the effect does, in deviations of all else that may be off, without it",
    "touched_after": "along what the effect does, in deviations of all else that may be off, with it",
    "within_tolerances": "points that no fit has seen, clearances, oil, sensors, .. free within their tolerances too",
    "noise_floor": "what noise alone would leave",
}
_GROUP = "Where model and measurement part"
OVER = (
    ("load", "residuals-load", "Residuals over static load, the coefficients that disagree most"),
    ("frequency", "residuals-excitation", "Residuals over excitation frequency, the same coefficients"),
)


def write_diagnosis_report(
    folder: Path,
    campaign: Campaign | TableSource,
    result: CampaignDiagnosis,
    settings: Mapping[str, Any],
    inputs: Mapping[str, str],
    then: str = "",
) -> Path:
    """Write report.html and its figures into an existing folder."""
    verdict = result.diagnosis.verdict
    table = before_and_after(result.diagnosis, result.identification)
    answer, *more = verdict_sentences(campaign.id, verdict, median_deviations(table))
    points = () if result.identification is None else result.identification.points
    coefficients = coefficient_panels(table) if len(table) else []
    worst = next((d.observable for d in verdict.disagreement if d.observable[0] in "kc"), "kyy")
    lead = next((p for p in coefficients if p.name.startswith(worst)), None)
    page = Page(
        title=f"{campaign.id}: what the model lacks",
        subtitle=campaign.description,
        answer=answer,
        more=more,
        facts=tested_facts(campaign, result.setup.bearing, points),
        values=values_table(points),
        flags=flags_line([("", p.quality) for p in points], len(points)),
        picture=lead,
        then=then,
        key_table=_effects_table(verdict) if verdict.effects else _gap_table(verdict),
        sections=_sections(result, [p for p in coefficients if p is not lead]),
        settings=settings,
        inputs=inputs,
    )
    return write_page(folder, page)


def _effects_table(verdict: Verdict) -> Table:
    return Table(
        "Effects added to the model, with 95 % intervals", ["effect", "parameter", "value"], parameter_rows(verdict)
    )  # fmt: skip


def _gap_table(verdict: Verdict) -> Table:
    rows = [
        [words, fixed(verdict.gap.get(name, math.nan), 2)]
        for name, words in _GAPS.items()
        # where nothing was added, both are the same
        if (verdict.effects or not name.endswith("after")) and (name in verdict.gap or not name.startswith("touched"))
    ]
    return Table("Gap: root mean square of (measured - predicted) / sigma", ["", "sigma"], rows)


def _effect_sections(verdict: Verdict) -> list[Section]:
    """What each named effect is, how it looks on a rig, what to check first."""
    sections = []
    for effect in verdict.effects:
        words = words_of(effect.name)
        if words is not None:
            texts = [words.physics, f"On the rig: {words.on_the_rig}", f"Check first: {words.check}."]
            sections.append(Section(f"What it means: {finding(effect.name, effect.parameters)}", texts))
    return sections


def _other_explanations(verdict: Verdict) -> list[Section]:
    """What else it could be, and the test that tells."""
    notes = []
    for group in verdict.indistinguishable:
        names = " or ".join(in_words(name) for name in group)
        notes.append(f"These data cannot tell apart: {names}.")
    if verdict.effects:
        notes += _rivals(verdict)
    if verdict.next_test:
        notes.append(f"Next test: {in_words(verdict.next_test)}.")
    return [Section("What else could it be, and the test that tells", notes)] if notes else []


def _rivals(verdict: Verdict) -> list[str]:
    """Fitted explanations that the named one does not leave as far behind as a name asks for, with their sizes."""
    names = {effect.name for effect in verdict.effects}
    listed = verdict.candidates
    named = [c for c in listed if {label.split()[0] for label in c.parameters} - set(TERMS) == names][:1]
    own = named[0].probability if named else 0.0
    odds = DiagnoseSettings.included / (1.0 - DiagnoseSettings.included)
    notes = []
    for rival in listed:
        if rival not in named and rival.probability * odds > own:
            sizes = [
                finding(label.split()[0], {key: Estimate(**value) for key, value in parameters.items()})
                for label, parameters in rival.parameters.items()
            ]
            share = f"probability {rival.probability:.2f}, that of what is named {own:.2f}"
            notes.append(f"It may also be that {' and '.join(sizes)}: {share}.")
    return notes or [f"No other explanation that was fitted comes within odds of 1 to {odds:.0f} of it."]


def _sections(result: CampaignDiagnosis, coefficients: Sequence[Panel]) -> list[Section]:
    verdict = result.diagnosis.verdict
    note = (
        "Sigma joins measurement noise and the stated model tolerance. Held-out points are whole operating points that "
        "no fit has seen, and to which a model must extrapolate: the top load, the outer frequencies, another speed, "
        "a sector of the locus."
    )
    places = [
        [observable(d.observable), place(d.where), f"{d.size_sigma:.2f}", f"{100 * d.share:.1f} %"]
        for d in verdict.disagreement
    ]
    tried = [
        [in_words(c.name), f"{c.score:.1f}", f"{c.heldout_gap:.2f}", f"{c.probability:.2f}"] for c in verdict.candidates
    ]
    columns = ["observable", "where", "size, sigma", "share"]
    sections = _effect_sections(verdict) + grouped(coefficients) + _other_explanations(verdict)
    sections.append(
        Section(
            _GROUP,
            notes=[note],
            panels=_diagnosis_panels(result.diagnosis),
            tables=[Table("Largest shares of the squared gap", columns, places)],
        )
    )
    sections += _evidence_sections(verdict)
    if tried:
        title = "Best first; log evidence in nats above the baseline's, everything free within its tolerance"
        columns = ["explanation", "log evidence", "held-out gap", "probability"]
        sections.append(Section("Explanations that were fitted", tables=[Table(title, columns, tried)]))
    if verdict.effects:
        sections.append(Section("The gap", tables=[_gap_table(verdict)]))
    return sections


def _diagnosis_panels(diagnosis: Diagnosis) -> list[Panel]:
    """Draw the residuals over load, over frequency and as a map, and the gap by observable, before and after."""
    panels = []
    frame = residual_frame(diagnosis)
    for over, name, title in OVER:
        try:
            panels.append(panel(name, title, residual_series(frame, over), _GROUP))
        except ValueError:  # nothing varies over it
            continue
    title = "Gap by observable, held-out points where there are any (* fitted points)"
    panels.append(panel("gap-by-observable", title, gap(diagnosis.verdict), _GROUP))
    if len(frame):
        panels.append(panel("residual-map", "Residuals of every coefficient and point", residual_map(frame), _GROUP))
    return panels


def _evidence_sections(verdict: Verdict) -> list[Section]:
    """What is left, and what was made of the tolerances."""
    note = (
        "One standard deviation each. They are free within these in every fit and part of every interval; the last "
        "columns are what the fit made of them, and how many deviations the farthest number is out. That of the "
        "model is what the campaign turned out to need."
    )
    columns = ["tolerance", "stated", "source", "fitted", "deviations"]
    table = Table("Stated tolerances", columns, [_row(a) for a in verdict.assumptions])
    left = Section("What is left", [_left_sentence(verdict.remainder)])
    return [left, Section("What may be off", [note], tables=[table])]


def _left_sentence(remainder: Remainder) -> str:
    """Say what is left on unseen points; what it behaves like, and what drifts, stands with the verdict."""
    return (
        "On points that no fit has seen, with all that has a tolerance free within it, "
        f"{remainder.sigma:.2f} sigma are left: {100 * remainder.share:.1f} % of the squared gap above noise, most in "
        f"{in_words(remainder.where)}; against noise and stated tolerances p = {remainder.p:.2g}."
    )


def _row(one: Assumption) -> list[str]:
    """A tolerance in the units that people read; a ratio in per cent."""
    unit, scale = shown_unit(one.unit)
    fitted = ", ".join(signed(v / scale) for v in one.values)
    far = signed(one.deviation) if one.deviation else ""
    return [label_in_words(one.name), f"{one.stated / scale:.3g} {unit}", one.source, f"{fitted} {unit}", far]
