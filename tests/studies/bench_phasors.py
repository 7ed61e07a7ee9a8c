"""Throughput from files to phasors: ``python -m tests.studies.bench_phasors [--seconds S] [--workers N]``.

Prints, all measured in one go: the rate from memory; the plain h5py read rate of a campaign beside the rate of
reading it and turning it to phasors, for campaigns of growing size, in processor time and (with several workers) in
wall time; peak memory of ``tpjb identify`` over the same campaigns, with what that means for 50 GB; the rate of a
decimal-comma CSV file.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata.campaign import load_campaign
from rigdata.operating_point import OperatingPoint
from rigdata.record import Record, VectorRecord
from rigdata.rows import RowReader, VectorRows
from tests.studies.bench_phasors_data import write_csv, write_hdf5
from tpjb_ident.dynamic.records.run_phasors import PhasorSettings, run_phasors
from tpjb_ident.dynamic.runs.run_jobs import all_runs
from tpjb_ident.runtime.executors import local_workers

RATE, SECONDS, RUNS = 10_000.0, 60.0, 8
POINT = OperatingPoint(5000.0, -np.pi / 2, 2 * np.pi * 22, 2 * np.pi * 25)
#: What a request for plain reading asks for [samples].
SLICE = 2**17


@dataclass
class HeldRun:
    """A run whose samples are in memory; the face of `rigdata.campaign.Run`."""

    id: str
    seed: int
    sample_rate: float = RATE
    seconds: float = SECONDS
    point: OperatingPoint = POINT
    excitation_direction: float = 0.0
    channels: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        self.length = round(self.seconds * self.sample_rate)
        self.time = np.arange(self.length) / self.sample_rate
        wave = {f: np.exp(2j * np.pi * f * self.time) for f in (25.0, 22.0, 44.0, 50.0)}
        self.data = {}
        for quantity, scale in (("displacement", 1e-6), ("force", 100.0), ("acceleration", 0.02)):
            z = rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))
            lines = sum(np.outer(w, z[i]).real for i, w in enumerate(wave.values()))
            self.data[quantity] = scale * (lines + 0.05 * rng.standard_normal((self.length, 2)))
        self.channels = {q: _Channel(q) for q in self.data}

    def vector(self, quantity: str, start: int | None = None, stop: int | None = None) -> VectorRecord:
        part = slice(start, stop)
        return VectorRecord(quantity, self.data[quantity][part], self.time[part], self.sample_rate, ("A", "B"))

    def row_reader(self, quantities: Sequence[str]) -> RowReader:
        return VectorRows(self, quantities)

    def kept_open(self) -> AbstractContextManager[None]:
        return nullcontext()

    def speed(self, start: int | None = None, stop: int | None = None) -> Record:
        part = self.time[start:stop]
        return Record("K1", "speed", np.full(len(part), 2 * np.pi * 22.0), part, self.sample_rate)


@dataclass
class _Channel:
    quantity: str
    axis: float | None = None


def best(work: Callable[[], object], clock: Callable[[], float], times: int = 3) -> float:
    """Least time of a few."""
    spent = []
    for _ in range(times):
        began = clock()
        work()
        spent.append(clock() - began)
    return min(spent)


def from_memory() -> None:
    """Print the rate of eight runs of 60 s at 10 kHz held in memory, counted as eight channels each."""
    spent = 0.0
    for seed in range(RUNS):
        run = HeldRun(f"r{seed}", seed)
        began = time.process_time()
        run_phasors(run, 30.0, PhasorSettings())
        spent += time.process_time() - began
    samples = RUNS * 8 * RATE * SECONDS
    print(
        f"from memory: {RUNS} runs of {SECONDS:g} s, 8 channels at {RATE:g} Hz: {spent:.2f} s processor time "
        f"(target 2 s), {samples / spent / 1e6:.0f} M samples/s"
    )


def read_plainly(path: Path) -> int:
    """Read every dataset with h5py alone; return the bytes."""
    import h5py

    size = 0
    with h5py.File(path) as file:
        for group in file["runs"].values():
            for dataset in group.values():
                for first in range(0, len(dataset), SLICE):
                    size += dataset[first : first + SLICE].nbytes
    return size


def to_phasors(path: Path, count: int = 1) -> None:
    """Turn all runs to phasors."""
    with local_workers(count, preload=("tpjb_ident.dynamic.runs.run_jobs", "h5py")) as workers:
        all_runs(load_campaign(path), PhasorSettings(), lambda text, done, total: None, workers).close()


def hdf5_rates(folder: Path, seconds: float, count: int) -> None:
    """Print reading beside reading and extracting, for three sizes, and the memory that goes with them."""
    for packed in (True, False):
        print(f"\nHDF5, float32, {'gzip 1 and shuffle' if packed else 'not compressed, in the page cache'}:")
        print("| MB | read MB/s | phasors MB/s | ratio | wall, N workers MB/s | ratio | peak MB of identify |")
        print("|---|---|---|---|---|---|---|")
        sizes, peaks, spent = [], [], []
        for factor in (1, 2, 4):
            path = folder / f"{packed}-{factor}.h5"
            size = write_hdf5(path, 4, seconds * factor, packed) / 1e6
            read = best(lambda path=path: read_plainly(path), time.process_time)
            own = best(lambda path=path: to_phasors(path), time.process_time)
            read_wall = best(lambda path=path: read_plainly(path), time.perf_counter)
            wall = best(lambda path=path: to_phasors(path, count), time.perf_counter, 2)
            peak = peak_memory([str(path), "--workers", str(count)], folder / "out")
            print(
                f"| {size:.0f} | {size / read:.0f} | {size / own:.0f} | {read / own:.2f} | {size / wall:.0f} "
                f"| {read_wall / wall:.2f} | {peak:.0f} |",
                flush=True,
            )
            path.unlink()
            sizes.append(size)
            peaks.append(peak)
            spent.append(own)
        slope = float(np.polyfit(sizes, peaks, 1)[0])
        growth = float(np.polyfit(np.log(sizes), np.log(spent), 1)[0])
        print(f"memory grows by {1e3 * slope:.1f} kB per MB of records; time grows with size to the power {growth:.2f}")


def peak_memory(arguments: list[str], out: Path) -> float:
    """Largest proportional set size [MB] of ``tpjb identify`` and its workers together."""
    command = [sys.executable, "-P", "-m", "tpjb_ident", "identify", *arguments, "--out", str(out)]
    peak = 0.0
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            peak = max(peak, sum(_proportional(pid) for pid in _family(process.pid)))
            time.sleep(0.03)
    return peak / 1e3


def _family(pid: int) -> list[int]:
    """A process and all its descendants."""
    found = [pid]
    for parent in found:
        for task in Path(f"/proc/{parent}/task").glob("*/children"):
            try:
                found += [int(child) for child in task.read_text().split()]
            except OSError:  # it ended meanwhile
                continue
    return found


def _proportional(pid: int) -> float:
    """Proportional set size [kB]; pages that processes share are counted once."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith("Pss:"))


def csv_rate(folder: Path) -> None:
    """Print the rate of a decimal-comma file from bytes to calibrated vectors."""
    size = write_csv(folder / "csv", 20.0) / 1e6

    def read() -> None:
        load_campaign(folder / "csv").runs[0].vector("displacement")

    cpu, wall = best(read, time.process_time, 5), best(read, time.perf_counter, 5)
    print(
        f"\ndecimal-comma CSV, {size:.0f} MB, 8 columns: {size / cpu:.0f} MB/s of processor time, "
        f"{size / wall:.0f} MB/s of wall time (target 60)"
    )


def main() -> None:
    """Print all rates."""
    parser = argparse.ArgumentParser(description="Throughput from files to phasors")
    parser.add_argument("--seconds", type=float, default=120.0, help="of each record of the smallest campaign")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from_memory()
    with tempfile.TemporaryDirectory() as folder:
        csv_rate(Path(folder))
        hdf5_rates(Path(folder), options.seconds, options.workers)


if __name__ == "__main__":
    main()
