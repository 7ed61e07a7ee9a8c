"""Random bearings from light to heavy load, preload -0.05 to 0.6: answered, meshes, starts.

    python -m tests.studies.loaded_pads [--cases 100] [--seed 1] [--rings] [--rows ROWS] [--write]

Half of the pads have central pivots, a quarter of these no preload at all; half of the films are isothermal. Every case
is solved on the default mesh, on one of four times as many cells, and again from where the same bearing
stands under 0.6 and 1.5 times the load and under a load turned by 0.4 rad. An answer from another start differs where
its dynamic stiffness does by 1e-3, and is excused where the prediction says that another equilibrium exists. Rows are
stored as they come: called again with the same ROWS it goes on. `--rings`: only hot films on central pivots with next
to no preload, where least decides which pads carry.
"""

import math
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from model.predict import predict
from model.prediction import Prediction
from tests.rigs.random_bearings import RANGES, Case, draw
from tests.studies.results import Rows, report, study_parser, table

LIGHT_TO_HEAVY = RANGES | {
    "preload": (-0.05, 0.6, False),
    "offset": (0.4, 0.6, False),
    "unit_load": (0.03e6, 3.0e6, True),
}
HOT_RINGS = LIGHT_TO_HEAVY | {
    "preload": (0.0, 0.02, False),
    "offset": (0.5, 0.5, False),
    "unit_load": (0.03e6, 2.0e6, True),
    "surface_speed": (15.0, 90.0, True),
}
FINE = (160, 12)
#: Factors on the load and turns of its direction [rad] of the other starts.
STARTS = ((0.6, 0.0), (1.5, 0.0), (1.0, 0.4))
#: Differences of the dynamic stiffness, as shares: of the mesh, of the start.
BY_MESH, BY_START = 0.01, 1e-3
#: What goes without saying, or follows, where there is no answer.
_LESS = ("not converged", "idle pads", "film not laminar", "pads ")


def cases(count: int, seed: int) -> list[tuple[Case, str]]:
    """Bearings as drawn, with central pivots, and without preload; isothermal and adiabatic in turn."""
    out = []
    for number, case in enumerate(draw(count, seed, LIGHT_TO_HEAVY)):
        pads = case.bearing.pads
        if number % 4 >= 2:
            pads = tuple(replace(p, pivot_offset=0.5) for p in pads)
        if number % 8 >= 6:
            pads = tuple(replace(p, pad_clearance=p.assembled_clearance) for p in pads)
        out.append((replace(case, bearing=case.bearing.with_pads(pads)), ("isothermal", "adiabatic")[number % 2]))
    return out


def rings(count: int, seed: int) -> list[tuple[Case, str]]:
    """Adiabatic; three in four without preload; the load on a pad, between two, and anywhere in turn."""
    out = []
    for number, case in enumerate(draw(count, seed, HOT_RINGS)):
        pads = case.bearing.pads
        if number % 4:
            pads = tuple(replace(p, pad_clearance=p.assembled_clearance) for p in pads)
        direction = (0.0, math.pi / len(pads), case.direction)[number % 3]
        out.append((replace(case, bearing=case.bearing.with_pads(pads), direction=direction), "adiabatic"))
    return out


def solve(case: Case, thermal: str, **more: Any) -> Prediction:
    return predict(case.bearing, case.load, case.direction, case.speed, pivots=case.stiffness, thermal=thermal, **more)


def difference(p: Prediction, q: Prediction) -> float:
    """Largest difference of two dynamic stiffnesses, as a share of the largest entry; infinite without an answer."""
    if not (p.converged and q.converged):
        return math.inf
    return float(np.abs(p.h - q.h).max() / np.abs(q.h).max())


def judged(number: int, case: Case, thermal: str) -> dict[str, Any]:
    """One case as a row."""
    began = time.process_time()
    p = solve(case, thermal)
    row: dict[str, Any] = {
        "case": number, "converged": p.converged, "status": [str(c) for c in p.status], "idle": list(p.idle_pads),
        "ms": 1e3 * (time.process_time() - began),
    }  # fmt: skip
    if p.converged:
        fine = solve(case, thermal, mesh=FINE)
        row["mesh"], row["idle on a fine mesh"] = difference(p, fine), list(fine.idle_pads)
        row["starts"] = []
        for share, turn in STARTS:
            near = replace(case, load=share * case.load, direction=case.direction + turn)
            row["starts"].append(difference(solve(case, thermal, start=solve(near, thermal)), p))
    return row


def summary(rows: Iterable[dict[str, Any]]) -> str:
    """The table, and every case that is off."""
    listed = sorted(rows, key=lambda row: row["case"])
    answered = [r for r in listed if r["converged"]]
    alike = [r for r in answered if r["idle"] == r["idle on a fine mesh"]]
    off = [r for r in answered if r["mesh"] > BY_MESH]
    parted = [r for r in answered if max(r["starts"]) > BY_START]
    unsaid = [r for r in parted if "another equilibrium exists" not in r["status"]]
    said = Counter("; ".join(s for s in r["status"] if not s.startswith(_LESS)) for r in listed if not r["converged"])
    across = [r for r in answered if "nothing holds the journal across its load" in r["status"]]
    counts = [
        ("answered", f"{len(answered)} of {len(listed)}"),
        ("same pads idle on the fine mesh", f"{len(alike)} of {len(answered)}"),
        ("dynamic stiffness off the fine mesh's: median", f"{np.median([r['mesh'] for r in answered]):.1e}"),
        (f"off by more than {BY_MESH:g}", f"{len(off)}: cases {[r['case'] for r in off]}"),
        (f"another answer from one of {len(STARTS)} starts", f"{len(parted)}: cases {[r['case'] for r in parted]}"),
        ("of these without a word", f"{len(unsaid)}: cases {[r['case'] for r in unsaid]}"),
        ("named: nothing holds the journal across its load", f"{len(across)}: cases {[r['case'] for r in across]}"),
        ("said of those without an answer", ", ".join(f"{n} {name}" for name, n in said.items()) or "none"),
    ]  # fmt: skip
    return table(("what", "count"), counts)


def main() -> None:
    asked = study_parser(__doc__, cases=100, seed=1, rings=False, rows=Path).parse_args()
    rows = Rows(asked.rows, "case")
    drawn = rings if asked.rings else cases
    for number, (case, thermal) in enumerate(drawn(asked.cases, asked.seed)):
        if (number,) not in rows.known:
            rows.add(judged(number, case, thermal))
    text = summary(row for key, row in rows.known.items() if key[0] < asked.cases)
    report(asked, "rings" if asked.rings else "loaded pads", text)


if __name__ == "__main__":
    main()
