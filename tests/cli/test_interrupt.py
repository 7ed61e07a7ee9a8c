"""Ctrl-C is heard wherever it falls."""

from __future__ import annotations

import subprocess
import sys

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
