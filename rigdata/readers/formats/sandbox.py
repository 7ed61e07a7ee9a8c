"""Libraries that crash, hang or eat memory on a damaged file read it in a process of their own.

asammdf 8.8 dies by SIGSEGV, follows circles of addresses without end, and unpacks gigabytes from kilobytes when a few
bytes of an MDF 4 file are wrong (found by fuzzing). No `except` in this process can help against that.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.problem import refuse
from rigdata.readers.series import Series

#: Seconds of processor time that any file may take, and bytes per second more; `PATIENCE` times that by the clock.
SECONDS, BYTES_PER_SECOND, PATIENCE = 60.0, 2e6, 10.0
#: Memory beyond what numpy has mapped that any file may take, and multiples of the file's size more [bytes].
MEMORY, MULTIPLES = 2**30, 64
_AGAIN = "Export or copy it again from the logger"


def read_sandboxed(module: str, path: Path) -> list[Series]:
    """Let ``rigdata.readers.formats.<module>.read_in_sandbox(path)`` read a file in a child process."""
    seconds = SECONDS + path.stat().st_size / BYTES_PER_SECOND
    # The child must find the same rigdata as this process, wherever that came from.
    home = str(Path(__file__).parents[3])
    search_path = os.pathsep.join([home, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    command = [sys.executable, "-m", "rigdata.readers.formats.sandbox", module, str(path), str(math.ceil(seconds))]
    too_long = refuse("", "", f"took longer than {seconds:.0f} s to read, far beyond its size", _AGAIN)
    try:
        # asammdf repairs a copy of a measurement that was cut short, and a child that dies cannot clear it away.
        with tempfile.TemporaryDirectory(prefix="tpjb-", ignore_cleanup_errors=True) as scratch:
            temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), scratch)
            # What a library prints about a broken file is no message for people; its exception comes with the answer.
            child = subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PATIENCE * seconds,
                env={**os.environ, "PYTHONPATH": search_path, **temporary},
                check=False,
            )
    except subprocess.TimeoutExpired as error:
        raise too_long from error
    if child.returncode == -getattr(signal, "SIGXCPU", 0) != 0:
        raise too_long
    head, _, body = child.stdout.partition(b"\n")
    if child.returncode != 0 or not head:
        fault = f"made its library crash (exit status {child.returncode}): it is damaged"
        raise refuse("", "", fault, _AGAIN)
    heads = json.loads(head)
    if isinstance(heads, dict):
        raise refuse("", "", str(heads["error"]), _AGAIN)
    return _unpack(heads, body)


def _unpack(heads: list[Any], body: bytes) -> list[Series]:
    """Undo `_send`."""
    numbers, start = np.frombuffer(body, dtype=float), 0
    series = []
    for name, unit, group, length, is_timed in heads:
        values, start = numbers[start : start + length], start + length
        time = None
        if is_timed:
            time, start = numbers[start : start + length], start + length
        series.append(Series(name, unit, values, time, group))
    return series


def _send(series: Sequence[Series]) -> None:
    heads = [[s.name, s.unit, s.group, len(s), s.time is not None] for s in series]
    out = sys.stdout.buffer
    out.write(json.dumps(heads).encode() + b"\n")
    for channel in series:
        for numbers in (channel.values, channel.time):
            if numbers is not None:
                out.write(np.ascontiguousarray(numbers, dtype=float).data)
    out.flush()


def _limit_memory(path: Path) -> None:
    """Allow some times the file's size beyond what is mapped by now (not on Windows)."""
    with contextlib.suppress(ImportError):
        import resource

        with contextlib.suppress(OSError):  # no /proc: macOS does not heed this limit either
            mapped = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
            limit = mapped + MEMORY + MULTIPLES * path.stat().st_size
            resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def main(module: str, path: Path) -> None:
    """Read a file and write its channels to the standard output: one line of JSON, then the numbers."""
    reader = importlib.import_module(f"rigdata.readers.formats.{module}")
    _limit_memory(path)
    try:
        with contextlib.redirect_stdout(sys.stderr):  # asammdf prints what it finds; the answer would begin with that
            series = reader.read_in_sandbox(path)
    except MemoryError:
        error = "claims more data than its size can hold"
    except Exception as problem:  # whatever another library raises on a broken file: it is the file's fault here
        error = f"cannot be read ({type(problem).__name__}: {str(problem)[:120]})"
    else:
        _send(series)
        return
    print(json.dumps({"error": error}))


if __name__ == "__main__":
    with contextlib.suppress(ImportError):  # no limits on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]), resource.getrlimit(resource.RLIMIT_CPU)[1]))
    main(sys.argv[1], Path(sys.argv[2]))
