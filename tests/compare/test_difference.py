"""Two campaigns against each other: what both share cancels, what changed is named, what nobody can tell is not."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from rigdata.calibration import Channel
from rigdata.operating_point import ROTATIONS
from tests.command_line import ended
from tpjb_ident.compare import summary
from tpjb_ident.compare.difference import Side, difference_of, difference_sentences, recorded_side
from tpjb_ident.report.difference_page import write_difference_report
from tpjb_ident.runtime.output_folder import record_text
from tpjb_ident.runtime.tables import write_table
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_COLUMNS

OMEGA = 2 * np.pi * 25.0
TRUE = np.array([6e7, 1e6, -1e6, 9e7, 6e5, 1e4, 2e4, 7e5])
CHANNELS = {"X1A": Channel("X1A", "displacement", gain=1e-6), "L1H": Channel("L1H", "force", gain=100.0)}


def side(name: str, values, random=1e-3, gain=0.01, quality="ok", channels=CHANNELS, load=5000.0) -> Side:
    """A campaign of one point: `gain` is what one standard deviation of X1A does, as a share of every entry."""
    row: dict[str, object] = dict(zip(POINT_COLUMNS, (load, -90.0, 22.0, 25.0), strict=True))
    for j, column in enumerate(COEFFICIENT_COLUMNS):
        error, systematic = random * TRUE[3 if j < 4 else 7], gain * abs(TRUE[j])
        half = 1.96 * np.hypot(error, systematic)
        row |= {column: values[j], f"{column}_lo": values[j] - half, f"{column}_hi": values[j] + half}
        row |= {f"{column}_se": error, f"{column}_se_systematic": systematic, f"{column}_random95": 1.96 * error}
    row["quality"] = quality
    moved = gain * TRUE * np.where(np.arange(8) < 4, 1.0, OMEGA)
    campaign = SimpleNamespace(channels=channels, housing_mass=30.0)
    return Side(name, pd.DataFrame([row]), campaign=campaign, sensors={"calibration: X1A": moved[None]})


def changed(place: int, factor: float) -> np.ndarray:
    """The true entries, one of them another."""
    return TRUE * np.where(np.arange(8) == place, factor, 1.0)


def half(difference, name="kyy_N_per_m"):
    row = difference.points.iloc[0]
    return 0.5 * (row[f"{name}_difference_hi"] - row[f"{name}_difference_lo"])


def test_a_common_calibration_cancels_and_another_one_does_not():
    same = difference_of(side("a", TRUE), side("b", TRUE))
    assert same.shared == ("calibration: X1A",)
    for name, true in (("kyy_N_per_m", TRUE[3]), ("cyy_Ns_per_m", TRUE[7])):
        assert half(same, name) == pytest.approx(1.96 * np.sqrt(2) * 1e-3 * true, rel=1e-3)
    other = CHANNELS | {"X1A": replace(CHANNELS["X1A"], gain=1.02e-6)}
    recalibrated = difference_of(side("a", TRUE), side("b", TRUE, channels=other))
    assert recalibrated.shared == ()
    assert half(recalibrated) == pytest.approx(1.96 * np.sqrt(2) * np.hypot(1e-3, 0.01) * TRUE[3], rel=1e-3)


def test_it_says_yes_no_and_cannot_tell():
    moved = changed(3, 1.05)
    found = difference_of(side("a", TRUE), side("b", moved)).points.iloc[0]
    assert found["kyy_N_per_m_difference"] == pytest.approx(0.05 * TRUE[3])
    limits = [found[f"kyy_N_per_m_difference{ending}"] for ending in ("_lo", "_hi")]
    width = 1.96 * np.sqrt(2) * 1e-3 * TRUE[3]
    assert limits == pytest.approx([0.05 * TRUE[3] - width, 0.05 * TRUE[3] + width], rel=1e-3)
    assert [found["kyy_changed"], found["kxx_changed"]] == ["yes", "no"]
    unsure = difference_of(side("a", TRUE, random=0.05), side("b", moved, random=0.05)).points.iloc[0]
    assert unsure["kyy_changed"] == "cannot tell"
    doubtful = difference_of(side("a", TRUE), side("b", moved, quality="ok; baseline-missing"))
    assert set(doubtful.points.filter(like="_changed").iloc[0]) == {"cannot tell"}
    assert doubtful.doubt == "1 point with a flag that forbids trust:\n5 kN at -90°, shaft at 22 Hz (1320 rpm), 25 Hz"
    assert difference_sentences(doubtful)[0] == "NOT to be trusted: 1 point with a flag that forbids trust."


def test_sentences_name_the_largest_change_and_points_without_a_partner():
    first, *_ = difference_sentences(difference_of(side("before", TRUE), side("after", changed(4, 1.2))))
    assert first == (
        "From before to after 1 of 8 coefficients changed beyond what both intervals allow, most of all cxx at 5 kN, "
        "25 Hz: +18.5\N{NO-BREAK SPACE}% of the mean direct coefficient (120.0 ± 1.9 kN s/m)."
    )
    apart = difference_of(side("a", TRUE), side("b", TRUE, load=6000.0))
    lead, first, *more = difference_sentences(apart)
    assert lead == "NOT to be trusted: nothing of the two can be compared."
    assert first == "a and b have no operating point in common."
    assert more[-1].startswith("Without a partner: a: 5 kN at -90°, shaft at 22 Hz (1320 rpm), 25 Hz; b: 6 kN")
    other = side("b", TRUE)
    both = pd.concat([other.coefficients.assign(static_load_N=load) for load in (6e3, 7e3)], ignore_index=True)
    *_, last = difference_sentences(difference_of(side("a", TRUE), replace(other, coefficients=both)))
    assert last.count("b: ") == 1
    assert "; b: 6 kN at -90°, shaft at 22 Hz (1320 rpm), 25 Hz; 7 kN at -90°" in last
    mirrored = replace(other, coefficients=other.coefficients.assign(rotation="clockwise"))
    *_, last = difference_sentences(difference_of(side("a", TRUE), mirrored))
    assert "b: 5 kN at -90°, shaft at 22 Hz (1320 rpm) clockwise, 25 Hz" in last


@pytest.mark.slow
def test_one_in_twenty_of_many_equal_points_is_no_change():
    rng = np.random.default_rng(5)
    seen = 0
    for _ in range(40):
        noise = [1e-3 * np.repeat([TRUE[3], TRUE[7]], 4) * rng.standard_normal(8) for _ in range(2)]
        points = difference_of(side("a", TRUE + noise[0]), side("b", TRUE + noise[1])).points
        seen += int((points.filter(like="_changed") == "yes").to_numpy().sum())
    assert seen <= 6  # 40 tables, of which one in twenty may hold one


def test_pivots_and_clearances_come_from_folders_of_results(tmp_path):
    sides = []
    for name, soft, gap in (("a", 1.0, 100e-6), ("b", 0.8, 104e-6)):
        folder = tmp_path / name
        folder.mkdir()
        write_table(folder, "coefficients", side(name, TRUE).coefficients)
        force = np.linspace(500.0, 5000.0, 10)
        stiffness = soft * 1e6 * np.sqrt(force)
        curve = {"pad": 1, "force_N": force, "stiffness_N_per_m": stiffness, "stiffness_N_per_m_lo": 0.99 * stiffness}
        curve |= {"stiffness_N_per_m_hi": 1.01 * stiffness, "extrapolated": force > 4500.0, "contact_complete": True}
        write_table(folder, "pivot_curves", pd.DataFrame(curve))
        write_table(folder, "clearance", pd.DataFrame({"pad": [1], "clearance_m": [gap], "clearance_m_se": [0.2e-6]}))
        sides.append(recorded_side(folder))
    difference = difference_of(*sides)
    assert difference.shared == ()
    assert difference.pivots["force_N"].max() == 4500.0
    assert set(difference.pivots["stiffness_changed"]) == {"yes"}
    assert difference.clearance["clearance_changed"].tolist() == ["yes"]
    assert difference.clearance["clearance_m_difference"].iloc[0] == pytest.approx(4e-6)
    texts = difference_sentences(difference)
    assert "Clearance changed: pad #1 by 4.00 ± 0.55 µm." in texts
    assert texts[-1] == "No calibration is known to be common to both: the intervals hold that of each."


@pytest.mark.parametrize("ids", [("before", "after"), ("rig", "rig"), ()])
def test_folders_of_results_are_called_by_their_campaigns(ids, tmp_path):
    folders = [tmp_path / name / "identify" for name in ("one", "two")]
    for number, folder in enumerate(folders):
        folder.mkdir(parents=True)
        write_table(folder, "coefficients", side("a", changed(4, 1.0 + 0.2 * number)).coefficients)
        if ids:
            (folder / "run.json").write_text(record_text({"identify": {"campaign": ids[number]}}), encoding="utf-8")
    said = " ".join(ended(0, "compare", *folders, "--out", tmp_path / "out").stdout.split())
    names = [f"{ids[k] if ids else 'identify'} ({folder})" for k, folder in enumerate(folders)]
    names = ids if len(set(ids)) == 2 else names
    assert said.startswith(f"From {names[0]} to {names[1]} 1 of 8 coefficients changed")


def test_one_pad_is_no_range_and_one_coefficient_no_plural(monkeypatch):
    pads = [SimpleNamespace(pad=pad, valid_to=5e3, stiffness=lambda load: 1e8) for pad in (1, 2)]
    monkeypatch.setattr(summary, "printed_formula", lambda bearing: lambda pad, load: (0.0, 1e8))
    for measured in (pads[:1], pads):
        (sentence,) = summary._pivot_sentence(SimpleNamespace(curves=measured, bearing=None))
        assert "have 100 % of" in sentence
    monkeypatch.setattr(summary, "printed_formula", lambda bearing: lambda pad, load: (0.0, 1e8 * pad))
    (sentence,) = summary._pivot_sentence(SimpleNamespace(curves=pads, bearing=None))
    assert "have 50 % (pad #2) to 100 % (pad #1) of" in sentence
    moved = TRUE * np.where(np.arange(8) == 3, 1.0, 1.5)
    _, said, *_ = difference_sentences(difference_of(side("a", TRUE), side("b", moved)))
    assert "1 coefficient the same within 3 %" in said


def test_campaigns_of_static_tests_alone_are_compared_by_these(tmp_path):
    without = side("a", TRUE).coefficients.iloc[:0]
    clearance = pd.DataFrame({"pad": [1], "clearance_m": [1e-4], "clearance_m_se": [2e-7]})
    sides = [Side(name, without, clearance=clearance) for name in "ab"]
    difference = difference_of(*sides)
    assert list(difference.tables) == ["clearance_difference"]
    texts = difference_sentences(difference)
    assert texts[1:] == ("Clearance: no pad changed beyond its interval.",)
    page = write_difference_report(tmp_path, difference, {}).read_text(encoding="utf-8")
    assert "0 points" not in page
    with_points = difference_of(sides[0], side("b", TRUE))
    assert len(with_points.unmatched) == 1


def test_the_first_screen_says_what_was_tested_and_each_value_with_its_interval(tmp_path):
    sides = []
    for one in (side("a", TRUE), side("b", changed(7, 0.5), quality="large-amplitude")):
        both = pd.concat([one.coefficients.assign(rotation=sense) for sense in ROTATIONS], ignore_index=True)
        sides.append(replace(one, campaign=None, coefficients=both))
    page = write_difference_report(tmp_path, difference_of(*sides), {"then": "tpjb view o"}).read_text("utf-8")
    first = re.sub(r"<[^>]+>", " ", page[page.index("<main>") : page.index("<nav")])
    words = " ".join(first.split())
    assert "Static load: 5 kN at -90°" in words
    assert "Shaft: 22 Hz (1320 rpm) clockwise, 22 Hz (1320 rpm) Excitation: 25 Hz" in words
    assert "At 5 kN, 25 Hz, shaft at 22 Hz (1320 rpm) clockwise; 95 % intervals" in words
    assert "cyy, kN s/m 700 ± 14 350 ± 14 −350" in words
    assert "Flags, none of which forbids trust: large-amplitude (2)." in words
    assert "operating point: load in kN, excitation in Hz" in words
    table = " ".join(re.sub(r"<[^>]+>", " ", page[page.index('id="s1"') :]).split())
    assert "5 kN, 25 Hz, ccw" in table
    assert "5 kN, 25 Hz, cw" in table
