"""K and C alone, as a paper's figures give them, become observations."""

import math

import numpy as np
import pytest

from tpjb_ident.diagnosis.observations.observe import observe_table
from tpjb_ident.errors import BadInputError

HEAD = "static_load_N,shaft_speed_Hz,excitation_Hz,kxx_N_per_m,kyy_N_per_m,cyy_Ns_per_m,cyy_Ns_per_m_se"


def table(tmp_path, *lines, head=HEAD):
    path = tmp_path / "read_off.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def test_values_errors_and_missing_cells(tmp_path):
    seen = observe_table(table(tmp_path, "5000,22,25,6e7,2e8,1e6,2e4", "8750,22,,,4e8,1.4e6,2e4"), 0.05)
    assert [e.observable for e in seen.elements] == ["kxx", "kyy", "cyy", "kyy", "cyy"]
    omega = 2 * math.pi * 25
    assert seen.value[2] == pytest.approx(omega * 1e6)
    assert math.sqrt(seen.covariance[2, 2]) == pytest.approx(max(omega * 2e4, 0.1 * 0.05 * omega * 1e6))
    assert math.sqrt(seen.covariance[1, 1]) == pytest.approx(0.05 * 2e8)
    assert [t.excitation for t in seen.layout.dynamic] == [(omega,), (2 * math.pi * 22,)]
    assert np.allclose([t.direction for t in seen.layout.dynamic], -math.pi / 2)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (("5000,22,25,6e7,2e8,1e6,2e4",), "nothing says how far it holds"),
        (("5000,22,25,,,1e6,2e4", "5000,22,25,,,1e6,2e4"), "second row for the same point"),
        (("-5,22,25,,,1e6,2e4",), "line 2, static_load_N: -5 is below 0"),
        (("0,22,25,,,1e6,2e4",), "must be positive"),
        (("5000,22,25,6e7,,1e6,inf",), "nothing says how far it holds"),
        (("5000,22,25,,,high,2e4",), "is no number"),
        (("5000,22,25,,,,",), "holds no coefficient"),
    ],
)
def test_tables_that_cannot_be_taken_are_refused_with_their_line(tmp_path, lines, said):
    with pytest.raises(BadInputError, match=said):
        observe_table(table(tmp_path, *lines))
