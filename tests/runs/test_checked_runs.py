"""Identification asks the checks: on the same reading of the records, with consequences at the points they touch."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.readers import series
from rigdata.readers.hdf5.reader import Hdf5Reader
from rigdata.readers.text import csv
from tests.rigs.acquisition import EXACT, Acquisition
from tests.rigs.closed_form import Rig, channels_of, with_entries, write_rig
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.check.findings import Reporter, verdicts
from tpjb_ident.check.observation import observe
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.run_data import PhasorSettings, beginning_of, with_kept_beginning
from tpjb_ident.phasors.run_phasors import run_phasors
from tpjb_ident.runs.run_jobs import packed, unpacked

QUICK = Rig(frequencies=(25.0,), directions=(0.0, 30.0, 60.0, 90.0, 120.0, 150.0), seconds=1.5)
HDF5 = Acquisition(rate=1000.0, uncertainty=EXACT)


def written(folder, rig, setup=HDF5, **sensors):
    """The campaign of a rig; `sensors` are what is different with channels of these first letters."""
    channels = channels_of(rig)
    for names, entries in sensors.items():
        channels = with_entries(channels, names, **entries)
    return load_campaign(write_rig(folder, rig, channels, setup, seed=3))


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return written(tmp_path_factory.mktemp("field"), QUICK)


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
    rig = replace(QUICK, keyphasor=True, directions=QUICK.directions[:3])
    campaign = written(tmp_path, rig, replace(HDF5, form="csv"))
    small = identify(campaign, IdentifySettings(methods=()))
    parsed = []
    plain = csv.read_table
    monkeypatch.setattr(series, "IN_MEMORY", 1000)
    monkeypatch.setattr(csv, "read_table", lambda source, wanted: parsed.append(len(wanted)) or plain(source, wanted))
    large = identify(load_campaign(campaign.path), IdentifySettings(methods=()))
    np.testing.assert_array_equal(large.points[0].stiffness.h, small.points[0].stiffness.h)
    assert large.points[0].quality == small.points[0].quality
    assert len(parsed) <= 5 * len(rig.directions)


def test_kept_readings_are_those_of_the_file(campaign):
    run = campaign.runs[0]
    kept = with_kept_beginning(run)
    for start, stop in ((0, 10), (700, 1500)):
        np.testing.assert_array_equal(kept.vector("force", start, stop).values, run.vector("force", start, stop).values)
        np.testing.assert_array_equal(kept.time(start, stop), run.time(start, stop))
    short = replace(kept, reader=type(kept.reader)(run.reader, list(run.channels), 400))
    assert beginning_of(short).length == 400
    np.testing.assert_array_equal(short.record("L1H").values, run.record("L1H").values)
    with pytest.raises(ValueError, match="read-only"):
        kept.reader.read(["L1H"], 0, 10)[0][0] = 1.0


def test_an_observation_that_was_kept_is_the_same(campaign):
    run = campaign.runs[2]
    seen = observe(run)
    seen.report.note("x", "warning", "here", "is odd", "Look")
    arrays = {}
    again = unpacked(packed(seen, arrays), arrays, run)
    assert packed(again, {}) == packed(seen, {})
    assert again.channels == seen.channels
    assert again.shaft_force == pytest.approx(seen.shaft_force, nan_ok=True)
    assert again.report.findings == seen.report.findings
    np.testing.assert_array_equal(again.lines.phasor, seen.lines.phasor)


def test_a_third_of_the_runs_share_a_finding(campaign):
    reports = [Reporter(run) for run in campaign.runs]
    for report in reports[:2]:
        report.note("two", "error", "", "wrong", "")
    for report in reports[2:5]:
        report.note("three", "error", "", "wrong", "")
        report.note("odd", "warning", "", "odd", "")
    found = verdicts(reports)
    assert list(found.unusable) == [run.id for run in campaign.runs[:2]]
    assert list(found.shared) == list(found.doubtful) == [run.id for run in campaign.runs[2:5]]


@pytest.mark.slow
def test_the_probes_zero_stands_in_the_positions_errors(campaign, tmp_path):
    zeros = {name: {"extra": (f'zero_uncertainty = "{size} um"',)} for name, size in (("X1A", 3), ("X1B", 4))}
    (stated,) = identify(written(tmp_path / "zero", QUICK, **zeros), IdentifySettings(methods=())).points
    (silent,) = identify(campaign, IdentifySettings(methods=())).points
    # probes at 45 and 135 deg: half of either variance along X and along Y
    expected = np.hypot(silent.position_se, 5e-6 / np.sqrt(2))
    np.testing.assert_allclose(stated.position_se, expected, rtol=1e-12)


@pytest.mark.slow
def test_one_inverted_probe_costs_its_run_inverted_cells_all_points(tmp_path):
    one = {"fault": lambda values, rng, number: -values if number == 2 else values}
    result = identify(written(tmp_path / "one", QUICK, X1A=one), IdentifySettings(methods=()))
    assert "run-left-out" in result.points[0].quality
    assert "records-contradicted" not in result.points[0].quality
    truth = QUICK.film.h(25.0, 5000.0)
    assert np.abs(result.points[0].stiffness.h - truth).max() < 0.01 * np.abs(truth).max()
    result = identify(written(tmp_path / "cells", QUICK, L1V={"gain": -1.0}), IdentifySettings(methods=()))
    assert "records-contradicted" in result.points[0].quality


@pytest.mark.slow
def test_records_of_several_excitations_are_checked_at_each(tmp_path):
    """The drive's second harmonic, made strong, serves as the other excitation."""
    rig = replace(QUICK, seconds=3.0, harmonic=0.5, frequencies=(20.0,))
    settings = IdentifySettings(methods=(), phasors=PhasorSettings(excitation_lines=(20.0, 40.0)))
    good = identify(written(tmp_path / "good", rig), settings)
    assert [p.point.excitation_hz for p in good.points] == [20.0, 40.0]
    assert not any({"records-contradicted", "records-doubtful"} & set(p.quality) for p in good.points)

    dead = {"fault": lambda values, rng, number: np.full_like(values, 3.0) if number == 2 else values}
    lost = identify(written(tmp_path / "dead", rig, L1H=dead), settings)
    assert all("run-left-out" in p.quality for p in lost.points)
    turned = identify(written(tmp_path / "cells", rig, L1V={"gain": -1.0}), settings)
    assert all("records-contradicted" in p.quality for p in turned.points)


@pytest.mark.slow
def test_a_drive_off_its_set_point_is_what_identification_makes_of_it(tmp_path):
    """By 2.8 %: measured where it is, as the run's phasors say, and no error of the check."""
    campaign = written(tmp_path, replace(QUICK, seconds=4.0, detune=0.7))
    assert check_campaign(campaign) == []
    for run in campaign.of_kind("dynamic"):
        phasors = run_phasors(run)
        assert phasors.conditions == ("excitation off set point",)
        assert phasors.lines.driven == (pytest.approx(25.7, abs=2e-3),)
