"""Compile the model's inner loops for this checkout, two processes beside each other.

What starts cold in several processes at once is compiled in each: the tests' two workers and the commands that they
start would compile the search, of half a minute, three to five times. Where it is known already this takes seconds.
"""

import gc
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
Case = tuple[str, dict[str, Any]]
#: The search is compiled twice: of plain films, and of all films and pads. What else is compiled, and shares most with
#: it, stands beside it.
PLAIN: tuple[Case, ...] = (("adiabatic", {"perturbed_heat": True}),)
ALL_KINDS: tuple[Case, ...] = (("thd", {}), ("tehd", {}), ("adiabatic", {"conduction": True}))


def rocker() -> Any:
    """The bearing that is predicted."""
    from model.bearing_file import load_bearing

    return load_bearing(ROOT / "model" / "bearings" / "rocker.toml")


def search(options: dict[str, Any]) -> Any:
    """A search that has not begun."""
    import numpy as np

    from model.options import Options
    from model.pivots import pivot_laws
    from model.setup import Setup
    from model.statics.search import Search

    bearing = rocker()
    setup = Setup(bearing, pivot_laws("kirk", bearing), options=Options(**options))
    return Search(setup, np.array([0.0, -5000.0]), 138.0)


def predict_all(cases: Sequence[Case]) -> None:
    """Predict the rocker bearing with some kinds of film, one after the other."""
    from model.options import Options
    from model.predict import predict

    for thermal, options in cases:
        predict(rocker(), 5000.0, speed=138.0, thermal=thermal, options=Options(**options))


def compile_plain() -> None:
    """Find where the pads carry, with which every search begins; then the search itself."""
    search({}).stand()
    predict_all(PLAIN)


def compile_all_kinds() -> None:
    """Search from anywhere: where the pads carry is being compiled by the other process."""
    from model.statics.compiled.case import Problem
    from model.statics.compiled.iteration import fresh_memory, iterate

    start = search({"conduction": True})
    problem = Problem(start.grids, start.bodies, start.stack, start.works, start.state, start.case)
    iterate(problem, fresh_memory(problem))
    predict_all(ALL_KINDS)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    gc.set_threshold(200_000)  # what a compiler makes lives to the end: the collector took a tenth of the time
    with ProcessPoolExecutor(2) as pool:
        for job in [pool.submit(part) for part in (compile_all_kinds, compile_plain)]:
            job.result()
