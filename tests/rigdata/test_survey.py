"""A folder of exports without a manifest: what is guessed, what is marked, and that the finished draft works."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from rigdata import RigDataError, load_campaign
from rigdata.manifest.fields import MARK
from rigdata.problem import Problem
from rigdata.readers.base import RecordFile
from rigdata.readers.series import Series
from rigdata.readers.text.head import find_head
from rigdata.survey.channels import ChannelGuess, Entry, guess_channel, usable_unit
from rigdata.survey.draft import draft_manifest
from rigdata.survey.exports import Export, read_exports, record_files
from rigdata.survey.runs import _load_of, guess_run
from rigdata.survey.spectrum import amplitude_spectrum, strongest
from rigdata.survey.survey import Survey, survey
from rigdata.vector import directions
from rigdata.virtual_rig import DryTest, locus_points, operating_points
from tests.good_campaigns import SMALL_PLAN, rocker_rig
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.cli.commands.show import channel_row

RATE = 1000.0


@pytest.fixture(scope="module")
def exports(campaign_of, tmp_path_factory):
    """CSV folder of a virtual rig, in German spelling, its manifest taken away."""
    plan = replace(
        SMALL_PLAN,
        dynamic=operating_points([(2500.0, 25.0), (5000.0, 40.0)]),
        directions=(0.0, math.pi / 2),
        locus=locus_points(2, load=1000.0),
        dry=(DryTest(1, levels=(500.0, 1000.0, 2000.0)),),
    )
    folder = shutil.copytree(campaign_of(rocker_rig(3, plan=plan), "csv-german"), tmp_path_factory.mktemp("e") / "rig")
    text = (folder / "campaign.toml").read_text(encoding="utf-8")
    (folder / "campaign.toml").unlink()
    return folder, text


@pytest.fixture(scope="module")
def found(exports):
    problems = []
    surveyed = survey(list(read_exports(exports[0], problems)))
    assert not problems
    return surveyed


def test_kinds_and_set_points_are_guessed_right(found):
    by_name = {run.file.rpartition("/")[2]: run for run in found.runs}
    kinds = {name[0]: run.kind.value for name, run in by_name.items()}
    assert kinds == {"c": "clearance", "d": "dynamic", "l": "locus", "p": "dry_pivot"}
    assert {name: unit.value for name, unit in found.clocks.items()} == {"Zeit": "s"}
    assert by_name["d-02500-25-01.csv"].speed.number == pytest.approx(22.0, abs=0.3)
    for name, load, line in (("d-02500-25-01.csv", 2500.0, 25.0), ("d-05000-40-02.csv", 5000.0, 40.0)):
        assert by_name[name].load.value == load
        assert by_name[name].lines[0].frequency == pytest.approx(line, abs=0.2)
        assert by_name[name].direction.value == pytest.approx(-90.0, abs=2.0)
    assert by_name["p-1-up.csv"].pad.value == 1


def test_a_draft_says_what_is_missing_and_works_when_that_is_filled_in(exports, found):
    folder, original = exports
    draft = draft_manifest(found, "rig", "bearing.toml")
    assert MARK in draft
    for line in ('rotation = "counter-clockwise"   # (guess)', 'date = ""', 'by = ""', '# mount = "floating"'):
        assert line in draft
    (folder / "draft.toml").write_text(draft, encoding="utf-8")
    problems = check_campaign(folder / "draft.toml")
    assert {p.severity for p in problems} == {"error"}
    (problem,) = problems  # what is open is one line
    assert "places open" in problem.what
    assert "sensitivity" in problem.what
    assert "line" in problem.place
    filled = draft.replace('"?? kg"', '"30 kg"').replace("# mount", "mount").replace('date = ""', 'date = "2026-03-12"')
    for name, lines in _calibrations(original).items():
        head, _, rest = filled.partition(f"[channels.{name}]\n")
        body, _, tail = rest.partition("\n\n")
        quantity = next(line for line in body.splitlines() if line.startswith("quantity"))
        filled = f"{head}[channels.{name}]\n{quantity}\n{lines}\n\n{tail}"
    assert MARK not in "".join(line.partition("#")[0] for line in filled.splitlines())
    (folder / "draft.toml").write_text(filled, encoding="utf-8")
    campaign = load_campaign(folder / "draft.toml")
    (folder / "original.toml").write_text(original, encoding="utf-8")
    truth = load_campaign(folder / "original.toml")
    assert {r.id: r.kind for r in campaign.runs} == {r.id: r.kind for r in truth.runs}
    run = truth.runs[0].id
    np.testing.assert_allclose(campaign.run(run).vector("force").values, truth.run(run).vector("force").values)


def test_a_sign_of_an_accelerometer_is_a_guess_as_long_as_nobody_says_how_the_stator_is_held():
    guess = ChannelGuess(Entry("acceleration", "file"), "g", axis=Entry(0.0, "records"), polarity=-1)
    probe = replace(guess, quantity=Entry("displacement", "file"), unit="um")
    text = draft_manifest(Survey({"A": guess, "X": probe}, (), {}), "x", None)
    assert text.count("polarity = -1   # (guess) on cells") == 1
    assert text.count("polarity = -1\n") == 1


@pytest.mark.parametrize(
    ("names", "line"), [("XXFF", 'quantity = "ignore"   # (guess)'), ("X?F?", 'quantity = "??"   #')]
)
def test_what_nothing_tells_is_left_out_where_the_others_suffice_else_asked_for(names, line):
    kinds = {"X": "displacement", "F": "force"}
    channels = {"spare": ChannelGuess(Entry(), "")}
    for number, name in enumerate(names):
        channels[f"{name}{number}"] = ChannelGuess(Entry(kinds.get(name), "file"), "V")
    head = draft_manifest(Survey(channels, (), {}), "x", None).partition("[channels.spare]\n")[2]
    assert head.startswith(line)


def _calibrations(manifest: str) -> dict[str, str]:
    """Everything but the quantity that the rig's own manifest says of each channel."""
    out = {}
    for block in manifest.split("[channels.")[1:]:
        name, _, body = block.partition("]\n")
        lines = body.split("\n\n")[0].split("[[runs]]")[0].strip().splitlines()
        if 'quantity = "time"' not in lines:
            out[name] = "\n".join(line for line in lines if not line.startswith("quantity"))
    return out


@pytest.mark.parametrize(
    ("name", "unit", "quantity", "axis"),
    [
        ("X1A", "V", "displacement", ""),
        ("L1H", "mV", "force", "0 deg"),
        ("A1V", "V", "acceleration", "90 deg"),
        ("T1", "V", "temperature", ""),
        ("whatever", "um", "displacement", ""),
        ("channel 7", "kN", "force", ""),
        ("Drehzahl", "U/min", "speed", ""),
        ("oil", "°C", "temperature", ""),
        ("p_supply", "bar", "pressure", ""),
        ("Zeit", "s", "time", ""),
        ("time_ms", "", "time", ""),
        ("Kraft waagrecht", "kN", "force", "0 deg"),
        ("Stützkraft senkrecht", "N", "force", "90 deg"),
        ("Kraft längs (H)", "", "force", ""),
        ("转速", "", "speed", ""),
        ("温度1", "", "temperature", ""),
        ("加速度Y", "", "acceleration", "90 deg"),
        ("力X", "", "force", "0 deg"),
        ("压力", "", "pressure", ""),
        ("荷重", "", "force", ""),
        ("位移1", "", "displacement", ""),
        ("变位".replace("变", "変"), "", "displacement", ""),
        ("时间", "", "time", ""),
        ("spare", "V", "", ""),
        ("=cmd|' /C calc'!A0", "sheep", "", ""),
    ],
)
def test_channels_are_guessed_by_unit_first_then_by_name(name, unit, quantity, axis):
    guess = guess_channel(name, unit)
    assert (guess.quantity.value or "") == quantity
    assert (f"{guess.hint:g} deg" if math.isfinite(guess.hint) else "") == axis
    assert guess.axis.value is None  # a name is no measurement


def _table(times, clock):
    """A text of 2000 samples of a probe, its times in a column `clock`."""
    return "\n".join([f"{clock},X1A", *(f"{time:.6g},{np.sin(0.2 * i):.5f}" for i, time in enumerate(times))]) + "\n"


@pytest.mark.parametrize(
    ("clock", "step", "unit", "rate", "mark"),
    [
        ("t", 0.001, "s", 1000.0, ""),
        ("t", 1.0, "ms", 1000.0, "guess"),  # nobody records a shaft at 1 Hz
        ("t", 0.1, "ms", 10_000.0, "guess"),
        ("time_ms", 1.0, "ms", 1000.0, ""),
        ("Zeit (ms)", 1.0, "ms", 1000.0, ""),
        ("time (s)", 1.0, "s", 1.0, ""),  # stated, so it holds
    ],
)
def test_times_without_a_unit_are_those_of_a_recorder(tmp_path, clock, step, unit, rate, mark):
    (tmp_path / "a.csv").write_text(_table(step * np.arange(2000), clock), "utf-8")
    exports = list(read_exports(tmp_path, []))
    found = survey(exports)
    (entry,) = found.clocks.values()
    assert (entry.value, entry.source.removeprefix("file")) == (unit, mark)
    assert [run.export.rate for run in found.runs] == [pytest.approx(rate)]
    text = draft_manifest(found, "a", "b.toml")
    assert (f'unit = "{unit}"   # (guess) not stated' in text) == bool(mark)
    typed = survey(exports, {clock.partition(" ")[0]: {"unit": "s"}})
    assert [run.export.rate for run in typed.runs] == [pytest.approx(1.0 / step if mark else rate)]


@pytest.mark.parametrize(
    ("stem", "newtons", "text", "source"),
    [
        ("dyn_1349lbf_25Hz", 1349 * 4.4482216152605, "1349 lbf", "file"),
        ("306kgf 25Hz", 306 * 9.80665, "306 kgf", "file"),
        ("5,5kn-1320rpm", 5500.0, "5.5 kN", "file"),
        ("1.5klbf", 6672.3324228907, "1.5 klbf", "file"),
        ("d-05000-25-01", 5000.0, "5 kN", "guess"),
        ("run 1320rpm 03", math.nan, "", ""),
    ],
)
def test_loads_in_names_of_files_have_any_unit_of_force(stem, newtons, text, source):
    entry = _load_of(stem)
    assert (entry.number, entry.text, entry.source) == (pytest.approx(newtons, nan_ok=True), text, source)


@pytest.mark.parametrize(
    ("label", "unit"),
    [("µm", "um"), ("U/min", "rpm"), ("Volts", "V"), ("Newtons", "N"), ("mils", "mil"), ("g/no", ""), ("H", "")],
)
def test_units_are_spelt_as_a_manifest_spells_them(label, unit):
    assert usable_unit(label) == unit


@pytest.mark.parametrize(
    ("text", "names", "units", "decimal"),
    [
        ("t;a;b\ns;V;N\n0,0;1,5;2\n0,1;1,6;3\n0,2;1,7;4\n", ("t", "a", "b"), ("s", "V", "N"), ","),
        ("remark\n\nTime [s],a [V]\n0.0,1.5\n0.1,1.6\n0.2,1.7\n", ("Time [s]", "a [V]"), ("s", "V"), "."),
        ("t;F (H)\ns;lbf\n0.0;1.5\n0.1;1.6\n0.2;1.7\n", ("t", "F (H)"), ("s", "lbf"), "."),
        ("t;F (kN)\nA;channel 1\n0.0;1.5\n0.1;1.6\n0.2;1.7\n", ("t", "F (kN)"), ("A", "kN"), "."),
        ("t;K1\n0.0;3,600.5\n0.1;999.5\n0.2;-1,234,567.5e3\n", ("t", "K1"), ("", ""), "."),
        ("0.0\t1.5\n0.1\t1.6\n0.2\t1.7\n", ("column1", "column2"), ("", ""), "."),
        ("t|a\n1|\n2|NaN\n3|7\n", ("t", "a"), ("", ""), "."),
    ],
)
def test_the_head_of_an_unknown_text_file_is_found(tmp_path, text, names, units, decimal):
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    head = find_head(RecordFile(tmp_path / "a.txt", "a.txt"))
    assert (head.names, head.units, head.decimal) == (names, units, decimal)


def test_a_text_without_numbers_is_no_record_and_a_folder_without_records_says_what_would_be(tmp_path):
    with pytest.raises(RigDataError, match=r"holds no records.*\.csv.*\.tdms"):
        record_files(tmp_path)
    (tmp_path / "a.txt").write_text("Dear Sir,\nplease find\n", encoding="utf-8")
    with pytest.raises(RigDataError, match="no table of numbers"):
        find_head(RecordFile(tmp_path / "a.txt", "a.txt"))
    (tmp_path / "b.csv").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    with pytest.raises(RigDataError, match="holds bytes of zero"):
        find_head(RecordFile(tmp_path / "b.csv", "b.csv"))


def test_movement_beats_a_misleading_name():
    time = np.arange(4000) / RATE
    force = Series("F1", "N", np.floor(time) * 500.0, time)
    guess = guess_run(Export("dynamic-7.csv", (force,)), {"F1": guess_channel("F1", "N")})
    assert guess.kind.value == "dry_pivot"
    assert "its name says dynamic" in guess.kind.reason


def test_a_look_finds_lines_and_dead_channels():
    time = np.arange(2000) / RATE
    rng = np.random.default_rng(1)
    swing = 3.0 * np.sin(2 * np.pi * 25.3 * time) + np.sin(2 * np.pi * 22 * time) + 0.01 * rng.standard_normal(2000)
    lines = strongest(*amplitude_spectrum(swing + 5.0 * time, RATE), 3)
    assert [round(x.frequency, 1) for x in lines[:2]] == [25.3, 22.0]
    assert lines[0].amplitude == pytest.approx(3.0, rel=0.1)
    assert strongest(*amplitude_spectrum(rng.standard_normal(2000), RATE), 3) == ()
    dead = shown(np.full(100, 2.5))
    assert (dead["minimum"], dead["maximum"], dead["missing"]) == (2.5, 2.5, 0)
    nothing = shown(np.full(100, np.nan))
    assert nothing["missing"] == nothing["samples"] == 100
    assert math.isnan(nothing["mean"])


def shown(values):
    return channel_row(Series("X", "um", values, np.arange(len(values)) / RATE), amplitude_spectrum(values, RATE))


TIME = np.arange(4000) / RATE
SWING = 500.0 * np.sin(2 * np.pi * 25.0 * TIME)


def guessed(*records):
    """Guesses of runs from their names, and their channels' unit and values."""
    series = [[Series(name, unit, v + 0.0 * TIME, TIME) for name, (unit, v) in of.items()] for _, of in records]
    return survey([Export(name, tuple(of)) for (name, _), of in zip(records, series, strict=True)]).runs


def pulled(degrees):
    return {"Fx": ("N", 1e3 * math.cos(math.radians(degrees))), "Fy": ("N", 1e3 * math.sin(math.radians(degrees)))}


def test_directions_a_degree_apart_are_one():
    angles = (-89.0, -91.0, -90.0, -18.4, 54.0)
    runs = guessed(*((f"l-{i}.csv", pulled(angle)) for i, angle in enumerate(angles)))
    assert [run.direction.value for run in runs] == [-90.0, -90.0, -90.0, -18.0, 54.0]


def test_speed_comes_from_the_tachometer_before_the_name_before_the_lines():
    first, second = guessed(
        ("run-900rpm.csv", pulled(-90.0) | {"tach": ("rpm", 1320.0)}), ("run-900rpm.csv", pulled(-90.0))
    )
    assert first.speed.value == pytest.approx(22.0)
    assert "by tach" in first.speed.reason
    assert second.speed.value == pytest.approx(15.0)


def test_units_in_names_are_understood():
    (run,) = guessed(("dyn_5kN_-90deg_1320rpm_25Hz.csv", {"Force": ("N", SWING)}))
    assert (run.load.value, run.direction.value, run.excitation.value) == (5000.0, -90.0, 25.0)
    assert run.speed.value == pytest.approx(22.0)


@pytest.mark.parametrize(
    ("name", "load", "kept", "source", "reason"),
    [
        ("run_0kN_25Hz.csv", 20.0, 0.0, "guess", "the file's name; cells 0.02 kN"),
        ("run_5kN_25Hz.csv", 5100.0, 5000.0, "file", ""),
        ("run_5kN_25Hz.csv", 6000.0, 5000.0, "guess", "the file's name; cells 6 kN"),
        ("run_08750_25Hz.csv", 8800.0, 8750.0, "records", "the file's name; cells 8.8 kN"),
        ("run_25Hz.csv", 5000.0, 5000.0, "records", "cells 5 kN"),
        ("run_08750_25Hz.csv", 60.0, 8750.0, "guess", "the file's name; cells 0.06 kN"),  # the preload of stingers
    ],
)
def test_a_load_by_a_file_s_name_is_held_against_the_cells(name, load, kept, source, reason):
    (run,) = guessed((name, {"LC_H": ("N", SWING), "LC_V": ("N", SWING - load)}))
    assert run.load.value == pytest.approx(kept, rel=1e-3)
    assert (run.load.source, run.load.reason) == (source, reason)


def test_where_dry_steps_end_tells_axes_of_probes_when_the_shaft_goes_aside():
    """A shaft that went 12 % beside every pad made axes of 38 deg of probes at 45 deg, residual 0.2 deg."""
    angles, time = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0]), np.arange(400) / 50.0
    tests = []
    for pad, angle in enumerate(angles, 1):
        (x, y), rise = directions([angle])[0], np.clip(time / 8.0, 0.0, 1.0)
        aside = directions([angle + 0.12])[0]
        place = 80.0 * np.array([x, y]) + np.outer(rise, 6.0 * aside)
        probes = place @ directions(np.radians([45.0, 135.0])).T
        columns = {"X1": ("um", probes[:, 0]), "X2": ("um", probes[:, 1])}
        columns |= {"L1": ("N", 5000.0 * rise * x), "L2": ("N", 5000.0 * rise * y)}
        series = tuple(Series(name, unit, values, time) for name, (unit, values) in columns.items())
        tests.append(Export(f"p-{pad}-up.csv", series))
    channels = survey(tests, pivots=angles).channels
    assert [channels[name].axis.number for name in ("X1", "X2")] == [45.0, 135.0]


def test_the_pad_of_a_thermometer_is_read_from_its_name():
    time = np.arange(100) / 10.0
    text = draft_manifest(survey([Export("a.csv", (Series("T3", "degC", 40.0 + 0 * time, time),))]), "x", None)
    assert "pad = 3   # (guess) its name" in text


def test_a_link_that_leads_out_of_the_folder_is_named_and_not_read(tmp_path):
    folder = tmp_path / "records"
    folder.mkdir()
    (folder / "a.csv").write_text("t,x\n" + "\n".join(f"{0.1 * i:.1f},{i}" for i in range(20)), encoding="utf-8")
    (tmp_path / "outside.csv").write_text((folder / "a.csv").read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "b.csv").symlink_to(tmp_path / "outside.csv")
    problems: list[Problem] = []
    assert [export.name for export in read_exports(folder, problems)] == ["a.csv"]
    assert "by a symlink" in problems[0].what
