"""Feed every reader spoilt files: only documented errors, bounded time and memory.

    python -m tests.studies.fuzz all [--cases 100000] [--seconds 600] [--seed 1] [--keep DIR] [--write]
    python -m tests.studies.fuzz TARGET --seed 1 --case 4711

Targets: manifest, bearing, pivots, effects, csv, hdf5, table, record, cli, mat, mat73, parquet, tdms, uff, mf4, asc,
all. The first cases of a seed run traced: an input that reaches a line no other has reached joins the corpus. It then
stays as it is, so that case i of a seed is always the same input (``--case i`` feeds it alone); what fails is kept as a
file. The cases run in child processes, so that a crash of a C library is a finding and not the end.
"""

import importlib
import json
import logging
import math
import mmap
import os
import random
import resource
import select
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from tests.hostile.fuzz_mutations import mutated
from tests.hostile.fuzz_targets import ROOT, TARGETS, Target, make_target
from tests.studies.results import report, study_parser, table

#: CPU seconds and bytes of growth above which a case is a finding.
SLOWEST, LARGEST = 5.0, 2**31
#: Seconds at one case after which the process is taken for hung.
HANG = 120.0
#: Bytes of an input.
LONGEST = 65536
#: Cases per child process.
BLOCK = 20_000
#: The first cases of a seed run traced and make the corpus, which then stays as it is: so a case is its number.
GROWTH = 500


class TooSlowError(BaseException):
    """The case took more than its time; no `except Exception` may swallow it."""


@dataclass
class Tally:
    """What a target answered."""

    cases: int = 0
    accepted: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    peak_MB: int = 0
    findings: list[dict[str, str]] = field(default_factory=list)

    def take(self, more: "Tally") -> None:
        """Add the cases of a block; its findings are counted by whoever stores them."""
        self.cases += more.cases
        self.accepted += more.accepted
        self.refused.update(more.refused)
        self.slowest = max(self.slowest, more.slowest)
        self.peak_MB = max(self.peak_MB, more.peak_MB)


def _expire(number: int, frame: FrameType | None) -> None:
    raise TooSlowError


def one_case(target: Target, data: bytes, tally: Tally) -> str | None:
    """Feed one input; the finding's text, None where the answer is a documented one."""
    start = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, SLOWEST)
    try:
        target.feed(data)
        tally.accepted += 1
    except target.documented as error:
        tally.refused[type(error).__name__] += 1
    except TooSlowError:
        return f"took more than {SLOWEST:g} s: {traceback.format_exc(limit=-4)}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:300]}\n{traceback.format_exc(limit=-6)}"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        tally.cases += 1
        tally.slowest = max(tally.slowest, time.process_time() - start)
    return None


class Reached:
    """Lines of our packages that some input has run."""

    def __init__(self) -> None:
        self.lines: set[tuple[str, int]] = set()
        self._ours = tuple(str(ROOT / p) for p in ("rigdata", "model", "tpjb_ident"))

    def _trace(self, frame: FrameType, event: str, arg: Any) -> Any:
        name = frame.f_code.co_filename
        if not name.startswith(self._ours):
            return None
        self.lines.add((name, frame.f_lineno))
        return self._trace

    def new(self, target: Target, data: bytes, tally: Tally) -> tuple[bool, str | None]:
        """Run traced; whether a line was reached for the first time, and the finding."""
        before = len(self.lines)
        sys.settrace(self._trace)
        try:
            finding = one_case(target, data, tally)
        finally:
            sys.settrace(None)
        return len(self.lines) > before, finding


def _child(target: Target, block: range, seed: int, corpus: Path, board: mmap.mmap, pipe: int) -> None:
    """Run the cases of one block; answer with a JSON line."""
    warnings.simplefilter("error")
    signal.signal(signal.SIGVTALRM, _expire)
    logging.disable(logging.CRITICAL)
    tally, reached = Tally(), Reached()
    # destructors of other people's half-open files (asammdf): counted, as nothing can catch them
    sys.unraisablehook = lambda told: tally.refused.update([f"in a destructor: {told.exc_type.__name__}"])
    seeds = [*target.seeds, *(p.read_bytes() for p in sorted(corpus.iterdir())[-400:])]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for number in block:
        data = mutated(seeds, random.Random(f"{seed}-{number}"), LONGEST)
        board[:8], board[16:24] = struct.pack("<q", number), struct.pack("<q", len(data))
        board[24 : 24 + len(data)] = data  # a crash of the process leaves the input behind
        if number < GROWTH:
            new, finding = reached.new(target, data, tally)
            if new:
                seeds.append(data)
                (corpus / f"{number:09d}").write_bytes(data)
        else:
            finding = one_case(target, data, tally)
        now = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if (now - peak) * 1024 > LARGEST:
            finding = finding or f"memory grew by {(now - peak) >> 10} MB"
        peak = max(peak, now)
        if finding is not None and len(tally.findings) < 50:
            tally.findings.append({"case": str(number), "what": finding, "input": data.hex()})
        if time.time() > struct.unpack("<d", board[8:16])[0]:
            break
    tally.peak_MB = peak >> 10
    with os.fdopen(pipe, "w") as stream:
        stream.write(json.dumps(vars(tally)))


def _ended_if_it_hangs(child: int, answer: int, board: mmap.mmap) -> bool:
    """Wait for a child's answer; end one that stays at a case, in code that no signal of Python's interrupts."""
    number, since = board[:8], time.monotonic()
    while not select.select([answer], [], [], 2.0)[0]:
        if board[:8] != number:
            number, since = board[:8], time.monotonic()
        elif time.monotonic() - since > HANG:
            os.kill(child, signal.SIGKILL)
            return True
    return False


def run_block(target: Target, block: range, seed: int, corpus: Path, board: mmap.mmap) -> Tally:
    """One child process; what it found, a crash of the process included."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        code = 1
        try:
            _child(target, block, seed, corpus, board, writing)
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(writing)
    hung = _ended_if_it_hangs(child, reading, board)
    with os.fdopen(reading) as stream:
        text = stream.read()
    _, status = os.waitpid(child, 0)
    if text:
        return Tally(**json.loads(text))
    (number,) = struct.unpack("<q", board[:8])
    (size,) = struct.unpack("<q", board[16:24])
    what = f"no end after {HANG:g} s, in a library" if hung else f"the process died (status {status})"
    finding = {"case": str(number), "what": what, "input": board[24 : 24 + size].hex()}
    return Tally(cases=number - block.start + 1, findings=[finding])


def fuzz(name: str, cases: int, seconds: float, seed: int, keep: Path) -> tuple[Tally, Counter[str], float]:
    """Fuzz one target; what it answered, findings, which are kept as files, and processor seconds."""
    total, findings, at = Tally(), Counter[str](), 0
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as scratch:
        folder, corpus = Path(scratch), Path(scratch) / "corpus"
        corpus.mkdir()
        target = make_target(name, folder)
        for module in target.preload:
            importlib.import_module(module)  # once, not in every child
        board = mmap.mmap(-1, 24 + LONGEST)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        until = time.time() + seconds
        board[8:16] = struct.pack("<d", until)
        while at < cases and time.time() < until:
            end = GROWTH if at < GROWTH else at + BLOCK
            block = run_block(target, range(at, min(cases, end)), seed, corpus, board)
            at += block.cases or 1
            total.take(block)
            _keep(keep, name, seed, block.findings, findings)
            if at % 100_000 < BLOCK:
                print(f"{name} {at} cases", file=sys.stderr, flush=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return total, findings, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _keep(keep: Path, name: str, seed: int, findings: list[dict[str, str]], seen: Counter[str]) -> None:
    for found in findings:
        lines = [line.strip() for line in found["what"].splitlines() if line.strip()]
        place = next((line for line in reversed(lines) if line.startswith("File ")), "")
        key = f"{lines[0][:90]} | {place[-90:]}"
        seen[key] += 1
        if seen[key] == 1:
            keep.mkdir(parents=True, exist_ok=True)
            stem = keep / f"{name}-{seed}-{found['case']}"
            stem.with_suffix(".bin").write_bytes(bytes.fromhex(found["input"]))
            stem.with_suffix(".txt").write_text(found["what"], encoding="utf-8", errors="replace")


def replay(name: str, seed: int, number: int) -> str | None:
    """Feed one case of a seed alone; the finding's text, None where the answer is a documented one."""
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as scratch:
        corpus = Path(scratch) / "corpus"
        corpus.mkdir()
        target = make_target(name, Path(scratch))
        board = mmap.mmap(-1, 24 + LONGEST)
        board[8:16] = struct.pack("<d", math.inf)
        if number >= GROWTH:
            run_block(target, range(GROWTH), seed, corpus, board)
        found = run_block(target, range(number, number + 1), seed, corpus, board).findings
    return found[0]["what"] if found else None


def main() -> None:
    parser = study_parser(__doc__, cases=100_000, seconds=600.0, seed=1, keep=Path("fuzz-findings"), case=int)
    parser.add_argument("target", nargs="+", choices=[*TARGETS, "all"])
    given = parser.parse_args()
    names = TARGETS if "all" in given.target else given.target
    if given.case is not None:
        finding = replay(names[0], given.seed, given.case)
        print(finding or "a documented answer")
        sys.exit(finding is not None)
    rows, failed = [], False
    for name in names:
        total, findings, spent = fuzz(name, given.cases, given.seconds, given.seed, given.keep)
        print(name, dict(total.refused), *findings, sep="\n", flush=True)
        cells = (name, total.cases, total.accepted, f"{spent:.1f}", f"{total.slowest:.1f} s", f"{total.peak_MB} MB")
        rows.append((*cells, len(findings)))
        failed = failed or bool(findings)
    head = ("reader", "cases", "taken", "CPU s", "slowest case", "peak memory", "findings")
    report(given, "fuzz", table(head, rows))
    sys.exit(failed)


if __name__ == "__main__":
    main()
