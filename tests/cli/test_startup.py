"""Before a command begins: Ctrl-C is heard wherever it falls, linear algebra keeps to one thread."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import signal, sys, time, weakref
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background of a shell has interrupts ignored
from tpjb_ident.cli import _interrupt_again

class Lock:
    "Stands in for a lock of the import machinery, whose end calls back."

def interrupted(_):
    raise KeyboardInterrupt

sys.unraisablehook = _interrupt_again
lock = Lock()
watched = weakref.ref(lock, interrupted)
try:
    del lock
    print("dropped by Python", flush=True)
    time.sleep(50)
    print("not delivered")
except KeyboardInterrupt:
    print("heard")
"""


def test_an_interrupt_that_falls_into_a_callback_is_delivered_again():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.split("\n")[:2] == ["dropped by Python", "heard"]
    assert done.stderr == ""


def test_other_lost_exceptions_are_still_shown():
    script = SCRIPT.replace("raise KeyboardInterrupt", "raise ValueError('shown')").replace("time.sleep(50)", "")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True)
    assert "ValueError: shown" in done.stderr


CODE = """import os
from tpjb_ident import cli
cli._one_thread_for_small_matrices()
print(os.environ["OMP_NUM_THREADS"])"""


@pytest.mark.parametrize(("given", "used"), [(None, "1"), ("4", "4")])
def test_one_thread_unless_told(given, used):
    kept = {k: v for k, v in os.environ.items() if k != "OMP_NUM_THREADS"}
    env = kept if given is None else {**kept, "OMP_NUM_THREADS": given}
    done = subprocess.run([sys.executable, "-c", CODE], env=env, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == used
