"""Take away what a command relies on, Dask workers, its cache, the clock: same tables, or an error that says why?

    python -m tests.hostile.surroundings [workers cache clock] [--trials 4] [--seed 1] [--write]

`workers`: `identify --scheduler` on two workers, one or both of which are killed, frozen for some seconds or lose their
scheduler once a random number of runs is done. `cache`: `predict` with a folder for TPJB_CACHE whose files are cut,
changed, emptied, replaced by folders, or deleted while the command runs; which is empty and shared by two. `clock`:
every look at the time of day gives another year. Each ends with the files of an undisturbed run, bit for bit (but for
rounding where loops are compiled anew), or with exit code 2 and one named reason; anything else is wrong, as is a
traceback.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.hostile.kills import ROOT, tables, tell, write_small_campaign
from tests.runtime.test_cluster import Cluster, wait_for
from tests.studies.load import make
from tests.studies.results import study_parser
from tpjb_ident.cli.commands.identify import KEPT
from tpjb_ident.runtime.differences import compared

#: Seconds after which a command is taken for hung.
HUNG = 3600.0
#: Loops may sum in another order in the process that compiles them than in those that load them.
ROUNDING = 1e-6
#: Runs of the campaign whose workers are lost.
_RUNS = 48
#: A program that runs a command line while the time of day jumps by hours and years at every look.
JUMPING = """
import itertools, sys, time
jumps = itertools.cycle((0.0, 3.6e3, -8.64e4, 1e9, -1.2e9, 2e9))
now = time.time
time.time = lambda: now() + next(jumps)
time.time_ns = lambda: int(1e9 * time.time())
from tpjb_ident.cli import main
sys.argv[0] = "tpjb"
main()
"""


@dataclass
class Study:
    """A folder to work in, the figures so far, and random numbers."""

    folder: Path
    trials: int
    rng: random.Random
    compiled: Path | None = None  #: a cache with the machine code that `predict` needs
    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: Counter[str] = field(default_factory=Counter)
    number: int = 0

    def place(self) -> Path:
        """A folder for one trial."""
        self.number += 1
        place = self.folder / str(self.number)
        place.mkdir()
        return place

    def judge(self, what: str, started: Started, reference: Path) -> None:
        """Wait for a command and count how it came out."""
        code, text = started.end()
        wrote, wanted = tables(started.out), tables(reference)
        differing = [name for name in wanted if wrote.get(name) != wanted[name]]
        csv = [compared(reference, started.out, name, ROUNDING) for name in wanted if name.endswith(".csv")]
        if code == -signal.SIGKILL:
            outcome = f"no end after {HUNG:g} s"
        elif code in (0, 3) and not differing:
            outcome = "same files"
        elif code in (0, 3) and not any(difference.matters for difference in csv):
            outcome = f"same but for rounding (below {ROUNDING:g})"
        elif code == 2 and not wrote:
            outcome = "exit 2, nothing written: " + text.strip().splitlines()[-1][:100]
        else:
            outcome = f"exit {code}, other files: {', '.join(differing[:5])}"
        good = outcome.startswith(("same", "exit 2")) and "Traceback" not in text
        (self.outcomes if good else self.wrong)[f"{what}: {outcome}"] += 1
        print(f"{what}: {outcome}", "" if good else text[-2000:], file=sys.stderr, flush=True)


class Started:
    """A command in a process of its own."""

    def __init__(self, place: Path, words: list[str], program: Sequence[str] = (), **more: str) -> None:
        self.out, self.log = place / "out", place / "log"
        words = [*words, "--out", str(self.out), "--quiet"]
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-P", *(program or ("-m", "tpjb_ident")), *words],
                cwd=ROOT,
                env={**os.environ, **more},
                stdout=log,
                stderr=log,
            )

    def end(self) -> tuple[int, str]:
        """Exit code and what was said."""
        try:
            code = self.process.wait(HUNG)
        except subprocess.TimeoutExpired:
            self.process.kill()
            code = self.process.wait()
        return code, self.log.read_text("utf-8", "replace")


def _lose_workers(study: Study) -> None:
    campaign = study.folder / "campaign.h5"
    make(campaign, _RUNS, 0.01)
    words = ["identify", str(campaign)]
    alone = Started(study.place(), [*words, "--workers", "1"])
    alone.end()

    def kill_one(cluster: Cluster) -> None:
        cluster.workers[0].kill()

    def kill_both(cluster: Cluster) -> None:
        for worker in cluster.workers:
            worker.kill()

    def replace_both(cluster: Cluster) -> None:
        kill_both(cluster)
        time.sleep(1.0)
        cluster.workers.append(cluster._start("worker", "--nthreads", "1", "--no-nanny"))

    def freeze_one(cluster: Cluster) -> None:
        cluster.workers[0].send_signal(signal.SIGSTOP)
        time.sleep(8.0)
        cluster.workers[0].send_signal(signal.SIGCONT)

    def kill_scheduler(cluster: Cluster) -> None:
        cluster.scheduler.kill()

    losses = (kill_one, replace_both, freeze_one, kill_both, kill_scheduler)
    for trial in range(study.trials):
        for loss in losses:
            _lose(study, loss, [*words, "--scheduler"], alone.out)
        print(f"workers: trial {trial + 1}", file=sys.stderr, flush=True)


def _lose(study: Study, loss: Callable[[Cluster], None], words: list[str], reference: Path) -> None:
    place = study.place()
    cluster = Cluster(place)
    try:
        wait_for(str(cluster.file), 2)
        runs = study.rng.randrange(1, _RUNS - 8)
        started = Started(place, [*words, str(cluster.file)])
        while started.process.poll() is None and len(list((started.out / KEPT).glob("[!.]*.npz"))) < runs:
            time.sleep(0.002)
        ended = started.process.poll() is not None
        loss(cluster)
        study.judge(f"Dask: {loss.__name__.replace('_', ' ')}{', but it had ended' * ended}", started, reference)
    finally:
        cluster.close()


def _spoil_cache(study: Study) -> None:
    words = ["predict", str(ROOT / "model" / "bearings" / "rocker.toml"), "--thermal", "adiabatic"]
    whole = study.folder / "cache"
    if study.compiled is not None:
        shutil.copytree(study.compiled, whole)
    Started(study.place(), words, TPJB_CACHE=str(whole)).end()
    loaded = Started(study.place(), words, TPJB_CACHE=str(whole))  # not what compiles: see ROUNDING
    loaded.end()
    pending = []
    for _ in range(study.trials):
        caches = [study.place() / "cache" for _ in range(2)]
        for cache in caches:
            shutil.copytree(whole, cache)
        _damage(caches[0], study.rng)
        pending += [("damaged", Started(caches[0].parent, words, TPJB_CACHE=str(caches[0])))]
        pending += [("deleted meanwhile", Started(caches[1].parent, words, TPJB_CACHE=str(caches[1])))]
        _delete_meanwhile(caches[1], study.rng)
    shared = study.place() / "cache"
    pending += [("empty, filled by two", Started(study.place(), words, TPJB_CACHE=str(shared))) for _ in range(2)]
    for what, started in pending:
        study.judge(f"cache: {what}", started, loaded.out)
    study.judge("cache: as the two left it", Started(study.place(), words, TPJB_CACHE=str(shared)), loaded.out)


def _damage(cache: Path, rng: random.Random) -> None:
    """Spoil half of the files, each in a way of its own."""
    for path in sorted(path for path in cache.rglob("*") if path.is_file()):
        data = bytearray(path.read_bytes())
        way = rng.randrange(10)
        if way == 0:
            data = data[: rng.randrange(len(data))]
        elif way == 1:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif way == 2:
            data[rng.randrange(min(len(data), 200))] ^= 255
        elif way == 3:
            data = bytearray()
        elif way == 4:
            path.unlink()
            path.mkdir()
            continue
        path.write_bytes(data)


def _delete_meanwhile(cache: Path, rng: random.Random) -> None:
    """Delete everything at some moment of the first seconds, and whatever comes for a while."""
    time.sleep(rng.uniform(0.0, 3.0))
    for _ in range(10):
        shutil.rmtree(cache, ignore_errors=True)
        time.sleep(0.1)


def _shift_clock(study: Study) -> None:
    campaign = write_small_campaign(study.folder / "clock.h5")
    for command in ("check", "identify", "pivot", "compare"):
        words = [command, str(campaign)]
        steady = Started(study.place(), words)
        steady.end()
        for year in (1971, 2100):
            os.utime(campaign, (365.25 * 86400 * (year - 1970),) * 2)
            jumping = Started(study.place(), words, ("-c", JUMPING))
            study.judge(f"clock: {command}, the campaign's file from {year}", jumping, steady.out)


_PARTS: dict[str, Callable[[Study], None]] = {"workers": _lose_workers, "cache": _spoil_cache, "clock": _shift_clock}


def main() -> None:
    parser = study_parser(__doc__)
    parser.add_argument("parts", nargs="*", choices=_PARTS, default=list(_PARTS))
    parser.add_argument("--trials", type=int, default=4, help="of each loss or damage")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--compiled", type=Path, help="a TPJB_CACHE of this checkout, which saves minutes")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        study = Study(Path(scratch), given.trials, random.Random(given.seed), given.compiled)
        for part in given.parts:
            _PARTS[part](study)
    tell("surroundings" if given.write else "", study.outcomes, study.wrong)


if __name__ == "__main__":
    main()
