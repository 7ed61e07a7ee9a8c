"""What each constant of `thermal="thd"` does to the peak temperatures of Fillon, Bligoud and Frene.

python tests/studies/thd_constants.py [--into docs/model.md]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from model.bearing import Bearing, Material
from model.effects import Effect
from model.growth import Growth
from model.options import Options
from model.predict import predict
from tests.literature.test_model_fillon import bearing, peak

SPEEDS = (1000, 2000, 3000, 4000)


def oil(**changes: float) -> Callable[[Bearing], Bearing]:
    """A bearing with another oil."""
    return lambda b: replace(b, oil=replace(b.oil, **changes))


def pads(**changes: Any) -> Callable[[Bearing], Bearing]:
    """A bearing with other pads."""
    return lambda b: b.with_pads(tuple(replace(p, **changes) for p in b.pads))


def same(b: Bearing) -> Bearing:
    """The bearing itself."""
    return b


STEEL_45 = Material(206e9, 0.3, 12e-6, 45.0)
AS_DRAWN = Options(growth=Growth(reference=40.0, expansion=(0.0, 0.0)))
CASES: dict[str, tuple[Callable[[Bearing], Bearing], dict[str, Any]]] = {
    "as it comes": (same, {}),
    "groove: lambda 0.9 instead of 1": (same, {"effects": [Effect("hot_oil_carryover", fraction=0.9)]}),
    "groove: lambda 0.8": (same, {"effects": [Effect("hot_oil_carryover", fraction=0.8)]}),
    "pads' free faces 25 W/m^2/K instead of 50": (pads(back_convection=25.0), {}),
    "pads' free faces 100 W/m^2/K": (pads(back_convection=100.0), {}),
    "pads' free faces 250 W/m^2/K": (pads(back_convection=250.0), {}),
    "steel of 45 W/m/K instead of 54": (pads(backing=STEEL_45), {}),
    "oil of 0.14 W/m/K instead of 0.13": (oil(conductivity=0.14), {}),
    "oil of 1,950 J/kg/K instead of 2,000": (oil(specific_heat=1950.0), {}),
    "viscosity +5 %": (oil(viscosity_40=1.05 * 0.0277), {}),
    "housing 10 K above the supply": (same, {"options": Options(growth=Growth(housing=50.0))}),
    "clearances as drawn": (same, {"options": AS_DRAWN}),
    "pads that hardly bend": (same, {"effects": [Effect("pad_bending", compliance_factor=1e-3)]}),
}


def table() -> str:
    """Peak of the case as it comes, and what every other one moves it by, as a table."""
    lines = [
        "| | " + " | ".join(f"{rpm:,} rpm" for rpm in SPEEDS) + " |",
        "|---" * (len(SPEEDS) + 1) + "|",
    ]
    base: list[float] = []
    for name, (change, given) in CASES.items():
        found = [
            peak(
                predict(change(bearing()), 10e3, -math.pi / 2, n * math.pi / 30, pivots="rigid", thermal="thd", **given)
            )
            for n in SPEEDS
        ]
        base = base or found
        shown = [f"{t:.1f} degC" for t in found] if found is base else [f"{t - b:+.1f} K" for t, b in zip(found, base)]
        lines.append(f"| {name} | " + " | ".join(shown) + " |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--into", type=Path)
    into = parser.parse_args().into
    made = table()
    if into is not None:
        text = into.read_text(encoding="utf-8")
        before, rest = text.split("<!-- thd: begin -->\n")
        _, after = rest.split("<!-- thd: end -->")
        into.write_text(f"{before}<!-- thd: begin -->\n{made}\n<!-- thd: end -->{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
