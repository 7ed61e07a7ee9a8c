"""Runs, workers, processor time and memory of `identify`: is the memory constant over the runs?

    python -m tests.studies.load [--runs 60,600,3000] [--workers 1,2] [--seconds 2] [--write]

The virtual rig writes one second of every run (six directions at each operating point), which is repeated, with fresh
noise, uncompressed; all lines are whole Hz, so that the repeats join. `identify` is watched as it runs: memory of it
and all its processes (proportional set size: shared pages count once), their processor time and open files.
"""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from rigdata.virtual_rig import RigPlan, operating_points
from tests.good_campaigns import directions, rocker_rig, written
from tests.studies.results import report, study_parser, table

DIRECTIONS = 6
FREQUENCIES = (10.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 55.0)
#: Of all channels of the virtual rig, in single precision.
BYTES_A_SECOND = 14 * 2000 * 4
HEAD = ("runs", "records", "workers", "processor s", "elapsed s", "peak MB of all processes", "open files", "exit")


def make(path: Path, runs: int, gigabytes: float) -> int:
    """Write a campaign; the number of its runs."""
    points = math.ceil(runs / DIRECTIONS)
    loads = np.linspace(2000.0, 9000.0, math.ceil(points / len(FREQUENCIES))).round()
    wanted = [(float(load), frequency) for load in loads for frequency in FREQUENCIES]
    plan = RigPlan(
        dynamic=operating_points(wanted[:points]), directions=directions(DIRECTIONS), locus=(), dry=(), clearance=(),
        dynamic_seconds=1.0,
    )  # fmt: skip
    second = written(path.with_name(f"{path.stem}.seed.h5"), rocker_rig(11, plan=plan))
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(2**22, dtype=np.float32)
    with h5py.File(second) as source, h5py.File(path, "w") as file:
        names = sorted(source["runs"])
        size = sum(data.size for data in source[f"runs/{names[0]}"].values()) * 4
        repeats = max(1, round(gigabytes * 1e9 / len(names) / size))
        for name in names:
            group = file.create_group(f"runs/{name}")
            group.attrs["sample_rate_hz"] = source[f"runs/{name}"].attrs["sample_rate_hz"]
            for channel, data in source[f"runs/{name}"].items():
                values = np.tile(data[:].astype(np.float32), repeats)
                first = int(rng.integers(len(noise)))
                fresh = np.take(noise, np.arange(first, first + len(values)), mode="wrap")
                values += np.float32(1e-4 * np.ptp(data[:])) * fresh
                group.create_dataset(channel, data=values)
        for key in ("bearing", "manifest"):
            file.attrs[key] = source.attrs[key]
    second.unlink()
    return len(names)


def stat(pid: str) -> list[str]:
    """What the system says of a process, from its state on."""
    return (Path("/proc") / pid / "stat").read_text().rpartition(")")[2].split()


def family(root: int) -> list[int]:
    """The process and everything that it started."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                children.setdefault(int(stat(entry.name)[1]), []).append(int(entry.name))
            except (OSError, IndexError):  # it has just ended
                continue
    found, left = [], [root]
    while left:
        found.append(left.pop())
        left += children.get(found[-1], [])
    return found


def usage(pid: int) -> tuple[float, float, int]:
    """Proportional set size [MB], processor time so far [s] and open files; zeros of a process that has ended."""
    try:
        rows = (Path("/proc") / str(pid) / "smaps_rollup").read_text().splitlines()
        ticks = sum(map(int, stat(str(pid))[11:13]))
        files = len(os.listdir(f"/proc/{pid}/fd"))
    except (OSError, IndexError):
        return 0.0, 0.0, 0
    memory = sum(float(row.split()[1]) for row in rows if row.startswith("Pss:")) / 1024
    return memory, ticks / os.sysconf("SC_CLK_TCK"), files


def watch(command: list[str]) -> tuple[str, ...]:
    """Run a command: its processor time and its elapsed time, peaks of memory and of open files, exit code."""
    began, peak, most = time.time(), 0.0, 0
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent: dict[int, float] = {}  # workers end with their server, whose times nobody gathers
    process = subprocess.Popen(command)
    while process.poll() is None:
        seen = {pid: usage(pid) for pid in family(process.pid)}
        for pid, (_, processor, _) in seen.items():
            spent[pid] = max(spent.get(pid, 0.0), processor)
        peak = max(peak, sum(memory for memory, _, _ in seen.values()))
        most = max(most, *(files for _, _, files in seen.values()))
        time.sleep(0.2)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    times = f"{max(used, sum(spent.values())):.1f}", f"{time.time() - began:.1f}"
    return (*times, f"{peak:.1f}", str(most), str(process.returncode))


def main() -> None:
    asked = study_parser(__doc__, runs="60,600,3000", workers="1,2", seconds=2.0).parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for count in map(int, asked.runs.split(",")):
            path = Path(folder) / f"{count}.h5"
            made = make(path, count, count * asked.seconds * BYTES_A_SECOND / 1e9)
            for number in asked.workers.split(","):
                words = ["identify", str(path), "--out", f"{folder}/{count}-{number}", "--workers", number, "--quiet"]
                seen = watch([sys.executable, "-P", "-m", "tpjb_ident", *words])
                rows.append((f"{made:,}", f"{path.stat().st_size / 1e6:.0f} MB", number, *seen))
                print(*rows[-1], flush=True)
            path.unlink()
    report(asked, "runs", table(HEAD, rows))


if __name__ == "__main__":
    main()
