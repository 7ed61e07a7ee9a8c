"""Long use and large campaigns: does memory grow, do files stay open?

    python tests/benchmarks/soak_runs.py --repeat 200
    python tests/benchmarks/soak_runs.py --gigabytes 0.25 0.5 1 2 [--workers 1]

`--repeat` identifies, checks and locates the same small campaign again and again in one process. `--gigabytes` makes
campaigns of that size on the fly, uncompressed, and identifies each in a process of its own: resident memory should be
that of the longest run, not of the campaign.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from fault_kills import write_small_campaign


def resident() -> float:
    """Memory of this process now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def open_files() -> int:
    """Count the open files of this process."""
    return len(os.listdir("/proc/self/fd"))


def soak(repeat: int) -> None:
    """Print memory and open files as the runs go by."""
    from rigdata import check_campaign, load_campaign
    from tpjb_ident.dynamic.identify import IdentifySettings, identify

    with tempfile.TemporaryDirectory() as scratch:
        path = write_small_campaign(Path(scratch) / "c.h5")
        seen: list[tuple[int, float, int]] = []
        first = None
        for number in range(1, repeat + 1):
            result = identify(load_campaign(path), IdentifySettings())
            h = result.points[0].stiffness.h
            first = h if first is None else first
            if not np.array_equal(h, first):
                raise SystemExit(f"run {number} gives other bits than run 1")
            if number % 10 == 0:
                check_campaign(path)
            if number in (1, 20, 50) or number % 50 == 0:
                seen.append((number, resident(), open_files()))
                print(
                    json.dumps({"run": number, "resident_MB": round(seen[-1][1], 1), "open_files": seen[-1][2]}),
                    flush=True,
                )
    late = [s for s in seen if s[0] >= 20] or seen
    growth = (late[-1][1] - late[0][1]) / max(1, late[-1][0] - late[0][0])
    print(json.dumps({"growth_kB_per_run": round(1024 * growth, 2), "files": late[-1][2] - late[0][2]}))


def write_large(path: Path, gigabytes: float, seconds: float = 60.0) -> int:
    """A campaign of many long dynamic runs: the small one's records repeated, with fresh noise; the number of runs."""
    import h5py

    small = write_small_campaign(path.with_name("seed.h5"))
    rng = np.random.default_rng(3)
    with h5py.File(small) as source, h5py.File(path, "w") as file:
        names = sorted(n for n in source["runs"] if n.startswith("d-"))
        text = str(source.attrs["manifest"])
        head, *entries = text.split("[[runs]]")
        dynamic = [e for e in entries if 'kind = "dynamic"' in e]
        size, number, manifest = 0, 0, [head]
        while size < gigabytes * 2**30:
            template = source[f"runs/{names[number % len(names)]}"]
            entry = next(e for e in dynamic if f'id = "{names[number % len(names)]}"' in e)
            group = file.create_group(f"runs/run-{number:05d}")
            group.attrs["sample_rate_hz"] = template.attrs["sample_rate_hz"]
            for channel, data in template.items():
                values = np.tile(data[:], int(seconds))
                values += (1e-4 * np.ptp(values) * rng.standard_normal(len(values))).astype(values.dtype)
                group.create_dataset(channel, data=values)
                size += values.nbytes
            manifest.append(entry.replace(f'id = "{names[number % len(names)]}"', f'id = "run-{number:05d}"'))
            number += 1
        file.attrs["bearing"] = source.attrs["bearing"]
        file.attrs["manifest"] = "[[runs]]".join(manifest)
    return number


def load(gigabytes: float, workers: int) -> dict[str, float]:
    """Identify a campaign of this size in a process of its own; time, peak memory."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "large.h5"
        runs = write_large(path, gigabytes)
        child = os.fork()
        if child == 0:
            code = 1
            try:
                code = _identify(path, workers, Path(scratch) / "answer.json")
            finally:
                os._exit(code)
        if os.waitpid(child, 0)[1]:
            raise SystemExit("the identification failed")
        return {"GB": gigabytes, "runs": runs, **json.loads((Path(scratch) / "answer.json").read_text())}


def _identify(path: Path, workers: int, answer: Path) -> int:
    from rigdata import load_campaign
    from tpjb_ident.dynamic.identify import IdentifySettings, identify
    from tpjb_ident.executors import open_workers

    began, cpu = time.time(), time.process_time()
    with open_workers(workers, None, ()) as team:
        identify(load_campaign(path), IdentifySettings(), workers=team)
    peaks = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    figures = {"seconds": time.time() - began, "cpu_seconds": time.process_time() - cpu,
               "peak_MB": peaks[0] / 1024, "peak_of_workers_MB": peaks[1] / 1024}  # fmt: skip
    answer.write_text(json.dumps({k: round(v, 1) for k, v in figures.items()}))
    return 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=0)
    parser.add_argument("--gigabytes", type=float, nargs="*", default=[])
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    if given.repeat:
        soak(given.repeat)
    for size in given.gigabytes:
        print(json.dumps(load(size, given.workers)), flush=True)


if __name__ == "__main__":
    main()
