"""CSV records: every seed of trouble of the export format, taken or refused with file, line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rigdata
from rigdata.problem import RigDataError
from rigdata.readers.file_reader import ReadingCache
from rigdata.readers.text.cells import MISSING
from tests.manifests import PROBES, SWEEP, manifest
from tpjb_ident.check.campaign import check_campaign

CLOCK = {"quantity": "time", "unit": "s"}
ROWS = [(0.5 * i, 1.5 + i, -2.25 * i) for i in range(30)]


def make(folder: Path, data: bytes | str, csv: str = "", time: bool = True, clock: dict = CLOCK) -> rigdata.Run:
    (folder / "runs").mkdir(exist_ok=True)
    (folder / "b.toml").write_text('name = "b"\n')
    text = manifest(PROBES | ({"Zeit": clock} if time else {}), SWEEP, acquisition={"sample_rate": "10 Hz"})
    (folder / "campaign.toml").write_text(text + csv)
    (folder / "runs" / "c-1.csv").write_bytes(data if isinstance(data, bytes) else data.encode())
    return rigdata.load_campaign(folder).run("c-1")


def table(delimiter=";", decimal=",", end="\r\n", names=("Zeit", "X1A", "X1B"), tail="", rows=ROWS) -> str:
    lines = [delimiter.join(names)]
    lines += [delimiter.join(f"{v:.4f}".replace(".", decimal) for v in row) + tail for row in rows]
    return end.join(lines) + end


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
    text = str(caught.value)
    for part in ("runs/c-1.csv", *says):
        assert part in text, text


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


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("a;b;c\r\nX1A;X1B;Zeit sind die Kanäle\r\n;;;\r\n" + table(), id="preamble with a channel name"),
        pytest.param(
            "Zeit;X1A;X1B\r\nnone;of;these\r\nare;numbers;yet\r\n" + "x\r\n" * 6 + table(), id="list of channels above"
        ),
        pytest.param(
            table().replace("Zeit;X1A;X1B", '"Zeit [s]";"X1A [µm]";X1B (µm)'), id="names with units and quotes"
        ),
        pytest.param("Zeit,X1A,X1B\n" + QUOTED + "\n", id="quoted numbers"),
        pytest.param(table(tail=";"), id="trailing delimiter in samples"),
        pytest.param(table(tail=";", names=("Zeit", "X1A", "X1B", "")), id="trailing delimiter everywhere"),
        pytest.param(table() + "\r\n\r\n  \r\n", id="blank last lines"),
        pytest.param(table() + ";;\r\n;;\r\n", id="last lines of bare delimiters"),
        pytest.param(table().rstrip(), id="no end of the last line"),
        pytest.param(table().replace(";", " ; ").replace(" ; 1", " ; +1"), id="blanks and plus signs"),
        pytest.param("  Zeit      X1A      X1B\n" + ALIGNED + "\n", id="aligned columns"),
        pytest.param(
            (table().replace("\r\n", ";schön, 1\r\n").replace("X1B;schön, 1", "X1B;Bemerkung")).encode("cp1252"),
            id="text in a column that is not described",
        ),
    ],
)
def test_spellings_that_real_exports_have(tmp_path, text):
    expect_good(make(tmp_path, text))


DIALECT = 'delimiter = ";"\ndecimal = ","\nencoding = "cp1252"\nheader_line = 5\nunits_line = 6'


@pytest.mark.parametrize(
    ("text", "csv"),
    [
        pytest.param(WITH_PREAMBLE.encode("cp1252"), DIALECT, id="dialect given by the manifest"),
        pytest.param(table().encode("utf-8-sig"), 'encoding = "cp1252"', id="byte order mark against the manifest"),
    ],
)
def test_what_the_manifest_says_of_the_dialect(tmp_path, text, csv):
    expect_good(make(tmp_path, text, f"[csv]\n{csv}\n"))


@pytest.mark.parametrize("mark", [m for m in MISSING if m not in {"*", "?"}])
@pytest.mark.parametrize("blank", ["", " "])
def test_missing_values(tmp_path, mark, blank):
    lines = table().split("\r\n")
    cells = lines[4].split(";")
    lines[4] = ";".join([cells[0], blank + mark + blank, cells[2]])
    values = make(tmp_path, "\r\n".join(lines)).record("X1A").values
    assert np.flatnonzero(np.isnan(values)).tolist() == [3]
    assert values[4] == pytest.approx(1e-6 * ROWS[4][1])


def test_overflow_number_is_missing(tmp_path):
    assert np.isnan(make(tmp_path, table().replace("3,5000", "1E+99")).record("X1A").values[2])


def test_time_column_wins_over_the_stated_rate_and_without_one_the_stated_counts(tmp_path):
    assert make(tmp_path, table()).sample_rate == pytest.approx(2.0)
    run = make(tmp_path, table(), time=False)
    assert run.sample_rate == 10.0
    assert run.record("X1A").time[:3] == pytest.approx([0.0, 0.1, 0.2])


def test_jitter_and_gaps_are_used_as_they_are(tmp_path):
    times = np.cumsum(np.r_[0.0, np.tile([0.49, 0.51, 0.5], 9), 4.0, 0.5])
    rows = [(float(t), *r[1:]) for t, r in zip(times, ROWS, strict=True)]
    run = make(tmp_path, table(rows=rows))
    assert run.record("X1A").time == pytest.approx(times, abs=1e-4)
    assert run.sample_rate == pytest.approx(2.0, rel=0.02)
    found = [p.what for p in check_campaign(tmp_path)]
    assert any("1 gaps, about 7 samples lost" in w for w in found)


def test_rounded_time_column_gives_the_true_rate(tmp_path):
    rows = [(round(i / 2000, 3), 1.0 * i, 2.0) for i in range(4000)]
    run = make(tmp_path, table(rows=rows))
    assert run.sample_rate == pytest.approx(2000.0, rel=1e-3)


def test_missing_times_are_filled_in(tmp_path):
    lines = table().split("\r\n")
    lines[4] = ";" + lines[4].partition(";")[2]
    assert make(tmp_path, "\r\n".join(lines)).record("X1A").time[3] == pytest.approx(1.5)


@pytest.mark.parametrize(("lost", "place"), [(12, "line 31"), (2, "last line")])  # two: inside the last number
def test_truncated_last_line_is_left_out_with_a_warning(tmp_path, lost, place):
    run = make(tmp_path, table().rstrip()[:-lost])
    assert run.length == len(ROWS) - 1
    (problem,) = run.reader.problems()
    assert problem.severity == "warning"
    assert "cut off" in problem.what
    assert place in problem.place


def with_line(number: int, old: str, new: str, text: str) -> str:
    """`text` with another spelling in one of its lines, counted from 1."""
    lines = text.split("\r\n")
    assert old in lines[number - 1]
    lines[number - 1] = lines[number - 1].replace(old, new, 1)
    return "\r\n".join(lines)


FOUR_COLUMNS = table(names=("Zeit", "X1A", "X1B", "X1A"), rows=[(*r, 9.0) for r in ROWS])
TWO_TEXTS = with_line(21, ";", ";x", with_line(15, ";", ";abc", PREAMBLE + table()))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (with_line(11, ";-20", "-20", table()), ("line 11", "has 2 cells, the names have 3")),
        (with_line(11, ";", ";7;", table()), ("line 11", "has 4 cells")),
        (TWO_TEXTS, ("line 15, column 2 (X1A)", "'abc", "not a number", "1 more")),
        (table().encode().replace(b"6,5000;", b"\xfcber;"), ("line 7, column 2 (X1A)", "'über'")),
        (PREAMBLE + table().replace("5,0000;", "1,0000;"), ("line 16, column Zeit", "backwards")),
        (FOUR_COLUMNS, ("line 1", "'X1A'", "columns 2, 4")),
        (table(names=("a", "b", "c")), ("no line holds a channel name", "X1A")),
    ],
)
def test_a_fault_is_named_with_line_and_column(tmp_path, text, says):
    refused(make(tmp_path, text), *says)


def test_missing_channel_names_the_nearest_column(tmp_path):
    run = make(tmp_path, table(names=("Zeit", "X1A", "X1b")))
    assert run.record("X1A").values[0] == pytest.approx(1.5e-6)
    refused(run, "channel X1B", "missing", "Did you mean 'X1b'", channel="X1B")


@pytest.mark.parametrize(
    ("encoding", "csv", "says"),
    [
        ("utf-8", 'delimiter = ","', ["delimiter ','", "line 1 with ';' holds 3", "leave it out"]),
        ("utf-8", 'decimal = "."', ["decimal is '.'", "'0,0000'"]),
        ("utf-8", "header_line = 3", ["header_line 3", "line 1 with ';' holds 3"]),
        ("utf-8", "header_line = 300", ["header_line 300", "line 1 with ';' holds 3"]),
        ("utf-16-le", 'encoding = "utf-16"', ["cannot be read as CSV (", "does not start with BOM)"]),
    ],
)
def test_a_manifest_that_contradicts_the_file(tmp_path, encoding, csv, says):
    refused(make(tmp_path, table().encode(encoding), f"[csv]\n{csv}\n"), *says)


EMPTY = [b"", b"\r\n\r\n", b"Zeit;X1A;X1B\r\n", b"Zeit;X1A;X1B\r\ns;um;um\r\n", b"\0" * 5000]
ENDLESS = [b"7" * 3_000_000, table().encode() + b"1;" + b"7" * 9_000_000]


@pytest.mark.parametrize("data", EMPTY + ENDLESS, ids=lambda data: f"{len(data)} bytes")
def test_empty_files_and_lines_of_megabytes_are_refused(tmp_path, data):
    refused(make(tmp_path, data))


def test_vanished_file_and_directory_in_its_place(tmp_path):
    run = make(tmp_path, table())
    (tmp_path / "runs" / "c-1.csv").unlink()
    refused(run, "not there")
    (tmp_path / "runs" / "c-1.csv").mkdir()
    refused(run, "not an ordinary file")


def test_changed_file_is_read_again(tmp_path):
    run = make(tmp_path, table())
    assert run.record("X1A").values[0] == pytest.approx(1.5e-6)
    (tmp_path / "runs" / "c-1.csv").write_text(table().replace(";1,5000;", ";7,25000;"))
    assert run.record("X1A").values[0] == pytest.approx(7.25e-6)


def test_slices(tmp_path):
    run = make(tmp_path, table())
    whole = run.vector("displacement")
    part = run.vector("displacement", 5, 9)
    assert np.array_equal(part.values, whole.values[5:9])
    assert np.array_equal(part.time, whole.time[5:9])
    assert len(run.record("X1A", -3)) == 3
    assert len(run.record("X1A", 20, 10)) == 0


def test_cached_columns_cannot_be_spoilt(tmp_path):
    run = make(tmp_path, table())
    run.record("X1A").values[:] = 0.0
    assert run.record("X1A").values[0] == pytest.approx(1.5e-6)


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
    folder = tmp_path_factory.mktemp("c")
    run = make(folder, (end.join(lines) + end).encode("cp1252"), time=False)
    for index, name in enumerate(("X1A", "X1B")):
        expected = [_number(row[index]) for row in rows]
        assert run.record(name).values == pytest.approx(np.array(expected) * 1e-6, nan_ok=True, rel=1e-12)


def _number(cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        return float("nan")
    return value if abs(value) < 1e30 else float("nan")


@pytest.mark.slow
@given(st.binary(max_size=400))
@settings(max_examples=40, deadline=None)
def test_any_bytes_are_read_or_refused(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("b")
    run = make(folder, b"X1A;X1B\n1,5;2\n2,5;3\n" + data, time=False)
    try:
        assert run.record("X1A").values.dtype == np.float64
    except RigDataError as caught:
        complete = all(p.cure and p.file for p in caught.problems)
        assert complete
    assert isinstance(check_campaign(folder), list)


def test_decimal_mark_that_shows_late(tmp_path):
    """The head holds whole numbers only."""
    rows = [f"{i};{i};{2 * i}" for i in range(400)] + ["400,5;1,5;2,5"]
    run = make(tmp_path, "Zeit;X1A;X1B\n" + "\n".join(rows) + "\n")
    assert run.record("X1A").values[-1] == pytest.approx(1.5e-6)


def test_file_with_none_of_the_used_channels(tmp_path):
    text = table(names=("Zeit", "a", "b"))
    refused(make(tmp_path, text, clock={"quantity": "ignore"}), "none of the channels")


def test_long_columns_wait_in_files(tmp_path, monkeypatch):
    monkeypatch.setattr("rigdata.readers.series.IN_MEMORY", 100)
    expect_good(make(tmp_path, table()))
    run = make(tmp_path, table() + ";;\r\n")
    expect_good(run)
    assert isinstance(run.reader._layout().values["X1A"], np.memmap)


def test_a_cache_lets_go_of_old_runs():
    cache = ReadingCache(limit=2000)
    made = []
    for i in [0, 1, 2, 3, 4, 4, 3, 0]:
        cache.get((i,), lambda i=i: made.append(i) or np.zeros(100))
    assert made == [0, 1, 2, 3, 4, 0]


def test_unreadable_file(tmp_path, monkeypatch):
    run = make(tmp_path, table())

    def no_rights(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("rigdata.readers.text.csv.open_numbers", no_rights)
    refused(run, "Permission denied")
