"""The comparison in words and in one small table: what is how far off, with which pivots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from model.effects import kind_of
from tpjb_ident.columns import amount, per, size, symbol
from tpjb_ident.compare.comparison import DIRECT, locus_distance
from tpjb_ident.compare.effect_words import Estimate, finding
from tpjb_ident.compare.predictions import PointPrediction, printed_formula
from tpjb_ident.rounding import percent, signed

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.compare.comparison import Comparison

#: Clearances no farther from the drawing are as drawn [m].
_AS_DRAWN = 0.3e-6
_PIVOTS_IN_WORDS = {
    "rigid": "rigid pivots",
    "kirk": "Kirk pivots (printed formula, tangent)",
    "kirk-secant": "Kirk pivots (printed formula as printed, secant)",
    "measured": "measured pivots",
}


def _in_words(variant: str) -> str:
    return _PIVOTS_IN_WORDS.get(variant, f"the table {variant}")


@dataclass(frozen=True)
class Deviation:
    """How one pivot model does on one direct coefficient: predicted / measured - 1."""

    coefficient: str
    median: float
    worst: float
    n: int
    inside: int


@dataclass(frozen=True)
class Agreement:
    """How one pivot model does on the direct coefficients."""

    pivots: str
    deviations: tuple[Deviation, ...]

    @property
    def compared(self) -> list[Deviation]:
        """Coefficients that could be compared at all."""
        return [d for d in self.deviations if math.isfinite(d.median)]

    @property
    def medians(self) -> str:
        """Median deviation of every coefficient, in words."""
        return ", ".join(f"{d.coefficient} {percent(d.median)}" for d in self.deviations)

    @property
    def inside(self) -> str:
        """How many predictions are within the measured intervals."""
        return f"{sum(d.inside for d in self.deviations)} of {sum(d.n for d in self.deviations)}"

    @property
    def is_off(self) -> bool:
        """Whether a direct coefficient is off by its tolerance, half of its points or more."""
        return any(abs(d.median) > _OFF and d.inside <= 0.5 * d.n for d in self.compared)


#: Median deviation of a direct coefficient from which a model is said to be off.
_OFF = 0.05


def agreements(table: pd.DataFrame) -> list[Agreement]:
    """How every pivot model of a table of comparison.csv does."""
    found = []
    for pivots, rows in table.groupby("pivots", sort=False):
        deviations = []
        for name in DIRECT:
            off = (rows[f"{name}_predicted"] / rows[name] - 1.0)[rows[f"{name}_lo"] * rows[f"{name}_hi"] > 0].to_numpy()
            off = off[np.isfinite(off)]
            inside = rows[f"{name}_predicted"].between(rows[f"{name}_lo"], rows[f"{name}_hi"])
            worst = float(off[np.argmax(np.abs(off))]) if len(off) else math.nan
            median = float(np.median(off)) if len(off) else math.nan
            deviations.append(Deviation(name[:3], median, worst, len(off), int(inside.sum())))
        found.append(Agreement(str(pivots), tuple(deviations)))
    return found


def closest(found: Sequence[Agreement]) -> Agreement | None:
    """The pivot model with the smallest mean size of its medians; None if nothing could be compared."""
    compared = [agreement for agreement in found if agreement.compared]
    return min(compared, key=lambda a: fmean(abs(d.median) for d in a.compared), default=None)


def _verdict_sentence(comparison: Comparison, best: Agreement | None) -> str:
    """Say in one sentence what to conclude."""
    name = comparison.campaign.id
    if best is None:
        return f"{name}: no coefficient could be compared; see the quality flags."
    worst = max(best.compared, key=lambda d: abs(d.median))
    if best.is_off:
        who = "No prediction agrees: the closest" if len(comparison.variants) > 1 else "The prediction"
        off = f"is off by {percent(worst.median)} in {worst.coefficient} (median)"
        return f"{name}: {who}, with {_in_words(best.pivots)}, {off}."
    largest = max(best.compared, key=lambda d: abs(d.worst))
    return (
        f"{name}: prediction and measurement agree within {100 * abs(worst.median):.1f} % (median) with "
        f"{_in_words(best.pivots)}; the largest single deviation is {percent(largest.worst)} in {largest.coefficient}, "
        f"and {sum(d.inside for d in best.compared)} of {sum(d.n for d in best.compared)} direct coefficients are "
        "inside their interval."
    )


def _effects_sentences(comparison: Comparison) -> tuple[str, ...]:
    """Say that effects took part, and what that means for the agreement."""
    effects = comparison.settings.effects
    if not effects or comparison.bearing is None:
        return ()
    pads = len(comparison.bearing.pads)
    listed = []
    for e in effects:
        sizes = {p.name: (float(e.parameters[p.name]), p.unit) for p in kind_of(e.name).parameters_of(pads)}
        listed.append(finding(e.name, {name: Estimate(v, v, v, unit) for name, (v, unit) in sizes.items()}))
    return (
        f"The model holds effects: {'; '.join(listed)}. Where `tpjb diagnose` found them in this campaign they were "
        "fitted to these data, and agreement with them is no independent proof.",
    )


def summary_sentences(comparison: Comparison) -> tuple[str, ...]:
    """Say what the comparison found, the answer first."""
    found = agreements(comparison.table)
    best = closest(found)
    sentences = [_verdict_sentence(comparison, best), *_effects_sentences(comparison)]
    if best is not None:
        points = max(d.n for d in best.deviations)
        with_best = f"The prediction comes closest with {_in_words(best.pivots)}: {best.medians}"
        sentences.append(f"{with_best} (median over {points} points).")
    sentences += [f"With {_in_words(other.pivots)}: {other.medians}." for other in found if other is not best]
    sentences += _pivot_sentence(comparison) + _extrapolation_sentence(comparison)
    sentences += _clearance_sentence(comparison) + _locus_sentence(comparison)
    return (*sentences, *comparison.remarks)


def _pivot_sentence(comparison: Comparison) -> list[str]:
    formula = printed_formula(comparison.bearing)
    if not comparison.curves or formula is None:
        return []
    ratios = {}
    for curve in comparison.curves:
        load = 0.8 * curve.valid_to
        ratios[curve.pad] = float(curve.stiffness(load)) / formula(curve.pad, load)[1]
    low, high = min(ratios, key=lambda k: ratios[k]), max(ratios, key=lambda k: ratios[k])
    load = 0.8 * comparison.curves[0].valid_to
    return [
        f"At {amount(load, 'load', '.3g')} the measured pivots have {100 * ratios[low]:.0f} % (pad #{low}) to "
        f"{100 * ratios[high]:.0f} % (pad #{high}) of the stiffness that the printed formula gives."
    ]


def _extrapolation_sentence(comparison: Comparison) -> list[str]:
    """Say where the model asks more of a measured pivot than the dry tests told."""
    measured = [point for v in comparison.variants if v.name == "measured" for point in v.points]
    points = [point for point in measured if isinstance(point, PointPrediction)]
    beyond = [point for point in points if point.extrapolated]
    if not beyond or not comparison.curves:
        return []
    largest = max(float(np.max(point.prediction.pad_load)) for point in beyond)
    tested = min(curve.valid_to for curve in comparison.curves)
    return [
        f"At {len(beyond)} of {len(points)} points the measured pivots are extrapolated: pads press them with up to "
        f"{amount(largest, 'load', '.3g')}, the dry tests went to {amount(tested, 'load', '.3g')}."
    ]


def _clearance_sentence(comparison: Comparison) -> list[str]:
    if comparison.clearance is None or comparison.bearing is None:
        return []
    drawn = np.array([pad.assembled_clearance for pad in comparison.bearing.pads])
    off = comparison.clearance.clearance - drawn
    if not np.isfinite(off).any():
        return []
    pad = int(np.nanargmax(np.abs(off)))
    if abs(off[pad]) < _AS_DRAWN:
        within = amount(abs(off[pad]), "length", ".1g")
        return [f"The measured clearance is that of the drawing, within {within} at every pad."]
    digits, unit = (1, symbol("length")) if size("length") < 1e-5 else (3, symbol("length"))
    median, worst = (signed(per("length") * float(v), digits) for v in (np.nanmedian(off), off[pad]))
    return [
        f"The measured clearance differs from the drawing by {worst} {unit} at pad #{pad + 1}, where it differs most "
        f"(median of all pads {median} {unit})."
    ]


def _locus_sentence(comparison: Comparison) -> list[str]:
    distances = {v.name: locus_distance(comparison, v) for v in comparison.variants}
    finite = {name: d for name, d in distances.items() if math.isfinite(d)}
    if not finite:
        return []
    parts = ", ".join(
        f"{amount(d, 'length', '.2g')} with {name.capitalize() if name.startswith('kirk') else name} pivots"
        for name, d in finite.items()
    )
    return [f"The predicted shaft centre locus is off the measured one by (root mean square) {parts}."]
