"""Two campaigns of one rig side by side: what differs between them, and by how much more than the intervals allow.

What is common to both cancels: a sensor with the same calibration in both manifests is wrong by the same in both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from rigdata.arrays import FloatArray, IntArray
from rigdata.operating_point import ROTATIONS
from tpjb_ident.columns import amount, place_of, size, spinning, symbol
from tpjb_ident.compare.coefficient_table import partners
from tpjb_ident.conditions import errors_in
from tpjb_ident.rounding import counted, percent, with_interval
from tpjb_ident.runtime.table_reader import read_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, KINDS, POINT_COLUMNS, TANGENT

if TYPE_CHECKING:
    from pathlib import Path

    from rigdata.campaign import Campaign
    from tpjb_ident.compare.static_tests import StaticTests
    from tpjb_ident.results.identification import Identification

#: Set points of both that are the same: share of the load, deg of its direction, share of the frequencies.
_SAME_POINT = (0.002, 0.5, 0.002)
#: A difference within this share of the point's mean direct coefficient (a pad's stiffness, its clearance) is none:
#: twice the tolerance that a model is granted.
_NO_CHANGE = 0.03
#: Loads at which two pivot curves are held against each other.
_PIVOT_LOADS = 5
#: Errors of instruments, which outlast an overhaul; what scatters with the runs or the films does not.
_OF_INSTRUMENTS = ("calibration", "axis", "delay", "mass", "temperature")
_LEVEL = 0.95
#: Columns of a value and its interval.
_ENDS = ("", "_lo", "_hi")
#: Degrees of freedom, by which the quantile that a table's interval was made with is read back.
_FREEDOM = np.geomspace(1.0, 1e6, 400)


@dataclass(frozen=True, repr=False)
class Side:
    """One of the two: tables as they are on disk; from records also how single sensors move its points."""

    name: str
    coefficients: pd.DataFrame
    pivots: pd.DataFrame | None = None
    clearance: pd.DataFrame | None = None
    campaign: Campaign | None = field(repr=False, default=None)
    #: (P, 8) by parameter, N/m: what one standard deviation of an instrument's error does to the points
    sensors: Mapping[str, FloatArray] = field(default_factory=dict)


def measured_side(campaign: Campaign, identification: Identification, static: StaticTests | None) -> Side:
    """A side from records."""
    from tpjb_ident.pivot.tables import pivot_table

    names, changes = identification.calibration_names, identification.calibration_changes
    size = np.sqrt(max(len(changes), 1))
    sensors = {
        name: (row / size).reshape(-1, 8)
        for name, row in zip(names, changes, strict=False)
        if name.partition(":")[0] in _OF_INSTRUMENTS
    }
    pivots = clearance = None
    if static is not None and static.curves:
        pivots = pivot_table(static.curves)
        scales = {curve.pad: curve.relative_calibration for curve in static.curves}
        pivots["relative_calibration"] = pivots["pad"].map(scales)
    if static is not None and static.clearance is not None:
        clearance = static.clearance.to_frame()
    return Side(campaign.id, identification.to_frame(), pivots, clearance, campaign, sensors)


def recorded_side(folder: Path) -> Side:
    """A side from a folder of results, in which nothing says how single sensors move the points."""
    tables = {name: folder / f"{name}.csv" for name in ("coefficients", "pivot_curves", "clearance")}
    frames = {
        name: read_table(path, ("pad",)) for name, path in tables.items() if name != "coefficients" and path.exists()
    }
    coefficients = read_table(tables["coefficients"], (*POINT_COLUMNS, *COEFFICIENT_COLUMNS))
    return Side(folder.name, coefficients, frames.get("pivot_curves"), frames.get("clearance"))


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

    def untrusted_points(self) -> list[str]:
        """Matched points with a flag that forbids trust, in words."""
        untrusted = []
        for row in self.points.to_dict("records"):
            for end, side in (("a", self.a), ("b", self.b)):
                quality = row.get(f"quality_{end}")
                if errors_in(quality):
                    place = place_of(row["static_load_N"], row["excitation_Hz"])
                    untrusted.append(f"{side.name}, {place}: {quality}")
        return untrusted


class _Values(NamedTuple):
    """A quantity of one side at several places (n,): value and interval, and what makes it uncertain."""

    value: FloatArray
    low: FloatArray
    high: FloatArray
    random: FloatArray  #: variance
    systematic: FloatArray | float = 0.0  #: variance from calibration
    freedom: FloatArray | float = np.inf  #: degrees of freedom of the random part


def difference_of(a: Side, b: Side) -> Difference:
    """Hold two sides against each other, B less A."""
    partner = partners(a.coefficients, b.coefficients, _SAME_POINT)
    pairs = np.column_stack([np.flatnonzero(partner >= 0), partner[partner >= 0]])
    shared = tuple(name for name in a.sensors if name in b.sensors and _same_instrument(name, a, b))
    return Difference(
        a,
        b,
        _points(a, b, pairs, shared),
        _pivots(a, b),
        _clearance(a, b),
        shared,
        (*_alone(a, pairs[:, 0]), *_alone(b, pairs[:, 1])),
    )


def _same_instrument(name: str, a: Side, b: Side) -> bool:
    """Whether a parameter's instrument is described alike in both manifests; all of them, where it names no channel."""
    if a.campaign is None or b.campaign is None:
        return False
    channel = name.partition(": ")[2].partition(", ")[0]
    before, after = dict(a.campaign.channels), dict(b.campaign.channels)
    if channel in before:
        return before[channel] == after.get(channel)
    return before == after and a.campaign.housing_mass == b.campaign.housing_mass


def _alone(side: Side, used: IntArray) -> tuple[str, ...]:
    rest = side.coefficients.drop(index=side.coefficients.index[used])
    return tuple(
        f"{side.name}: {amount(row['static_load_N'], 'load')} at {row['static_load_direction_deg']:g}°, "
        f"shaft at {spinning(row['shaft_speed_Hz'])}, {row['excitation_Hz']:g} Hz"
        for row in rest.to_dict("records")
    )


def _points(a: Side, b: Side, pairs: IntArray, shared: Sequence[str]) -> pd.DataFrame:
    left, right = (s.coefficients.iloc[pairs[:, k]].reset_index(drop=True) for k, s in enumerate((a, b)))
    columns: dict[str, Any] = {name: left[name] for name in POINT_COLUMNS}
    columns["rotation"] = left.get("rotation", ROTATIONS[0])  # a table that does not say means the usual one
    for name in ("static_load_measured_N", "quality"):
        if name in left and name in right:
            columns |= {f"{name}_a": left[name], f"{name}_b": right[name]}
    flags = [frame.get("quality", pd.Series("", frame.index)) for frame in (left, right)]
    usable = [not errors_in(f"{a}; {b}") for a, b in zip(*flags, strict=True)]
    per_omega = [1 / (2 * np.pi * frame["excitation_Hz"].to_numpy(float)) for frame in (left, right)]
    for j, name in enumerate(COEFFICIENT_COLUMNS):
        scale = 1.0 if j < 4 else per_omega[0] * per_omega[1]
        common = np.zeros(len(pairs))
        for parameter in shared:
            common += a.sensors[parameter][pairs[:, 0], j] * b.sensors[parameter][pairs[:, 1], j] * scale
        direct = left[[KINDS[name[0]].column(entry) for entry in ("xx", "yy")]].abs().mean(axis=1).to_numpy()
        sides = [_coefficient(frame, name) for frame in (left, right)]
        judged = _judged(name, sides, common, _NO_CHANGE * direct, 8 * len(pairs))
        judged[f"{name[:3]}_changed"] = np.where(usable, judged[f"{name[:3]}_changed"], "cannot tell")
        columns |= judged
    return pd.DataFrame(columns)


def _coefficient(frame: pd.DataFrame, name: str) -> _Values:
    value, low, high = (frame[name + end].to_numpy(float) for end in _ENDS)
    if f"{name}_se_systematic" not in frame:  # of another program: its interval is all that is known
        return _Values(value, low, high, _variance(low, high))
    error, systematic = (frame[f"{name}{ending}"].to_numpy(float) for ending in ("_se", "_se_systematic"))
    with np.errstate(invalid="ignore", divide="ignore"):  # a coefficient that is missing has neither
        quantile = frame[f"{name}_random95"].to_numpy(float) / error
    table = stdtrit(_FREEDOM, 0.5 + 0.5 * _LEVEL)
    freedom = np.interp(-np.nan_to_num(quantile, nan=1.96), -table, _FREEDOM)
    return _Values(value, low, high, error**2, systematic**2, freedom)


def _variance(low: FloatArray, high: FloatArray) -> FloatArray:
    return ((high - low) / (2 * 1.96)) ** 2


def _judged(
    name: str, sides: Sequence[_Values], common: FloatArray | float, none: FloatArray, number: int
) -> dict[str, Any]:
    """Columns of one quantity: both values, their difference, each with its interval, and whether it changed.

    `common` is the covariance of the two. The difference's degrees of freedom are Welch's and Satterthwaite's. Of
    `number` differences that are looked at together one in twenty is beyond its own interval by chance; "yes" holds for
    all of them at once (Bonferroni).
    """
    systematic = sum(side.systematic for side in sides) - 2 * common
    variance = np.asarray(sum(side.random for side in sides) + np.maximum(systematic, 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):  # without scatter there is nothing to count
        freedom = variance**2 / sum(side.random**2 / side.freedom for side in sides)
    freedom = np.clip(np.nan_to_num(freedom, nan=_FREEDOM[-1]), 1.0, _FREEDOM[-1])
    difference = sides[1].value - sides[0].value
    deviation = np.sqrt(variance)
    half = stdtrit(freedom, 0.5 + 0.5 * _LEVEL) * deviation
    sure = stdtrit(freedom, 1 - 0.5 * (1 - _LEVEL) / max(number, 1)) * deviation
    verdict = np.where(np.abs(difference) + half <= none, "no", "cannot tell")
    verdict = np.where(np.abs(difference) > sure, "yes", verdict)
    columns: dict[str, Any] = {}
    shown = (sides[0][:3], sides[1][:3], (difference, difference - half, difference + half))
    for side, ends in zip(("a", "b", "difference"), shown, strict=True):
        columns |= zip((f"{name}_{side}{end}" for end in _ENDS), ends, strict=True)
    return columns | {f"{name.partition('_')[0]}_changed": verdict}


def _pivots(a: Side, b: Side) -> pd.DataFrame:
    """Tangent stiffness of every pad at loads that both curves were measured at."""
    if a.pivots is None or b.pivots is None:
        return pd.DataFrame()
    same = a.campaign is not None and b.campaign is not None and a.campaign.channels == b.campaign.channels
    pads = [pad for pad in a.pivots["pad"].unique() if (b.pivots["pad"] == pad).any()]
    frames = [_pivot(pad, [_measured(s.pivots, pad) for s in (a, b)], same, len(pads) * _PIVOT_LOADS) for pad in pads]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _measured(table: pd.DataFrame | None, pad: float) -> pd.DataFrame:
    assert table is not None
    return table[(table["pad"] == pad) & ~table["extrapolated"].astype(bool) & table["contact_complete"].astype(bool)]


def _pivot(pad: float, curves: Sequence[pd.DataFrame], same: bool, number: int) -> pd.DataFrame:
    low = max(curve["force_N"].min() for curve in curves)
    high = min(curve["force_N"].max() for curve in curves)
    force = np.linspace(low, high, _PIVOT_LOADS) if low < high else np.zeros(0)
    sides = []
    for curve in curves:
        value, low_end, high_end = (np.interp(force, curve["force_N"], curve[TANGENT + end]) for end in _ENDS)
        scale = curve["relative_calibration"].iloc[0] if "relative_calibration" in curve and len(curve) else 0.0
        sides.append(_Values(value, low_end, high_end, _variance(low_end, high_end), (scale * value) ** 2))
    common = np.sqrt(sides[0].systematic * sides[1].systematic) if same else 0.0
    judged = _judged(TANGENT, sides, common, _NO_CHANGE * sides[0].value, number)
    return pd.DataFrame({"pad": pad, "force_N": force, **judged})


def _clearance(a: Side, b: Side) -> pd.DataFrame:
    """Assembled clearance at zero push load of the pads that both have."""
    if a.clearance is None or b.clearance is None:
        return pd.DataFrame()
    name = "clearance_m"
    joined = a.clearance.merge(b.clearance, on="pad", suffixes=("_a", "_b"))
    sides = []
    for side in "ab":
        value, error = (joined[f"{name}{ending}_{side}"].to_numpy(float) for ending in ("", "_se"))
        sides.append(_Values(value, value - 1.96 * error, value + 1.96 * error, error**2))
    judged = _judged(name, sides, 0.0, _NO_CHANGE * sides[0].value, len(joined))
    return pd.DataFrame({"pad": joined["pad"], **judged})


def shown(row: Mapping[Any, Any], name: str, scale: float, side: str = "difference") -> str:
    """A difference, or one side's value, with its interval, for a table or a sentence."""
    value, low, high = (row[f"{name}_{side}{end}"] for end in _ENDS)
    return with_interval(value, low, high, scale)


def verdicts(frame: pd.DataFrame) -> list[str]:
    """All cells that say whether something changed: yes, no or cannot tell."""
    columns = [name for name in frame.columns if str(name).endswith("_changed")]
    return [str(cell) for cell in frame[columns].to_numpy().ravel()]


def difference_sentences(difference: Difference) -> tuple[str, ...]:
    """Say what changed from A to B, the answer first."""
    a, b, points = difference.a.name, difference.b.name, difference.points
    judged = verdicts(points)
    number, yes, no = len(judged), judged.count("yes"), judged.count("no")
    if not number:
        return (f"{a} and {b} have no operating point in common.", *_sentences_beside(difference))
    head = f"From {a} to {b} {yes} of {number} coefficients changed beyond what both intervals allow"
    largest = _largest_change(points)
    rest = f"{no} are the same within {100 * _NO_CHANGE:g} %"
    rest += f", of {number - yes - no} the records cannot tell." if number > yes + no else "."
    return (
        f"{head}, most of all {largest}." if yes else f"{head}.",
        f"At {counted(len(points), 'common operating point')}: {rest}",
        *_sentences_beside(difference),
    )


def _largest_change(points: pd.DataFrame) -> str:
    """The coefficient that changed by the largest share of its point's mean direct one, in words."""
    best, words = 0.0, ""
    for row in points.to_dict("records"):
        for name in COEFFICIENT_COLUMNS:
            kind = KINDS[name[0]]
            direct = 0.5 * sum(abs(row[f"{kind.column(entry)}_a"]) for entry in ("xx", "yy"))
            share = row[f"{name}_difference"] / direct
            if row[f"{name[:3]}_changed"] != "yes" or abs(share) <= best:
                continue
            best = abs(share)
            size = f"{shown(row, name, kind.display_scale)} {kind.display_unit}"
            place = place_of(row["static_load_N"], row["excitation_Hz"])
            words = f"{name[:3]} at {place}: {percent(share)} of the mean direct coefficient ({size})"
    return words


def _sentences_beside(difference: Difference) -> tuple[str, ...]:
    """Pivots, clearances, what cancels, and points without a partner."""
    sentences = []
    for words, frame, name, quantity in (
        ("Pivot stiffness", difference.pivots, TANGENT, "stiffness"),
        ("Clearance", difference.clearance, "clearance_m", "length"),
    ):
        if frame.empty:
            sentences.append(f"{words} is not compared: one of the two has no such tests.")
            continue
        changed = frame[frame[f"{name.partition('_')[0]}_changed"] == "yes"]
        parts = []
        for pad, rows in changed.groupby("pad"):
            row = rows.iloc[-1].to_dict()
            at = f" at {amount(row['force_N'], 'load', '.3g')}" if "force_N" in frame else ""
            parts.append(f"pad #{pad:g} by {shown(row, name, size(quantity))} {symbol(quantity)}{at}")
        sentences.append(
            f"{words} changed: {'; '.join(parts)}." if parts else f"{words}: no pad changed beyond its interval."
        )
    names = ", ".join(name.partition(": ")[2] for name in difference.shared if name.startswith("calibration"))
    if names:
        sentences.append(f"Both state the same calibration of {names}: its errors cancel in the differences.")
    else:
        sentences.append("No calibration is known to be common to both: the intervals hold that of each.")
    if difference.unmatched:
        sentences.append(f"Without a partner: {'; '.join(difference.unmatched)}.")
    return tuple(sentences)
