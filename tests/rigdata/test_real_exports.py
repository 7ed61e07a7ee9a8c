"""What real exports write around their numbers: units behind names and of time, statistics, minus signs, AM and PM."""

from pathlib import Path

import numpy as np
import pytest

import rigdata
from rigdata.problem import RigDataError
from tests.manifests import PROBE, SET_POINT, Table, manifest, write_files

RUN = {"id": "r", "file": "r.csv", "kind": "locus", **SET_POINT}
CLOCK = {"Zeit": {"quantity": "time", "unit": "s"}}


def written(folder: Path, head: str, rows: list[str], clock: Table | None = None, **tables: Table) -> rigdata.Run:
    """The one run of a campaign with a CSV file of these lines; what describes its clock, and more tables."""
    text = manifest({"X1A": PROBE, **(clock or {})}, RUN, **tables)
    return rigdata.load_campaign(write_files(folder, text, {"r.csv": "\n".join([head, *rows, ""])})).run("r")


def counted(number: int, step: float) -> list[str]:
    """Rows of times, `step` apart, and readings."""
    return [f"{step * i:.12f},{i}" for i in range(number)]


@pytest.mark.parametrize("name", ["X1A [mV]", "X1A (mV)", "X1A / mV", "X1A/mV"])
def test_a_unit_behind_a_channels_name_is_held_against_the_manifest(tmp_path, name):
    """Names in brackets were read as the channel's, and what stood in the brackets went unheard."""
    run = written(tmp_path, f"Zeit,{name}", counted(50, 0.001))
    (problem,) = (p for p in run.reader.problems() if p.severity == "error")
    assert "states 'mV', the manifest unit = 'um'" in problem.what
    same = written(tmp_path, f"Zeit,{name.replace('mV', 'um')}", counted(2, 0.001))
    assert not [p for p in same.reader.problems() if p.severity == "error"]


@pytest.mark.parametrize(
    ("name", "factor"),
    [("Zeit [ms]", 1e3), ("Zeit/ms", 1e3), ("Zeit (Millisekunden)", 1e3), ("Zeit [min]", 1 / 60), ("Zeit / us", 1e6)],
)
def test_times_count_in_the_unit_of_their_name(tmp_path, name, factor):
    run = written(tmp_path, f"{name},X1A", counted(500, 0.001 * factor))
    assert run.sample_rate == pytest.approx(1000.0, rel=1e-4)


@pytest.mark.parametrize("factor", [1e3, 1e6, 1 / 60, 1 / 86400])
def test_times_that_miss_the_stated_rate_by_another_unit_are_refused(tmp_path, factor):
    """A thousandth of the rate was believed: the frequencies of the run were thousandths too."""
    stated = {"acquisition": {"sample_rate": "1 kHz"}}
    with pytest.raises(RigDataError, match=r"r.csv, column Zeit: its times, taken for seconds.*1000 Hz\. State their"):
        _ = written(tmp_path, "Zeit,X1A", counted(500, 0.001 * factor), CLOCK, **stated).sample_rate
    # half of the campaign's rate is a run's own
    assert written(tmp_path, "Zeit,X1A", counted(500, 0.002), CLOCK, **stated).sample_rate == pytest.approx(500.0)


def test_lines_of_statistics_at_the_end_are_no_samples(tmp_path):
    run = written(tmp_path, "Zeit,X1A", [*counted(50, 0.001), ",24.5", ",49"], CLOCK)
    assert run.length == 50
    (problem,) = (p for p in run.reader.problems() if p.severity == "warning")
    assert problem.place == "line 52 and on"


def test_minus_signs_and_hours_as_spreadsheets_write_them(tmp_path):
    stamps = ["11:59:59.998 AM", "11:59:59.999 AM", "12:00:00.000 PM", "12:00:00.001 PM"]
    run = written(tmp_path, "Zeit,X1A", [f"03/14/2019 {stamp},\u2212{i}.5" for i, stamp in enumerate(stamps)])
    assert run.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(run.record("X1A").values, [-0.5e-6, -1.5e-6, -2.5e-6, -3.5e-6])
