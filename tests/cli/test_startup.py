"""Before a command begins: Ctrl-C is heard wherever it falls, linear algebra keeps to one thread."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import os, signal, sys, time, weakref
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background of a shell has interrupts ignored
signal.signal(signal.SIGALRM, signal.SIG_IGN)  # as some parents leave it
from tpjb_ident.runtime import interrupts

class Lock:
    "Stands in for a lock of the import machinery, whose end calls back."

def signalled(_):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)

def in_a_callback():
    lock = Lock()
    watched = weakref.ref(lock, signalled)
    del lock

def swallowed():
    try:
        signalled(None)
    except BaseException:
        pass

interrupts.listen()
try:
    PLACE()
    print("dropped", flush=True)
    time.sleep(50)
    print("not delivered")
except KeyboardInterrupt:
    time.sleep(1)  # what is being cleared away is not interrupted again
    interrupts.heard()
    print("heard", flush=True)
time.sleep(0.5)
print("once")
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("place", [pytest.param("in_a_callback", marks=pytest.mark.slow), "swallowed"])
def test_an_interrupt_that_is_dropped_is_delivered_again(place):
    script = SCRIPT.replace("PLACE", place)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.split("\n")[:3] == ["dropped", "heard", "once"]
    assert done.stderr == ""


def test_other_lost_exceptions_are_still_shown():
    script = SCRIPT.replace("os.kill(os.getpid(), signal.SIGINT)", "raise ValueError('shown')")
    script = script.replace("PLACE", "in_a_callback").replace("time.sleep(50)", "")
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
