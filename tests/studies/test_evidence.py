"""Evidence: rows of trials into tables, figures and a page."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.studies.evidence.case import case_residuals, case_table
from tests.studies.evidence.counts import abstention_table, confusion_matrix, impostors_table, plans_table
from tests.studies.evidence.measures import closure_table, coverage_table, p_value_table, power_table, rules_table
from tests.studies.evidence.next_tests import next_test_pairs, next_test_table, separations
from tests.studies.evidence.rows import RowsError, read_rows, write_rows
from tests.studies.evidence.shares import share_interval
from tests.studies.evidence.tables import evidence_tables
from tests.studies.evidence_cases import row, rows

ROCKER = Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml"


def only(frame, **wanted):
    """The one line of a table that has these values."""
    mine = frame[np.logical_and.reduce([frame[k] == v for k, v in wanted.items()])]
    (line,) = mine.to_dict("records")
    return line


def test_rows_survive_their_file(tmp_path):
    file = tmp_path / "rows.jsonl"
    write_rows(file, rows())
    assert read_rows([file]) == rows()


def test_a_torn_last_line_is_no_row_and_the_last_of_two_counts(tmp_path):
    file = tmp_path / "rows.jsonl"
    write_rows(file, [row(said="consistent"), row(), row(number=1)])
    with file.open("a", encoding="utf-8") as out:
        out.write('{"kind": "hid')
    assert [r["verdict"] for r in read_rows([file])] == ["named", "named"]


def test_rows_of_an_evaluation_that_still_runs_are_read(tmp_path):
    file = tmp_path / "kept.jsonl"
    file.write_text(json.dumps({"code": "0", "key": "1", "row": row()}) + "\n", encoding="utf-8")
    assert read_rows([file]) == [row()]


@pytest.mark.parametrize(
    ("text", "said"),
    [("", "holds no trials"), ('{"a": 1}\n', "line 1: no trial"), ("no\n{}\n", "line 1: no JSON"), ("[]\n", "lacks")],
)
def test_files_that_hold_no_rows_are_refused(tmp_path, text, said):
    file = tmp_path / "rows.jsonl"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RowsError, match=said):
        read_rows([file])


def test_exact_binomial_intervals():
    # Clopper and Pearson's own example: 10 trials
    assert share_interval(0, 10) == pytest.approx((0.0, 0.0, 0.3085), abs=1e-4)
    assert share_interval(3, 10) == pytest.approx((0.3, 0.0667, 0.6525), abs=1e-4)
    assert share_interval(10, 10)[1:] == pytest.approx((0.6915, 1.0), abs=1e-4)
    assert math.isnan(share_interval(0, 0)[0])


def test_power_counts_both_noises_together_and_apart():
    table = power_table(rows())
    both, one = (only(table, rung="surrogate", size_sigma=6.0, noise_factor=n) for n in ("all", "1"))
    assert (both["trials"], one["trials"]) == (11, 10)
    assert both["detected"] == pytest.approx(9 / 11)
    assert both["named_right"] == pytest.approx(7 / 11)
    assert both["right"] == pytest.approx(8 / 11)
    assert both["named_wrong"] == pytest.approx(1 / 11)  # the other pad
    assert both["right_lo"] < both["right"] < both["right_hi"]


def test_confusion_keeps_another_pad_apart_and_sums_to_what_was_tried():
    matrix = confusion_matrix(rows(), size=6.0)
    line = only(matrix, hidden="soft_pivot")
    assert (line["soft_pivot"], line["other pad or direction"], line["group holds it"]) == (7, 1, 1)
    assert matrix.drop(columns="hidden").to_numpy().sum() == 11
    lacking = only(confusion_matrix(rows(), "left out"), hidden="soft_pivot")
    assert (lacking["channel_delay"], lacking["group without it"], lacking["unexplained"]) == (2, 1, 5)


def test_abstention_and_impostors_of_what_was_left_out():
    line = only(abstention_table(rows()), size_sigma=12.0)
    assert line["abstained_share"] == pytest.approx(6 / 8)
    first = impostors_table(rows()).iloc[0]
    assert (first["left_out"], first["impostor"], first["count"]) == ("soft_pivot pad 5", "channel_delay", 2)


def test_coverage_is_counted_by_size_and_by_effect():
    table = coverage_table(rows())
    assert only(table, effect="all, d' = 6, surrogate")["share"] == pytest.approx(6 / 7)
    assert only(table, effect="all, d' = 6 and more")["intervals"] == 7 + 9 + 3 + 4
    assert only(table, effect="oil_viscosity")["hold_truth"] == 3


def test_closure_stands_beside_its_controls():
    table = closure_table(rows())
    line = only(table, rung="surrogate", size_sigma=6.0, closed_by="best wrong effect")
    assert line["median"] == 0.3
    placebo = only(table, closed_by="placebo: fall per point")
    assert (placebo["campaigns"], placebo["median"]) == (21, pytest.approx(0.02))


def test_p_values_of_no_effect_and_simple_rules():
    assert only(p_value_table(rows()), rung="surrogate")["below_0.01"] == pytest.approx(1 / 21)
    rule = only(rules_table(rows()), kind="hidden", size_sigma=6.0, rule="largest score")
    assert (rule["right_share"], rule["trials"]) == (1.0, 6)
    assert only(rules_table(rows()), kind="none", rule="BIC")["none_share"] == 1.0


def test_next_tests_are_counted_where_a_test_followed():
    table = next_test_table(rows())
    a = only(table, data_set="A", size_sigma="all")
    assert (a["ambiguous_campaigns"], a["settled"], a["settled_by_random"]) == (2, 1.0, 0.5)
    assert (a["expected"], a["achieved"]) == (8.5, 8.0)
    d = only(table, data_set="D", size_sigma="6")
    assert (d["ambiguous_campaigns"], d["settled"], d["named_wrong"]) == (1, 0.0, 0.0)
    pair = only(next_test_pairs(rows()), data_set="A")
    assert (pair["confused_with"], pair["next_test"], pair["settled"]) == ("channel_delay", "a locus and a dry test", 2)
    assert separations(rows())["random"][0] == (2.0, -1.0)


def test_a_case_is_told_entry_by_entry():
    table = case_table(rows())
    assert only(table, observable="kyy")["baseline"] == 9.0
    assert len(case_residuals(rows())) == 8
    assert not len(case_table([row()]))


def test_plans_are_told_apart():
    table = plans_table(rows())
    assert only(table, plan="no locus")["other"] == 2
    assert only(table, plan="paper")["consistent"] == 3


def test_a_table_without_a_line_is_left_out():
    assert set(evidence_tables([row("none", "consistent", p_before=0.5)])) == {"summary", "p_values"}
