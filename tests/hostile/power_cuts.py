"""Cut the power at every step on the disk: what does the file system hold after its recovery?

    sudo python -m tests.hostile.power_cuts [--trials 6] [--seed 1] [--commands identify pivot locus] [--write]

Results go to an ext4 file system in an image, mounted so that only what a program asks to be flushed reaches the image
soon. Just before every step of the command on the disk (opening a file to write, renaming, deleting) and once it has
ended, the image is copied: that copy is what a power cut at that moment leaves on a drive that does as it is told. Each
copy is mounted, which has the journal recover, and asked what `kills.py` asks after a kill; after the command's
end the new results must be there whole. Some of the copies are given the command once more. Takes Linux and root.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.hostile.kills import (
    COMMANDS,
    Bench,
    Reference,
    faults_after_rerun,
    make_bench,
    prepare,
    start,
    state_and_faults,
    tell,
    wait,
)
from tests.studies.results import study_parser

#: Seconds after which ext4 writes its journal unasked: longer than a command takes.
COMMIT = 300
MEGABYTES = 24


@contextmanager
def mounted(image: Path, folder: Path) -> Iterator[Path]:
    """Mount an image for the block; a journal left open is recovered by that."""
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-o", f"loop,commit={COMMIT}", image, folder], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


def new_image(path: Path) -> Path:
    """An empty ext4 file system in a file."""
    with path.open("wb") as file:
        file.truncate(MEGABYTES * 2**20)
    subprocess.run(["mkfs.ext4", "-q", "-F", path], check=True)
    return path


@dataclass(frozen=True)
class Trial:
    """One command on an image of its own, and the state of the image before each of its steps."""

    command: str
    old: dict[str, str]
    cuts: tuple[Path, ...]


def trial(bench: Bench, command: str, former: bool, place: Path) -> Trial:
    """Run a command to its end; an image per step on the disk, the last one of after the end."""
    image, point = new_image(place / "image"), place / "disk"

    def cut(step: int) -> None:
        shutil.copyfile(image, place / f"cut-{step:04d}")

    with mounted(image, point):
        old = prepare(bench, point / "out", command, former)
        os.sync()  # the former results are long on the disk
        child = start(bench.words(command, point / "out"), place / "log", at_step=cut)
        wait(child)
        cut(9999)
    return Trial(command, old, tuple(sorted(place.glob("cut-*"))))


def judged(bench: Bench, tried: Trial, reference: Reference, place: Path, rerun: set[int]) -> Iterator[tuple[str, str]]:
    """For every cut: what is there, and what is wrong with it (nothing: empty)."""
    for number, image in enumerate(tried.cuts):
        last = number == len(tried.cuts) - 1
        with mounted(image, place / "after") as folder:
            out = folder / "out"
            state, wrong = state_and_faults(out, tried.old, reference.tables)
            if last and (state != "new" or not (out / "run.json").exists()):
                wrong.append(f"the command had ended, and its results are {state}")
            if number in rerun:
                code = wait(start(bench.words(tried.command, out), place / "log"))
                wrong += faults_after_rerun(out, code, reference)
        when = "after the end" if last else "on the way"
        yield f"{tried.command}: cut {when}, results {state}", "; ".join(wrong)
        image.unlink()


def run(trials: int, seed: int, commands: tuple[str, ...], reruns: int) -> tuple[Counter[str], Counter[str]]:
    """States and faults over all cuts of `trials` commands."""
    outcomes: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(dir="/dev/shm") as scratch:
        bench = make_bench(Path(scratch), commands)
        references = {command: bench.reference(command) for command in commands}
        for number in range(trials):
            command = commands[number % len(commands)]
            place = Path(tempfile.mkdtemp(dir=scratch))
            tried = trial(bench, command, number // len(commands) % 2 == 1, place)
            chosen = set(random.Random(f"{seed}-{number}").sample(range(len(tried.cuts)), reruns))
            for outcome, fault in judged(bench, tried, references[command], place, chosen):
                outcomes[outcome] += 1
                if fault:
                    wrong[f"{command}: {fault}"] += 1
            wrong.update({f"{command}: the raw data has changed": 1} if bench.raw_data_changed() else {})
            shutil.rmtree(place)
    return outcomes, wrong


def main() -> None:
    parser = study_parser(__doc__)
    parser.add_argument("--trials", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=COMMANDS)
    parser.add_argument("--reruns", type=int, default=3, help="cuts per trial that are given the command once more")
    given = parser.parse_args()
    if "TPJB_IN_NAMESPACE" not in os.environ:  # mounts that nobody else sees, and that go with this process
        words = ["unshare", "-m", sys.executable, "-m", "tests.hostile.power_cuts", *sys.argv[1:]]
        os.execvpe(words[0], words, {**os.environ, "TPJB_IN_NAMESPACE": "1"})
    tell("power-cuts" if given.write else "", *run(given.trials, given.seed, tuple(given.commands), given.reruns))


if __name__ == "__main__":
    main()
