"""A campaign of 2,000 runs and 20 GB, made on the fly: is the memory of a command constant over its runs?

    python -m tests.studies.load make FILE.h5 [--runs 2000] [--gigabytes 20]
    python -m tests.studies.load watch [--every 0.5] [--write] -- tpjb identify FILE.h5 --out DIR --workers 2
    python -m tests.studies.load table [--runs 60 600 3000] [--workers 1 2] [--seconds 2] [--write]

`make` lets the virtual rig write one second of every run (six directions at each operating point), repeats it and adds
fresh noise, uncompressed. All lines are whole Hz, so that the repeats join. `watch` runs any command and samples the
memory of it and all its processes (proportional set size: shared pages count once), their CPU time and open files.
`table` makes campaigns of several sizes, with records of some seconds, and watches `identify` of each.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from tests.studies.results import table, write_section

DIRECTIONS = 6
FREQUENCIES = (10.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 55.0)


def _rig(points: int) -> Any:
    from rigdata.virtual_rig import RigPlan, operating_points
    from tests.good_campaigns import directions, rocker_rig

    loads = np.linspace(2000.0, 9000.0, math.ceil(points / len(FREQUENCIES)))
    wanted = [(round(float(load), 0), f) for load in loads for f in FREQUENCIES][:points]
    return rocker_rig(
        11,
        plan=RigPlan(
            dynamic=operating_points(wanted),
            directions=directions(DIRECTIONS),
            locus=(),
            dry=(),
            clearance=(),
            dynamic_seconds=1.0,
        ),
    )


def make(path: Path, runs: int, gigabytes: float) -> int:
    """Write the campaign; the number of its runs."""
    import h5py

    from rigdata.virtual_rig import write_campaign

    seed = path.with_name(f"{path.stem}.seed.h5")
    write_campaign(seed, _rig(math.ceil(runs / DIRECTIONS)))
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(2**22, dtype=np.float32)
    with h5py.File(seed) as source, h5py.File(path, "w") as file:
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
    seed.unlink()
    return len(names)


def _family(root: int) -> list[int]:
    """The process and everything that it started."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError):  # it has just ended
                continue
            parents.setdefault(parent, []).append(int(entry.name))
    found, left = [], [root]
    while left:
        found.append(left.pop())
        left += parents.get(found[-1], [])
    return found


def _memory(pid: int) -> float:
    """Proportional set size [MB]; zero of a process that has ended."""
    try:
        rows = (Path("/proc") / str(pid) / "smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(float(row.split()[1]) for row in rows if row.startswith("Pss:")) / 1024


def _processor(pid: int) -> float:
    """Processor time of a process so far [s]; zero of one that has ended."""
    try:
        fields = (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _files(pid: int) -> int:
    try:
        return len(os.listdir(f"/proc/{pid}/fd"))
    except OSError:
        return 0


def watch(command: list[str], every: float) -> dict[str, float]:
    """Run a command; its peak memory over all processes, and that of every tenth of its time [MB]."""
    began, seen = time.time(), []
    spent: dict[int, float] = {}  # workers end with their server, whose times nobody gathers
    process = subprocess.Popen(command)
    while process.poll() is None:
        family = _family(process.pid)
        for pid in family:
            spent[pid] = max(spent.get(pid, 0.0), _processor(pid))
        seen.append((time.time() - began, sum(map(_memory, family)), len(family), max(map(_files, family))))
        time.sleep(every)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    rows = np.array(seen)
    tenths = [round(float(part[:, 1].max()), 1) for part in np.array_split(rows, 10) if len(part)]
    return {
        "exit_code": process.returncode,
        "seconds": round(time.time() - began, 1),
        "cpu_seconds": round(max(used.ru_utime + used.ru_stime, sum(spent.values())), 1),
        "peak_MB": round(float(rows[:, 1].max()), 1),
        "peak_MB_by_tenths": tenths,
        "processes": int(rows[:, 2].max()),
        "open_files": int(rows[:, 3].max()),
    }


def sizes(runs: list[int], workers: list[int], seconds: float, folder: Path) -> list[tuple[str, ...]]:
    """Watch `identify` of campaigns with so many runs; one row per campaign and number of workers."""
    rows = []
    for count in runs:
        path = folder / f"{count}.h5"
        made = make(path, count, count * seconds * _BYTES_A_SECOND / 1e9)
        for number in workers:
            out = folder / f"{count}-{number}"
            words = ["identify", str(path), "--out", str(out), "--workers", str(number), "--quiet"]
            seen = watch([sys.executable, "-P", "-m", "tpjb_ident", *words], 0.2)
            cells = (seen["cpu_seconds"], seen["seconds"], seen["peak_MB"], seen["open_files"], seen["exit_code"])
            rows.append((f"{made:,}", f"{path.stat().st_size / 1e6:.0f} MB", str(number), *map(str, cells)))
            print(*rows[-1], flush=True)
        path.unlink()
    return rows


#: Of all channels of the virtual rig, in single precision.
_BYTES_A_SECOND = 14 * 2000 * 4
_COLUMNS = ("runs", "records", "workers", "processor s", "elapsed s", "peak MB of all processes", "open files", "exit")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    actions = parser.add_subparsers(dest="action", required=True)
    making = actions.add_parser("make")
    making.add_argument("file", type=Path)
    making.add_argument("--runs", type=int, default=2000)
    making.add_argument("--gigabytes", type=float, default=20.0)
    watching = actions.add_parser("watch")
    watching.add_argument("--every", type=float, default=0.5)
    watching.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    watching.add_argument("command", nargs=argparse.REMAINDER)
    sized = actions.add_parser("table")
    sized.add_argument("--runs", type=int, nargs="+", default=[60, 600, 3000])
    sized.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    sized.add_argument("--seconds", type=float, default=2.0, help="of each record")
    sized.add_argument("--write", action="store_true", help="replace the table of RESULTS.md")
    given = parser.parse_args()
    if given.action == "table":
        with tempfile.TemporaryDirectory() as scratch:
            rows = sizes(given.runs, given.workers, given.seconds, Path(scratch))
        if given.write:
            write_section("runs", f"python -m tests.studies.load {' '.join(sys.argv[1:])}", table(_COLUMNS, rows))
        return
    if given.action == "make":
        print(json.dumps({"runs": make(given.file, given.runs, given.gigabytes)}))
    else:
        command = given.command[1:] if given.command[:1] == ["--"] else given.command
        figures = watch(command, given.every)
        print(json.dumps(figures))
        if given.write:
            text = table(("what", "measured"), [(name, str(value)) for name, value in figures.items()])
            write_section("load", f"python -m tests.studies.load watch --write -- {' '.join(command)}", text)


if __name__ == "__main__":
    main()
