"""Compile the model's inner loops for this checkout, two processes beside each other.

What starts cold in several processes at once is compiled in each: the tests' two workers and the commands that they
start would compile the search, of half a minute, three to five times. Where it is known already this takes seconds.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: The search is compiled three times: of plain films, of pads that take up heat, of all kinds of rupture with both; the
#: rest is small.
CASES = (
    ("adiabatic", {"cavitation": "jfo", "conduction": True}),
    ("adiabatic", {"perturbed_heat": True}),
    ("adiabatic", {"conduction": True}),
    ("thd", {}),
    ("tehd", {"turbulence": "ng-pan"}),
)


def predicted(case: tuple[str, dict[str, object]]) -> None:
    """Predict the rocker bearing with one kind of film."""
    from model.bearing_file import load_bearing
    from model.options import Options
    from model.predict import predict

    thermal, options = case
    bearing = load_bearing(ROOT / "model" / "bearings" / "rocker.toml")
    predict(bearing, 5000.0, speed=138.0, thermal=thermal, options=Options(**options))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(predicted, CASES))
