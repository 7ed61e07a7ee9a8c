"""Compile the model's inner loops for this checkout, two processes beside each other.

What starts cold in several processes at once is compiled in each: the tests' two workers and the commands that they
start would compile the search, of half a minute, three to five times. Where it is known already this takes seconds.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
Case = tuple[str, dict[str, Any]]
#: The search is compiled three times: of plain films, of pads that take up heat, of all kinds of rupture with both; the
#: rest is small. What a case shares with one before it stands in the same process: none is compiled twice.
CASES: tuple[tuple[Case, ...], ...] = (
    (("adiabatic", {"conduction": True}), ("thd", {})),
    (
        ("adiabatic", {"perturbed_heat": True}),
        ("adiabatic", {"cavitation": "jfo", "conduction": True}),
        ("tehd", {"turbulence": "ng-pan"}),
    ),
)


def rocker() -> Any:
    """The bearing that is predicted."""
    from model.bearing_file import load_bearing

    return load_bearing(ROOT / "model" / "bearings" / "rocker.toml")


def find_curves() -> None:
    """Find where the pads carry, with which every search begins."""
    import numpy as np

    from model.pivots import pivot_laws
    from model.setup import Setup
    from model.statics.search import Search

    bearing = rocker()
    Search(Setup(bearing, pivot_laws("kirk", bearing)), np.array([0.0, -5000.0]), 138.0).stand()


def predict_all(cases: Sequence[Case]) -> None:
    """Predict the rocker bearing with some kinds of film, one after the other."""
    from model.options import Options
    from model.predict import predict

    for thermal, options in cases:
        predict(rocker(), 5000.0, speed=138.0, thermal=thermal, options=Options(**options))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    find_curves()  # before there are two that would
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(predict_all, CASES))
