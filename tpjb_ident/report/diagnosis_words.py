"""A verdict in sentences and rows, in the units of an engineer, for the terminal and for the report."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from tpjb_ident.columns import size, symbol
from tpjb_ident.compare.effect_words import amount, finding, label_in_words, shown_unit, words_of
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.gap import gap_at
from tpjb_ident.report.drawing.series import DIRECT
from tpjb_ident.rounding import MINUS, percent, signed, significant

if TYPE_CHECKING:
    from tpjb_ident.diagnosis.verdict.verdict import Assumption, Verdict

#: Parameters that number what there are several of.
_PLACES = ("pad", "probe", "cell")
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
    sentences = [_answer(name, verdict, deviations), *verdict.beforehand]
    if deviations and verdict.verdict != "consistent":
        before, after = (
            ", ".join(f"{c} {percent(deviations[c][end])}" for c in DIRECT if c in deviations) for end in (0, 1)
        )
        with_effects = f"; with it {after}" if verdict.effects else ""
        sentences.append(f"The model was off by {before} (median over the points){with_effects}.")
    if verdict.effects:
        tested = "was tested on points left out of the fit"
        if not _tested(verdict):
            tested = "could not be tested, since no point can be left out; over all of them"
        sentences.append(
            f"The sizes were fitted to these data; that they close the gap {tested}: "
            f"{verdict.gap['heldout_before']:.1f} standard deviations before, {verdict.gap['heldout_after']:.1f} after "
            f"with all else as stated{_within(verdict)}."
        )
        words = [words_of(effect.name) for effect in verdict.effects]
        checks = [word.check for word in words if word is not None]
        if checks:
            sentences.append(f"Check first: {'; '.join(dict.fromkeys(checks))}.")
    sentences += _remainder_sentences(verdict)
    if verdict.verdict in {"unexplained", "partly-explained"}:
        sentences += [f"Because {in_words(reason)}." for reason in verdict.reasons]
    if verdict.verdict != "consistent" and verdict.disagreement:
        worst = verdict.disagreement[0]
        sentences.append(f"The model and the rig part most in {observable(worst.observable)}, {place(worst.where)}.")
    worse = [observable(o) for o, g in verdict.gap_by_observable.items() if _worse(g)]
    if verdict.effects and worse:
        sentences.append(f"With the effect added, {' and '.join(worse)} fits worse than before.")
    sentences += [_beyond(one) for one in verdict.assumptions if abs(one.deviation) > Deciding.visible]
    if verdict.next_test and verdict.verdict in {"ambiguous", "unexplained", "partly-explained"}:
        sentences.append(f"Next test: {in_words(verdict.next_test)}.")
    if verdict.below_floor:
        hidden = ", ".join(label_in_words(n) for n in verdict.below_floor)
        sentences.append(f"This campaign could not have seen {hidden}: silence about that is no absence.")
    return sentences


def _beyond(one: Assumption) -> str:
    """What is further out than its tolerance explains, with its size: no name, but to be looked at."""
    unit, scale = shown_unit(one.unit)
    sizes = ", ".join(signed(value / scale) for value in one.values)
    return (
        f"Beyond what is stated, without a name: {label_in_words(one.name)} {sizes} {unit}, "
        f"{abs(one.deviation):.1f} standard deviations."
    )


def _tested(verdict: Verdict) -> bool:
    """Whether there were points that the sizes had not seen."""
    return verdict.gap.get("heldout_numbers", 1) > 0


def _within(verdict: Verdict) -> str:
    """The same gap once clearances, oil and sensors may be anywhere within their tolerances."""
    gap = verdict.gap.get("within_tolerances")
    return "" if gap is None else f", {gap:.1f} with it free within its tolerances"


def _answer(name: str, verdict: Verdict, deviations: Mapping[str, tuple[float, float]] | None) -> str:
    found = " and ".join(finding(e.name, e.parameters) for e in verdict.effects)
    found = found[:1].upper() + found[1:]
    if verdict.verdict == "consistent":
        return f"{name}: model and measurement agree within noise and tolerance."
    if verdict.verdict == "named":
        return f"{name}: {found}. {_deciding(verdict)}"
    if verdict.verdict == "ambiguous":
        rivals = dict.fromkeys(label_in_words(n) for group in verdict.indistinguishable for n in group[1:])
        return f"{name}: {found}; these data cannot tell it from {' or '.join(rivals)}."
    if verdict.effects:
        return f"{name}: {found}. That explains most of the disagreement, and something is left."
    worst = _largest(deviations)
    return f"{name}: unexplained{worst}. Nothing in the library of effects closes the gap."


def _deciding(verdict: Verdict) -> str:
    """What a name rests on: the gap along what the effects do."""
    gap = verdict.gap
    acting = "it acts" if len(verdict.effects) == 1 else "the less certain one acts"
    where = "on points left out of the fit" if gap["touched_unseen"] else "over all points (none left out shows it)"
    shrunk = f"from {gap['touched_before']:.1f} to {gap['touched_after']:.1f} standard deviations"
    return f"That explains the disagreement: where {acting}, {where}, it shrinks {shrunk}."


def _largest(deviations: Mapping[str, tuple[float, float]] | None) -> str:
    if not deviations:
        return ""
    name = max(deviations, key=lambda c: abs(deviations[c][0]))
    return f", {name} is off by {percent(deviations[name][0])}"


def _remainder_sentences(verdict: Verdict) -> list[str]:
    """What is left and what it behaves like, where a diagnosis says so."""
    sentences = [
        f"What is left behaves like {in_words(term.words)} (within {100 * term.spread:.0f} %)."
        for term in verdict.behaves_like
    ]
    return sentences + [
        f"The {label_in_words(drift.parameter)} of {label_in_words(drift.effect)} {in_words(drift.words)}, from "
        f"{drift.start:.3g} to {drift.end:.3g}."
        for drift in verdict.drift
    ]


def observable(name: str) -> str:
    """An observable in words."""
    return _OBSERVABLES.get(name, label_in_words(name))


def place(range_text: str) -> str:
    """A range of operating points in words and in kN, Hz and degrees."""

    def kilo(match: re.Match[str]) -> str:
        ends = [f"{float(end) / size('load'):.6g}" for end in match[1].split("-")]
        return f"{' to '.join(ends)} {symbol('load')}"

    text = re.sub(r"((?:\d+(?:\.\d+)?)(?:-\d+(?:\.\d+)?)?) N\b(?!/| s)", kilo, range_text)
    text = text.replace("static_load_direction", "load direction").replace("static_load", "static load")
    text = re.sub(r"(-?\d+)-(-?\d+) deg", r"\1 to \2°", text)
    text = re.sub(r"\bpads? (\d)", r"pad #\1", text).replace(" deg", "°")
    return f"at {text}" if text and not text.startswith(("at ", "everywhere")) else text


def in_words(text: str) -> str:
    """A sentence of a diagnosis without the names of its variables."""
    found = place(text).removeprefix("at ")
    for name, words in _OBSERVABLES.items():
        found = found.replace(name, words)
    return label_in_words(re.sub(r"(-?\d(?:\.\d+)?e[+-]?\d+) (N/m|N s/m|m|rad)\b", _read, found))


def _read(number: re.Match[str]) -> str:
    unit, scale = shown_unit(number[2])
    return f"{significant(float(number[1]) / scale)} {unit}".replace("-", MINUS)


def _worse(gap: Mapping[str, float]) -> bool:
    return gap_at(gap, "_after") > max(gap_at(gap, "_before") + 0.3, 1.0)


def next_command(campaign: str, bearing: str, verdict: Verdict, folder: str) -> str:
    """How to use what was found, as a command to type."""
    drawn = f" --bearing {bearing}" if bearing else ""
    if verdict.effects:
        return f"tpjb compare {campaign}{drawn} --effects {folder}/updated.effects.toml"
    if verdict.verdict == "consistent":
        return f"tpjb export {folder} --to ross"
    return f"tpjb compare {campaign}{drawn} --pivots measured"


def parameter_rows(verdict: Verdict) -> list[list[str]]:
    """One row per parameter of the effects, in the units that people read."""
    return [
        [label_in_words(e.name), label_in_words(key), f"#{p.value:.0f}" if key in _PLACES else amount(p)]
        for e in verdict.effects
        for key, p in e.parameters.items()
    ]
