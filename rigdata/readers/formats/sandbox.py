"""Libraries that crash, hang or eat memory on a damaged file read it in a process of their own.

asammdf 8.8 dies by SIGSEGV, follows circles of addresses without end, and unpacks gigabytes from kilobytes when a few
bytes of an MDF 4 file are wrong (found by fuzzing). No `except` in this process can help against that.
"""

import contextlib
import importlib
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from rigdata.problem import refuse
from rigdata.readers.series import Series

#: Seconds of processor time that any file may take, and bytes per second more; `PATIENCE` times that by the clock.
SECONDS, BYTES_PER_SECOND, PATIENCE = 60.0, 2e6, 10.0
#: Memory beyond what numpy has mapped that any file may take, and multiples of the file's size more [bytes].
MEMORY, MULTIPLES = 2**30, 64
_AGAIN = "Export or copy it again from the logger"


def read_sandboxed(function: str, path: Path) -> list[Series]:
    """Let ``rigdata.readers.formats.loggers.<function>(path)`` read a file in a child process."""
    seconds = SECONDS + path.stat().st_size / BYTES_PER_SECOND
    # The child must find the same rigdata as this process, wherever that came from.
    home = str(Path(__file__).parents[3])
    search_path = os.pathsep.join([home, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    command = [sys.executable, "-m", "rigdata.readers.formats.sandbox", function, str(path), str(math.ceil(seconds))]
    too_long = refuse("", "", f"took longer than {seconds:.0f} s to read, far beyond its size", _AGAIN)
    try:
        # asammdf repairs a copy of a measurement that was cut short, and a child that dies cannot clear it away.
        with tempfile.TemporaryDirectory(prefix="tpjb-", ignore_cleanup_errors=True) as scratch:
            temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), scratch)
            answer = Path(scratch) / "answer.npz"
            # What a library prints about a broken file is no message for people; its exception comes with the answer.
            child = subprocess.run(
                [*command, str(answer)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PATIENCE * seconds,
                env={**os.environ, "PYTHONPATH": search_path, **temporary},
                check=False,
            )
            if answer.exists() and child.returncode == 0:
                return _answered(answer)
    except subprocess.TimeoutExpired as error:
        raise too_long from error
    if child.returncode == -getattr(signal, "SIGXCPU", 0) != 0:
        raise too_long
    fault = f"made its library crash (exit status {child.returncode}): it is damaged"
    raise refuse("", "", fault, _AGAIN)


def _answered(answer: Path) -> list[Series]:
    """Series from the file that `main` wrote; its error, if that is what it holds."""
    with np.load(answer, allow_pickle=False) as arrays:
        if "error" in arrays:
            raise refuse("", "", str(arrays["error"]), _AGAIN)
        series = []
        for i, (name, unit, group) in enumerate(json.loads(str(arrays["heads"]))):
            series.append(Series(name, unit, arrays[f"values {i}"], arrays.get(f"time {i}"), group))
    return series


def _limit(path: Path, seconds: int) -> None:
    """Allow so much processor time, and some times the file's size beyond what is mapped by now (not on Windows)."""
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))
        with contextlib.suppress(OSError):  # no /proc: macOS does not heed this limit either
            mapped = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
            limit = mapped + MEMORY + MULTIPLES * path.stat().st_size
            resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def main(function: str, path: Path, seconds: int, answer: Path) -> None:
    """Read a file and write its channels to `answer` (.npz): texts, and the numbers of each; or what is wrong."""
    read = getattr(importlib.import_module("rigdata.readers.formats.loggers"), function)
    _limit(path, seconds)
    try:
        series = read(path)
    except MemoryError:
        np.savez(answer, error="claims more data than its size can hold")
    except Exception as problem:  # whatever another library raises on a broken file: it is the file's fault here
        np.savez(answer, error=f"cannot be read ({type(problem).__name__}: {str(problem)[:120]})")
    else:
        heads, arrays = [], {}
        for i, channel in enumerate(series):
            heads.append([channel.name, channel.unit, channel.group])
            arrays[f"values {i}"] = channel.values
            if channel.time is not None:
                arrays[f"time {i}"] = channel.time
        np.savez(answer, heads=json.dumps(heads), **arrays)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
