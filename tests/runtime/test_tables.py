"""Tables on disk: whole or not at all, no formula for a spreadsheet."""

import pandas as pd
import pytest

from tpjb_ident.runtime.tables import printable, write_atomic, write_table


def test_csv_and_parquet_hold_the_same_numbers_to_the_last_bit(tmp_path):
    frame = pd.DataFrame(
        {"a_m": [1 / 3, 1e-9, float("nan")], "n": [1, 2, 3], "ok": [True, False, True], "s": list("xyz")}
    )
    csv, parquet = write_table(tmp_path, "t", frame)
    pd.testing.assert_frame_equal(pd.read_csv(csv), frame, check_exact=True, check_dtype=False)
    pd.testing.assert_frame_equal(pd.read_parquet(parquet), frame, check_exact=True, check_dtype=False)
    assert b"\r" not in csv.read_bytes()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_atomic(path, fail)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_printable_keeps_words_and_drops_what_steers():
    assert printable("µm ± °C 日本") == "µm ± °C 日本"
    assert printable("a\x1b[2Jb\u202ec\x00") == "a\ufffd[2Jb\ufffdc\ufffd"
