"""Put each named fault into good virtual campaigns: what does `tpjb check` say, and does identification go on?

    python tests/benchmarks/fault_detection.py [--seeds 3] [--faults dead "wrong pad" ..] [--identify]

Per fault: the share of campaigns in which the struck run is named with an error or a warning, the share in which
another run is blamed, and with ``--identify`` what became of the coefficients: the largest error of the direct terms
against the truth, and whether the point was flagged. Good campaigns give the rate of false alarms.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import rigdata
from rigdata.virtual_rig import Fault
from tests.good_campaigns import DAMPING, RUN, STIFFNESS, stiff_rig, written

#: The faults of the list, in one run unless the name says otherwise.
FAULTS: dict[str, Fault] = {
    "dead probe": Fault("dead", RUN, "X1A"),
    "dead load cell": Fault("dead", RUN, "L1H"),
    "probe stuck for 0.2 s": Fault("stuck", RUN, "X1A", start=0.5, length=0.2),
    "load cell stuck half-way": Fault("stuck", RUN, "L1V", start=1.0),
    "load cell clipped at 60 %": Fault("clipped", RUN, "L1H"),
    "probe clipped at 90 %": Fault("clipped", RUN, "X1A", value=0.9),
    "probes swapped": Fault("swapped", RUN, "X1A", other="X1B"),
    "load cells swapped": Fault("swapped", RUN, "L1H", other="L1V"),
    "accelerometers swapped": Fault("swapped", RUN, "A1H", other="A1V"),
    "probe inverted": Fault("inverted", RUN, "X1A"),
    "load cell inverted": Fault("inverted", RUN, "L1V"),
    "accelerometer inverted": Fault("inverted", RUN, "A1H"),
    "probe 3 ms late": Fault("delayed", RUN, "X1A", value=3e-3),
    "probe 1 ms late": Fault("delayed", RUN, "X1A", value=1e-3),
    "probe reads 30 % too much": Fault("scaled", RUN, "X1A", value=1.3),
    "probe reads 10 % too much": Fault("scaled", RUN, "X1A", value=1.1),
    "probe reads 3 % too much": Fault("scaled", RUN, "X1A", value=1.03),
    "cell reads 10 % too much": Fault("scaled", RUN, "L1H", value=1.1),
    "probe sensitivity ten times off": Fault("scaled", RUN, "X1A", value=10.0),
    "cell sensitivity ten times off": Fault("scaled", RUN, "L1H", value=0.1),
    "cells ten times off, all runs": Fault("scaled", "*", "L1*", value=0.1),
    "probe ten times off, all runs": Fault("scaled", "*", "X1A", value=10.0),
    "probe 10 % off, all runs": Fault("scaled", "*", "X1A", value=1.1),
    "wrong pad label": Fault("wrong_pad", "p-2-up", value=3.0),
    "static load 1.6 times the cells'": Fault("wrong_load", RUN, value=1.6),
    "static load 1.1 times the cells'": Fault("wrong_load", RUN, value=1.1),
    "speed channel doubled, all runs": Fault("scaled", "*", "K1", value=2.0),
    "speed 5 % off in one run": Fault("scaled", RUN, "K1", value=1.05),
    "no excitation": Fault("missing_excitation", RUN),
    "wrong excitation frequency": Fault("wrong_frequency", RUN, value=3.0),
    "wrong excitation direction": Fault("wrong_direction", RUN, value=0.4),
    "duplicated run": Fault("duplicate_run", RUN, other="d-05000-25-02"),
    "gap without values": Fault("nan_gap", RUN, "X1A", start=0.5, length=0.2),
    "crosstalk of 30 %": Fault("crosstalk", RUN, "L1H", value=0.3),
    "missing file": Fault("missing_file", RUN),
}
#: In place of a fault: some runs from a bearing half as stiff, as when two bearings' runs got into one campaign.
MIXED = "mixed bearings: every third run of another"


@dataclass(frozen=True)
class Outcome:
    """What one campaign with one fault led to."""

    named: bool
    blamed_others: bool
    severity: str
    error: float
    flagged: bool


def write(path: Path, seed: int, fault: Fault | None, stiffness: float = 1.0) -> None:
    """Write a campaign."""
    written(path, stiff_rig(seed, *(() if fault is None else (fault,)), k=stiffness * STIFFNESS))


def mix(path: Path, other: Path) -> None:
    """Put every third dynamic run of `other` into `path`."""
    import h5py

    with h5py.File(path, "r+") as file, h5py.File(other) as source:
        for number, name in enumerate(sorted(n for n in file["runs"] if n.startswith("d-"))):
            if number % 3 == 0:
                del file[f"runs/{name}"]
                source.copy(f"runs/{name}", file["runs"])


def judge(path: Path, struck: str | None, identify: bool) -> Outcome:
    """Check, and identify if asked."""
    found = [p for p in rigdata.check_campaign(path) if p.severity != "note"]
    mine = [p for p in found if struck is None or p.run == struck or (p.run is None and struck == "*")]
    worst = "error" if any(p.severity == "error" for p in mine) else "warning" if mine else "-"
    others = [p for p in found if p not in mine]
    error, flagged = _identified(path) if identify else (math.nan, False)
    return Outcome(bool(mine), bool(others), worst, error, flagged)


def _identified(path: Path) -> tuple[float, bool]:
    """Largest error of the direct terms; whether anything was said of the point."""
    from tpjb_ident.dynamic.identify import IdentifySettings, identify

    try:
        result = identify(rigdata.load_campaign(path), IdentifySettings())
    except ValueError:
        return math.nan, True
    point = max(result.points, key=lambda p: p.stiffness.weights.shape[0])  # a wrong label makes a point of its own
    h = point.stiffness.h
    omega = 2 * math.pi * 25.0
    errors = [abs(h[i, i] - STIFFNESS[i, i] - 1j * omega * DAMPING[i, i]) / abs(STIFFNESS[i, i]) for i in (0, 1)]
    return float(max(errors)), bool(point.conditions if hasattr(point, "conditions") else point.stiffness.status)


def row(name: str, outcomes: list[Outcome]) -> str:
    """One line of the table."""
    n = len(outcomes)
    named, others = sum(o.named for o in outcomes), sum(o.blamed_others for o in outcomes)
    errors = [o.error for o in outcomes if not math.isnan(o.error)]
    worst = f"{100 * max(errors):.1f} %" if errors else "-"
    flagged = sum(o.flagged for o in outcomes)
    said = ", ".join(sorted({o.severity for o in outcomes}))
    return f"| {name} | {named} of {n} | {said} | {others} of {n} | {worst} | {flagged} of {n} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--faults", nargs="*", help="parts of names")
    parser.add_argument("--identify", action="store_true")
    given = parser.parse_args()
    began = time.time()
    print("| fault | named | as | others blamed | worst error of direct terms | point flagged |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        names = ["none (false alarms)", *FAULTS, MIXED]
        for name in names:
            if given.faults and not any(part in name for part in given.faults):
                continue
            outcomes = []
            for seed in range(1, given.seeds + 1):
                path = folder / "c.h5"
                fault = FAULTS.get(name)
                write(path, seed, fault)
                if name == MIXED:
                    write(folder / "other.h5", seed + 100, None, 0.5)
                    mix(path, folder / "other.h5")
                    (folder / "other.h5").unlink()
                outcomes.append(judge(path, None if fault is None else fault.run, given.identify))
                path.unlink()
            print(row(name, outcomes), flush=True)
    print(f"\n{given.seeds} campaigns per row, {time.time() - began:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
