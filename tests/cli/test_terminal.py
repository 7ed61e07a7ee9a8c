"""Tables fit the terminal; progress without one is a line now and then, with the remaining time once it is known."""

import math
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from rigdata.problem import Problem, gathered
from tests.command_line import ended
from tpjb_ident.cli import terminal
from tpjb_ident.cli.identification import cross_coupling_matters
from tpjb_ident.cli.terminal import MOST_ROWS, Terminal, cell_len, table_lines, with_half, wrapped
from tpjb_ident.columns import Column, words
from tpjb_ident.report.diagnosis_page import next_command
from tpjb_ident.schema import COEFFICIENT_COLUMNS

COLUMNS = ["load kN", "dir. deg", "speed Hz", "exc. Hz", "kxx MN/m", "kyy MN/m", "quality"]
FLAGS = "large-amplitude; mains-on-excitation-line; methods-disagree"
ROW = ["8.75", "-90", "22", "25", "1234.5 ±67.8", "1234.5 ±67.8", FLAGS]


@pytest.mark.parametrize("width", [60, 72, 80, 100, 140])
def test_no_line_is_wider_than_the_terminal(width):
    lines = table_lines(COLUMNS, [ROW, ROW], {6}, width)
    assert max(cell_len(line) for line in lines) <= width
    assert sum("1234.5 ±67.8  1234.5 ±67.8" in line for line in lines) == 2


def test_no_word_is_broken_into_letters():
    text = "\n".join(table_lines(COLUMNS, [ROW], {6}, 80))
    for word in ("large-amplitude", "mains-on-excitation-line", "methods-disagree"):
        assert word in text


def test_words_without_room_stand_below_their_row():
    lines = table_lines(["a" * 30, "b" * 30, "note"], [["1", "2", "some words"]], {2}, 66)
    assert lines[-1] == "    note: some words"


def test_numbers_alone_are_never_cut():
    assert "1" * 100 in "\n".join(table_lines(["n"], [["1" * 100]], (), 40))


def test_wide_letters_count_twice():
    lines = table_lines(["name", "n"], [["温度", "1"], ["temp", "2"]], {0}, 40)
    assert cell_len(lines[-1]) == cell_len(lines[-2]) == cell_len("温度  1")


def test_sentences_break_at_spaces_and_paths_stay_whole():
    path = "/a/" + "b" * 90
    lines = wrapped(f"Results are in {path} and nowhere else", 60)
    assert any(path in line for line in lines)
    assert wrapped("", 60) == [""]


@pytest.mark.parametrize(
    ("value", "half", "says"),
    [
        (32.31, 0.28, "32.3 ±0.3"),
        (1315.2, 11.4, "1315 ±11"),
        (math.nan, math.nan, "no answer"),
        (math.nan, 1.0, "no answer"),
        (0.0, math.nan, "no answer"),
        (0.0, 1.0, "0 ±1"),
        (5.0, math.nan, "5 ±?"),
    ],
)
def test_a_point_without_an_answer_says_so(value, half, says):
    assert with_half(value, half) == says


@pytest.mark.parametrize(("half", "matters"), [(5.0, True), (15.0, False), (math.nan, False)])
def test_cross_coupling_is_shown_when_it_is_beyond_doubt(half, matters):
    values = dict(zip(COEFFICIENT_COLUMNS, (100.0, 20.0, -1.0, 90.0, 500.0, 0.0, 0.0, 500.0), strict=True))
    ends = {
        name + end: value + sign * half for name, value in values.items() for end, sign in (("_lo", -1), ("_hi", 1))
    }
    assert cross_coupling_matters(pd.DataFrame([values | ends])).tolist() == [matters]


def test_notes_of_one_sort_are_counted():
    alike = [Problem("note", f"run{i}.csv", "time", f"the clock has {i} steps", "none", f"r{i}") for i in range(39)]
    error = [Problem("error", f"run{i}.csv", "time", "is empty", "mend it", f"r{i}") for i in range(5)]
    sentences = list(gathered([*error, *alike]))
    assert len(sentences) == 6
    assert "the like 38 more times, such as r1, r2, r3)" in str(sentences[-1])


def test_a_verdict_leads_to_a_command():
    named = SimpleNamespace(effects=("x",), verdict="named")
    consistent = SimpleNamespace(effects=(), verdict="consistent")
    folder, terminal = Path("my rig/o"), Terminal(silent=True)
    terminal.next(*next_command(["k.h5"], named, folder))
    assert terminal.following == "tpjb compare k.h5 --effects 'my rig/o/updated.effects.toml'"
    terminal.next(*next_command(["k.h5", "--bearing", "b.toml"], consistent, folder))
    assert terminal.following == "tpjb export 'my rig/o' --to ross"


@pytest.mark.parametrize("file", ["", "coefficients.csv"])
def test_a_long_table_ends_with_the_file_that_has_all_of_it(capsys, file):
    rows = [[f"row {i}", str(i)] for i in range(MOST_ROWS + 25)]
    terminal = Terminal()
    terminal.show("points", [*words("name"), Column("value")], rows, file=file)
    printed = capsys.readouterr().out
    assert ("row 64" in printed) is (file == "")
    assert ("25 more rows: coefficients.csv has all 65" in printed) is (file != "")
    assert f"row {MOST_ROWS - 1}" in printed
    assert terminal.tables[-1]["rows"] == rows  # --json repeats every row
    terminal.show("points", [*words("name"), Column("value")], rows[:MOST_ROWS], file="coefficients.csv")
    assert "more rows" not in capsys.readouterr().out


#: Looks at a step: seconds, what is done of how many, and the line that is printed.
LOOKS = {
    "what is quickly done says nothing": [(done, done, 20, "") for done in range(1, 20)],
    "time left is told from the speed of this step": [
        (0.0, 0, 1000, ""),
        (40.0, 100, 1000, "100 of 1000, about 6 min left"),
        (400.0, 0, 100, ""),
        (440.0, 80, 100, "80 of 100, about 10 s left"),
    ],
    "the first of many foretells nothing": [(0.0, 0, 334, ""), (100.0, 1, 334, "1 of 334")],
    "what the first one had to compile is not foretold of the rest": [
        (0.0, 0, 14, ""),
        (60.0, 1, 14, "1 of 14"),
        (92.0, 5, 14, "5 of 14, about 1 min left"),
    ],
}


@pytest.mark.parametrize("looks", LOOKS.values(), ids=LOOKS)
def test_progress_is_a_line_now_and_then(looks, monkeypatch):
    clock, printed = [0.0], []
    monkeypatch.setattr(terminal.time, "monotonic", lambda: clock[0])
    progress = terminal.ProgressLines("identifying", printed.append)
    for seconds, done, total, says in looks:
        clock[0], before = seconds, len(printed)
        progress.show("d-1", done, total)
        assert printed[before:] == ([f"identifying: {says} (d-1)"] if says else [])


@pytest.mark.slow
def test_a_check_tells_how_many_runs_it_has_read(small_campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(terminal, "LINE_EVERY", 0.0)
    result = ended(0, "check", small_campaign, "--out", tmp_path / "out")
    assert "tpjb: doing: reading small.h5: 9 of 10" in result.stderr


def test_what_is_printed_fits_80_columns_in_a_pipe(capsys):
    c = Terminal()
    c.print("a sentence of many words " * 8)
    columns = ["load kN", "dir. deg", "speed Hz", "exc. Hz", *(Column(f"c{entry} kN s/m") for entry in "abcd"), "out %"]
    rows = [[str(load), "-90", "22", "25", *4 * ["12345.6 ±123.4"], "0"] for load in (3, 6)]
    c.show("a table that is wider than a page", columns, rows)
    c.next("check", "a folder")
    c.close()
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert any("dir. deg -90; speed Hz 22" in line for line in lines)  # what is the same in all rows is said once
    assert lines[-1] == "Next: tpjb check 'a folder'"


def test_what_is_the_same_in_every_row_is_told_once_though_two_columns_have_it(capsys):
    columns = [*words("pad"), Column("load"), Column("of the formula"), Column("of the formula"), *words("remark")]
    Terminal().show("pads", columns, [["#1", 1.0, 2.0, 2.0, "x" * 60], ["#2", 1.5, 2.0, 2.0, "x" * 60]])
    assert capsys.readouterr().out.replace("\n  ", " ").count("of the formula 2") == 1


def test_numbers_that_have_no_room_are_below_their_row(capsys):
    c = Terminal()
    columns = ["load kN", *(Column(f"c{entry} kN s/m") for entry in "abcdef"), *words("verdict")]
    rows = [[str(load), *5 * [f"{load}2345.6 ±123.4"], last, "refused"] for load, last in ((3, "-"), (6, "6.5 ±1"))]
    c.show("a table", columns, rows)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[-2] == "    ce kN s/m: 62345.6 ±123.4; cf kN s/m: 6.5 ±1; verdict: refused"
    assert not any("cf kN s/m: -" in line for line in lines)
