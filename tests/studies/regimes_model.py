"""Random physical bearings with the physics beyond the baseline: how many converge, and what the rest are called.

    python tests/studies/regimes_model.py [--cases 2000] [--seed 1] [--only thd]

The bearings of `robustness_model.py`, a quarter each with turbulent films, with pivots that roll and slide, with hot
oil that goes round, and with all that heat does (`thermal="thd"`). A case is at fault if it raises, if a converged
prediction is not finite or its pads' loads do not balance the load, or if one that has not converged does not say so.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections import Counter
from collections.abc import Callable

import numpy as np

from model.effects import Effect
from model.errors import ModelError
from model.options import Options
from model.predict import predict
from model.prediction import Prediction
from tests.studies.robustness_model import Case, draw


def turbulence(case: Case, rng: np.random.Generator) -> Prediction:
    """Oil up to twenty times thinner, as far as the Sommerfeld number is one of a running bearing."""
    from dataclasses import replace

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


def with_contact(case: Case):  # type: ignore[no-untyped-def]
    """The bearing with spheres whose size goes with it."""
    from dataclasses import replace

    from model.bearing import Pivot

    size = 0.4 * case.bearing.journal_diameter
    pivot = Pivot("spherical", sphere_diameter=size, housing_diameter=1.1 * size, pivot_diameter=size)
    return replace(case.bearing, pivot=pivot)


def mixing(case: Case, rng: np.random.Generator) -> Prediction:
    """Lambda up to 0.95."""
    effect = Effect("hot_oil_carryover", fraction=float(rng.uniform(0.3, 0.95)))
    return predict(case.bearing, case.load, case.direction, case.speed, pivots=case.stiffness, effects=[effect])


def thd(case: Case, rng: np.random.Generator) -> Prediction:
    """All that heat does."""
    return predict(case.bearing, case.load, case.direction, case.speed, pivots=case.stiffness, thermal="thd")


KINDS: dict[str, Callable[[Case, np.random.Generator], Prediction]] = {
    "turbulence": turbulence,
    "rolling": rolling,
    "mixing": mixing,
    "thd": thd,
}


def fault(p: Prediction) -> str:
    """What is silently wrong with a prediction; empty if nothing is."""
    if not p.converged:
        return "" if "not converged" in p.status and np.isnan(p.h).all() else "does not say that it has not converged"
    if not np.isfinite(p.h).all():
        return "not finite"
    force = sum(
        f.forces.force[0] * f.normal + f.forces.force[1] * f.tangent
        for f in p.equilibrium.films
        if f.forces is not None
    )
    push = p.load * np.array([math.cos(p.load_direction), math.sin(p.load_direction)])
    return "" if np.abs(force - push).max() < 1e-4 * p.load else "unbalanced"


def study(kind: str, cases: list[Case], first: int) -> tuple[Counter[str], int, list[str]]:
    """Statuses of those that did not converge, how many converged, and faults."""
    names: Counter[str] = Counter()
    faults, converged = [], 0
    for k, case in enumerate(cases, start=first):
        try:
            p = KINDS[kind](case, np.random.default_rng(k))
        except ModelError as error:
            names[f"refused: {str(error)[:60]}"] += 1
            print(kind, k, "refused", error, flush=True)
            continue
        converged += p.converged
        if not p.converged:
            names[" and ".join(s for s in p.status if "idle" not in s)] += 1
            print(kind, k, p.status, f"S {case.sommerfeld:.3g}", flush=True)
        if said := fault(p):
            faults.append(f"{kind} {k}: {said}")
            print(faults[-1], flush=True)
    return names, converged, faults


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=KINDS)
    chosen = parser.parse_args()
    warnings.simplefilter("error")
    cases = draw(chosen.cases, chosen.seed)
    share = chosen.cases // len(KINDS)
    print("| physics | bearings | converged | the rest | silently wrong | ms each |\n|---|---|---|---|---|---|")
    for n, kind in enumerate(KINDS):
        if chosen.only in (None, kind):
            start = time.process_time()
            names, converged, faults = study(kind, cases[n * share : (n + 1) * share], n * share)
            spent = 1e3 * (time.process_time() - start) / share
            rest = ", ".join(f"{count} {name}" for name, count in names.most_common()) or "none"
            print(f"| {kind} | {share} | {converged} | {rest} | {len(faults)} | {spent:.0f} |", flush=True)


if __name__ == "__main__":
    main()
