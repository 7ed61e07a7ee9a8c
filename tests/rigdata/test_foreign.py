"""Records of other loggers: every file is written by that format's own library and read through the same Run."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from rigdata import RigDataError, load_campaign
from rigdata.readers import series
from rigdata.readers.base import FORMATS
from rigdata.readers.file_reader import FileReader, ReadingCache, read_series
from rigdata.readers.series import Contents, Series, equidistant, is_time, seconds, with_unique_names
from tests.foreign_files import write_mdf, write_tdms, write_uff
from tests.manifests import PROBE, SET_POINT, manifest
from tpjb_ident.check.campaign import check_campaign

RATE, COUNT = 1000.0, 2000
TIME = np.arange(COUNT) / RATE
X = np.sin(2 * math.pi * 25 * TIME) - 0.3
F = 2.0 * np.cos(2 * math.pi * 25 * TIME)
SLOW = TIME[::100]
T = 40.0 + SLOW

CHANNELS = {
    "X1A": PROBE | {"axis": "45 deg", "unit": "V", "sensitivity": "7.78 mV/um", "polarity": -1},
    "L1H": {"quantity": "force", "axis": "0 deg", "unit": "kN"},
    "T1": {"quantity": "temperature", "unit": "degC"},
}


def write_loggers_tdms(path: Path) -> None:
    fast, slow = ({"wf_increment": step, "wf_start_offset": 0.0} for step in (1 / RATE, 100 / RATE))
    channels = [("fast", "X1A", X, {**fast, "unit_string": "V"}), ("fast", "L1H", F, {**fast, "unit_string": "kN"})]
    write_tdms(path, [*channels, ("slow", "T1", T, slow), ("slow", "remark", ["a text"], {})])


def write_loggers_uff(path: Path) -> None:
    write_uff(path, {"X1A": (1 / RATE, X), "L1H": (1 / RATE, F), "T1": (100 / RATE, T)})


def write_loggers_mdf(path: Path) -> None:
    write_mdf(path, [(TIME, {"X1A": ("V", X), "L1H": ("kN", F)}), (SLOW, {"T1": ("degC", T)})])


ALL = {"t": TIME, "X1A": X, "L1H": F, "T1": np.interp(TIME, SLOW, T)}


def write_mat5(path: Path) -> None:
    savemat(path, {**ALL, "note": "text"}, oned_as="column")


def write_mat73(path: Path) -> None:
    # the library behind MATLAB's save -v7.3 is HDF5; MATLAB puts 512 bytes of its own text in front
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in ALL.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("note", data=np.frombuffer(b"t\0e\0", dtype="uint16"))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\x02IM")


def write_parquet(path: Path) -> None:
    pd.DataFrame({**ALL, "who": "me"}).to_parquet(path, index=False)


def write_catman(path: Path) -> None:
    """Write a table as catman exports it: two clocks, tabs, decimal comma, the slow part padded with blanks."""
    lines = ["CATMAN", "Kanäle: 5", "", "Zeit  1 - Standardrate [s]\tX1A [V]\tL1H [kN]\tZeit  2 - langsam [s]\tT1 [°C]"]
    for i in range(COUNT):
        cells = [f"{TIME[i]:.4f}", f"{X[i]:.6f}", f"{F[i]:.6f}"]
        cells += [f"{SLOW[i]:.2f}", f"{T[i]:.4f}"] if i < len(SLOW) else ["", ""]
        lines.append("\t".join(cells).replace(".", ","))
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode("cp1252"))


WRITERS = {
    "one.tdms": write_loggers_tdms,
    "one.unv": write_loggers_uff,
    "one.mf4": write_loggers_mdf,
    "one.mat": write_mat5,
    "new.mat": write_mat73,
    "one.parquet": write_parquet,
    "one.asc": write_catman,
}


#: Formats that hold one table, with a thermometer at every sample.
ONE_RATE = ("one.mat", "new.mat", "one.parquet")
#: MDF takes a second for each file, since its library is loaded in a process of its own.
SLOWLY_READ = {"one.mf4": pytest.mark.slow}


@pytest.fixture(params=[pytest.param(name, marks=SLOWLY_READ.get(name, ())) for name in WRITERS])
def campaign(request, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # what other people's writers warn of is not ours to judge
        WRITERS[request.param](tmp_path / request.param)
    one = {"id": "one", "file": request.param, "kind": "dynamic", "excitation_frequency": "25 Hz", **SET_POINT}
    (tmp_path / "campaign.toml").write_text(manifest(CHANNELS, one), encoding="utf-8")
    return tmp_path


def test_every_format_comes_through_the_same_record(campaign):
    run = load_campaign(campaign).run("one")
    record = run.record("X1A")
    assert record.rate == pytest.approx(RATE)
    assert len(record) == COUNT
    np.testing.assert_allclose(record.values, -X / 7780.0, atol=1e-9)  # 7.78 mV/um, polarity -1
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(run.record("L1H").values, 1e3 * F, atol=1e-3)
    warm = run.record("T1")
    assert len(warm) == (COUNT if run.file in ONE_RATE else len(SLOW))
    np.testing.assert_allclose(warm.values, 313.15 + np.minimum(warm.time, SLOW[-1]), atol=1e-3)
    np.testing.assert_array_equal(run.record("X1A", 10, 20).values, record.values[10:20])
    assert not [p for p in check_campaign(campaign) if "cannot be read" in p.what]


def test_a_misspelt_channel_is_answered_with_the_nearest(campaign):
    text = (campaign / "campaign.toml").read_text(encoding="utf-8").replace("channels.X1A", "channels.X1a")
    (campaign / "campaign.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RigDataError, match="Did you mean 'X1A'"):
        load_campaign(campaign).run("one").record("X1a")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "content"),
    [
        pytest.param(name, content, id=f"{name} {content[:4].decode()}")
        for name in ("one.tdms", "one.unv", "one.mf4", "one.mat", "one.parquet")
        for content in (b"rubbish\n" * 50, b"TDSm" + b"\xff" * 400, b"PAR1" + b"\0" * 64)
        if name != "one.mf4" or content.startswith(b"rubbish")  # others: tests/hostile/test_sandboxed_reader.py
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_broken_file_is_refused_by_name(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RigDataError) as caught:
        read_series(tmp_path / name, name)
    assert name in str(caught.value)


def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch):
    import sys

    (tmp_path / "a.tdms").write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "nptdms", None)
    monkeypatch.delitem(sys.modules, "rigdata.readers.formats.loggers", raising=False)
    with pytest.raises(RigDataError, match=r'pip install "tpjb-ident\[tdms\]"'):
        read_series(tmp_path / "a.tdms", "a.tdms")


def test_links_out_of_a_matlab_file_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["x"] = h5py.ExternalLink("/etc/passwd", "/x")
    with pytest.raises(RigDataError, match="is a link"):
        read_series(tmp_path / "a.mat", "a.mat")


@pytest.mark.parametrize("suffix", sorted(FORMATS))
def test_an_empty_file_is_called_empty(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_bytes(b"")
    with pytest.raises(RigDataError, match="is empty"):
        read_series(tmp_path / f"a{suffix}", f"a{suffix}")


def test_a_matlab_file_without_vectors_says_what_it_holds(tmp_path):
    savemat(tmp_path / "a.mat", {"gain": 2.0, "note": "bearing 3"})
    with pytest.raises(RigDataError, match="no vector of at least 8 numbers, only gain, note"):
        read_series(tmp_path / "a.mat", "a.mat")


@pytest.mark.parametrize("name", ["one.tdms", "one.parquet", "one.unv"])
def test_long_channels_wait_in_files_and_read_as_short_ones_do(tmp_path, monkeypatch, name):
    path = tmp_path / name
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        WRITERS[name](path)
    short = FileReader(path, path.name, "r", {})
    monkeypatch.setattr(series, "IN_MEMORY", 1000)
    equidistant.cache_clear()
    long = FileReader(path, path.name, "r", {})
    assert any(isinstance(v, np.memmap) for v in long._layout().values.values())
    for start, stop in ((0, COUNT), (17, 400), (COUNT - 3, COUNT)):
        np.testing.assert_array_equal(long.read(["X1A"], start, stop), short.read(["X1A"], start, stop))
        np.testing.assert_array_equal(long.time(start, stop), short.time(start, stop))


def test_a_campaign_keeps_few_columns_however_many_runs_it_has(tmp_path):
    cache = ReadingCache(limit=3 * 8 * COUNT)
    for i in range(6):
        savemat(tmp_path / f"{i}.mat", {"X1A": X + i, "fs": RATE})
        reader = FileReader(tmp_path / f"{i}.mat", f"{i}.mat", "r", {}, cache=cache)
        assert reader.read(["X1A"], 0, 1)[0][0] == X[0] + i
    assert cache.nbytes <= 3 * 8 * COUNT


def arranged(series):
    return FileReader(Path("f"), "f", "r")._arranged(Contents(series))


def test_a_channel_of_another_length_without_times_is_a_fault_of_that_channel():
    same = [Series("b", "", np.zeros(5)), Series("c", "", np.zeros(5))]
    layout = arranged([Series("a", "", np.zeros(4)), *same])
    assert layout.grids[0].channels == ["b", "c"]
    assert "has 4 samples and no times, the others have 5" in str(layout.faults["a"])


def test_slow_channels_stay_at_their_own_times():
    fast = Series("a", "V", np.arange(11.0), 0.1 * np.arange(11))
    slow = Series("b", "K", np.array([0.0, 1.0]), np.array([0.2, 0.8]))
    layout = arranged([slow, fast])
    first, second = layout.grids
    assert (first.length, first.rate, second.length) == (11, 10.0, 2)
    np.testing.assert_array_equal(layout.times[second.clock], slow.time)
    np.testing.assert_array_equal(layout.values["b"], slow.values)


@pytest.mark.parametrize(("groups", "names"), [(("g1", "g2"), ["g1.a", "g2.a"]), (("", ""), ["a", "a_2"])])
def test_channels_of_one_name_get_their_groups_name_or_a_number(groups, names):
    series = with_unique_names([Series("a", "", np.zeros(3), group=group) for group in groups])
    assert [channel.name for channel in series] == names


def test_a_text_of_any_suffix_is_a_table(tmp_path):
    (tmp_path / "a.xyz").write_text("t;x\n0;1\n1;2\n2;3\n", encoding="utf-8")
    (column,) = read_series(tmp_path / "a.xyz", "a.xyz")
    assert (column.name, column.values.tolist(), column.rate) == ("x", [1.0, 2.0, 3.0], 1.0)


def test_a_rate_is_asked_for_where_the_file_knows_none(tmp_path):
    savemat(tmp_path / "a.mat", {"X1A": X})
    with pytest.raises(RigDataError, match="sample_rate"):
        FileReader(tmp_path / "a.mat", "a.mat", "r", {}).rate()
    assert FileReader(tmp_path / "a.mat", "a.mat", "r", {}, stated_rate=500.0).time(0, 3)[2] == pytest.approx(0.004)


TIMES = ("Zeit", "TIME [s]", "Time  1 - default sample rate", "t", "t [ms]", "Temps")
OTHERS = ("T", "T1", "Temperature", "Timer", "X1A", "torque", "Tempo1", "")


@pytest.mark.parametrize("name", TIMES + OTHERS)
def test_times_by_name(name):
    assert is_time(name) == (name in TIMES)


def test_times_in_other_units():
    for name, unit in (("Zeit", "[ms]"), ("time_ms", ""), ("time (ms)", ""), ("t [ms]", "")):
        np.testing.assert_allclose(seconds(Series(name, unit, np.array([1.0, 2.0]))), [1e-3, 2e-3])
    np.testing.assert_allclose(seconds(Series("t", "", np.array([1.0, 2.0]))), [1.0, 2.0])


def test_a_signalling_nan_among_times_is_a_missing_time():
    times = np.array([0, 0x7FF0000000000001, 0x4000000000000000], dtype="u8").view("f8")
    np.testing.assert_array_equal(seconds(Series("t", "ms", times)), [0.0, np.nan, 0.002])
