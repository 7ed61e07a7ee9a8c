"""What real exports write around their numbers: units behind names and of time, statistics, minus signs, AM and PM."""

from pathlib import Path

import numpy as np
import pytest

import rigdata
from rigdata.problem import RigDataError


def written(folder: Path, head: list[str], rows: list[list[str]], channels: str, acquisition: str = "") -> rigdata.Run:
    """The one run of a campaign with a CSV file of these lines; `channels` are more tables of the manifest."""
    folder.mkdir(exist_ok=True)
    lines = head + [",".join(row) for row in rows]
    (folder / "r.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = f"""schema = "tpjb-rig/1"
id = "a"
bearing = "rocker.toml"
{acquisition}
[channels.X1A]
quantity = "displacement"
axis = "45 deg"
unit = "um"
{channels}
[[runs]]
id = "r"
file = "r.csv"
kind = "locus"
shaft_speed = "22 Hz"
static_load = "5 kN"
static_load_direction = "-90 deg"
"""
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return rigdata.load_campaign(folder).run("r")


STATED = '[acquisition]\nsample_rate = "1 kHz"\n'
TIMED = '[channels.Zeit]\nquantity = "time"\nunit = "s"\n'


@pytest.mark.parametrize("name", ["X1A [mV]", "X1A (mV)", "X1A / mV", "X1A/mV"])
def test_a_unit_behind_a_channels_name_is_held_against_the_manifest(tmp_path, name):
    """Names in brackets were read as the channel's, and what stood in the brackets went unheard."""
    run = written(tmp_path, [f"Zeit,{name}"], [[f"{0.001 * i:.3f}", f"{i}"] for i in range(50)], "")
    (problem,) = (p for p in run.reader.problems() if p.severity == "error")
    assert "states 'mV', the manifest unit = 'um'" in problem.what
    same = written(tmp_path, [f"Zeit,{name.replace('mV', 'um')}"], [["0", "1"], ["0.001", "2"]], "")
    assert not [p for p in same.reader.problems() if p.severity == "error"]


@pytest.mark.parametrize(
    ("name", "factor"),
    [("Zeit [ms]", 1e3), ("Zeit/ms", 1e3), ("Zeit (Millisekunden)", 1e3), ("Zeit [min]", 1 / 60), ("Zeit / us", 1e6)],
)
def test_times_count_in_the_unit_of_their_name(tmp_path, name, factor):
    rows = [[f"{0.001 * i * factor:.9f}", f"{i}"] for i in range(500)]
    assert written(tmp_path, [f"{name},X1A"], rows, "").sample_rate == pytest.approx(1000.0, rel=1e-4)


@pytest.mark.parametrize("factor", [1e3, 1e6, 1 / 60, 1 / 86400])
def test_times_that_miss_the_stated_rate_by_another_unit_are_refused(tmp_path, factor):
    """A thousandth of the rate was believed: the frequencies of the run were thousandths too."""
    rows = [[f"{0.001 * i * factor:.12f}", f"{i}"] for i in range(500)]
    with pytest.raises(RigDataError, match=r"r.csv, column Zeit: its times, taken for seconds.*1000 Hz\. State their"):
        _ = written(tmp_path, ["Zeit,X1A"], rows, TIMED, STATED).sample_rate
    slow = [[f"{0.002 * i:.3f}", f"{i}"] for i in range(500)]  # half of the campaign's rate is a run's own
    assert written(tmp_path, ["Zeit,X1A"], slow, TIMED, STATED).sample_rate == 500.0


def test_lines_of_statistics_at_the_end_are_no_samples(tmp_path):
    rows = [[f"{0.001 * i:.3f}", f"{i}"] for i in range(50)]
    run = written(tmp_path, ["Zeit,X1A"], [*rows, ["", "24.5"], ["", "49"]], TIMED)
    assert run.length == 50
    (problem,) = (p for p in run.reader.problems() if p.severity == "warning")
    assert problem.place == "line 52 and on"


def test_minus_signs_and_hours_as_spreadsheets_write_them(tmp_path):
    stamps = ["11:59:59.998 AM", "11:59:59.999 AM", "12:00:00.000 PM", "12:00:00.001 PM"]
    rows = [[f"03/14/2019 {stamp}", f"\u2212{i}.5"] for i, stamp in enumerate(stamps)]
    run = written(tmp_path, ["Zeit,X1A"], rows, "")
    assert run.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(run.record("X1A").values, [-0.5e-6, -1.5e-6, -2.5e-6, -3.5e-6])
