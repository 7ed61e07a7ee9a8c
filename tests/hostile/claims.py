"""Small files whose headers claim gigabytes: made by their own libraries, and read in a process that is measured."""

import resource
import struct
import sys
import time
import zlib
from pathlib import Path

import numpy as np

SAMPLES = 2**29
#: Channels of the campaign, as the manifest of tests has them.
CHANNELS = ("X1A", "X1B")


def hdf5_campaign(folder: Path, manifest: str, runs: int, samples: int) -> Path:
    """Datasets in chunks of which none is stored: each below what a channel may be, in all 64 GB."""
    import h5py

    path = folder / "claims.h5"
    with h5py.File(path, "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = manifest, "x = 1"
        for number in range(runs):
            group = file.create_group(f"runs/c-{number + 1}")
            group.attrs["sample_rate_hz"] = 10.0
            for name in CHANNELS:
                group.create_dataset(name, (samples,), "f8", chunks=(min(samples, 2**16),), compression="gzip")
    return path


def mat73(folder: Path) -> Path:
    """A MATLAB 7.3 file: four vectors of 8 GB each."""
    import h5py

    path = folder / "claims.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in "abcd":
            file.create_dataset(name, (1, 2**30), "f8", chunks=(1, 2**16), compression="gzip")
    data = bytearray(path.read_bytes())
    data[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(data)
    return path


def mat73_chunk(folder: Path) -> Path:
    """A short vector in one chunk of 2 GB."""
    import h5py

    path = folder / "chunk.mat"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", (1, 16), "f8", maxshape=(1, None), chunks=(1, 2**28), compression="gzip")
    return path


def mat5(folder: Path) -> Path:
    """A compressed variable of version 5 that unpacks to a thousand times its size."""
    path = folder / "bomb.mat"
    size = 2**28
    packed = zlib.compressobj(9)
    body = packed.compress(struct.pack("<II", 14, size)) + b"".join(packed.compress(bytes(2**20)) for _ in range(256))
    body += packed.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + struct.pack("<II", 15, len(body)) + body)
    return path


def parquet(folder: Path) -> Path:
    """Columns of one value, a few bytes each: 2 GB."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "claims.parquet"
    table = pa.table({name: np.zeros(2**20) for name in ("a", "b", "c")})
    with pq.ParquetWriter(path, table.schema) as writer:
        for _ in range(2**6):
            writer.write_table(table)
    return path


FOREIGN = {"mat73": mat73, "mat73_chunk": mat73_chunk, "mat5": mat5, "parquet": parquet}


def mdf(folder: Path, cycles: int = 2**31) -> Path:
    """MDF 4 of a kilobyte whose channel group claims this many records."""
    from asammdf import MDF, Signal

    path = folder / "claims.mf4"
    values = np.zeros(20)
    with MDF(version="4.10") as file:
        file.append([Signal(samples=values, timestamps=np.arange(20.0), name="X1A", unit="um")])
        file.save(path, overwrite=True)
    data = bytearray(path.read_bytes())
    group = data.index(b"##CG")
    links = int.from_bytes(data[group + 16 : group + 24], "little")
    count = group + 24 + 8 * links + 8  # behind head, links and record number
    assert int.from_bytes(data[count : count + 8], "little") == len(values)
    data[count : count + 8] = cycles.to_bytes(8, "little")
    path.write_bytes(data)
    return path


def read(path: Path) -> str:
    """Read a file as whoever opens it would; what it is answered with."""
    from rigdata import load_campaign
    from rigdata.problem import RigDataError
    from tests.foreign_files import read_series

    try:
        if path.suffix == ".h5":
            campaign = load_campaign(path)
            for run in campaign.runs:
                run.vector("displacement")
        else:
            read_series(path, path.name)
    except RigDataError as error:
        return str(error)
    return "read"


def main(paths: list[str]) -> None:
    """Print seconds of processor time, growth of memory [MB] and answer for every file."""
    import h5py  # noqa: F401 (libraries are no part of what a file takes)
    import pyarrow.parquet  # noqa: F401
    import scipy.io  # noqa: F401

    import rigdata.readers.hdf5.reader  # noqa: F401

    for path in paths:
        start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        answer = read(Path(path)).splitlines()[0]
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
        print(f"{time.process_time() - start:.2f}\t{grown:.0f}\t{answer}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
