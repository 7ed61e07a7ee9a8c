"""Tables at the terminal: what stands in a file is not printed without end."""

from __future__ import annotations

import pytest

from tpjb_ident.cli.common import terminal as show
from tpjb_ident.cli.common.output import command_output

ROWS = [[f"row {i}", str(i)] for i in range(show.MOST_ROWS + 25)]


@pytest.mark.parametrize("whole", ["", "coefficients.csv"])
def test_a_long_table_ends_with_the_file_that_has_all_of_it(capsys, whole):
    show.table("points", ["name", "value"], ROWS, whole=whole)
    told = capsys.readouterr().out
    assert ("row 64" in told) is (whole == "")
    assert ("25 more rows: coefficients.csv has all 65" in told) is (whole != "")
    assert f"row {show.MOST_ROWS - 1}" in told
    assert command_output().tables[-1]["rows"] == ROWS  # --json repeats every row


def test_a_table_that_fits_says_no_more(capsys):
    show.table("points", ["name", "value"], ROWS[: show.MOST_ROWS], whole="coefficients.csv")
    assert "more rows" not in capsys.readouterr().out
