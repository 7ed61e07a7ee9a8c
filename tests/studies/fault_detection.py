"""Put each named fault into good virtual campaigns: what does `tpjb check` say, and does identification go on?

    python -m tests.studies.fault_detection [--seeds 3] [--good 12] [--only dead|stuck] [--rows FILE] [--write]

Per fault: the share of campaigns in which the struck run is named with an error or a warning, the share in which
another run is blamed, and what became of the coefficients: the largest error of the direct terms
against the truth, what identification itself says of them, and in how many campaigns it says so. Good campaigns of
various make (number of directions, noise, points, bearings that wander from run to run) give the rate of false alarms.
``--rows FILE`` keeps a JSON line per campaign; the same call again does what is missing there and prints the table.
"""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rigdata
from model.bearing_file import load_bearing
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import Fault, Noise, operating_points
from rigdata.virtual_rig.truth import load_vector
from tests.good_campaigns import BEARINGS, DAMPING, PLAN, RUN, STIFFNESS, directions, stiff_rig, written
from tests.studies.results import Rows, report, study_parser, table
from tpjb_ident.check.campaign import check_campaign
from tpjb_ident.compare.static_tests import bearing_problems

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
NOISE = Noise.like_samples()
BEARING = BEARINGS / "rocker.toml"
TEXT = BEARING.read_text("utf-8")
#: Of that bearing, and of the virtual rig's polygon [m].
CLEARANCE = 80e-6

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
    "probe reads 5 % too much": Fault("scaled", RUN, "X1A", value=1.05),
    "probe reads 3 % too much": Fault("scaled", RUN, "X1A", value=1.03),
    "probe reads 3 % too little": Fault("scaled", RUN, "X1B", value=0.97),
    "probe reads 5 % too little": Fault("scaled", RUN, "X1B", value=0.95),
    "cell reads 10 % too much": Fault("scaled", RUN, "L1H", value=1.1),
    "cell reads 5 % too much": Fault("scaled", RUN, "L1H", value=1.05),
    "cell reads 3 % too much": Fault("scaled", RUN, "L1H", value=1.03),
    "loaded cell reads 5 % too little": Fault("scaled", RUN, "L1V", value=0.95),
    "loaded cell reads 3 % too much": Fault("scaled", RUN, "L1V", value=1.03),
    "probe sensitivity ten times off": Fault("scaled", RUN, "X1A", value=10.0),
    "cell sensitivity ten times off": Fault("scaled", RUN, "L1H", value=0.1),
    "cells ten times off, all runs": Fault("scaled", "*", "L1*", value=0.1),
    "probe ten times off, all runs": Fault("scaled", "*", "X1A", value=10.0),
    "both probes ten times too large, all runs": Fault("scaled", "*", "X1*", value=10.0),
    "both probes ten times too small, all runs": Fault("scaled", "*", "X1*", value=0.1),
    "probe 3 % off, all runs": Fault("scaled", "*", "X1A", value=1.03),
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
#: Good campaigns; those of the second kind wander from run to run.
GOOD, WANDERING = "none (false alarms)", "none, wandering (false alarms)"
#: One channel of `RUN` with all that it reads, gap voltage included, times a factor, as from a wrong amplifier.
AMPLIFIED = {"probe amplified 3 % too much": ("X1A", 1.03), "probe amplified 5 % too little": ("X1B", 0.95)}
#: In place of a fault: some runs from a bearing half as stiff, as when two bearings' runs got into one campaign.
MIXED = "mixed bearings: every third run of another"


#: What identification says of every virtual campaign, good or bad.
USUAL = {"calibration-uncertainty-unstated", "cells-against-set-points"}


def write(path: Path, seed: int, fault: Fault | None, stiffness: float = 1.0) -> None:
    """Write a campaign."""
    faults = () if fault is None else (fault,)
    written(path, stiff_rig(seed, *faults, k=stiffness * STIFFNESS, bearing_name=BEARING.name, bearing_text=TEXT))


def write_various(path: Path, seed: int) -> None:
    """Write a good campaign whose make depends on the seed: directions, noise, operating points."""
    plan = replace(
        PLAN,
        directions=directions((4, 6, 8)[seed % 3]),
        dynamic=operating_points([(5000.0, 25.0), *([(2500.0, 35.0), (8000.0, 15.0)] if seed % 5 == 0 else [])]),
    )
    noise = Noise.like_samples().scaled((0.5, 1.0, 2.0)[seed // 3 % 3])
    written(path, stiff_rig(1000 + seed, plan=plan, noise=noise, bearing_name=BEARING.name, bearing_text=TEXT))


def write_wandering(path: Path, seed: int) -> None:
    """Write a good campaign in which every run has a temperature of its own, in some seeds with outliers among them.

    Stiffness scatters by 0.5 to 2 % from run to run, damping by twice as much, the mean position by 0.2 to 1 um besides
    what the load does. What a run is like hangs on by how much it misses its set points, which is drawn for every run.
    """
    size, heavy = (0.5, 1.0, 2.0)[seed % 3], bool(seed // 3 % 2)

    def chance(point: OperatingPoint) -> tuple[float, float]:
        warm = (point.shaft_speed_hz / 22.0 - 1) / NOISE.speed_miss
        turned = (point.static_load_direction + math.pi / 2) / NOISE.direction_miss
        return (warm * abs(warm), turned * abs(turned)) if heavy else (warm, turned)

    def stiffness(point: OperatingPoint) -> ComplexArray:
        warm = 0.01 * size * chance(point)[0]
        softer = (point.static_load / 5000.0) ** 0.6 * (1 - warm)
        return np.asarray(softer * STIFFNESS + 1j * point.excitation * (1 - 2 * warm) * DAMPING)

    def position(point: OperatingPoint) -> FloatArray:
        warm, turned = chance(point) if point.static_load > 0 and point.shaft_speed > 0 else (0.0, 0.0)
        moved = 0.5e-6 * size * np.array([0.6 * warm + 0.8 * turned, 0.8 * warm - 0.6 * turned])
        return np.asarray(np.linalg.solve(STIFFNESS, load_vector(point)) + moved)

    plan = replace(PLAN, directions=directions((6, 4, 8)[seed // 2 % 3]), locus=())
    texts = {"bearing_name": BEARING.name, "bearing_text": TEXT}
    written(path, stiff_rig(2000 + seed, plan=plan, stiffness=stiffness, position=position, **texts))


def mix(path: Path, other: Path) -> None:
    """Put every third dynamic run of `other` into `path`."""
    import h5py

    with h5py.File(path, "r+") as file, h5py.File(other) as source:
        for number, name in enumerate(sorted(n for n in file["runs"] if n.startswith("d-"))):
            if number % 3 == 0:
                del file[f"runs/{name}"]
                source.copy(f"runs/{name}", file["runs"])


def amplify(path: Path, channel: str, factor: float) -> None:
    """Multiply one channel's readings in `RUN`."""
    import h5py

    with h5py.File(path, "r+") as file:
        file[f"runs/{RUN}/{channel}"][...] *= factor


def judge(path: Path, struck: str | None) -> tuple[bool, bool, str]:
    """Whether the check names the run with the fault, whether it names others, and how severely."""
    known = check_campaign(path)
    campaign = rigdata.load_campaign(path)
    found = [
        p
        for p in [*known, *bearing_problems(campaign, load_bearing(campaign.bearing_text), known)]
        if p.severity != "note"
    ]
    mine = [p for p in found if struck is None or p.run == struck or struck == "*"]
    worst = "error" if any(p.severity == "error" for p in mine) else "warning" if mine else "-"
    return bool(mine), any(p not in mine for p in found), worst


def identified(path: Path) -> tuple[float, list[str]]:
    """Largest error of the direct terms at the struck point; names of what identification says."""
    from tpjb_ident.identification.identify import identify
    from tpjb_ident.identification.settings import IdentifySettings

    try:
        result = identify(rigdata.load_campaign(path), IdentifySettings(methods=(), clearance=CLEARANCE))
    except ValueError as error:
        return math.nan, [f"refused: {error}"]
    # a wrong label makes a point of its own
    point = max((p for p in result.points if p.point.excitation_hz == 25.0), key=lambda p: p.n_windows)
    h = point.stiffness.h
    omega = 2 * math.pi * 25.0
    errors = [abs(h[i, i] - STIFFNESS[i, i] - 1j * omega * DAMPING[i, i]) / abs(STIFFNESS[i, i]) for i in (0, 1)]
    said = {str(c) for c in (*result.conditions, *(c for p in result.points for c in p.quality))}
    return float(max(errors)), sorted(said - USUAL)


def cells(name: str, outcomes: list[dict[str, Any]]) -> list[str]:
    """One row of the table."""
    count = len(outcomes)
    named, others = sum(o["named"] for o in outcomes), sum(o["others"] for o in outcomes)
    errors = [o["error"] for o in outcomes if o["error"] is not None]
    worst = f"{100 * max(errors):.1f} %" if errors else "-"
    severity = ", ".join(sorted({o["severity"] for o in outcomes}))
    conditions = Counter(c for o in outcomes for c in o["said"])
    text = ", ".join(f"{c} {k}" for c, k in conditions.most_common()) or "-"
    return [name, f"{named} of {count}", severity, f"{others} of {count}", worst, text]


def make(path: Path, name: str, seed: int) -> str | None:
    """Write the campaign of a row; the run that its fault strikes, None where it strikes several or none."""
    fault = FAULTS.get(name)
    if name in (GOOD, WANDERING):
        (write_various if name == GOOD else write_wandering)(path, seed)
        return None
    write(path, seed, fault)
    if name in AMPLIFIED:
        amplify(path, *AMPLIFIED[name])
        return RUN
    if name == MIXED:
        other = path.with_name("other.h5")
        write(other, seed + 100, None, 0.5)
        mix(path, other)
        other.unlink()
    return None if fault is None else fault.run


def run_seed(name: str, seed: int, folder: Path) -> dict[str, Any]:
    """One campaign through `check` and `identify`."""
    path = folder / "c.h5"
    struck = make(path, name, seed)
    named, others, severity = judge(path, struck)
    error, conditions = identified(path)
    path.unlink()
    row = {"fault": name, "seed": seed, "named": named, "others": others, "severity": severity}
    return {**row, "error": None if math.isnan(error) else error, "said": conditions}


def main() -> None:
    asked = study_parser(__doc__, seeds=3, first=1, good=12, only="", rows=Path).parse_args()
    stored, entries = Rows(asked.rows, "fault", "seed"), []
    with tempfile.TemporaryDirectory() as scratch:
        for name in (GOOD, WANDERING, *FAULTS, *AMPLIFIED, MIXED):
            if not any(part in name for part in asked.only.split("|")):
                continue
            seeds = range(asked.first, asked.first + (asked.good if name in (GOOD, WANDERING) else asked.seeds))
            for seed in seeds:
                if (name, seed) not in stored.known:
                    stored.add(run_seed(name, seed, Path(scratch)))
            entries.append(cells(name, [stored.known[name, seed] for seed in seeds]))
            print(entries[-1], flush=True)
    head = ("fault", "named", "as", "others blamed", "worst error", "identify says")
    report(asked, "faults", table(head, entries))


if __name__ == "__main__":
    main()
