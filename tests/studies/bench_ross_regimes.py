"""Hot oil round the ring and turbulent films beside the ROSS fluid-film engine: K, C, temperatures, one table each.

    python tests/studies/bench_ross_regimes.py --python /path/to/an/environment/with/ross/bin/python

The paper's rocker bearing at 5 kN. Hot oil: 22 Hz, adiabatic, lambda 0 and 0.8, rigid and flexible pivots, both
programs with the flow balance of their own films. Turbulence: isothermal, oil so thin that the largest local Re is some
thousands, where ROSS has Reichardt's eddy viscosity across the film and this model Ng and Pan's fitted factors.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from typing import Any

from model.effects import Effect
from model.options import Options
from model.predict import predict
from model.prediction import Prediction
from tests.studies.bench_ross import NAMES, VISCOSITY, bearing, peer_case, run_peer

LOAD, DOWN = 5000.0, -math.pi / 2
MESH = (40, 20)


def hot_oil(python: str) -> None:
    """Carry-over 0 and 0.8, rigid and flexible pivots."""
    print("hot oil, adiabatic, 22 Hz: difference of ROSS to this model in %")
    for stiffness in (0.0, 5e8):
        for fraction in (0.0, 0.8):
            case = peer_case("adiabatic", MESH, stiffness) | {"hot_oil_lambda": fraction}
            effects = [Effect("hot_oil_carryover", fraction=fraction)]
            ours = predict(bearing(), LOAD, DOWN, case["frequency"][0], pivots=stiffness or "rigid", effects=effects)
            _show(f"pivots {stiffness or 'rigid'}, lambda {fraction}", ours, run_peer(python, case, 0))


def turbulence(python: str) -> None:
    """Isothermal films at growing Reynolds numbers."""
    print("turbulent, isothermal, 150 Hz: difference of ROSS to this model in %")
    for share in (0.1, 0.05, 0.03, 0.02):
        case = peer_case(None, MESH, 0.0)
        case["frequency"], case["weight"] = [2 * math.pi * 150.0], LOAD
        oil = case["lubricant"]
        for key in ("liquid_viscosity1", "liquid_viscosity2"):
            oil[key] *= share
        one = bearing()
        thin = replace(one, oil=replace(one.oil, viscosity_40=share * VISCOSITY))
        peer = run_peer(python, case, 0)
        for name in ("none", "ng-pan"):
            options = Options(turbulence=name)
            ours = predict(
                thin, LOAD, DOWN, case["frequency"][0], pivots="rigid", thermal="isothermal", options=options
            )
            _show(f"Re {ours.reynolds:.0f}, here {'laminar' if name == 'none' else name}", ours, peer)


def _show(name: str, ours: Prediction, peer: dict[str, Any]) -> None:
    if not set(NAMES) <= set(peer):
        print(f"  {name}: ROSS gave nothing ({peer})")
        return
    text = "  ".join(f"{key} {getattr(ours, key):.4e} ({peer[key] / getattr(ours, key) - 1:+.1%})" for key in NAMES)
    print(f"  {name}: {text}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable, help="an interpreter that can import ross")
    parser.add_argument("--only", choices=("hot-oil", "turbulence"))
    arguments = parser.parse_args()
    if arguments.only != "turbulence":
        hot_oil(arguments.python)
    if arguments.only != "hot-oil":
        turbulence(arguments.python)


if __name__ == "__main__":
    main()
