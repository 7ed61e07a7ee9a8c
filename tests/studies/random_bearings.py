"""Random physical bearings with the physics beyond the baseline: how many converge, and what the rest are called.

    python -m tests.studies.random_bearings [--cases 2000] [--seed 1] [--only thd] [--rows ROWS] [--write]

The bearings of `tests/rigs/random_bearings.py`, a quarter each with turbulent films, with pivots that roll and slide,
with hot oil that goes round, and with all that heat does (`thermal="thd"`). A case is at fault if it raises, if a
converged prediction is not finite or its pads' loads do not balance the load, if its heat does not leave, or if a case
that has not converged does not say so. Rows are stored as they come: called again with the same ROWS it goes on.
"""

import math
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing import Bearing, Pivot
from model.effects import Effect
from model.errors import ModelError
from model.growth import Growth, grown
from model.options import Options
from model.predict import predict
from model.prediction import Prediction
from model.statics.pad_film import PadFilm
from tests.rigs.random_bearings import Case, draw
from tests.studies.results import Rows, report, study_parser, table


def turbulence(case: Case, rng: np.random.Generator) -> Prediction:
    """Oil up to twenty times thinner, as far as the Sommerfeld number is one of a running bearing."""
    oil, most = case.bearing.oil, min(20.0, case.sommerfeld / 0.03)
    thin = replace(case.bearing, oil=replace(oil, viscosity_40=oil.viscosity_40 * most ** -rng.random()))
    options = Options(turbulence="ng-pan")
    return predict(thin, case.load, case.direction, case.speed, pivots=case.stiffness, options=options)


def rolling(case: Case, rng: np.random.Generator) -> Prediction:
    """Half of them roll, half slide."""
    if rng.random() < 0.5:
        effect = Effect("pivot_rolling", factor=float(rng.uniform(0.2, 2.0)))
    else:
        effect = Effect("pivot_friction", coefficient=float(rng.uniform(0.02, 0.3)))
    bearing = with_contact(case)
    return predict(bearing, case.load, case.direction, case.speed, pivots=case.stiffness, effects=[effect])


def with_contact(case: Case) -> Bearing:
    """The bearing with spheres whose size goes with it."""
    size = 0.4 * case.bearing.journal_diameter
    pivot = Pivot("spherical", sphere_diameter=size, housing_diameter=1.1 * size, pivot_diameter=size)
    return replace(case.bearing, pivot=pivot)


def mixing(case: Case, rng: np.random.Generator) -> Prediction:
    """Lambda up to 0.95."""
    effect = Effect("hot_oil_carryover", fraction=float(rng.uniform(0.3, 0.95)))
    return predict(case.bearing, case.load, case.direction, case.speed, pivots=case.stiffness, effects=[effect])


def thd(case: Case, rng: np.random.Generator) -> Prediction:
    """All that heat does; the clearances drawn are those of a bearing that runs, with a journal 30 K above the oil."""
    return predict(as_workshop(case), case.load, case.direction, case.speed, pivots=case.stiffness, thermal="thd")


def as_workshop(case: Case) -> Bearing:
    """The bearing at 20 degC that has the drawn clearances when it runs."""
    bearing, supply = case.bearing, case.bearing.oil.supply_temperature
    running = grown(bearing, Growth(), supply, supply + 30.0)

    def cold(pad: Any, warm: Any) -> Any:
        return replace(
            pad,
            pad_clearance=2.0 * pad.pad_clearance - warm.pad_clearance,
            assembled_clearance=2.0 * pad.assembled_clearance - warm.assembled_clearance,
        )

    return bearing.with_pads(tuple(cold(p, w) for p, w in zip(bearing.pads, running.pads, strict=True)))


KINDS: dict[str, Callable[[Case, np.random.Generator], Prediction]] = {
    "turbulence": turbulence,
    "rolling": rolling,
    "mixing": mixing,
    "thd": thd,
}
NAMES = {
    "turbulence": "turbulence, Re to ten thousand",
    "rolling": "pivots that roll or slide",
    "mixing": "hot oil round the ring, lambda 0.3 to 0.95",
    "thd": "`thd`, clearances drawn as they run",
}
#: The heat that does not leave, as a share of what is made: the balances are second order in the mesh.
HEAT_LIMIT = 0.1


def fault(p: Prediction) -> str:
    """What is silently wrong with a prediction; empty if nothing is."""
    if not p.converged:
        return "" if "not converged" in p.status and np.isnan(p.h).all() else "does not say that it has not converged"
    if not np.isfinite(p.h).all():
        return "not finite"
    films = [f for f in p.equilibrium.films if f.forces is not None]
    force = sum(f.forces.force[0] * f.normal + f.forces.force[1] * f.tangent for f in films)
    push = p.load * np.array([math.cos(p.load_direction), math.sin(p.load_direction)])
    if not np.abs(force - push).max() < 1e-4 * max(p.load, 1.0):
        return "unbalanced"
    said = p.setup.thermal != "thd" or "flow back at a leading edge" in p.status
    return "" if said or abs(heat_lost(p)) < HEAT_LIMIT else "heat is lost"


def heat_lost(p: Prediction) -> float:
    """Share of the power that neither the oil nor the pads carry away; backwaters limit what oil carries."""
    oil, gone = p.setup.bearing.oil, 0.0
    around = float(np.mean([f.inlet for f in p.equilibrium.films]))
    for film, flow in zip(p.equilibrium.films, p.pad_flow, strict=True):
        gone += oil.density(flow.outlet) * oil.specific_heat * flow.outflow * (flow.outlet - flow.inlet)
        if film.forces is None or film.deformation is None:
            continue
        sides = film.work.flow_z[:, -1] * (edge_temperature(film) - flow.inlet) * oil.specific_heat
        into = film.deformation.flux @ (film.deformation.to_coarse @ (film.face_temperature - around).ravel())
        gone += 2.0 * float(sides.sum()) + float(film.grid.area.ravel() @ into)
    return 1.0 - float(gone) / p.power_loss


def edge_temperature(film: PadFilm) -> np.ndarray:
    """Of the oil that leaves over a side [degC], (nt + 1,): more of it from the film's middle, where it is hot."""
    if film.cross is None:
        return film.work.temperature[:, -1]
    eta = film.cross.edges
    return film.cross.temperature[:, -1] @ np.diff(eta * eta * (3.0 - 2.0 * eta))


def judged(kind: str, number: int, case: Case) -> dict[str, Any]:
    """One case as a row."""
    start = time.process_time()
    row: dict[str, Any] = {"kind": kind, "case": number, "converged": False, "why": "", "fault": ""}
    try:
        p = KINDS[kind](case, np.random.default_rng(number))
    except ModelError as error:
        row["why"] = f"refused: {str(error)[:60]}"
    else:
        row["converged"] = bool(p.converged)
        row["fault"] = fault(p)
        if not p.converged:
            row["why"] = " and ".join(s for s in p.status if s.severity == "error" and s != "not converged")
        elif kind.startswith("thd"):
            row["heat lost"] = round(float(heat_lost(p)), 4)
    row["ms"] = round(1e3 * (time.process_time() - start))
    return row


def table_rows(rows: list[dict[str, Any]]) -> list[tuple[object, ...]]:
    """One row of the table per kind of physics."""
    lines: list[tuple[object, ...]] = []
    for kind, name in NAMES.items():
        mine = [r for r in rows if r["kind"] == kind]
        if not mine:
            continue
        why = Counter(r["why"] or "not converged" for r in mine if not r["converged"])
        rest = ", ".join(f"{n} {w}" for w, n in why.most_common()) or "none"
        good = sum(r["converged"] for r in mine)
        wrong = sum(bool(r["fault"]) for r in mine)
        lines.append((name, len(mine), f"{good} ({good / len(mine):.1%})", rest, wrong or "none"))
    return lines


def main() -> None:
    asked = study_parser(__doc__, cases=2000, seed=1, only="", rows=Path).parse_args()
    warnings.simplefilter("error")
    stored = Rows(asked.rows, "kind", "case")
    cases = draw(asked.cases, asked.seed)
    share = asked.cases // len(KINDS)
    for place, kind in enumerate(KINDS):
        if asked.only not in kind:
            continue
        for number in range(place * share, (place + 1) * share):
            if (kind, number) not in stored.known:
                row = judged(kind, number, cases[number])
                stored.add(row)
                if row["fault"] or not row["converged"]:
                    print(row, flush=True)
    head = ("physics", "bearings", "converged", "the rest, all named", "silently wrong")
    report(asked, "random-bearings", table(head, table_rows([*stored.known.values()])))


if __name__ == "__main__":
    main()
