"""Records of other loggers: every file is written by that format's own library and read through the same Run."""

import math
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rigdata import RigDataError, load_campaign
from rigdata.readers import series
from rigdata.readers.base import FORMATS, ReadingCache
from rigdata.readers.file_reader import FileReader
from rigdata.readers.series import Series, equidistant, is_time, seconds, with_unique_names
from tests.foreign_files import read_series, write_columns, write_data_set, write_groups, write_mat73
from tests.manifests import PROBE, SET_POINT, manifest, write_files
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
GROUPS = (TIME, {"X1A": ("V", X), "L1H": ("kN", F)}), (SLOW, {"T1": ("degC", T)})
ALL = {"t": TIME, "X1A": X, "L1H": F, "T1": np.interp(TIME, SLOW, T)}


def write_catman(path: Path) -> None:
    """Two clocks, the slow part padded with blanks, below a title."""
    columns = {"Zeit  1 - Standardrate [s]": TIME, "X1A [V]": X, "L1H [kN]": F}
    write_columns(path, columns | {"Zeit  2 - langsam [s]": SLOW, "T1 [°C]": T})
    path.write_bytes("CATMAN\r\nKanäle: 5\r\n\r\n".encode("cp1252") + path.read_bytes())


WRITERS = {
    "one.tdms": lambda path: write_groups(path, GROUPS[0], (SLOW, GROUPS[1][1] | {"remark": ("", ["a text"])})),
    "one.unv": lambda path: write_groups(path, *GROUPS),
    "one.mf4": lambda path: write_groups(path, *GROUPS),
    "one.mat": lambda path: write_columns(path, ALL | {"note": "text"}),
    "new.mat": lambda path: write_mat73(path, ALL | {"note": "te"}),
    "one.parquet": lambda path: write_columns(path, ALL | {"who": ["me"] * COUNT}),
    "one.asc": write_catman,
}
#: Formats that hold one table, with a thermometer at every sample.
ONE_RATE = ("one.mat", "new.mat", "one.parquet")
#: MDF takes a second for each file, since its library is loaded in a process of its own.
SLOWLY_READ = {"one.mf4": pytest.mark.slow}


def read(path: Path) -> list[Series]:
    return read_series(path, path.name)


@pytest.fixture(params=[pytest.param(name, marks=SLOWLY_READ.get(name, ())) for name in WRITERS])
def campaign(request, tmp_path):
    WRITERS[request.param](tmp_path / request.param)
    one = {"id": "one", "file": request.param, "kind": "dynamic", "excitation_frequency": "25 Hz", **SET_POINT}
    return write_files(tmp_path, manifest(CHANNELS, one))


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
    text = (campaign / "campaign.toml").read_text(encoding="utf-8")
    with pytest.raises(RigDataError, match="Did you mean 'X1A'"):
        load_campaign(write_files(campaign, text.replace("channels.X1A", "channels.X1a"))).run("one").record("X1a")


def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch):
    (tmp_path / "a.tdms").write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "nptdms", None)
    monkeypatch.delitem(sys.modules, "rigdata.readers.formats.loggers", raising=False)
    with pytest.raises(RigDataError, match=r'pip install "tpjb-ident\[tdms\]"'):
        read(tmp_path / "a.tdms")


def linked(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["x"] = h5py.ExternalLink("/etc/passwd", "/x")


FREQUENCY = np.arange(16.0)
NO_RECORDS = {
    "link.mat": (linked, "is a link"),
    "a.mat": (
        lambda path: savemat(path, {"gain": 2.0, "note": "bearing 3"}),
        "no vector of at least 8 numbers, only gain, note",
    ),
    "a.uff": (
        lambda path: write_data_set(path, FREQUENCY, FREQUENCY * (1 + 1j), func_type=4, id1="H"),
        "no record over time, only 1 x function type 4",
    ),
    "a.tmds": (lambda path: path.write_text("x"), "did you mean .tdms"),
    "a.tdm": (lambda path: path.write_text("x"), "did you mean .tdms"),
    "a.xlsx": (lambda path: path.write_text("x"), "export it as .csv"),
    **{f"empty{suffix}": (lambda path: path.write_bytes(b""), "is empty") for suffix in sorted(FORMATS)},
}


@pytest.mark.parametrize("name", NO_RECORDS)
def test_what_holds_no_record_says_why(tmp_path, name):
    write, says = NO_RECORDS[name]
    write(tmp_path / name)
    with pytest.raises(RigDataError, match=says):
        read(tmp_path / name)


@pytest.mark.parametrize("name", ["one.tdms", "one.parquet", "one.unv"])
def test_long_channels_wait_in_files_and_read_as_short_ones_do(tmp_path, monkeypatch, name):
    path = tmp_path / name
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


def test_a_cache_lets_go_of_old_runs():
    cache = ReadingCache(limit=2000)
    made = []
    for i in [0, 1, 2, 3, 4, 4, 3, 0, 3]:  # 3 was asked for after 4
        cache.get((i,), lambda i=i: made.append(i) or np.zeros(100))
    assert made == [0, 1, 2, 3, 4, 0]


@pytest.mark.parametrize(("groups", "names"), [(("g1", "g2"), ["g1.a", "g2.a"]), (("", ""), ["a", "a_2"])])
def test_channels_of_one_name_get_their_groups_name_or_a_number(groups, names):
    alike = with_unique_names([Series("a", "", np.zeros(3), group=group) for group in groups])
    assert [channel.name for channel in alike] == names


def test_a_text_of_any_suffix_is_a_table(tmp_path):
    (tmp_path / "a.xyz").write_text("t;x\n0;1\n1;2\n2;3\n", encoding="utf-8")
    (column,) = read(tmp_path / "a.xyz")
    assert (column.name, column.values.tolist(), column.rate) == ("x", [1.0, 2.0, 3.0], 1.0)


def test_a_rate_is_asked_for_where_the_file_knows_none(tmp_path):
    savemat(tmp_path / "a.mat", {"X1A": X})
    with pytest.raises(RigDataError, match="sample_rate"):
        FileReader(tmp_path / "a.mat", "a.mat", "r", {}).rate()
    assert FileReader(tmp_path / "a.mat", "a.mat", "r", {}, stated_rate=500.0).time(0, 3)[2] == pytest.approx(0.004)


@pytest.mark.parametrize("rows", [False, True])
def test_a_matrix_is_named_by_the_texts_beside_it(tmp_path, rows):
    data = np.stack([TIME, X, -X], axis=1)
    names, units = np.array(["Time", "X1A", "L1H"], dtype=object), np.array(["ms", "V", "mV"], dtype=object)
    savemat(tmp_path / "a.mat", {"Data": data.T if rows else data, "ChannelNames": names, "ChannelUnits": units})
    x, force = read(tmp_path / "a.mat")
    assert [(s.name, s.unit) for s in (x, force)] == [("X1A", "V"), ("L1H", "mV")]
    np.testing.assert_allclose(x.values, X)
    assert x.rate == pytest.approx(1e3 * RATE)


def test_a_matrix_in_a_file_of_version_seven_three_is_named_likewise(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["Data"] = np.stack([TIME, X, -X])  # MATLAB's columns are rows here
        cells = []
        for i, name in enumerate(["Time", "X1A", "L1H"]):
            text = file.create_dataset(f"#refs#/{i}", data=np.array([[ord(c)] for c in name], dtype=np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(text.ref)
        file.create_dataset("ChannelNames", data=np.array([cells], dtype=object).T, dtype=h5py.ref_dtype)
    x, force = read(tmp_path / "a.mat")
    assert (x.name, force.name) == ("X1A", "L1H")
    np.testing.assert_allclose(x.values, X)
    assert x.rate == pytest.approx(RATE)


TIMES = ("Zeit", "TIME [s]", "Time  1 - default sample rate", "t", "t [ms]", "Temps")
OTHERS = ("T", "T1", "Temperature", "Timer", "X1A", "torque", "Tempo1", "")


@pytest.mark.parametrize("name", TIMES + OTHERS)
def test_times_by_name(name):
    assert is_time(name) == (name in TIMES)


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [("Zeit", "[ms]", 1e-3), ("time_ms", "", 1e-3), ("time (ms)", "", 1e-3), ("t [ms]", "", 1e-3), ("t", "", 1.0)],
)
def test_times_in_other_units_and_a_signalling_nan_is_a_missing_time(name, unit, factor):
    times = np.array([0, 0x7FF0000000000001, 0x4000000000000000], dtype="u8").view("f8")
    np.testing.assert_allclose(seconds(Series(name, unit, times)), [0.0, np.nan, 2.0 * factor])
