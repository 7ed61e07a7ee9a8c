"""Next tests: how often the suggested one settles what a campaign could not tell, beside one picked blindly."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tests.studies.evidence.outcome import Row
from tests.studies.evidence.shares import quantiles, share_interval

if TYPE_CHECKING:
    import pandas as pd

KIND = "next test"


def followed(rows: Sequence[Row]) -> list[Row]:
    """Rows of campaigns that were followed by a test."""
    return [row for row in rows if row["kind"] == KIND and "then_tests" in row]


def next_test_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Shares settled by the suggested test and by a random one, per data set and size, with 95 % intervals.

    ``expected`` and ``achieved`` are separations of campaign and test together, in standard deviations: as foretold,
    and as the root of the chi-square by which the truth beats its rival; medians over campaigns.
    """
    import pandas as pd

    mine = followed(rows)
    cells = sorted({(r["data_set"], f"{r['size']:g}") for r in mine}, key=lambda c: (c[0], float(c[1])))
    cells += [(name, "all") for name in sorted({r["data_set"] for r in mine})]
    out = []
    for data_set, size in sorted(cells, key=lambda c: (c[0], c[1] == "all")):
        part = [r for r in mine if r["data_set"] == data_set and size in {"all", f"{r['size']:g}"}]
        out.append({"data_set": data_set, "size_sigma": size, **_settled(part)})
    return pd.DataFrame(out)


def _settled(part: Sequence[Row]) -> dict[str, Any]:
    share, low, high = share_interval(sum(bool(r["then_settled"]) for r in part), len(part))
    blind, blind_low, blind_high = share_interval(sum(bool(r["random_settled"]) for r in part), len(part))
    return {
        "ambiguous_campaigns": len(part), "settled": share, "settled_lo": low, "settled_hi": high,
        "named_wrong": _wrong(part), "settled_expected": sum(float(r["then_chance"]) for r in part) / len(part),
        "settled_by_random": blind, "random_lo": blind_low, "random_hi": blind_high,
        "apart_now": _median(part, "apart_now"), "expected": _median(part, "then_expected"),
        "achieved": _median(part, "then_achieved"), "achieved_by_random": _median(part, "random_achieved"),
    }  # fmt: skip


def _wrong(part: Sequence[Row]) -> float:
    """Share of campaigns after whose test something else is named."""
    return sum(r["then_verdict"] == "named" and not r["then_settled"] for r in part) / len(part)


def _median(part: Sequence[Row], key: str) -> float:
    return quantiles([r[key] for r in part], (0.5,))[0]


def next_test_pairs(rows: Sequence[Row]) -> pd.DataFrame:
    """One line per data set, hidden effect and what it was confused with: the usual test and what came of it."""
    import pandas as pd

    pairs: dict[tuple[str, str, str], list[Row]] = {}
    for row in followed(rows):
        pairs.setdefault((row["data_set"], row["truth"][0], _other(row)), []).append(row)
    out = []
    for (data_set, truth, other), part in sorted(pairs.items()):
        words, _ = Counter(" and ".join(r["then_tests"]) for r in part).most_common(1)[0]
        out.append(
            {
                "data_set": data_set, "hidden": truth, "confused_with": other, "campaigns": len(part),
                "next_test": words, "apart_now": _median(part, "apart_now"), "expected": _median(part, "then_expected"),
                "achieved": _median(part, "then_achieved"), "settled": sum(bool(r["then_settled"]) for r in part),
                "settled_by_random": sum(bool(r["random_settled"]) for r in part),
            }
        )  # fmt: skip
    return pd.DataFrame(out)


def _other(row: Row) -> str:
    """The explanation that stood beside the truth."""
    return str(row["rival"] if row["model"] == row["truth"][0] else row["model"])


def separations(rows: Sequence[Row]) -> dict[str, list[tuple[float, float]]]:
    """Expected and achieved separation of every campaign that has both, by how the test was chosen."""
    out: dict[str, list[tuple[float, float]]] = {"suggested": [], "random": []}
    for row in followed(rows):
        for name, prefix in (("suggested", "then_"), ("random", "random_")):
            pair = float(row[f"{prefix}expected"]), float(row[f"{prefix}achieved"])
            if all(map(math.isfinite, pair)):
                out[name].append(pair)
    return {name: pairs for name, pairs in out.items() if pairs}
