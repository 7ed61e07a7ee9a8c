"""The comparison in words and in one small table: what is how far off, with which pivots."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from model.effects import kind_of
from tpjb_ident.columns import amount, size, symbol
from tpjb_ident.compare.comparison import Comparison
from tpjb_ident.compare.effect_words import Estimate, finding
from tpjb_ident.compare.predictions import printed_formula
from tpjb_ident.conditions import led_by
from tpjb_ident.rounding import deviation, signed
from tpjb_ident.schema import COEFFICIENT_COLUMNS

#: Direct coefficients, and their columns.
DIRECT = {name[:3]: name for name in COEFFICIENT_COLUMNS if name[1:3] in ("xx", "yy")}
#: Clearances no farther from the drawing are as drawn [m].
_AS_DRAWN = 0.3e-6
_PIVOTS_IN_WORDS = {
    "rigid": "rigid pivots",
    "kirk": "Kirk pivots (printed formula, tangent)",
    "kirk-secant": "Kirk pivots (printed formula as printed, secant)",
    "measured": "measured pivots",
}


def _in_words(variant: Any) -> str:
    return _PIVOTS_IN_WORDS.get(variant, f"the table {variant}")


#: Median deviation of a direct coefficient from which a model is said to be off.
_OFF = 0.05
#: Ratios of predicted to measured beyond which the bearing may be another one.
_FOREIGN = (0.5, 2.0)


def agreements(table: pd.DataFrame) -> pd.DataFrame:
    """How every pivot model of a table of comparison.csv does: a row each.

    For every direct coefficient columns ``median`` and ``worst`` of predicted / measured - 1, the number of points
    ``n`` and of those ``inside`` the measured interval.
    """
    deviations = table[[f"{column}_ratio" for column in DIRECT.values()]].set_axis(list(DIRECT), axis=1) - 1.0
    inside = {}
    for name, column in DIRECT.items():
        inside[name] = table[f"{column}_predicted"].between(table[f"{column}_lo"], table[f"{column}_hi"])
    models = deviations.groupby(table["pivots"], sort=False)
    columns = {
        "median": models.median(),
        "worst": models.agg(_largest),
        "n": models.count(),
        "inside": pd.DataFrame(inside).groupby(table["pivots"], sort=False).sum(),
    }
    return pd.concat(columns, axis=1)


def _largest(deviations: pd.Series) -> float:
    """What is farthest from zero."""
    return max(deviations.dropna(), key=abs, default=math.nan)


def number_inside(agreement: pd.Series) -> str:
    """How many predictions of one model are within the measured intervals."""
    return f"{agreement['inside'].sum():.0f} of {agreement['n'].sum():.0f}"


def closest(agreement: pd.DataFrame) -> pd.Series | None:
    """The pivot model with the smallest mean size of its medians; None if nothing could be compared."""
    sizes = agreement[["median"]].abs().mean(axis=1)
    return agreement.T[sizes.idxmin()] if sizes.notna().any() else None


def is_off(agreement: pd.Series) -> bool:
    """Whether a direct coefficient is off by its tolerance, half of its points or more."""
    far, missed = agreement["median"].abs() > _OFF, agreement["inside"] <= 0.5 * agreement["n"]
    return bool((far & missed).any())


def farthest(agreement: pd.Series) -> str:
    """The direct coefficient that one model misses most, by its median."""
    return agreement["median"].abs().idxmax()


def _verdict_sentence(comparison: Comparison, best: pd.Series | None) -> str:
    """Say in one sentence what to conclude."""
    campaign = comparison.campaign.id
    if best is None:
        return f"{campaign}: no coefficient could be compared; see the quality flags."
    name, pivots = farthest(best), _in_words(best.name)
    median = best["median", name]
    if is_off(best):
        who = "No prediction agrees: the closest" if len(comparison.predictions) > 1 else "The prediction"
        size = deviation(median)
        off = f"gives {size} the measured {name}" if "times" in size else f"is off by {size} in {name}"
        sentence = f"{campaign}: {who}, with {pivots}, {off} (median)."
        medians = best["median"].dropna()
        if 2 * (1.0 + medians).between(*_FOREIGN).sum() < len(medians):
            sentence += " Most coefficients are off by more than a factor of two: is this the bearing of the records?"
        return sentence
    largest = best["worst"].abs().idxmax()
    return (
        f"{campaign}: prediction and measurement agree within {100 * abs(median):.1f} % (median) with {pivots}; the "
        f"largest single deviation is {deviation(best['worst', largest])} in {largest}, and {number_inside(best)} "
        "direct coefficients are inside their interval."
    )


def _effects_sentences(comparison: Comparison) -> tuple[str, ...]:
    """Say that effects took part, and what that means for the agreement."""
    effects = comparison.settings.effects
    if not effects or comparison.bearing is None:
        return ()
    listed = []
    for effect in effects:
        sizes = {}
        for parameter in kind_of(effect.name).parameters_of(len(comparison.bearing.pads)):
            value = effect.parameters[parameter.name]
            sizes[parameter.name] = Estimate(value, value, value, parameter.unit)
        listed.append(finding(effect.name, sizes))
    return (
        f"The model holds effects: {'; '.join(listed)}. Where `tpjb diagnose` found them in this campaign they were "
        "fitted to these data, and agreement with them is no independent proof.",
    )


def summary_sentences(comparison: Comparison) -> Sequence[str]:
    """Say what the comparison found, the answer first."""
    agreement = agreements(comparison.table)
    best = closest(agreement)
    sentences = [_verdict_sentence(comparison, best), *_effects_sentences(comparison)]
    for name, row in agreement.iterrows() if best is not None else ():
        medians = ", ".join(f"{coefficient} {deviation(value)}" for coefficient, value in row["median"].items())
        sentences.append(f"With {_in_words(name)}: {medians} (median).")
    sentences += _pivot_sentence(comparison) + _extrapolation_sentence(comparison)
    sentences += _clearance_sentence(comparison)
    loci = comparison.loci
    if loci is not None:
        squares = (loci["x_m_predicted"] - loci["x_m"]) ** 2 + (loci["y_m_predicted"] - loci["y_m"]) ** 2
        distances = []
        for name, distance in np.sqrt(squares.groupby(loci["pivots"], sort=False).mean()).items():
            distances.append(f"{amount(distance, 'length', '.2g')} with {name.replace('kirk', 'Kirk')} pivots")
        head = "The predicted shaft centre locus is off the measured one by (root mean square)"
        sentences.append(f"{head} {', '.join(distances)}.")
    return led_by(comparison.doubt, (*sentences, *comparison.remarks))


def _pivot_sentence(comparison: Comparison) -> list[str]:
    formula = printed_formula(comparison.bearing)
    if not comparison.curves or formula is None:
        return []
    ratios = []
    for curve in comparison.curves:
        load = 0.8 * curve.valid_to
        ratios.append((curve.stiffness(load) / formula(curve.pad, load)[1], curve.pad))
    (low, soft), (high, stiff) = min(ratios), max(ratios)
    load = 0.8 * comparison.curves[0].valid_to
    least, most = f"{100 * low:.0f} %", f"{100 * high:.0f} %"
    reach = least if least == most else f"{least} (pad #{soft}) to {most} (pad #{stiff})"
    stiffness = f"{reach} of the tangent stiffness by Kirk's formula"
    return [f"At {amount(load, 'load', '.3g')} the measured pivots have {stiffness}."]


def _extrapolation_sentence(comparison: Comparison) -> list[str]:
    """Say where the model asks more of a measured pivot than the dry tests told."""
    points = comparison.predictions.get("measured")
    if points is None or not points["pivot_extrapolated"].any():
        return []
    overloads = points[points["pivot_extrapolated"]]
    largest = overloads.filter(regex=r"pad\d+_load_N").to_numpy().max()
    tested = min(curve.valid_to for curve in comparison.curves)
    return [
        f"At {len(overloads)} of {len(points)} points the measured pivots are extrapolated: pads press them with up to "
        f"{amount(largest, 'load', '.3g')}, the dry tests went to {amount(tested, 'load', '.3g')}."
    ]


def _clearance_sentence(comparison: Comparison) -> list[str]:
    if comparison.clearance is None or comparison.bearing is None:
        return []
    gap = comparison.clearance.clearance - np.array(comparison.bearing.clearances)
    if not np.isfinite(gap).any():
        return []
    pad = np.nanargmax(np.abs(gap))
    digits, unit = 1 if size("length") < 1e-5 else 3, symbol("length")
    mean, median, worst = (signed(v / size("length"), digits) for v in (np.nanmean(gap), np.nanmedian(gap), gap[pad]))
    status = comparison.clearance.status
    remarks = [f"The clearance sweep: {c.detail}." for c in status if c == "probe-gains-differ"]
    inseparable = [c.detail for c in status if c == "pads-not-separable"]
    if inseparable:
        first = f"The measured clearances differ from the drawing by {mean} {unit} on the mean; {inseparable[0]}."
        return [first, *remarks]
    if abs(gap[pad]) < _AS_DRAWN:
        within = amount(abs(gap[pad]), "length", ".1g")
        return [f"The measured clearance is that of the drawing, within {within} at every pad.", *remarks]
    return [
        *remarks,
        f"The measured clearance differs from the drawing by {worst} {unit} at pad #{pad + 1}, where it differs most "
        f"(median of all pads {median} {unit}).",
    ]
