"""Threads of linear algebra: what its libraries read when they are loaded, and how they are told later."""

import os
from pathlib import Path

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: The function of OpenBLAS by the names that its builds give it.
_NAME = "openblas_set_num_threads"
_NAMES = (f"scipy_{_NAME}64_", f"scipy_{_NAME}", f"{_NAME}64_", _NAME)
#: The system's list of what is loaded, where it has one.
_LOADED = Path("/proc/self/maps")


def one_thread() -> None:
    """Let linear algebra of this process take one thread: processes beside it share the cores already.

    The variables of the environment act on libraries that are loaded later: numpy is there before any worker is, and
    processes that are forked have what their parent has.
    """
    import ctypes

    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    lines = _LOADED.read_text("utf-8", "replace").splitlines() if _LOADED.exists() else ()
    for path in {line.split(maxsplit=5)[-1] for line in lines if "openblas" in line}:
        try:
            library = ctypes.CDLL(path)
        except OSError:  # replaced on disk since it was loaded
            continue
        for name in _NAMES:
            if hasattr(library, name):
                getattr(library, name)(1)
