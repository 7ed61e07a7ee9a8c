"""CSV records: every seed of trouble of the export format, taken or refused with file, line and column."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rigdata
from rigdata.problem import RigDataError
from rigdata.readers.text.cells import MISSING
from tests.manifests import PROBES, SWEEP, manifest, write_files
from tpjb_ident.check.campaign import check_campaign

CLOCK = {"quantity": "time", "unit": "s"}
ROWS = [(0.5 * i, 1.5 + i, -2.25 * i) for i in range(30)]


def make(folder: Path, data: bytes | str, csv: str = "", time: bool = True, clock: dict = CLOCK) -> rigdata.Run:
    text = manifest(PROBES | ({"Zeit": clock} if time else {}), SWEEP, acquisition={"sample_rate": "10 Hz"})
    return rigdata.load_campaign(write_files(folder, text + csv, {"runs/c-1.csv": data})).run("c-1")


def table(delimiter=";", decimal=",", end="\r\n", names=("Zeit", "X1A", "X1B"), tail="", rows=ROWS) -> str:
    lines = [delimiter.join(names)]
    lines += [delimiter.join(f"{v:.4f}".replace(".", decimal) for v in row) + tail for row in rows]
    return end.join(lines) + end


def with_line(number: int, old: str, new: str, text: str) -> str:
    """`text` with another spelling in one of its lines, counted from 1."""
    lines = text.split("\r\n")
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new, 1)
    return "\r\n".join(lines)


def expect_good(run: rigdata.Run, rate: float = 2.0) -> None:
    assert run.length == len(ROWS)
    assert run.sample_rate == pytest.approx(rate)
    record = run.record("X1A")
    assert record.values == pytest.approx([1e-6 * r[1] for r in ROWS])
    assert record.time == pytest.approx([r[0] for r in ROWS])
    vector = run.vector("displacement")
    assert vector.values[:, 1] == pytest.approx([1e-6 * r[2] for r in ROWS], abs=1e-18)


def refused(run: rigdata.Run, *says: str, channel: str = "X1A") -> None:
    with pytest.raises(RigDataError) as caught:
        run.record(channel)
    for part in ("runs/c-1.csv", *says):
        assert part in str(caught.value)


PREAMBLE = "HBM catman; Prüfstand\r\nDatum: 14.03.2019; 09:41\r\n\r\nKanäle;3;X1A\r\n"
WITH_PREAMBLE = PREAMBLE + table().replace("\r\n", "\r\ns;µm;µm\r\n", 1)


@pytest.mark.slow
@pytest.mark.parametrize("decimal", [",", "."])
@pytest.mark.parametrize("end", ["\r\n", "\n", "\r"])
@pytest.mark.parametrize("delimiter", [";", "\t", ",", "|", " "])
def test_delimiters_decimals_line_ends(tmp_path, delimiter, decimal, end):
    if delimiter == decimal:
        pytest.skip("cannot be told apart by anyone")
    expect_good(make(tmp_path, table(delimiter, decimal, end)))


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_encodings_are_detected(tmp_path, encoding):
    expect_good(make(tmp_path, WITH_PREAMBLE.encode(encoding)))


QUOTED = "\n".join(",".join(f'"{v:.4f}"'.replace(".", ",") for v in row) for row in ROWS)
ALIGNED = "\n".join("".join(f"{v:9.3f}" for v in row) for row in ROWS)
COMMENTED = table().replace("\r\n", ";schön, 1\r\n").replace("X1B;schön, 1", "X1B;Bemerkung")
LISTED = "Zeit;X1A;X1B\r\nnone;of;these\r\nare;numbers;yet\r\n" + "x\r\n" * 6
SPELLINGS = {
    "preamble with a channel name": "a;b;c\r\nX1A;X1B;Zeit sind die Kanäle\r\n;;;\r\n" + table(),
    "list of channels above": LISTED + table(),
    "names with units and quotes": table().replace("Zeit;X1A;X1B", '"Zeit [s]";"X1A [µm]";X1B (µm)'),
    "quoted numbers": "Zeit,X1A,X1B\n" + QUOTED + "\n",
    "trailing delimiter in samples": table(tail=";"),
    "trailing delimiter everywhere": table(tail=";", names=("Zeit", "X1A", "X1B", "")),
    "blank last lines": table() + "\r\n\r\n  \r\n",
    "last lines of bare delimiters": table() + ";;\r\n;;\r\n",
    "no end of the last line": table().rstrip(),
    "blanks and plus signs": table().replace(";", " ; ").replace(" ; 1", " ; +1"),
    "aligned columns": "  Zeit      X1A      X1B\n" + ALIGNED + "\n",
    "text in a column that is not described": COMMENTED.encode("cp1252"),
}


@pytest.mark.parametrize("text", SPELLINGS.values(), ids=SPELLINGS)
def test_spellings_that_real_exports_have(tmp_path, text):
    expect_good(make(tmp_path, text))


@pytest.mark.parametrize(("decimal", "marks"), [(".", ",."), (",", ".,")])
@pytest.mark.parametrize(("delimiter", "cell"), [(";", "{}"), (",", '"{}"')])
def test_marks_between_thousands_are_read_beside_a_decimal_mark_else_named(tmp_path, decimal, marks, delimiter, cell):
    lines = ["Zeit;X1A;X1B".replace(";", delimiter)]
    for time, first, second in ROWS:
        numbers = [f"{v:,.3f}".translate(str.maketrans(",.", marks)) for v in (time, 700 * first, 1e5 * second)]
        lines.append(delimiter.join(map(cell.format, numbers)))
    run = make(tmp_path, "\n".join(lines) + "\n")
    assert run.record("X1A").values == pytest.approx([700e-6 * r[1] for r in ROWS])
    assert run.record("X1B").values == pytest.approx([0.1 * r[2] for r in ROWS])
    lines[9] = lines[9].replace(f"{decimal}000", "")
    if marks == ",.":  # 3,500 may be three and a half
        refused(make(tmp_path, "\n".join(lines) + "\n"), "line 10", "thousands have no mark between them")


DIALECT = 'delimiter = ";"\ndecimal = ","\nencoding = "cp1252"\nheader_line = 5\nunits_line = 6'


@pytest.mark.parametrize(
    ("text", "csv"),
    [(WITH_PREAMBLE.encode("cp1252"), DIALECT), (table().encode("utf-8-sig"), 'encoding = "cp1252"')],
    ids=["dialect given by the manifest", "byte order mark against the manifest"],
)
def test_what_the_manifest_says_of_the_dialect(tmp_path, text, csv):
    expect_good(make(tmp_path, text, f"[csv]\n{csv}\n"))


@pytest.mark.parametrize("mark", [m for m in (*MISSING, "1E+99", "1e31", "1e999") if m not in {"*", "?"}])
@pytest.mark.parametrize("blank", ["", " "])
def test_missing_values(tmp_path, mark, blank):
    values = make(tmp_path, with_line(5, "4,5000", blank + mark + blank, table())).record("X1A").values
    assert np.flatnonzero(np.isnan(values)).tolist() == [3]
    assert values[4] == pytest.approx(1e-6 * ROWS[4][1])


def test_time_column_wins_over_the_stated_rate_and_without_one_the_stated_counts(tmp_path):
    assert make(tmp_path, table()).sample_rate == pytest.approx(2.0)
    run = make(tmp_path, table(), time=False)
    assert run.sample_rate == 10.0
    assert run.record("X1A").time[:3] == pytest.approx([0.0, 0.1, 0.2])


def test_jitter_is_used_as_it_is_and_rows_left_out_are_readings_without_a_value(tmp_path):
    times = np.cumsum(np.r_[0.0, np.tile([0.49, 0.51, 0.5], 9), 4.0, 0.5])
    run = make(tmp_path, table(rows=[(float(t), *r[1:]) for t, r in zip(times, ROWS, strict=True)]))
    record = run.record("X1A")
    lost = np.s_[28:35]
    assert np.isnan(record.values[lost]).all()
    assert np.delete(record.time, lost) == pytest.approx(times, abs=1e-4)
    np.testing.assert_allclose(np.delete(record.values, lost), 1e-6 * np.array([r[1] for r in ROWS]), rtol=1e-9)
    assert run.sample_rate == pytest.approx(2.0, rel=0.02)
    assert any("7 of 37 samples have no value" in p.what for p in check_campaign(tmp_path))


def test_rounded_time_column_gives_the_true_rate_and_missing_times_are_filled_in(tmp_path):
    run = make(tmp_path, table(rows=[(round(i / 2000, 3), 1.0 * i, 2.0) for i in range(4000)]))
    assert run.sample_rate == pytest.approx(2000.0, rel=1e-3)
    run = make(tmp_path, with_line(5, "1,5000;", ";", table()))
    assert run.record("X1A").time[3] == pytest.approx(1.5)


@pytest.mark.parametrize(("lost", "place"), [(12, "line 31"), (2, "last line")])  # two: inside the last number
def test_truncated_last_line_is_left_out_with_a_warning(tmp_path, lost, place):
    run = make(tmp_path, table().rstrip()[:-lost])
    assert run.length == len(ROWS) - 1
    (problem,) = run.reader.problems()
    assert problem.severity == "warning"
    assert "cut off" in problem.what
    assert place in problem.place


FOUR_COLUMNS = table(names=("Zeit", "X1A", "X1B", "X1A"), rows=[(*r, 9.0) for r in ROWS])
TWO_TEXTS = with_line(21, ";", ";x", with_line(15, ";", ";abc", PREAMBLE + table()))
OTHERS = table(names=("a", "b", "c"))
CONTRADICTED = ("line 1 with ';' holds 3", "leave it out")


@pytest.mark.parametrize(
    ("text", "csv", "says"),
    [
        (with_line(11, ";-20", "-20", table()), "", ("line 11", "has 2 cells, the names have 3")),
        (with_line(11, ";", ";7;", table()), "", ("line 11", "has 4 cells")),
        (TWO_TEXTS, "", ("line 15, column 2 (X1A)", "'abc", "not a number", "1 more")),
        (table().encode().replace(b"6,5000;", b"\xfcber;"), "", ("line 7, column 2 (X1A)", "'über'")),
        (PREAMBLE + table().replace("5,0000;", "1,0000;"), "", ("line 16, column Zeit", "backwards")),
        (FOUR_COLUMNS, "", ("line 1", "'X1A'", "columns 2, 4")),
        (OTHERS, "", ("no line holds a channel name", "X1A")),
        (table(), 'delimiter = ","', ("delimiter ','", *CONTRADICTED)),
        (table(), 'decimal = "."', ("decimal is '.'", "'0,0000'")),
        (table(), "header_line = 3", ("header_line 3", *CONTRADICTED[:1])),
        (table(), "header_line = 300", ("header_line 300", *CONTRADICTED[:1])),
        (table().encode("utf-16-le"), 'encoding = "utf-16"', ("cannot be read as CSV (", "does not start with BOM)")),
    ],
)
def test_a_fault_is_named_with_line_and_column(tmp_path, text, csv, says):
    refused(make(tmp_path, text, f"[csv]\n{csv}\n" if csv else ""), *says)


def test_missing_channels_are_named_with_the_nearest_column(tmp_path):
    run = make(tmp_path, table(names=("Zeit", "X1A", "X1b")))
    assert run.record("X1A").values[0] == pytest.approx(1.5e-6)
    refused(run, "channel X1B", "missing", "Did you mean 'X1b'", channel="X1B")
    none = make(tmp_path, table(names=("Zeit", "a", "b")), clock={"quantity": "ignore"})
    refused(none, "none of the channels")


EMPTY = [b"", b"\r\n\r\n", b"Zeit;X1A;X1B\r\n", b"Zeit;X1A;X1B\r\ns;um;um\r\n", b"\0" * 5000]
ENDLESS = [b"7" * 3_000_000, table().encode() + b"1;" + b"7" * 9_000_000]


@pytest.mark.parametrize("data", EMPTY + ENDLESS, ids=lambda data: f"{len(data)} bytes")
def test_empty_files_and_lines_of_megabytes_are_refused(tmp_path, data):
    refused(make(tmp_path, data))


@pytest.mark.slow
def test_a_program_that_ends_right_after_a_record_ends_well(tmp_path):
    """Threads that let go of a stream of Python's while the interpreter ends aborted one program in ten."""
    run = make(tmp_path, table())
    no_pandas = "sys.modules['pandas'] = types.SimpleNamespace(__version__='0.1')"  # half of the time
    script = f"import sys, types; {no_pandas}; import rigdata; rigdata.load_campaign(sys.argv[1]).runs[0].record('X1A')"
    command = [sys.executable, "-W", "ignore", "-c", script, str(tmp_path)]
    assert {subprocess.run(command, check=False).returncode for _ in range(20)} == {0}
    assert len(run.record("X1A").values)


def test_vanished_and_unreadable_files_and_a_directory_in_their_place(tmp_path, monkeypatch):
    def no_rights(*_):
        raise PermissionError(13, "Permission denied")

    run = make(tmp_path, table())
    with monkeypatch.context() as patch:
        patch.setattr("rigdata.readers.text.csv.number_blocks", no_rights)
        refused(run, "Permission denied")
    (tmp_path / "runs" / "c-1.csv").unlink()
    refused(run, "not there")
    (tmp_path / "runs" / "c-1.csv").mkdir()
    refused(run, "not an ordinary file")


def test_a_changed_file_is_read_again_and_cached_columns_cannot_be_spoilt(tmp_path):
    run = make(tmp_path, table())
    run.record("X1A").values[:] = 0.0
    assert run.record("X1A").values[0] == pytest.approx(1.5e-6)
    (tmp_path / "runs" / "c-1.csv").write_text(table().replace(";1,5000;", ";7,25000;"))
    assert run.record("X1A").values[0] == pytest.approx(7.25e-6)


def test_slices(tmp_path):
    run = make(tmp_path, table())
    whole, part = run.vector("displacement"), run.vector("displacement", 5, 9)
    assert np.array_equal(part.values, whole.values[5:9])
    assert np.array_equal(part.time, whole.time[5:9])
    assert len(run.record("X1A", -3)) == 3
    assert len(run.record("X1A", 20, 10)) == 0


CELLS = st.one_of(
    st.floats(-1e6, 1e6).map(lambda v: f"{v:.6g}"), st.sampled_from(["", "NaN", "-", "#N/A", "1E+99", "+1", " 2 "])
)


@pytest.mark.slow
@given(
    rows=st.lists(st.tuples(CELLS, CELLS), min_size=1, max_size=20),
    delimiter=st.sampled_from([";", "\t", "|"]),
    comma=st.booleans(),
    end=st.sampled_from(["\n", "\r\n"]),
    preamble=st.lists(st.text(st.characters(codec="cp1252", categories=["L", "N", "P"]), max_size=20), max_size=3),
)
@settings(max_examples=40, deadline=None)
def test_what_is_written_is_read(tmp_path_factory, rows, delimiter, comma, end, preamble):
    """Any mixture of numbers and gaps, in any dialect, comes back; a first row to tell decimals by."""
    rows = [("0.25", "-1.5"), *rows]
    lines = [*(p for p in preamble if "X1" not in p), delimiter.join(["X1A", "X1B"])]
    lines += [delimiter.join(row).replace(".", "," if comma else ".") for row in rows]
    run = make(tmp_path_factory.mktemp("c"), (end.join(lines) + end).encode("cp1252"), time=False)
    for index, name in enumerate(("X1A", "X1B")):
        expected = [float(row[index]) if row[index] not in ("", "-", "#N/A", "1E+99") else np.nan for row in rows]
        assert run.record(name).values == pytest.approx(np.array(expected) * 1e-6, nan_ok=True, rel=1e-12)


def test_decimal_mark_that_shows_late(tmp_path):
    """The head holds whole numbers only."""
    rows = [f"{i};{i};{2 * i}" for i in range(400)] + ["400,5;1,5;2,5"]
    run = make(tmp_path, "Zeit;X1A;X1B\n" + "\n".join(rows) + "\n")
    assert run.record("X1A").values[-1] == pytest.approx(1.5e-6)


def test_long_columns_wait_in_files(tmp_path, monkeypatch):
    monkeypatch.setattr("rigdata.readers.series.IN_MEMORY", 100)
    expect_good(make(tmp_path, table()))
    run = make(tmp_path, table() + ";;\r\n")
    expect_good(run)
    assert isinstance(run.reader._layout().values["X1A"], np.memmap)
