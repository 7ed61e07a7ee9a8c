"""Long use and large campaigns: does memory grow, do files stay open?

    python tests/studies/soak_runs.py --repeat 40
    python tests/studies/soak_runs.py --gigabytes 0.25 0.5 1 2 [--workers 1]

`--repeat` checks and identifies the same small campaign, measures its pivots, clearance and locus and predicts its
bearing, again and again in one process: the same bits each time, and how memory, open files and threads go.
`--gigabytes` makes campaigns of that size on the fly, uncompressed, and identifies each in a process of its own:
resident memory should be that of the longest run, not of the campaign.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
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


def threads() -> int:
    """Count the threads of this process."""
    return len(os.listdir("/proc/self/task"))


def one_round(path: Path) -> str:
    """Check, identify, measure all static tests and predict; a fingerprint of every number that came out."""
    from model.bearing_file import parse_bearing
    from model.predict import predict
    from rigdata import load_campaign
    from tpjb_ident.check.campaign import check_campaign
    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.dynamic.identify import identify
    from tpjb_ident.dynamic.settings import IdentifySettings

    campaign = load_campaign(path)
    bearing = parse_bearing(campaign.bearing_text, "bearing")
    point = identify(campaign, IdentifySettings()).points[0]
    static = measure_static(campaign, bearing)
    assert static.clearance is not None
    assert static.locus is not None
    h = predict(bearing, load=5000.0, load_direction=-np.pi / 2, speed=138.0, excitation=157.0, thermal="isothermal").h
    numbers = [point.stiffness.h, h, static.clearance.clearance, *(p.position for p in static.locus.points)]
    numbers += [curve.deflection(np.array([1000.0, 3000.0])) for curve in static.curves]
    text = "\n".join(map(str, check_campaign(path)))
    return hashlib.sha256(b"".join(np.ascontiguousarray(n).tobytes() for n in numbers) + text.encode()).hexdigest()


def soak(repeat: int) -> None:
    """Print memory, open files and threads as the rounds go by, and how fast memory grows over the second half."""
    with tempfile.TemporaryDirectory() as scratch:
        path = write_small_campaign(Path(scratch) / "c.h5")
        seen: list[tuple[int, float, int, int]] = []
        first = ""
        for number in range(1, repeat + 1):
            marks = one_round(path)
            first = first or marks
            if marks != first:
                raise SystemExit(f"round {number} gives other bits than round 1")
            seen.append((number, resident(), open_files(), threads()))
            if number in (1, 2, 5, 10) or number % 10 == 0:
                told = {"round": number, "resident_MB": round(seen[-1][1], 1), "open_files": seen[-1][2]}
                print(json.dumps({**told, "threads": seen[-1][3]}), flush=True)
    late = np.array(seen[len(seen) // 2 :], dtype=float)
    slope = np.polyfit(late[:, 0], late[:, 1], 1)[0] if len(late) > 2 else math.nan
    grown = {"files": seen[-1][2] - seen[0][2], "threads": seen[-1][3] - seen[0][3]}
    print(json.dumps({"growth_kB_per_round": round(1024 * float(slope), 2), **grown}))


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
    from tpjb_ident.dynamic.identify import identify
    from tpjb_ident.dynamic.settings import IdentifySettings
    from tpjb_ident.runtime.workers import open_workers

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
