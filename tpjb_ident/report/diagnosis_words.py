"""A verdict in sentences and rows, for the terminal and for the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tpjb_ident.diagnose.verdict.verdict import Verdict


def verdict_sentences(name: str, verdict: Verdict) -> list[str]:
    """Say what came out, the answer first."""
    gap = verdict.gap
    change = f"{gap['heldout_before']:.2f} to {gap['heldout_after']:.2f} sigma"
    held = f"on points that no fit has seen the gap goes from {change}"
    names = " and ".join(_words(e.label) for e in verdict.effects)
    verb = "explain" if len(verdict.effects) > 1 else "explains"
    first = {
        "consistent": f"{name}: consistent. Model and measurement agree within noise and tolerance "
        f"(gap {gap['before']:.2f} sigma).",
        "named": f"{name}: {names} {verb} the disagreement; {held}.",
        "ambiguous": f"{name}: {names} closes the gap, but these data cannot tell it from "
        f"{' or '.join(_words(n) for group in verdict.indistinguishable for n in group[1:])}; {held}.",
        "unexplained": f"{name}: unexplained. There is a gap of {gap['before']:.2f} sigma, and nothing in the library "
        "closes it.",
    }[verdict.verdict]
    out = [first]
    if verdict.verdict == "unexplained":
        out += [f"Because {reason}." for reason in verdict.reasons]
    if verdict.verdict != "consistent" and verdict.disagreement:
        worst = verdict.disagreement[0]
        out.append(
            f"It shows most in {worst.observable} at {worst.where}: {worst.size_sigma:.1f} sigma, "
            f"{100 * worst.share:.0f} % of the squared gap."
        )
    sensors = verdict.notes.get("sensor_map")
    if verdict.verdict != "consistent" and sensors:
        out.append(f"Sensors or physics: {sensors['words']}.")
    worse = [o for o, g in verdict.gap_by_observable.items() if _worse(g)]
    if verdict.effects and worse:
        out.append(f"With the effect added, {', '.join(worse)} fits worse than before.")
    if verdict.next_test and verdict.verdict in {"ambiguous", "unexplained"}:
        out.append(f"Next test: {verdict.next_test}.")
    if verdict.below_floor:
        hidden = ", ".join(_words(n) for n in verdict.below_floor)
        out.append(
            f"This campaign could not have seen at a plausible size: {hidden}. Silence about them is no absence."
        )
    return out


def _worse(gap: dict[str, float]) -> bool:
    before, after = (next((v for k, v in gap.items() if k.endswith(end)), 0.0) for end in ("_before", "_after"))
    return after > before + 0.3


def _words(name: str) -> str:
    return name.replace("_", " ")


def effect_rows(verdict: Verdict) -> list[list[str]]:
    """One row per parameter: effect, parameter, value, interval, unit."""
    rows = []
    for e in verdict.effects:
        for k, p in e.parameters.items():
            interval = "" if p.lo == p.hi else f"{p.lo:.4g} .. {p.hi:.4g}"
            rows.append([_words(e.name), _words(k), f"{p.value:.4g}", interval, p.unit])
    return rows
