"""Counting what trials of the diagnosis came to."""

import pytest

from tests.studies.evidence.counts import confusion_table, summary_table
from tests.studies.evidence.outcome import outcome
from tests.studies.evidence.shares import upper_bound
from tests.studies.evidence.tables import markdown


@pytest.mark.parametrize(
    ("row", "wanted"),
    [
        ({"kind": "none", "verdict": "named", "found": ("a",)}, "named wrong"),
        ({"verdict": "named", "found": ("a",)}, "named right"),
        ({"verdict": "named", "found": ("b",)}, "named wrong"),
        ({"verdict": "ambiguous", "found": ("b",), "groups": (("b", "a"),)}, "group right"),
        ({"verdict": "ambiguous", "found": ("b",), "groups": (("b", "a", "c", "d"),)}, "large group"),
        ({"verdict": "ambiguous", "found": ("b",), "groups": (("b", "c"),)}, "group wrong"),
        ({"names": ("a", "b"), "verdict": "named", "found": ("b",)}, "part of it"),
        ({"names": ("a", "b"), "verdict": "ambiguous", "found": ("b", "c"), "groups": (("c", "a"),)}, "group right"),
        ({"kind": "left out", "verdict": "ambiguous", "found": ("b",), "groups": (("b", "c"),)}, "group wrong"),
    ],
)
def test_outcomes(row, wanted):
    full = {"kind": "hidden", "names": ("a",), "groups": (), "size": 6.0, "noise": 1.0, "labels": (), **row}
    assert outcome(full) == wanted


def test_tables_count_what_happened():
    rows = [
        {"kind": "hidden", "names": ("a",), "truth": ("a",), "size": 6.0, "noise": 1.0, "groups": (), **r}
        for r in (
            {"verdict": "named", "found": ("a",), "labels": ("a",)},
            {"verdict": "unexplained", "found": (), "labels": ()},
            {"verdict": "unreachable"},
        )
    ]
    (line,) = summary_table(rows).to_dict("records")
    assert (line["trials"], line["right_share"], line["unreachable"], line["errors"]) == (2, 0.5, 1, 0)
    assert list(confusion_table(rows)["said"]) == ["a", "unexplained"]
    assert "| 0.5 |" in markdown(summary_table(rows)[["right_share"]])


def test_upper_bounds_are_clopper_and_pearson():
    assert upper_bound(0, 59) == pytest.approx(0.0495, abs=2e-4)
    assert upper_bound(8, 300) == pytest.approx(0.0476, abs=3e-4)
    assert upper_bound(3, 3) == 1.0
