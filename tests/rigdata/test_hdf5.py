"""HDF5 campaigns: slices, rates, links, storage, filters."""

import subprocess
import sys
import tracemalloc
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest

import rigdata
from rigdata.problem import RigDataError
from rigdata.readers import base
from rigdata.readers.hdf5 import guards
from rigdata.readers.hdf5.guards import too_long_text
from tests.manifests import PROBES, SWEEP, manifest, write_hdf5
from tpjb_ident.check.campaign import check_campaign

MANIFEST = manifest(PROBES, SWEEP, acquisition={"sample_rate": "10 Hz"})
CLOCK = {"quantity": "time", "unit": "ms"}
N = 1000
COLUMNS = {"X1A": np.arange(N, dtype="f4"), "X1B": np.arange(N, dtype="f4") * 2}


def make(path: Path, manifest: str = MANIFEST, rate: object = 500.0) -> rigdata.Run:
    return reopened(write_hdf5(path, manifest, COLUMNS, rate, chunks=(100,), compression="gzip", shuffle=True))


@pytest.fixture
def path(tmp_path) -> Path:
    """A good file."""
    make(tmp_path / "c.h5")
    return tmp_path / "c.h5"


@contextmanager
def changed(path: Path, *dropped: str):
    """The group of the run in a good file, without some of its channels; the file itself is `group.file`."""
    with h5py.File(path, "r+") as file:
        for name in dropped:
            del file[f"runs/c-1/{name}"]
        yield file["runs/c-1"]


def reopened(path: Path) -> rigdata.Run:
    return rigdata.load_campaign(path).run("c-1")


def refused(path: Path, *says: str, channel: str = "X1A") -> None:
    with pytest.raises(RigDataError) as caught:
        reopened(path).record(channel)
    for part in (path.name, *says):
        assert part in str(caught.value)
    assert any(p.severity == "error" for p in check_campaign(path))


def test_values_are_calibrated_float64(path):
    run = reopened(path)
    record = run.record("X1A", 10, 13)
    assert record.values.dtype == np.float64
    assert record.values == pytest.approx([10e-6, 11e-6, 12e-6])
    assert record.time == pytest.approx(np.array([10, 11, 12]) / 500.0)
    assert (run.length, run.file) == (N, "c.h5:/runs/c-1")
    assert rigdata.load_campaign(path).bearing_text == 'name = "b"\n'


def test_a_slice_reads_only_its_own_samples(path, monkeypatch):
    run = reopened(path)
    asked = []
    plain = h5py.Dataset.__getitem__

    def spy(self, key, *rest, **more):
        asked.append(key)
        return plain(self, key, *rest, **more)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", spy)
    run.vector("displacement", 200, 300)
    assert asked == [slice(200, 300), slice(200, 300)]


@pytest.mark.parametrize(("of_run", "attribute", "rate"), [(250, 500.0, 500.0), (250, None, 250.0), (None, None, 10.0)])
def test_attribute_wins_over_run_which_wins_over_acquisition(tmp_path, of_run, attribute, rate):
    text = MANIFEST + (f'sample_rate = "{of_run} Hz"\n' if of_run else "")
    assert make(tmp_path / "a.h5", text, rate=attribute).sample_rate == rate


@pytest.mark.parametrize(("name", "described"), [("t", {"t": CLOCK}), ("Time", {})])
def test_a_time_dataset_counts_as_described_or_by_its_name_where_no_rate_is_stated(tmp_path, name, described):
    path = tmp_path / "c.h5"
    make(path, manifest(PROBES | described, SWEEP), rate=None)
    with changed(path) as group:
        group[name] = np.arange(N) * 4.0 + 1.0
        group[name].attrs.update({} if described else {"unit": "ms"})
    run = reopened(path)
    assert run.sample_rate == pytest.approx(250.0)
    assert run.record("X1A", 0, 2).time == pytest.approx([0.001, 0.005])


def test_a_stated_rate_counts_where_the_time_dataset_is_missing_or_nobody_describes_it(tmp_path):
    path = tmp_path / "c.h5"
    assert make(path, manifest(PROBES | {"t": CLOCK}, SWEEP)).record("X1A").time[1] == pytest.approx(1 / 500)
    assert reopened(write_hdf5(path, MANIFEST, COLUMNS | {"Time": np.zeros(N)}, None)).sample_rate == 10.0


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf, 1e300, "abc", "500", [1.0, 2.0]])
def test_senseless_rates(tmp_path, rate):
    """A text stands elsewhere in the file."""
    make(tmp_path / "c.h5", rate=rate)
    refused(tmp_path / "c.h5", "attribute sample_rate_hz", "is no rate")


@pytest.mark.parametrize("rate", ["1e-300 Hz", "1e13 Hz"])
def test_a_rate_that_no_times_can_be_counted_from_is_refused(tmp_path, rate):
    make(tmp_path / "a.h5", MANIFEST.replace("10 Hz", rate), rate=None)
    refused(tmp_path / "a.h5", "sample rate: is 1e", "sample_rate in the manifest")


def external_storage(group):
    group.create_dataset("X1A", shape=(N,), dtype="f8", external=[("raw.bin", 0, N * 8)])


def virtual_dataset(group):
    layout = h5py.VirtualLayout(shape=(N,), dtype="f4")
    layout[:] = h5py.VirtualSource("other.h5", "runs/c-1/X1A", shape=(N,))
    group.create_virtual_dataset("X1A", layout)


def foreign_filter(group):
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_chunk((100,))
    creation.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, ())  # zstd, a plug-in
    h5py.h5d.create(group.id, b"X1A", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((N,)), creation)


def stored(data):
    return lambda group: group.create_dataset("X1A", data=data)


def linked(target, **others):
    """A record that is a link, and what else is at the top of the file."""

    def link(group):
        for name, content in others.items():
            group.file[name] = content
        group["X1A"] = h5py.SoftLink(target) if isinstance(target, str) else target

    return link


def chain(length):
    """A soft link to a soft link, and so on, to a record."""
    links = {f"link{i}": h5py.SoftLink(f"/link{i - 1}") for i in range(1, length + 1)}
    return linked(f"/link{length}", link0=np.full(N, 7.0), **links)


NO_RECORDS = {
    "external link": (linked(h5py.ExternalLink("other.h5", "/runs/c-1/X1A")), ("link out of the file", "other.h5")),
    "soft link through an external one": (
        linked("/outside/runs/c-1/X1A", outside=h5py.ExternalLink("other.h5", "/")),
        ("link out of the file",),
    ),
    "external storage": (external_storage, ("another file",)),
    "virtual": (virtual_dataset, ("another file",)),
    "foreign filter": (foreign_filter, ("filter 32015",)),
    "group": (lambda group: group.create_group("X1A"), ("X1A", "not a dataset")),
    "matrix": (stored(np.zeros((3, 3))), ("X1A", "not 1-D numbers")),
    "texts": (stored(np.array(["a", "b"], dtype="S1")), ("X1A", "not 1-D numbers")),
    "complex": (stored(np.zeros(3, dtype="c8")), ("X1A", "not 1-D numbers")),
    "dangling": (linked("/nowhere"), ("X1A",)),
    "link to itself": (linked("/runs/c-1/X1A"), ("X1A",)),
    "circle of links": (linked("/loop", loop=h5py.SoftLink("/runs/c-1/X1A")), ("X1A",)),
    "long chain of links": (chain(62), ("circle of links, or too deep",)),
    "longer chain of links": (chain(200), ("circle of links, or too deep",)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NO_RECORDS)
def test_what_is_no_record_in_this_file_is_refused_before_anything_is_loaded(path, name):
    store, says = NO_RECORDS[name]
    make(path.with_name("other.h5"))
    path.with_name("raw.bin").write_bytes(bytes(8 * N))
    with changed(path, "X1A") as group:
        store(group)
    refused(path, *says)


@pytest.mark.parametrize(
    ("store", "value"),
    [
        (chain(1), 7e-6),
        (chain(3), 7e-6),
        (stored(np.arange(N, dtype=">i2")), 5e-6),  # counts, big-endian
        (stored(np.full(N, 0x7F800001, "u4").view("f4")), np.nan),  # signals
        *((stored(np.full(N, value)), np.nan) for value in (np.nan, np.inf, -np.inf, 1e31, -3e38)),
    ],
)
def test_records_of_every_kind_are_taken(path, store, value):
    with changed(path, "X1A") as group:
        store(group)
    assert reopened(path).record("X1A").values[5] == pytest.approx(value, nan_ok=True)


def test_decompression_bombs(path, monkeypatch):
    with changed(path, "X1A", "X1B") as group:
        group.create_dataset("X1A", shape=(10**13,), dtype="f8", chunks=(1000,), compression="gzip")
        group.create_dataset("X1B", shape=(N,), maxshape=(None,), dtype="f8", chunks=(10**9 // 2,))
    refused(path, "claims 80004000 MB")
    monkeypatch.setattr(base, "CLAIM_FREE", 10**15)
    refused(path, "X1A: claims 10000000000000 samples")
    with pytest.raises(RigDataError, match="chunks"):
        reopened(path).reader.read(["X1B"], 0, 10)


def test_a_request_for_billions_of_samples_is_refused(path, monkeypatch):
    monkeypatch.setattr(base, "CLAIM_FREE", 2**40)
    with changed(path, "X1A", "X1B") as group:
        for name in ("X1A", "X1B"):
            group.create_dataset(name, shape=(2**30,), dtype="f4", chunks=(1000,), fillvalue=1.0)
    run = reopened(path)
    with pytest.raises(RigDataError, match="in slices"):
        run.record("X1A")
    assert run.record("X1A", 2**29, 2**29 + 3).values == pytest.approx([1e-6] * 3)


def test_short_missing_channels_and_what_takes_the_place_of_the_group(path):
    with changed(path, "X1B") as group:
        group["X1B"] = np.zeros(N - 5)
    refused(path, "X1B: has 995 samples and no times, the others have 1000", channel="X1B")
    with changed(path, "X1B"):
        pass
    refused(path, "X1B: channel is missing in the file", channel="X1B")
    with changed(path) as group:
        del group.file["runs/c-1"]
    refused(path, "group is missing")
    with h5py.File(path, "r+") as file:
        file["runs/c-1"] = 3.0
    refused(path, "not a group")


@pytest.mark.parametrize("bad", [b"", b"no hdf5 at all", b"\x89HDF\r\n\x1a\n" + b"\0" * 100])
def test_files_that_are_no_hdf5(tmp_path, bad):
    (tmp_path / "c.h5").write_bytes(bad)
    with pytest.raises(RigDataError, match="HDF5"):
        rigdata.load_campaign(tmp_path / "c.h5")


@pytest.mark.slow  # a lock is seen by other processes only
def test_a_file_that_is_being_written(path):
    code = "import sys, rigdata\ntry:\n  rigdata.load_campaign(sys.argv[1])\nexcept rigdata.RigDataError as e: print(e)"
    with changed(path):
        told = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)
    assert "being written by another program" in told.stdout, told


def test_truncated_and_scrambled_files(path):
    good = path.read_bytes()
    rng = np.random.default_rng(5)
    for _ in range(60):
        data = bytearray(good)
        if rng.random() < 0.3:
            data = data[: rng.integers(100, len(data))]
        for at in rng.integers(0, len(data), rng.integers(1, 30)):
            data[at] = rng.integers(0, 256)
        path.write_bytes(bytes(data))
        assert all(p.what and p.file for p in check_campaign(path))


@pytest.mark.parametrize("value", [None, 3.0, b"\xff\xfe", "", np.arange(4), np.bytes_(MANIFEST.encode())])
def test_manifest_attribute_must_be_text_which_may_be_of_fixed_length(path, value):
    with changed(path) as group:
        del group.file.attrs["manifest"]
        if value is not None:
            group.file.attrs["manifest"] = value
    if isinstance(value, np.bytes_):
        assert rigdata.load_campaign(path).id == "t"
        return
    with pytest.raises(RigDataError, match="manifest"):
        rigdata.load_campaign(path)


def test_nothing_is_written_and_no_file_stays_open(path):
    before = path.read_bytes()
    path.chmod(0o444)
    reopened(path).vector("displacement")
    check_campaign(path)
    assert path.read_bytes() == before
    assert h5py.h5f.get_obj_count(h5py.h5f.OBJ_ALL, h5py.h5f.OBJ_FILE) == 0


@pytest.mark.parametrize("reserved", [0, 0x7F])
def test_heap_that_the_library_would_walk_for_ever(path, reserved):
    """One wrong byte: the free space of the heap that holds the manifest claims size zero."""

    def entry(at: int) -> tuple[int, int]:
        return int.from_bytes(data[at : at + 2], "little"), int.from_bytes(data[at + 8 : at + 16], "little")

    data = bytearray(path.read_bytes())
    data[data.index(b"GCOL") + 5] = reserved  # which nobody looks at
    at = data.index(b"GCOL") + 16
    while entry(at)[0]:
        at += 16 + (entry(at)[1] + 7) // 8 * 8
    data[at + 8 : at + 16] = bytes(8)
    path.write_bytes(bytes(data))
    with pytest.raises(RigDataError, match="damaged"):
        rigdata.load_campaign(path)


@pytest.mark.parametrize("name", ["manifest", "bearing"])
@pytest.mark.parametrize(("block", "piece"), [(0, 2**20), (512, 2**20), (0, 9)])
def test_a_text_that_claims_gigabytes_is_refused_before_room_is_made(tmp_path, monkeypatch, name, block, piece):
    """A wrong byte in the length of a text: found by fuzzing, the library made room for 4 GB."""
    monkeypatch.setattr(guards, "_PIECE", piece)
    path = tmp_path / "a.h5"
    texts = {"manifest": MANIFEST, "bearing": 'name = "b"' + " " * 300}
    with h5py.File(path, "w", userblock_size=block) as file:
        file.attrs.update(texts)
    data = bytearray(path.read_bytes())
    for at in range(data.index(name.encode() + b"\0"), len(data) - 4):
        if int.from_bytes(data[at : at + 4], "little") == len(texts[name]):
            data[at + 3] = 0xF0
            break
    assert too_long_text(path, list(texts), block) is None
    path.write_bytes(data)
    assert too_long_text(path, list(texts), block) == name
    with pytest.raises(RigDataError, match=f"attribute {name}: claims a text longer than the file"):
        rigdata.load_campaign(path)


def test_opening_a_large_file_takes_no_memory_and_samples_that_look_like_a_heap_are_none(path):
    with changed(path) as group:
        group.create_dataset("other", data=np.ones(2**22))  # 32 MB
        group.create_dataset("X2", data=np.frombuffer(b"GCOL\x01abc" + b"\xff" * 8, dtype="u1"))
    tracemalloc.start()
    try:
        assert reopened(path).length == N
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2**23


def test_the_stored_hash_reads_no_attribute_that_stands_elsewhere(path):
    run = reopened(path)
    before = run.reader.stored_hash()
    for value, is_alike in (("a text in the heap", True), (np.bytes_("here"), False)):
        with changed(path) as group:
            group.attrs["comment"] = value
        assert (run.reader.stored_hash() == before) == is_alike


@pytest.mark.parametrize("scale", ["scale_factor", "gain"])
def test_counts_whose_scale_stands_in_an_attribute_are_refused(path, scale):
    """They were read as if they were volts."""
    with changed(path, "X1A") as group:
        group["X1A"] = np.arange(N, dtype=np.int16)
        group["X1A"].attrs[scale] = 1e-4
    refused(path, "dataset X1A", f"attribute {scale} is not applied", "physical numbers")
    with changed(path) as group:
        del group["X1A"].attrs[scale]
    assert reopened(path).record("X1A").values[3] == pytest.approx(3e-6)
