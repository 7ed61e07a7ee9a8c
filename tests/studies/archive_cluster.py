"""An archive of many runs on a Dask cluster in processes here: does it scale, what does a worker need, what is lost?

    python -m tests.studies.archive_cluster [--runs 10000] [--distinct 48] [--seconds 5] [--folder DIR]

The virtual rig writes `--distinct` records; the archive names each of them again and again, as runs of operating points
of their own, so that all that is read and fitted is as much as a real archive would be, from a disk that needs not hold
it. (What the operating system keeps in memory of the file is told: reading costs less than from a cold disk then.) The
campaign is identified by one worker, by two, and by two of which one is killed half-way and replaced; the digest of all
results, in their order, must be the same three times. What the parent spends itself is told: nobody shares that.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata.campaign import Campaign, load_campaign
from rigdata.run import Run
from tpjb_ident.dynamic.identify import identify
from tpjb_ident.dynamic.settings import IdentifySettings
from tpjb_ident.runtime.workers import dask_workers

ROOT = Path(__file__).resolve().parents[2]
DIRECTIONS = 6


@dataclass
class Cluster:
    """A scheduler and workers on this machine, each a process of its own, and the most memory that any of them had.

    Attributes
    ----------
    folder : Path
        For the scheduler's file and what the processes print.
    workers : list of Popen
    peak : float
        Resident memory of the largest worker so far [MB].
    """

    folder: Path
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)
    peak: float = 0.0

    @property
    def address(self) -> str:
        """The file in which the scheduler says where it is."""
        return str(self.folder / "scheduler.json")

    def start(self, role: str, *options: str) -> subprocess.Popen[bytes]:
        """Start a scheduler or a worker."""
        command = [sys.executable, "-m", f"distributed.cli.dask_{role}", "--no-dashboard", *options]
        given = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
        with (self.folder / "dask.log").open("a") as log:
            return subprocess.Popen(
                [*command, "--scheduler-file", self.address], cwd=ROOT, env=given, stdout=log, stderr=log
            )

    def add_worker(self) -> None:
        """Start another worker."""
        self.workers.append(self.start("worker", "--nthreads", "1", "--no-nanny"))

    def watch(self, ended: threading.Event) -> None:
        """Look at the workers' memory ten times a second."""
        while not ended.wait(0.1):
            self.peak = max([self.peak, *(resident(w.pid) for w in self.workers if w.poll() is None)])


def resident(process: int) -> float:
    """Resident memory of a process [MB]; 0 if it has ended."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@contextmanager
def cluster(count: int) -> Iterator[Cluster]:
    """A scheduler and `count` workers while the block runs."""
    from distributed import Client

    with tempfile.TemporaryDirectory() as folder:
        made = Cluster(Path(folder))
        scheduler = made.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        ended = threading.Event()
        watcher = threading.Thread(target=made.watch, args=(ended,))
        try:
            for _ in range(count):
                made.add_worker()
            until = time.monotonic() + 120
            while not Path(made.address).exists() and time.monotonic() < until:
                time.sleep(0.1)
            with Client(scheduler_file=made.address, set_as_default=False) as client:
                client.wait_for_workers(count, timeout=120)
            watcher.start()
            yield made
        finally:
            ended.set()
            if watcher.is_alive():
                watcher.join()
            for process in (*made.workers, scheduler):
                process.kill()
                process.wait()


def write_records(path: Path, distinct: int, seconds: float) -> Campaign:
    """Let the virtual rig write the records, `DIRECTIONS` runs at every operating point."""
    from rigdata.virtual_rig import RigPlan, Timing, operating_points, write_campaign
    from tests.good_campaigns import directions, rocker_rig

    loads = np.linspace(2000.0, 9000.0, max(1, distinct // DIRECTIONS))
    points = operating_points([(round(float(load)), 25.0) for load in loads])
    timing = Timing(dynamic_seconds=seconds)
    plan = RigPlan(dynamic=points, directions=directions(DIRECTIONS), locus=(), dry=(), clearance=(), timing=timing)
    write_campaign(path, rocker_rig(11, plan=plan))
    return load_campaign(path)


def archive(campaign: Campaign, count: int) -> list[Run]:
    """`count` runs that are named apart and share the records; every round has operating points of its own."""
    runs = campaign.of_kind("dynamic")
    made = []
    for k in range(count):
        run, turn = runs[k % len(runs)], k // len(runs)
        point = replace(run.point, static_load=run.point.static_load + 0.1 * turn)
        made.append(replace(run, id=f"{run.id}-{turn}", point=point))
    return made


def identify_all(made: Cluster, campaign: Campaign, kill_at: int | None = None) -> tuple[float, float, str]:
    """Identify all runs; seconds, processor seconds of this process, and a digest of every number in order."""
    settings = IdentifySettings(keep_weights=False)

    def tell(text: str, done: int, total: int) -> None:
        if kill_at is not None and done == kill_at and text != "estimating":
            made.workers[0].kill()
            made.add_worker()

    with dask_workers(made.address) as workers:
        few = replace(campaign, runs=campaign.runs[: 2 * DIRECTIONS])
        for _ in range(2):  # imports are done then, by all workers
            identify(few, settings, workers=workers)
        began, own = time.monotonic(), time.process_time()
        found = identify(campaign, settings, tell, workers)
        spent, own = time.monotonic() - began, time.process_time() - own
    numbers = [part for p in found.points for part in (p.stiffness.h, p.stiffness.covariance, p.stiffness.systematic)]
    return spent, own, hashlib.sha256(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers)).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--distinct", type=int, default=48)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--folder", type=Path, help="where the records are written [default: a temporary folder]")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        path = (given.folder or Path(scratch)) / "archive.h5"
        campaign = write_records(path, given.distinct, given.seconds)
        runs = archive(campaign, given.runs)
        stored = path.stat().st_size / 2**20
        read = stored * len(runs) / len(campaign.runs) / 1024
        print(f"{len(campaign.runs)} records of {given.seconds:g} s, {stored:.0f} MB on disk", end="; ")
        print(f"read {len(runs)} times: {read:.1f} GB as stored, most of it from the page cache")
        print(f"{'workers':24s} {'s':>7s} {'here, s':>8s} {'runs/s':>7s} {'MB each':>8s}  digest", flush=True)
        rows = {}
        for name, count, kill_at in (("1", 1, None), ("2", 2, None), ("2, one killed half-way", 2, len(runs) // 2)):
            with cluster(count) as made:
                rows[name] = identify_all(made, replace(campaign, runs=tuple(runs)), kill_at)
            spent, own, mark = rows[name]
            rate = len(runs) / spent
            print(f"{name:24s} {spent:7.1f} {own:8.1f} {rate:7.1f} {made.peak:8.0f}  {mark[:16]}", flush=True)
    print(f"efficiency of two workers: {rows['1'][0] / rows['2'][0] / 2:.0%} (target 80 %)")
    if len({mark for *_, mark in rows.values()}) > 1:
        raise SystemExit("not the same numbers: something was lost")
    print("the same numbers three times: a killed worker loses nothing")


if __name__ == "__main__":
    main()
