"""A diagnosis in words, and its report: verdict, residuals before and after, candidates, how it was made."""

import functools
import itertools
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from rigdata.campaign import Campaign
from tpjb_ident.columns import size, symbol
from tpjb_ident.compare.coefficient_table import TableSource
from tpjb_ident.compare.effect_words import Estimate, amount, finding, label_in_words, shown_unit, words_of
from tpjb_ident.diagnosis.campaign import CampaignDiagnosis
from tpjb_ident.diagnosis.diagnose import before_and_after
from tpjb_ident.diagnosis.forward.candidates import TERMS
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import gap_at
from tpjb_ident.diagnosis.verdict.verdict import Assumption, FoundEffect, Verdict
from tpjb_ident.report.drawing.picture import DIRECT
from tpjb_ident.report.figure import Panel
from tpjb_ident.report.page import Page, Section, Table, plain_templates, write_page
from tpjb_ident.report.plots.residuals import gap, residual_frame, residual_map, residual_series
from tpjb_ident.report.sections import coefficient_sections, flags_line, tested_facts, values_table
from tpjb_ident.rounding import MINUS, deviation, fixed, signed, significant

#: Parameters that number what there are several of.
_PLACES = ("pad", "probe", "cell")
#: Share of the squared gap from which something is left of it.
_LEFT = 5e-4
#: Observables of a diagnosis in words.
_OBSERVABLES = {
    "locus_x": "the shaft's horizontal position",
    "locus_y": "the shaft's vertical position",
    "load_ratio": "the size of the measured load",
    "load_turn": "the direction of the measured load",
    "clearance_pushed": "the clearance polygon",
    "side_angle": "the angles of the polygon's sides",
    "dry_compliance": "the dry pivot tests",
    "pad_temperature": "the pad temperatures",
}


def verdict_sentences(
    name: str, verdict: Verdict, deviations: Mapping[str, tuple[float, float]] | None = None
) -> list[str]:
    """Say what came out, the answer first."""
    worse = []
    for observed, gaps in verdict.gap_by_observable.items():
        if gap_at(gaps, "_after") > max(gap_at(gaps, "_before") + 0.3, 1.0):
            worse.append(observed)
    words = [words_of(effect.name) for effect in verdict.effects]
    text = (
        _templates()
        .get_template("verdict.txt")
        .render(
            name=name,
            verdict=verdict,
            deviations=deviations,
            direct=DIRECT,
            not_excluded=Deciding.not_excluded,
            rivals=list(itertools.chain(*(group[1:] for group in verdict.indistinguishable))),
            checks=dict.fromkeys(word.check for word in words if word),
            worse=worse,
            beyond=[a for a in verdict.assumptions if abs(a.deviation) > Deciding.visible],
            farthest=max(verdict.assumptions, key=lambda a: abs(a.deviation), default=None),
        )
    )
    return text.splitlines()


@functools.cache
def _templates() -> jinja2.Environment:
    """Sentences as templates, with what makes words of a diagnosis' values."""
    environment = plain_templates()
    environment.filters |= {
        "deviation": deviation,
        "findings": _findings,
        "fitted": _fitted,
        "in_words": in_words,
        "label": label_in_words,
        "observable": observable,
        "place": place,
    }
    return environment


def _findings(effects: Sequence[FoundEffect]) -> str:
    text = " and ".join(finding(effect.name, effect.parameters) for effect in effects)
    return text[:1].upper() + text[1:]


def _fitted(tolerance: Assumption) -> str:
    """What the fit made of a tolerance, in the unit that people read."""
    unit, scale = shown_unit(tolerance.unit)
    return f"{', '.join(signed(value / scale) for value in tolerance.values)} {unit}"


def observable(name: str) -> str:
    """An observable in words."""
    return _OBSERVABLES.get(name, label_in_words(name))


def place(range_text: str) -> str:
    """A range of operating points in words and in kN, Hz and degrees."""

    def kilo(match: re.Match[str]) -> str:
        ends = [f"{float(end) / size('load'):.4g}" for end in match[1].split("-")]
        return f"{' to '.join(ends)} {symbol('load')}"

    text = re.sub(r"((?:\d+(?:\.\d+)?)(?:-\d+(?:\.\d+)?)?) N\b(?!/| s)", kilo, range_text)
    text = text.replace("static_load_direction", "load direction").replace("static_load", "static load")
    text = re.sub(r"(-?\d+)-(-?\d+) deg", r"\1 to \2°", text)
    text = re.sub(r"\bpads? (\d)", r"pad #\1", text).replace(" deg", "°")
    return f"at {text}" if text and not text.startswith(("at ", "everywhere")) else text


def in_words(text: str) -> str:
    """A sentence of a diagnosis without the names of its variables."""
    sentence = place(text).removeprefix("at ")
    for name, words in _OBSERVABLES.items():
        sentence = sentence.replace(name, words)
    return label_in_words(re.sub(r"(-?\d(?:\.\d+)?e[+-]?\d+) (N/m|N s/m|m|rad)\b", _read, sentence))


def _read(number: re.Match[str]) -> str:
    unit, scale = shown_unit(number[2])
    return f"{significant(float(number[1]) / scale)} {unit}".replace("-", MINUS)


def next_command(source: Sequence[object], verdict: Verdict, folder: Path) -> list[object]:
    """How to use what was found, as words of a command; those of `source` say what was diagnosed."""
    if verdict.effects:
        return ["compare", *source, "--effects", folder / "updated.effects.toml"]
    if verdict.verdict == "consistent":
        return ["export", folder, "--to", "ross"]
    return ["compare", *source]


def parameter_rows(verdict: Verdict) -> list[list[str]]:
    """One row per parameter of the effects, in the units that people read."""
    rows = []
    for e in verdict.effects:
        for key, p in e.parameters.items():
            size = f"#{p.value:.0f}" if key in _PLACES else amount(p)
            rows.append([label_in_words(e.name), label_in_words(key), size])
    return rows


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
_SERIES = (
    ("load", "residuals-load", "Residuals over static load, the coefficients that disagree most"),
    ("frequency", "residuals-excitation", "Residuals over excitation frequency, the same coefficients"),
)


def write_diagnosis_report(
    folder: Path, campaign: Campaign | TableSource, result: CampaignDiagnosis, origin: Mapping[str, Any]
) -> None:
    """Write report.html and its figures into an existing folder."""
    verdict = result.diagnosis.verdict
    table = before_and_after(result.diagnosis, result.identification)
    points = () if result.identification is None else result.identification.points
    title = "Effects added to the model, with 95 % intervals"
    added = Table(title, ["effect", "parameter", "value"], parameter_rows(verdict))
    page = Page(
        title=f"{campaign.id}: what the model lacks",
        subtitle=campaign.description,
        sentences=result.summary().splitlines(),
        facts=tested_facts(campaign, result.setup.bearing, points),
        values=values_table(points),
        flags=flags_line([p.quality for p in points], len(points)),
        lead=next((d.observable for d in verdict.disagreement if d.observable[0] in "kc"), "kyy"),
        key_table=added if verdict.effects else _gap_table(verdict),
        sections=_sections(result, coefficient_sections(table) if len(table) else []),
        **origin,
    )
    write_page(folder, page)


def _gap_table(verdict: Verdict) -> Table:
    rows = []
    for name, words in _GAPS.items():
        if name.endswith("after") and not verdict.effects:
            continue  # where nothing was added, both are the same
        if name in verdict.gap or not name.startswith("touched"):
            rows.append([words, fixed(verdict.gap.get(name, math.nan), 2)])
    return Table("Gap: root mean square of (measured - predicted) / sigma", ["", "sigma"], rows)


def _other_explanations(verdict: Verdict) -> Section:
    """What else it could be, and the test that tells."""
    notes = []
    for group in verdict.indistinguishable:
        notes.append(f"These data cannot tell apart: {' or '.join(map(in_words, group))}.")
    if verdict.effects:
        notes += _rivals(verdict)
    if verdict.next_test and verdict.verdict != "consistent":
        notes.append(f"Next test: {in_words(verdict.next_test)}.")
    return Section("What else could it be, and the test that tells", notes)


def _rivals(verdict: Verdict) -> list[str]:
    """Fitted explanations that the named one does not leave as far behind as a name asks for, with their sizes."""
    names = {effect.name for effect in verdict.effects}
    listed = verdict.candidates
    named, probability = None, 0.0
    for candidate in listed:
        fitted = {label.split()[0] for label in candidate.parameters}
        if fitted - set(TERMS) == names:
            named, probability = candidate, candidate.probability
            break
    odds = Deciding.included / (1.0 - Deciding.included)
    notes = []
    for rival in listed:
        if rival is not named and rival.probability * odds > probability:
            sizes = []
            for label, parameters in rival.parameters.items():
                estimates = {key: Estimate(**value) for key, value in parameters.items()}
                sizes.append(finding(label.split()[0], estimates))
            share = f"probability {rival.probability:.2f}, that of what is named {probability:.2f}"
            notes.append(f"It may also be that {' and '.join(sizes)}: {share}.")
    return notes or [f"No other explanation that was fitted comes within odds of 1 to {odds:.0f} of it."]


def _sections(result: CampaignDiagnosis, coefficients: list[Section]) -> list[Section]:
    verdict = result.diagnosis.verdict
    note = (
        "Sigma joins measurement noise and the stated model tolerance. Held-out points are whole operating points that "
        "no fit has seen, and to which a model must extrapolate: the top load, the outer frequencies, another speed, "
        "a sector of the locus."
    )
    panels, frame = [], residual_frame(result.diagnosis)
    for over, name, title in _SERIES:
        try:
            panels.append(Panel(name, title, residual_series(frame, over)))
        except ValueError:  # nothing varies over it
            continue
    title = "Gap by observable, held-out points where there are any (* fitted points)"
    panels.append(Panel("gap-by-observable", title, gap(verdict)))
    if len(frame):
        panels.append(Panel("residual-map", "Residuals of every coefficient and point", residual_map(frame)))
    effects = []
    for effect in verdict.effects:  # what it is, how it looks on a rig, what to check first
        if words := words_of(effect.name):
            texts = [words.physics, f"By itself it shows so: {words.on_the_rig}", f"Check first: {words.check}."]
            effects.append(Section(f"What it means: {finding(effect.name, effect.parameters)}", texts))
    places = [
        [observable(d.observable), place(d.where), f"{d.size_sigma:.2f}", f"{100 * d.share:.1f} %"]
        for d in verdict.disagreement
    ]
    columns = ["observable", "where", "size, sigma", "share"]
    shares = Table("Largest shares of the squared gap", columns, places)
    tried = [
        [in_words(c.name), f"{c.score:.1f}", f"{c.heldout_gap:.2f}", f"{c.probability:.2f}"] for c in verdict.candidates
    ]
    title = "Best first; log evidence in nats above the baseline's, everything free within its tolerance"
    explanations = Table(title, ["explanation", "log evidence", "held-out gap", "probability"], tried)
    return [
        *effects,
        *coefficients,
        _other_explanations(verdict),
        Section("Where model and measurement part", [note], panels, [shares]),
        *_evidence_sections(verdict),
        Section("Explanations that were fitted", tables=[explanations]),
        Section("The gap", tables=[_gap_table(verdict)] if verdict.effects else []),
    ]


def _evidence_sections(verdict: Verdict) -> list[Section]:
    """What is left, and what was made of the tolerances."""
    note = (
        "One standard deviation each. They are free within these in every fit and part of every interval; the last "
        "columns are what the fit made of them, and how many deviations the farthest number is out. That of the "
        "model is what the campaign turned out to need."
    )
    columns = ["tolerance", "stated", "source", "fitted", "deviations"]
    table = Table("Stated tolerances", columns, [_row(a) for a in verdict.assumptions])
    remainder = verdict.remainder
    share = f"{100 * remainder.share:.1f} % of the squared gap above noise, most in {in_words(remainder.where)}"
    sentence = (
        f"On points that no fit has seen, with all that has a tolerance free within it, {remainder.sigma:.2f} sigma "
        f"are left: {share if remainder.share >= _LEFT else 'no more than noise'}; against noise and stated "
        f"tolerances p = {remainder.p:.2g}."
    )
    return [Section("What is left", [sentence]), Section("What may be off", [note], tables=[table])]


def _row(tolerance: Assumption) -> list[str]:
    """A tolerance in the units that people read; a ratio in per cent."""
    unit, scale = shown_unit(tolerance.unit)
    words = [label_in_words(tolerance.name), f"{tolerance.stated / scale:.3g} {unit}", tolerance.source]
    return [*words, _fitted(tolerance), signed(tolerance.deviation) if tolerance.deviation else ""]
