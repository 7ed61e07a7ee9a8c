"""What speaks for a verdict: closure on held-out points beside its controls, laws of the gap, what is left."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tpjb_ident.report.page import Section, Table

if TYPE_CHECKING:
    from tpjb_ident.diagnose.verdict.verdict import Verdict


def evidence_sections(verdict: Verdict) -> list[Section]:
    """Sections of the report; those for which a diagnosis holds nothing are left out."""
    out = []
    closure = verdict.notes.get("closure")
    if closure is not None:
        out.append(Section("What the named effects close, beside three controls", [_closure_text(closure)],
                           tables=[_closure_table(verdict, closure)]))  # fmt: skip
    laws = _law_sentences(verdict)
    if laws:
        out.append(Section("Sensors or physics, and the law in frequency", laws))
    structure = verdict.notes.get("structure")
    if structure is not None:
        out.append(Section("What is left", _structure_sentences(structure)))
    return out


def _closure_text(closure: dict[str, Any]) -> str:
    return (
        "Share of the squared gap that is closed on points no fit has seen, whitened with noise, tolerance and "
        f"calibration errors: {closure['heldout_before']:.2f} per point before, {closure['heldout_after']:.2f} after; "
        "1 is what noise and tolerance leave. The Gaussian process closes what can be closed and names nothing."
    )


def _closure_table(verdict: Verdict, closure: dict[str, Any]) -> Table:
    names = " + ".join(e.label for e in verdict.effects) or "best model that was fitted"
    low, middle, high = closure["placebo_fall"]
    wrong = closure["wrong_effect"]
    rows = [
        [names, _percent(closure["closed"]), _range(closure["closed_lo"], closure["closed_hi"])],
        [f"wrong effect: {wrong['name'] or 'none was fitted'}", _percent(wrong["closed"]), ""],
        ["Gaussian process (ceiling)", _percent(closure["gaussian_process_closed"]), ""],
        ["placebo: fall per point where nothing is hidden", f"{middle:.3f}", f"{low:.3f} .. {high:.3f}"],
    ]
    return Table("Closed on held-out points", ["by", "closed", "95 % interval"], rows)


def _law_sentences(verdict: Verdict) -> list[str]:
    sensors = verdict.notes.get("sensor_map")
    sentences = [_sentence(sensors["words"])] if sensors else []
    return sentences + [_sentence(law["words"]) for law in verdict.notes.get("frequency_laws", ())]


def _structure_sentences(structure: dict[str, Any]) -> list[str]:
    where = ", ".join(structure["left_in"])
    out = [
        "The residual was tested for smooth patterns in every coefficient, constant sensor maps, locus, polygon, "
        f"dry tests and temperatures, and for every effect of the library: p = {structure['p_before']:.2g} for the "
        f"baseline, {structure['p_after']:.2g} for the model with the effects."
    ]
    if where:
        out.append(f"What is left stands out in {where}.")
    if structure["scatter_over_stated"] > 1.1:
        out.append(f"Measurements scatter {math.sqrt(structure['scatter_over_stated']):.1f} times as much as stated.")
    return out


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _percent(share: float) -> str:
    return "no gap to close" if share is None or math.isnan(share) else f"{min(100 * share, 100.0):.0f} %"


def _range(low: float, high: float) -> str:
    return "" if math.isnan(low) else f"{min(100 * low, 100.0):.0f} to {min(100 * high, 100.0):.0f} %"
