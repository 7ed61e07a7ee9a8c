"""What a verdict rests on: what is left and what it looks like, drifts, and the tolerances that took part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.effect_words import UNITS, label_in_words
from tpjb_ident.report.diagnosis_words import in_words
from tpjb_ident.report.page import Section, Table
from tpjb_ident.rounding import signed

if TYPE_CHECKING:
    from tpjb_ident.diagnose.verdict.verdict import Assumption, Verdict


def evidence_sections(verdict: Verdict) -> list[Section]:
    """Sections of the report; those for which a diagnosis holds nothing are left out.

    Parameters
    ----------
    verdict : Verdict
        What a diagnosis found.

    Returns
    -------
    list of Section
        In the order of the page.
    """
    out = [Section("What is left", left_sentences(verdict))]
    if verdict.assumptions:
        note = (
            "One standard deviation each. They are free within these in every fit and part of every interval; the last "
            "column is what the fit made of them. That of the model is what the campaign turned out to need."
        )
        columns = ["tolerance", "stated", "source", "fitted"]
        rows = [_row(a) for a in verdict.assumptions]
        table = Table("Stated tolerances", columns, rows, frozenset({0, 2, 3}))
        out.append(Section("What may be off", [note], tables=[table]))
    return out


def left_sentences(verdict: Verdict) -> list[str]:
    """Say what is left on unseen points, what it behaves like, and what drifts.

    Parameters
    ----------
    verdict : Verdict
    """
    left = verdict.remainder
    out = [
        "On points that no fit has seen, with all that has a tolerance free within it, "
        f"{left.sigma:.2f} sigma are left: {100 * left.share:.1f} % of the squared gap above noise, most in "
        f"{in_words(left.where)}; against noise and stated tolerances p = {left.p:.2g}."
    ]
    out += [f"The rest behaves like {b.words} (within {100 * b.spread:.0f} %)." for b in verdict.behaves_like]
    out += [f"{label_in_words(d.effect)}: its {label_in_words(d.parameter)} {d.words}, from {d.start:.3g} to "
            f"{d.end:.3g}." for d in verdict.drift]  # fmt: skip
    return out


def _row(one: Assumption) -> list[str]:
    """A tolerance in the units that people read; a ratio in per cent."""
    values: Sequence[float] = one.fitted if isinstance(one.fitted, list) else [one.fitted]
    unit, scale = UNITS.get(one.unit, (one.unit, 1.0))
    fitted = ", ".join(signed(v / scale) for v in values)
    return [label_in_words(one.name), f"{one.stated / scale:.3g} {unit}", one.source, f"{fitted} {unit}"]
