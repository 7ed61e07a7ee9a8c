"""Identification asks the checks: on the same reading of the records, with consequences at the points they touch."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.readers import series
from rigdata.readers.hdf5.reader import Hdf5Reader
from rigdata.readers.text import csv
from tests.rigs.campaign_file import BEARING, manifest_text, plans_of, write_campaign
from tests.rigs.field_rig import Device, Rig, record
from tpjb_ident.check.findings import Reporter, verdicts
from tpjb_ident.check.observation import observe
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.reading_cache import beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.run_store import packed, unpacked

QUICK = replace(Rig(), seconds=1.5, rate=1000.0)
ONE_LOAD = plans_of(loads=(5000.0,))


def written(path, rig, plans=ONE_LOAD, seed=3):
    write_campaign(path, rig, plans, seed)
    return load_campaign(path)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return written(tmp_path_factory.mktemp("field") / "field.h5", QUICK)


def test_the_beginning_of_a_record_is_read_once(campaign, monkeypatch):
    asked = []
    plain = Hdf5Reader.read

    def counted(self, names, start, stop):
        asked.append((self.run, len(names), stop - start))
        return plain(self, names, start, stop)

    monkeypatch.setattr(Hdf5Reader, "read", counted)
    result = identify(campaign, IdentifySettings(methods=()))
    assert result.points[0].quality == ()
    assert asked == [(run.id, 6, 1500) for run in campaign.of_kind("dynamic")]


@pytest.mark.slow
def test_a_long_csv_file_gives_the_same_and_is_parsed_a_few_times_only(tmp_path, monkeypatch):
    """Its columns wait in files; a look at its beginning must not cost one parse a channel."""
    rig, plans = replace(QUICK, keyphasor=True), ONE_LOAD[:3]
    rng = np.random.default_rng(4)
    text = manifest_text(rig, plans, {})
    for plan in plans:
        text = text.replace(f'id = "{plan.id}"\n', f'id = "{plan.id}"\nfile = "{plan.id}.csv"\n')
        columns = record(rig, plan, rng)
        scaled = np.stack([v * (1e6 if n.startswith("D") else 1.0) for n, v in columns.items()], axis=1)
        np.savetxt(tmp_path / f"{plan.id}.csv", scaled, "%.9g", ";", header=";".join(columns), comments="")
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    (tmp_path / "rocker.toml").write_text(BEARING.read_text(encoding="utf-8"), encoding="utf-8")
    small = identify(load_campaign(tmp_path), IdentifySettings(methods=()))
    parsed = []
    plain = csv.read_table
    monkeypatch.setattr(series, "IN_MEMORY", 1000)
    monkeypatch.setattr(csv, "read_table", lambda source, wanted: parsed.append(len(wanted)) or plain(source, wanted))
    large = identify(load_campaign(tmp_path), IdentifySettings(methods=()))
    np.testing.assert_array_equal(large.points[0].stiffness.h, small.points[0].stiffness.h)
    assert large.points[0].quality == small.points[0].quality
    assert len(parsed) <= 5 * len(plans)


def test_kept_readings_are_those_of_the_file(campaign):
    run = campaign.runs[0]
    kept = with_kept_beginning(run)
    for start, stop in ((0, 10), (700, 1500)):
        np.testing.assert_array_equal(kept.vector("force", start, stop).values, run.vector("force", start, stop).values)
        np.testing.assert_array_equal(kept.time(start, stop), run.time(start, stop))
    short = replace(kept, reader=type(kept.reader)(run.reader, list(run.channels), 400))
    assert beginning_of(short).length == 400
    np.testing.assert_array_equal(short.record("F1").values, run.record("F1").values)
    with pytest.raises(ValueError, match="read-only"):
        kept.reader.read(["F1"], 0, 10)[0][0] = 1.0


def test_an_observation_that_was_kept_is_the_same(campaign):
    run = campaign.runs[2]
    seen = observe(run)
    seen.report.say("x", "warning", "here", "is odd", "Look")
    arrays = {}
    again = unpacked(packed(seen, arrays), arrays, run)
    assert packed(again, {}) == packed(seen, {})
    assert again.channels == seen.channels
    assert again.shaft_force == pytest.approx(seen.shaft_force, nan_ok=True)
    assert again.report.found == seen.report.found
    np.testing.assert_array_equal(again.lines.phasor, seen.lines.phasor)


def test_a_third_of_the_runs_share_a_finding(campaign):
    reports = [Reporter(run) for run in campaign.runs]
    for report in reports[:2]:
        report.say("two", "error", "", "wrong", "")
    for report in reports[2:5]:
        report.say("three", "error", "", "wrong", "")
        report.say("odd", "warning", "", "odd", "")
    found = verdicts(reports)
    assert list(found.unusable) == [run.id for run in campaign.runs[:2]]
    assert list(found.shared) == list(found.doubtful) == [run.id for run in campaign.runs[2:5]]


@pytest.mark.slow
def test_the_probes_zero_stands_in_the_positions_errors(tmp_path):
    path = tmp_path / "zero.h5"
    write_campaign(
        path, QUICK, ONE_LOAD, 3, {"D1": {"zero_uncertainty": '"3 um"'}, "D2": {"zero_uncertainty": '"4 um"'}}
    )
    (stated,) = identify(load_campaign(path), IdentifySettings(methods=())).points
    (silent,) = identify(written(tmp_path / "none.h5", QUICK), IdentifySettings(methods=())).points
    # probes at 45 and 135 deg: half of either variance along X and along Y
    expected = np.hypot(silent.position_se, 5e-6 / np.sqrt(2))
    np.testing.assert_allclose(stated.position_se, expected, rtol=1e-12)


@pytest.mark.slow
def test_one_inverted_probe_costs_its_run_inverted_cells_all_points(tmp_path):
    def inverted(values, run, rng):
        return -values if "-25-2-" in run else values

    one = replace(QUICK, devices={"D1": Device(reading=inverted)})
    result = identify(written(tmp_path / "one.h5", one), IdentifySettings(methods=()))
    assert "run-left-out" in result.points[0].quality
    assert "records-contradicted" not in result.points[0].quality
    truth = QUICK.bearing.h(2 * np.pi * 25, 5000.0)
    assert np.abs(result.points[0].stiffness.h - truth).max() < 0.01 * np.abs(truth).max()
    cells = replace(QUICK, devices={"F2": Device(gain=-1.0)})
    result = identify(written(tmp_path / "cells.h5", cells), IdentifySettings(methods=()))
    assert "records-contradicted" in result.points[0].quality


@pytest.mark.slow
def test_records_of_several_excitations_are_checked_at_each(tmp_path):
    """The drive's second harmonic, made strong, serves as the other excitation."""
    rig = replace(QUICK, seconds=3.0, drive_harmonic=0.5)
    plans = plans_of(loads=(5000.0,), frequencies=(20.0,))
    settings = IdentifySettings(methods=(), phasors=PhasorSettings(excitation_lines=(20.0, 40.0)))
    good = identify(written(tmp_path / "good.h5", rig, plans), settings)
    assert [p.point.excitation_hz for p in good.points] == [20.0, 40.0]
    assert not any({"records-contradicted", "records-doubtful"} & set(p.quality) for p in good.points)

    def dead(values, run, rng):
        return np.full_like(values, 3.0) if "-20-2-" in run else values

    lost = identify(written(tmp_path / "dead.h5", replace(rig, devices={"F1": Device(reading=dead)}), plans), settings)
    assert all("run-left-out" in p.quality for p in lost.points)
    cells = replace(rig, devices={"F2": Device(gain=-1.0)})
    turned = identify(written(tmp_path / "cells.h5", cells, plans), settings)
    assert all("records-contradicted" in p.quality for p in turned.points)
