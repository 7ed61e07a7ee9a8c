"""Two campaigns of one rig side by side: what differs between them, and by how much more than the intervals allow.

What is common to both cancels: a sensor with the same calibration in both manifests is wrong by the same in both.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtridf, stdtrit

from rigdata.arrays import FloatArray, IntArray
from rigdata.campaign import Campaign
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, place_of, size, symbol
from tpjb_ident.compare.coefficient_table import described, partners
from tpjb_ident.compare.static_tests import StaticTests
from tpjb_ident.conditions import errors_in, led_by
from tpjb_ident.results.identification import Identification
from tpjb_ident.rounding import counted, listed, percent, with_interval
from tpjb_ident.runtime.output_folder import former_runs
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, HALF_INTERVAL, KINDS, POINT_COLUMNS, TANGENT

#: Set points of both that are the same: share of the load, deg of its direction, share of the frequencies.
_SAME_POINT = (0.002, 0.5, 0.002)
#: A difference within this share of the point's mean direct coefficient (a pad's stiffness, its clearance) is none:
#: twice the tolerance that a model is granted.
_NO_CHANGE = 0.03
#: Loads at which two pivot curves are held against each other.
_PIVOT_LOADS = 5
#: Errors of instruments, which outlast an overhaul; what scatters with the runs or the films does not.
_OF_INSTRUMENTS = ("calibration", "axis", "delay", "mass", "temperature")
_CLEARANCE = "clearance_m"
_LEVEL = 0.95
#: Columns of a value and its interval.
_ENDS = ("", "_lo", "_hi")
#: Degrees of freedom from which a scatter is known.
_MOST_FREEDOM = 1e6


@dataclass(frozen=True, repr=False)
class Side:
    """One of the two: tables as they are on disk; from records also how single sensors move its points."""

    name: str
    coefficients: pd.DataFrame
    pivots: pd.DataFrame | None = None
    clearance: pd.DataFrame | None = None
    campaign: Campaign | None = None
    #: (P, 8) by parameter, N/m: what one standard deviation of an instrument's error does to the points
    sensors: Mapping[str, FloatArray] = field(default_factory=dict)


def measured_side(campaign: Campaign, identification: Identification | None, static: StaticTests | None) -> Side:
    """A side from records, with an identification where some are dynamic."""
    from tpjb_ident.pivot.tables import pivot_table

    coefficients, sensors = pd.DataFrame(), {}
    if identification is not None:
        coefficients = identification.to_frame()
        changes = identification.calibration_changes / np.sqrt(max(len(identification.calibration_changes), 1))
        for name, moved in zip(identification.calibration_names, changes.reshape(len(changes), -1, 8)):
            if name.partition(":")[0] in _OF_INSTRUMENTS:
                sensors[name] = moved
    pivots = clearance = None
    if static is not None:
        if static.curves:
            pivots = pivot_table(static.curves)
            scales = {curve.pad: curve.relative_calibration for curve in static.curves}
            pivots["relative_calibration"] = pivots["pad"].map(scales)
        if static.clearance is not None:
            clearance = replace(static.clearance, relative_calibration=0.0).to_frame()
    return Side(campaign.id, coefficients, pivots, clearance, campaign, sensors)


def recorded_side(folder: Path) -> Side:
    """A side from a folder of results, in which nothing says how single sensors move the points."""
    coefficients = read_table(folder / "coefficients.csv", (*POINT_COLUMNS, *COEFFICIENT_COLUMNS))
    paths = [folder / f"{name}.csv" for name in ("pivot_curves", "clearance")]
    pivots, clearance = (read_table(path, ("pad",)) if path.exists() else None for path in paths)
    name = folder.name
    for entry in former_runs(folder).values():
        name = str(entry.get("campaign", name))
    return Side(name, coefficients, pivots, clearance)


@dataclass(frozen=True)
class Difference:
    """What differs between two sides; tables as they are written to disk."""

    a: Side
    b: Side
    points: pd.DataFrame  #: difference.csv
    pivots: pd.DataFrame  #: pivot_difference.csv
    clearance: pd.DataFrame  #: clearance_difference.csv
    shared: tuple[str, ...]  #: errors that cancel
    unmatched: tuple[str, ...]  #: points of one side alone, in words

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """Tables that hold anything, by the names of their files."""
        named = {"difference": self.points, "pivot_difference": self.pivots, "clearance_difference": self.clearance}
        return {name: frame for name, frame in named.items() if len(frame)}

    @property
    def doubt(self) -> str:
        """Why it is not to be trusted: no common points, or those with a flag that forbids it; "" where it is."""
        is_static = self.a.coefficients.empty or self.b.coefficients.empty
        if self.points.empty and not (is_static and self.tables):
            return "nothing of the two can be compared."
        flagged = self.points.filter(like="quality_").map(errors_in).astype(bool).any(axis=1)
        bad = described(self.points[flagged])
        count = f"{counted(len(bad), 'point')} with a flag that forbids trust:"
        return "\n".join([count, listed(bad, between="\n")]) if bad else ""


def difference_of(a: Side, b: Side) -> Difference:
    """Hold two sides against each other, B less A."""
    partner = partners(a.coefficients, b.coefficients, _SAME_POINT)
    pairs = np.column_stack([np.flatnonzero(partner >= 0), partner[partner >= 0]])
    shared = tuple(name for name in a.sensors if name in b.sensors and _same_instrument(name, a, b))
    unmatched = (*_alone(a, pairs[:, 0]), *_alone(b, pairs[:, 1]))
    return Difference(a, b, _points(a, b, pairs, shared), _pivots(a, b), _clearance(a, b), shared, unmatched)


def _same_instrument(name: str, a: Side, b: Side) -> bool:
    """Whether a parameter's instrument is described alike in both manifests; all of them, where it names no channel."""
    if a.campaign is None or b.campaign is None:
        return False
    channel = name.partition(": ")[2].partition(", ")[0]
    before, after = dict(a.campaign.channels), dict(b.campaign.channels)
    if channel in before:
        return before[channel] == after.get(channel)
    return before == after and a.campaign.housing_mass == b.campaign.housing_mass


def _alone(side: Side, used: IntArray) -> list[str]:
    alone = side.coefficients.drop(index=side.coefficients.index[used])
    first, *tail = described(alone) or [""]
    return [f"{side.name}: {first}", *tail] if first else []


def _points(a: Side, b: Side, pairs: IntArray, shared: Sequence[str]) -> pd.DataFrame:
    if not len(pairs):
        return pd.DataFrame()
    frame_a = a.coefficients.iloc[pairs[:, 0]].reset_index(drop=True)
    frame_b = b.coefficients.iloc[pairs[:, 1]].reset_index(drop=True)
    columns: dict[str, Any] = {name: frame_a[name] for name in POINT_COLUMNS}
    columns["rotation"] = frame_a.get("rotation", ROTATIONS[0])  # a table that does not say means the usual one
    for name in ("static_load_measured_N", "quality"):
        if name in frame_a and name in frame_b:
            columns |= {f"{name}_a": frame_a[name], f"{name}_b": frame_b[name]}
    common = np.zeros((len(pairs), 8))
    for parameter in shared:
        common += a.sensors[parameter][pairs[:, 0]] * b.sensors[parameter][pairs[:, 1]]
    omega_squared = (2 * np.pi) ** 2 * (frame_a["excitation_Hz"] * frame_b["excitation_Hz"]).to_numpy(float)
    common[:, 4:] /= omega_squared[:, None]
    for j, name in enumerate(COEFFICIENT_COLUMNS):
        column = f"{name}_se_systematic"
        systematic = frame_a.get(column, 0.0) ** 2 + frame_b.get(column, 0.0) ** 2
        none = _NO_CHANGE * _mean_direct(frame_a, name)
        columns |= _judged(name, (frame_a, frame_b), systematic - 2.0 * common[:, j], none, 8 * len(pairs))
    flags = [frame.get("quality", pd.Series("", frame.index)) for frame in (frame_a, frame_b)]
    doubtful = (flags[0] + "; " + flags[1]).map(errors_in).astype(bool)
    table = pd.DataFrame(columns)
    table.loc[doubtful, list(map(changed_column, COEFFICIENT_COLUMNS))] = "cannot tell"
    return table


def _random(frame: pd.DataFrame, name: str) -> tuple[pd.Series, pd.Series | float]:
    """Random variance of a quantity and its degrees of freedom; of a table without them by the interval."""
    if f"{name}_random95" not in frame:
        return (0.5 * (frame[f"{name}_hi"] - frame[f"{name}_lo"]) / HALF_INTERVAL) ** 2, np.inf
    error = frame[f"{name}_se"]
    return error**2, stdtridf(0.5 + 0.5 * _LEVEL, frame[f"{name}_random95"] / error)


def _judged(
    name: str, frames: Sequence[pd.DataFrame], systematic: pd.Series | FloatArray | float, none: pd.Series, number: int
) -> dict[str, Any]:
    """Columns of one quantity: both values, their difference, each with its interval, and whether it changed.

    `systematic`: variance of the difference that is not random; less than none, where intervals hold what both share.
    The degrees of freedom are Welch's and Satterthwaite's. Of `number` differences that are looked at together one in
    twenty is beyond its own interval by chance; "yes" holds for all of them at once (Bonferroni).
    """
    random_a, freedom_a = _random(frames[0], name)
    random_b, freedom_b = _random(frames[1], name)
    variance = np.maximum(random_a + random_b + systematic, 0.0)
    freedom = variance**2 / (random_a**2 / freedom_a + random_b**2 / freedom_b)
    freedom = freedom.fillna(_MOST_FREEDOM).clip(1.0, _MOST_FREEDOM)  # without scatter there is nothing to count
    half = stdtrit(freedom, 0.5 + 0.5 * _LEVEL) * np.sqrt(variance)
    sure = stdtrit(freedom, 1 - 0.5 * (1 - _LEVEL) / max(number, 1)) * np.sqrt(variance)
    columns = {}
    for side, frame in zip("ab", frames, strict=True):
        for end in _ENDS:
            columns[f"{name}_{side}{end}"] = frame[name + end]
    gap = columns[f"{name}_b"] - columns[f"{name}_a"]
    columns |= {f"{name}_difference": gap, f"{name}_difference_lo": gap - half, f"{name}_difference_hi": gap + half}
    verdict = np.where(gap.abs() + half <= none, "no", "cannot tell")
    return columns | {changed_column(name): np.where(gap.abs() > sure, "yes", verdict)}


def changed_column(name: str) -> str:
    """Column that says whether a quantity changed: yes, no or cannot tell."""
    return f"{name.partition('_')[0]}_changed"


def _pivots(a: Side, b: Side) -> pd.DataFrame:
    """Tangent stiffness of every pad at loads that both curves were measured at."""
    if a.pivots is None or b.pivots is None:
        return pd.DataFrame()
    is_one_rig = a.campaign is not None and b.campaign is not None and a.campaign.channels == b.campaign.channels
    curves = []
    for table in (a.pivots, b.pivots):
        sound = ~table["extrapolated"].astype(bool) & table["contact_complete"].astype(bool)
        curves.append(dict(iter(table[sound].groupby("pad"))))
    frames: list[list[pd.DataFrame]] = [[], []]
    for pad in filter(curves[1].__contains__, curves[0]):
        pair = [side[pad] for side in curves]
        low, high = max(curve["force_N"].min() for curve in pair), min(curve["force_N"].max() for curve in pair)
        force = np.linspace(low, high, _PIVOT_LOADS if low < high else 0)
        for curve, tables in zip(pair, frames, strict=True):
            scale = curve["relative_calibration"].iloc[0] if "relative_calibration" in curve else 0.0
            columns = {TANGENT + end: np.interp(force, curve["force_N"], curve[TANGENT + end]) for end in _ENDS}
            columns["systematic"] = scale * columns[TANGENT]
            tables.append(pd.DataFrame({"force_N": force, "pad": pad, **columns}))
    if not frames[0]:
        return pd.DataFrame()
    frame_a, frame_b = (pd.concat(tables, ignore_index=True) for tables in frames)
    before, after = frame_a["systematic"], frame_b["systematic"]
    systematic = -2.0 * before * after if is_one_rig else 0.0  # the intervals hold both
    judged = _judged(TANGENT, (frame_a, frame_b), systematic, _NO_CHANGE * frame_a[TANGENT], len(frame_a))
    return pd.DataFrame({"pad": frame_a["pad"], "force_N": frame_a["force_N"], **judged})


def _clearance(a: Side, b: Side) -> pd.DataFrame:
    """Assembled clearance at zero push load of the pads that both have."""
    if a.clearance is None or b.clearance is None:
        return pd.DataFrame()
    pads = a.clearance[["pad"]].merge(b.clearance[["pad"]])
    frames = []
    for table in (a.clearance, b.clearance):
        frame = pads.merge(table)
        for end, sign in (("_lo", -HALF_INTERVAL), ("_hi", HALF_INTERVAL)):
            frame[_CLEARANCE + end] = frame[_CLEARANCE] + sign * frame[f"{_CLEARANCE}_se"]
        frames.append(frame)
    judged = _judged(_CLEARANCE, frames, 0.0, _NO_CHANGE * frames[0][_CLEARANCE], len(pads))
    return pd.DataFrame({"pad": pads["pad"], **judged})


def _shown(row: Mapping[Any, Any], name: str, scale: float) -> str:
    """A difference with its interval, for a sentence."""
    name = f"{name}_difference"
    return with_interval(row[name], row[f"{name}_lo"], row[f"{name}_hi"], scale)


def difference_sentences(difference: Difference) -> Sequence[str]:
    """Say what changed from A to B, the answer first."""
    a, b, points = difference.a, difference.b, difference.points
    judged = points.filter(like="_changed").to_numpy()
    number, yes, no = judged.size, (judged == "yes").sum(), (judged == "no").sum()
    sentences = []
    if number:
        most = f", most of all {_largest_change(points)}" if yes else ""
        sentences.append(
            f"From {a.name} to {b.name} {yes} of {number} coefficients changed beyond what both intervals allow{most}."
        )
        unsure = f", of {number - yes - no} the records cannot tell" if number > yes + no else ""
        statement = f"{counted(no, 'coefficient')} the same within {100 * _NO_CHANGE:g} %"
        sentences.append(f"At {counted(len(points), 'common operating point')}: {statement}{unsure}.")
    elif not (a.coefficients.empty and b.coefficients.empty):
        sentences.append(f"{a.name} and {b.name} have no operating point in common.")
    return led_by(difference.doubt, (*sentences, *_sentences_beside(difference)))


def _largest_change(points: pd.DataFrame) -> str:
    """The coefficient that changed by the largest share of its point's mean direct one, in words."""
    shares = {}
    for name in COEFFICIENT_COLUMNS:
        share = points[f"{name}_difference"] / _mean_direct(points, name, "_a")
        shares[name] = share.where(points[changed_column(name)] == "yes")
    sizes = pd.DataFrame(shares).abs().to_numpy()
    number, index = np.unravel_index(np.nanargmax(sizes), sizes.shape)
    name, row = COEFFICIENT_COLUMNS[index], points.iloc[number].to_dict()
    kind = KINDS[name[0]]
    size = f"{_shown(row, name, kind.display_scale)} {kind.display_unit}"
    place = place_of(row["static_load_N"], row["excitation_Hz"])
    return f"{name[:3]} at {place}: {percent(shares[name][number])} of the mean direct coefficient ({size})"


def _mean_direct(frame: pd.DataFrame, name: str, side: str = "") -> pd.Series:
    """Mean size of the direct coefficients of a coefficient's kind at every point."""
    columns = [KINDS[name[0]].column(entry) + side for entry in ("xx", "yy")]
    return frame[columns].abs().mean(axis=1)


def _sentences_beside(difference: Difference) -> tuple[str, ...]:
    """Pivots, clearances, what cancels, and points without a partner."""
    sentences = []
    for words, frame, name, quantity in (
        ("Pivot stiffness", difference.pivots, TANGENT, "stiffness"),
        ("Clearance", difference.clearance, _CLEARANCE, "length"),
    ):
        if frame.empty:
            sentences.append(f"{words} is not compared: one of the two has no such tests.")
            continue
        changed = frame[frame[changed_column(name)] == "yes"]
        parts = []
        for pad, rows in changed.groupby("pad"):
            row = rows.iloc[-1].to_dict()
            at = f" at {amount(row['force_N'], 'load', '.3g')}" if "force_N" in frame else ""
            parts.append(f"pad #{pad:g} by {_shown(row, name, size(quantity))} {symbol(quantity)}{at}")
        sentences.append(
            f"{words} changed: {'; '.join(parts)}." if parts else f"{words}: no pad changed beyond its interval."
        )
    names = ", ".join(name.partition(": ")[2] for name in difference.shared if name.startswith("calibration"))
    if names:
        sentences.append(f"Both state the same calibration of {names}: its errors cancel in the differences.")
    elif len(difference.points):
        sentences.append("No calibration is known to be common to both: the intervals hold that of each.")
    if difference.unmatched:
        sentences.append(f"Without a partner: {'; '.join(difference.unmatched)}.")
    return tuple(sentences)
