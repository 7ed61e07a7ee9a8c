"""The special cases of hostile input, one by one: endless lines, claims of billions, links, numbers, names, folders."""

import resource
import time
from contextlib import contextmanager

import h5py
import numpy as np
import pytest

import rigdata
from model.bearing import BearingError
from model.bearing_file import load_bearing
from model.effects import EffectError, load_effects
from model.pivots import load_pivots
from rigdata.manifest.manifest import parse_manifest
from rigdata.problem import RigDataError
from rigdata.readers.base import FORMATS
from tests.foreign_files import read_series
from tests.manifests import PROBE, manifest, write_files, write_hdf5

pytestmark = pytest.mark.slow
RUN = {"id": "c-1", "file": "c-1.csv", "kind": "clearance"}
VOLTS = PROBE | {"unit": "V", "sensitivity": "7.78 mV/um"}
GIGABYTES = 2**32
LOADERS = {"c": rigdata.load_campaign, "b": load_bearing, "p": load_pivots, "e": load_effects}


def text_of(channel=PROBE, name="X1A"):
    """Manifest of one channel and one run."""
    return manifest({name: channel}, RUN, acquisition={"sample_rate": "10 Hz"})


def folder_run(folder, record, name="X1A"):
    return rigdata.load_campaign(write_files(folder, text_of(name=name), {"c-1.csv": record})).run("c-1")


@contextmanager
def refused_at_once(error, match, seconds=5.0, kilobytes=2**17):
    """Refuse, in that much processor time and memory at most."""
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(error, match=match):
        yield
    assert time.process_time() - began < seconds
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < kilobytes


@pytest.mark.parametrize("head", [b"", b"X1A\n", b"X1A\n1.5\n2.5\n3.5\n", b"X1A;X1B\n1.5;2\n2.5"])
def test_a_line_of_four_gigabytes_is_refused_in_little_time_and_memory(tmp_path, head):
    run = folder_run(tmp_path, head)
    with (tmp_path / "c-1.csv").open("r+b") as stream:
        stream.truncate(GIGABYTES)  # a hole: no disk is used
    with refused_at_once(RigDataError, r"c-1\.csv", kilobytes=2**18):
        run.record("X1A")


@pytest.mark.parametrize("name", ["campaign.toml", "b.toml", "p.toml", "e.effects.toml"])
def test_a_toml_file_of_four_gigabytes_is_refused_unread(tmp_path, name):
    path = tmp_path / name
    with path.open("wb") as stream:
        stream.truncate(GIGABYTES)
    with refused_at_once((RigDataError, BearingError, EffectError), None, seconds=2.0):
        LOADERS[name[0]](path)


def test_a_manifest_of_more_runs_than_any_campaign_has():
    with pytest.raises(RigDataError, match=r"more than 100000 runs|larger than"):
        parse_manifest(text_of(VOLTS) + "[[runs]]\n" * 100_001)


def test_a_group_linked_into_itself_is_walked_once(tmp_path):
    path = write_hdf5(tmp_path / "a.h5", text_of(), {"X1A": np.arange(20.0)}, 100.0)
    with h5py.File(path, "r+") as file:
        file["runs/c-1/again"] = file["runs/c-1"]  # a hard link: /runs/c-1/again/again/...
    run = rigdata.load_campaign(path).run("c-1")
    assert len(run.record("X1A").values) == 20
    assert run.reader.problems()


@pytest.mark.parametrize("gain", ["nan mV/um", "inf mV/um", "1e999 mV/um", "1e-400 mV/um"])
def test_endless_and_vanishing_sensitivities_are_named(gain):
    with pytest.raises(RigDataError, match="sensitivity"):
        parse_manifest(text_of(VOLTS | {"sensitivity": gain}))


@pytest.mark.parametrize("unit", ["0", "-um", "um^0", "um^99999", "1e5 um", "um/0", "V**V", "\u202emu", "µ" * 500])
def test_units_that_are_none(unit):
    with pytest.raises(RigDataError, match="unit"):
        parse_manifest(text_of(VOLTS | {"unit": unit, "sensitivity": "1 V/V"}))


@pytest.mark.parametrize("name", ["Größe µ", "شبه", "\u202eA1X", "日本", "e\u0301", "\U0001f600", "a\u2066b"])
def test_channel_names_of_any_writing_are_taken_or_told_in_print(tmp_path, name):
    told = []
    try:
        assert len(folder_run(tmp_path, f"{name}\n" + "1.5\n" * 5, name).record(name).values) == 5
    except RigDataError as error:
        told = str(error).splitlines()
    assert all(line.isprintable() for line in told)


@pytest.mark.parametrize("suffix", [*FORMATS, ".asc"])
def test_a_folder_in_the_place_of_a_record(tmp_path, suffix):
    (tmp_path / f"r{suffix}").mkdir()
    with pytest.raises(RigDataError, match=r"not there|not an ordinary file"):
        read_series(tmp_path / f"r{suffix}", f"r{suffix}")


@pytest.mark.parametrize("load", LOADERS.values())
def test_a_folder_in_the_place_of_a_file(tmp_path, load):
    folder = tmp_path / "x.toml"
    folder.mkdir()
    with pytest.raises((RigDataError, BearingError, EffectError), match=r"x\.toml"):
        load(folder)
