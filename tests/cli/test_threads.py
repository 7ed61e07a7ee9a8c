"""Linear algebra keeps to one thread on the command line, unless the user says otherwise."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

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
