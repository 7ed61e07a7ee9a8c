"""Kill commands at random moments: are results whole or absent, and does a rerun give the same bits?

    python -m tests.hostile.kills [--kills 200] [--seed 1] [--commands identify pivot locus] [--write]

Each trial starts a command in a process of its own (forked from one that has the libraries loaded), into a new folder
or one that holds former results, and sends it SIGKILL: at a random time, or just before its n-th step on the disk
(opening a file to write, renaming, deleting: counted by an audit hook). Then it is asked: is the campaign's every byte
the same; is every file under its final name one of a former or a whole run; if run.json is there, do all files it lists
have their SHA-256; does a rerun end with the same exit code and bit-identical tables, and leave nothing else behind.
"""

import hashlib
import json
import mmap
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tests.studies.results import study_parser, table, typed, write_section

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = ("identify", "pivot", "locus")
#: Commands that take longer, killed on request.
_LONG = ("compare", "diagnose", "demo")
#: When a page was written.
_MINUTE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2} UTC")
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_STEPS = ("os.rename", "os.remove", "os.rmdir", "os.mkdir", "shutil.rmtree")


def write_small_campaign(path: Path, commands: Sequence[str]) -> Path:
    """An HDF5 campaign with a little of everything that the commands ask for, not writable."""
    from tests.good_campaigns import SMALL_PLAN, rocker_rig, written

    plan = replace(SMALL_PLAN, dynamic=(), dry=()) if set(commands) == {"locus"} else SMALL_PLAN
    written(path, rocker_rig(5, plan=plan))
    path.chmod(0o444)
    return path


def files_with_hash(folder: Path) -> dict[str, str]:
    """SHA-256 of all files below `folder`, by relative name."""
    if not folder.is_dir():
        return {}
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found[path.relative_to(folder).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def tables(folder: Path) -> dict[str, str]:
    """Results without run.json, which tells the time, and pages without theirs."""
    hashes = {n: h for n, h in files_with_hash(folder).items() if n != "run.json" and not n.startswith(".tpjb")}
    for name in hashes:
        if name.endswith(".html"):
            text = _MINUTE.sub("", (folder / name).read_text(encoding="utf-8"))
            hashes[name] = hashlib.sha256(text.encode()).hexdigest()
    return hashes


def watch_steps(at_step: Callable[[int], None]) -> None:
    """Have `at_step` called, with a number that counts from 1, just before every step of this process on the disk."""
    steps = 0
    inside = False

    def watch(event: str, arguments: tuple) -> None:
        nonlocal steps, inside
        writing = event == "open" and isinstance(arguments[2], int) and bool(arguments[2] & _WRITING)
        if (writing or event in _STEPS) and not inside:
            steps += 1
            inside = True  # its own steps are none of the command's
            try:
                at_step(steps)
            finally:
                inside = False

    sys.addaudithook(watch)


def start(words: list[str], log: Path, at_step: Callable[[int], None] = lambda step: None) -> int:
    """Fork a process that runs the command line; its id."""
    child = os.fork()
    if child:
        return child
    os.setsid()
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    watch_steps(at_step)
    code = 1
    try:
        from tpjb_ident.cli.commands.app import app

        app(words, prog_name="tpjb")
        code = 0
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        os._exit(code)


def wait(child: int) -> int:
    """Exit code of a child, minus the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@dataclass(frozen=True)
class Reference:
    """What an undisturbed run gives, and how long it takes."""

    tables: dict[str, str]
    code: int
    seconds: float
    steps: int


@dataclass(frozen=True)
class Bench:
    """The campaign, its state at the beginning, and a folder to work in."""

    campaign: Path
    digest: str
    mode: int
    folder: Path

    def words(self, command: str, out: Path) -> list[str]:
        extra = ["--workers", "1"] if command in ("identify", "diagnose") else []
        source = [] if command == "demo" else [str(self.campaign)]
        return [command, *source, "--out", str(out), *extra]

    def reference(self, command: str) -> Reference:
        """Run once undisturbed."""
        out, counter = self.folder / f"reference-{command}", mmap.mmap(-1, 8)

        def count(step: int) -> None:
            counter[:] = step.to_bytes(8, "little")

        began = time.time()
        code = wait(start(self.words(command, out), self.folder / "log", count))
        return Reference(tables(out), code, time.time() - began, int.from_bytes(counter[:], "little"))

    def raw_data_changed(self) -> bool:
        state = hashlib.sha256(self.campaign.read_bytes()).hexdigest(), self.campaign.stat().st_mode
        return state != (self.digest, self.mode)


def make_bench(folder: Path, commands: tuple[str, ...]) -> Bench:
    """Campaign and libraries, ready to fork from."""
    from typer.testing import CliRunner

    from tpjb_ident.cli.commands.app import app

    campaign = write_small_campaign(folder / "campaign.h5", commands)
    digest = hashlib.sha256(campaign.read_bytes()).hexdigest()
    bench = Bench(campaign, digest, campaign.stat().st_mode, folder)
    for command in commands:  # once in this process, so that what they import late is there for all forks
        CliRunner().invoke(app, bench.words(command, folder / f"warm-{command}"))
    return bench


def prepare(bench: Bench, out: Path, command: str, former: bool) -> dict[str, str]:
    """Make an output folder as a former run of another version left it; its tables."""
    if not former:
        return {}
    source = bench.folder / f"reference-{command}"
    shutil.copytree(source, out)
    for path in out.rglob("*.csv"):
        path.write_text(path.read_text().splitlines()[0] + "\n")  # other bytes, as of another campaign
    record = json.loads((out / "run.json").read_text())
    entry = record["commands"][command]
    (out / "gone.csv").write_text("x\n")
    entry["outputs"] = sorted([*entry["outputs"], "gone.csv"])
    entry["outputs_sha256"] = {n: h for n, h in files_with_hash(out).items() if n in entry["outputs"]}
    (out / "run.json").write_text(json.dumps(record))
    return tables(out)


def faults_after_kill(out: Path, old: dict[str, str], new: dict[str, str]) -> list[str]:
    """What a reader who opens the folder now would take for a result and is none."""
    found = []
    for name, digest in tables(out).items():
        if digest not in {old.get(name), new.get(name)}:
            found.append(f"{name} is neither the former nor the new one")
    if (out / "run.json").is_file():
        for entry in json.loads((out / "run.json").read_text())["commands"].values():
            wrong = {n for n, h in entry["outputs_sha256"].items() if files_with_hash(out).get(n) != h}
            found += [f"run.json vouches for {name}, which differs" for name in sorted(wrong)]
    return found


def state_and_faults(out: Path, old: dict[str, str], new: dict[str, str]) -> tuple[str, list[str]]:
    """Which results are there: new, absent, former or on their way in; and what is wrong with them."""
    wrong, now = faults_after_kill(out, old, new), tables(out)
    state = "new" if now == new else "absent" if not now else "former" if now == old else "moving in"
    if state == "moving in" and (out / "run.json").exists():
        wrong.append("a mixture of former and new tables with a run.json")
    return state, wrong


def faults_after_rerun(out: Path, code: int, reference: Reference) -> list[str]:
    """How the rerun differs from an undisturbed run."""
    found = [] if code == reference.code else [f"the rerun ends with {code}, not {reference.code}"]
    if tables(out) != reference.tables:
        found.append("the rerun gives other tables")
    rest = [p.name for p in out.parent.glob(f".{out.name}*")] + [p.name for p in out.glob(".*")]
    return found + [f"{name} is left over" for name in rest]


def trial(bench: Bench, command: str, reference: Reference, rng: random.Random) -> tuple[str, list[str]]:
    """One kill and one rerun: how it came out, and what is wrong."""
    place = Path(tempfile.mkdtemp(dir=bench.folder))
    out, log = place / "out", place / "log"
    former = rng.random() < 0.5
    old = prepare(bench, out, command, former)
    # Half of the kills hit the disk steps, the last of which put the results in place: one step where the folder is
    # new, some twenty more where it holds former results.
    step = None if rng.random() < 0.5 else max(1, reference.steps + 25 * former - rng.randrange(40))

    def die(at: int) -> None:
        if at == step:
            os.kill(os.getpid(), signal.SIGKILL)

    child = start(bench.words(command, out), log, die)
    if step is None:
        time.sleep(rng.uniform(0.0, 1.1) * reference.seconds)
        os.kill(child, signal.SIGKILL)
    code = wait(child)
    state, wrong = state_and_faults(out, old, reference.tables)
    wrong += ["the raw data has changed"] * bench.raw_data_changed()
    wrong += faults_after_rerun(out, wait(start(bench.words(command, out), log)), reference)
    shutil.rmtree(place)
    return f"{command}: {'killed' if code == -9 else 'had ended'}, results {state}", wrong


#: Outcomes, each with what is wrong, of a trial of a command, by its number.
Trial = Callable[[Bench, str, Reference, int], Iterable[tuple[str, list[str]]]]


def run(trial: Trial, trials: int, commands: Sequence[str], scratch: str | None = None) -> list[Counter[str]]:
    """Outcomes and faults of so many trials."""
    outcomes: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        bench = make_bench(Path(folder), tuple(commands))
        references = {command: bench.reference(command) for command in commands}
        for number in range(trials):
            command = commands[number % len(commands)]
            for outcome, faults in trial(bench, command, references[command], number):
                outcomes[outcome] += 1
                wrong.update(f"{command}: {text}" for text in faults)
    return [outcomes, wrong]


def tell(section: str, outcomes: Counter[str], wrong: Counter[str]) -> None:
    """Print both, write them where a section is named, and end the program, with 1 where anything is wrong."""
    if section:
        rows = [(text, count) for counts in (outcomes, wrong) for text, count in sorted(counts.items())]
        write_section(section, typed(), table(("outcome", "trials"), rows))
    for title, counts in (("outcomes", outcomes), ("WRONG", wrong)):
        print(f"{title}:")
        for text, count in sorted(counts.items()):
            print(f"  {count:5d}  {text}")
    sys.exit(bool(wrong))


def main() -> None:
    parser = study_parser(__doc__, kills=200, seed=1)
    parser.add_argument("--commands", nargs="+", choices=(*COMMANDS, *_LONG), default=COMMANDS)
    given = parser.parse_args()

    def kill(bench: Bench, command: str, reference: Reference, number: int) -> list[tuple[str, list[str]]]:
        return [trial(bench, command, reference, random.Random(f"{given.seed}-{number}"))]

    tell("kills" if given.write else "", *run(kill, given.kills, given.commands))


if __name__ == "__main__":
    main()
