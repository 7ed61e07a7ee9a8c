"""Cut the power at every step on the disk: what does the file system hold after its recovery?

    sudo python -m tests.hostile.power_cuts [--trials 6] [--seed 1] [--commands identify pivot locus] [--write]

Results go to an ext4 file system in an image, mounted so that only what a program asks to be flushed reaches the image
soon. Just before every step of the command on the disk (opening a file to write, renaming, deleting) and once it has
ended, the image is copied: that copy is what a power cut at that moment leaves on a drive that does as it is told. Each
copy is mounted, which has the journal recover, and asked what `kills.py` asks after a kill; after the command's
end the new results must be there whole. Some of the copies are given the command once more. Takes Linux and root.
"""

import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.hostile.kills import (
    COMMANDS,
    Bench,
    Reference,
    faults_after_rerun,
    prepare,
    run,
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


def cuts(bench: Bench, command: str, former: bool, place: Path) -> tuple[dict[str, str], list[Path]]:
    """Run a command to its end: the former tables, and an image before each step on the disk and after the end."""
    image, point = new_image(place / "image"), place / "disk"

    def cut(step: int) -> None:
        shutil.copyfile(image, place / f"cut-{step:04d}")

    with mounted(image, point):
        old = prepare(bench, point / "out", command, former)
        os.sync()  # the former results are long on the disk
        wait(start(bench.words(command, point / "out"), place / "log", at_step=cut))
        cut(9999)
    return old, sorted(place.glob("cut-*"))


def trial(
    bench: Bench, command: str, reference: Reference, former: bool, rng: random.Random, reruns: int
) -> Iterator[tuple[str, list[str]]]:
    """For every cut: what is there, and what is wrong with it; some are given the command once more."""
    place = Path(tempfile.mkdtemp(dir=bench.folder))
    old, images = cuts(bench, command, former, place)
    rerun = set(rng.sample(range(len(images)), reruns))
    for number, image in enumerate(images):
        last = image is images[-1]
        with mounted(image, place / "after") as folder:
            out = folder / "out"
            state, wrong = state_and_faults(out, old, reference.tables)
            if last and (state != "new" or not (out / "run.json").exists()):
                wrong.append(f"the command had ended, and its results are {state}")
            if number in rerun:
                code = wait(start(bench.words(command, out), place / "log"))
                wrong += faults_after_rerun(out, code, reference)
        wrong += ["the raw data has changed"] * (last and bench.raw_data_changed())
        yield f"{command}: cut {'after the end' if last else 'on the way'}, results {state}", wrong
        image.unlink()
    shutil.rmtree(place)


def main() -> None:
    parser = study_parser(__doc__, trials=6, seed=1)
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=COMMANDS)
    parser.add_argument("--reruns", type=int, default=3, help="cuts per trial that are given the command once more")
    given = parser.parse_args()
    if "TPJB_IN_NAMESPACE" not in os.environ:  # mounts that nobody else sees, and that go with this process
        words = ["unshare", "-m", sys.executable, "-m", "tests.hostile.power_cuts", *sys.argv[1:]]
        os.execvpe(words[0], words, {**os.environ, "TPJB_IN_NAMESPACE": "1"})

    def cut(bench: Bench, command: str, reference: Reference, number: int) -> Iterator[tuple[str, list[str]]]:
        former, rng = number // len(given.commands) % 2 == 1, random.Random(f"{given.seed}-{number}")
        return trial(bench, command, reference, former, rng, given.reruns)

    tell("power-cuts" if given.write else "", *run(cut, given.trials, given.commands, "/dev/shm"))


if __name__ == "__main__":
    main()
