"""Mixtures as raw records: written by the virtual rig, identified and diagnosed by the command line.

    python -m tests.studies.diagnosis.volts --rows FILE [--count 100] [--seed 80000] [--keep FOLDER] [--write]

Everything that may be off is drawn from its stated tolerance as in `strangers`, the same kinds in the same order, each
on a bearing and a plan of its own; the rig writes a campaign from it (bearing and pivots that are off, probes, cells
and thermometers with errors, noise, runout, drift, glitches,
loads that miss their set points), which is diagnosed with the bearing as drawn. The model that writes the records is
ours, on a finer mesh than the one that diagnoses: what is tested beyond emulated campaigns is the way from volts to
coefficients and the model itself in the place of its emulator. Campaigns are deleted once they are diagnosed; rows
that are there are not drawn again, so that a run that was stopped goes on where it was.
"""

from __future__ import annotations

import functools
import math
import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing_file import load_bearing
from model.effects import Effect, apply_effects
from model.pivots import pivot_laws
from model.setup import Setup
from rigdata.operating_point import OperatingPoint
from rigdata.virtual_rig import Instruments, Noise, RigPlan, RigTruth, VirtualRig, write_campaign
from rigdata.virtual_rig.truth import ClearanceSweep, DryTest
from tests.studies.diagnosis.bench import Bench, Drawn, hidden, said
from tests.studies.diagnosis.strangers import KINDS, draw, stranger
from tests.studies.diagnosis.tables import tables
from tests.studies.results import Rows, report, study_parser
from tpjb_ident.compare.rig_from_model import erring_instruments, is_of_records, truth_of
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.forward.nuisance import Nuisance, shifted
from tpjb_ident.diagnosis.from_python import diagnose
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.errors import TpjbError

#: Tolerances of the instruments.
READ = {"probe_gain", "cell_gain", "thermometer"}
NAMES = {"probe 1": "X1A", "probe 2": "X1B", "cell 1": "L1H", "cell 2": "L1V"}


@dataclass(frozen=True)
class Case:
    """A bearing's file, how it is tested, and a campaign that was drawn on it."""

    text: str
    plan: RigPlan
    bench: Bench
    drawn: Drawn
    words: str


def case_of(kind: str, seed: int) -> Case | None:
    """Draw a campaign on a bearing that is drawn itself."""
    rng = np.random.default_rng([seed, 20190761])
    one = stranger(seed, None)
    tries = (draw(one, kind, rng) for _ in range(6))
    drawn = next((d for d in tries if d is not None), None)
    if drawn is None:
        return None
    return Case(one.text, plan_of(one.bench.problem.observations.layout), one.bench, drawn, one.words)


def plan_of(layout: Layout) -> RigPlan:
    """The test plan that gives a layout of observations."""
    points = tuple(OperatingPoint(*test.point, omega) for test in layout.dynamic for omega in test.excitation)
    top = max(point.static_load for point in points)
    fastest = max(max(point.excitation, point.shaft_speed) for point in points) / (2.0 * math.pi)
    levels = tuple(top * share for share in np.arange(1, 11) / 10.0)
    return RigPlan(
        dynamic=points,
        locus=tuple(OperatingPoint(*test.point) for test in layout.locus),
        dry=tuple(DryTest(test.pad, levels, start=0.5 * levels[0]) for test in layout.dry),
        clearance=(ClearanceSweep(layout.push_load),) if layout.push_load else (),
        dynamic_rate=max(1000.0, 12.0 * fastest),
    )


def rig_of(case: Case, seed: int) -> VirtualRig:
    """A virtual rig with what was drawn in it."""
    bearing, drawn, problem = load_bearing(case.text), case.drawn, case.drawn.problem
    known = list(zip(problem.nuisances, map(float, drawn.size), strict=True))
    physical = [(n, s) for n, s in known if n.column is None and n.name not in READ]
    shift = functools.partial(shifted, known=[n for n, _ in physical], size=[s for _, s in physical])
    inside = [e for e in drawn.hidden if not is_of_records(e)]
    plain = Setup(bearing, pivot_laws("kirk", bearing))

    def setup(growth: float) -> Setup:
        more = [Effect("thermal_growth", clearance_change=growth)] if growth else []
        return shift(apply_effects(plain, [*inside, *more]))

    layout = problem.observations.layout
    top = max(test.load for test in layout.dynamic)
    instruments = erring_instruments(Instruments.like_paper(len(bearing.pads), seed, top), drawn.hidden)
    instruments = _off(instruments, known)
    if not any(test.pads for test in layout.dynamic):
        sensors = tuple(sensor for sensor in instruments.sensors if sensor.quantity != "temperature")
        instruments = replace(instruments, sensors=sensors)
    return VirtualRig(
        truth=_truth(setup, drawn.growth / top, case.text), instruments=instruments, campaign=f"volts-{seed}",
        noise=Noise.like_samples(), plan=case.plan, seed=seed,
    )  # fmt: skip


def _truth(setup: Any, growth: float, text: str) -> RigTruth:
    """What a bearing does; its clearance grows in proportion to the load [m/N] where that is hidden."""
    base = truth_of(setup(0.0), text)
    if not growth:
        return base
    at = functools.lru_cache(maxsize=4096)(lambda load: truth_of(setup(growth * load), text))
    return replace(
        base,
        stiffness=lambda point: at(point.static_load).stiffness(point),
        position=lambda point: at(point.static_load).position(point),
        temperature=lambda point: at(point.static_load).temperature(point),
    )


def _off(instruments: Instruments, known: Sequence[tuple[Nuisance, float]]) -> Instruments:
    """Sensors whose gains and zeros are off as drawn."""
    changes = [(n.name, n.place, size * n.sigma) for n, size in known if n.name in READ]
    sensors = {sensor.name: sensor for sensor in instruments.sensors}
    for name, place, change in changes:
        at = f"T{place.split()[-1]}" if name == "thermometer" else NAMES[place]
        more = {"offset": change} if name == "thermometer" else {"gain": math.exp(change)}
        sensors[at] = sensors[at].with_error(**more)
    return replace(instruments, sensors=tuple(sensors.values()))


def run(case: Case, seed: int, settings: DiagnoseSettings, keep: Path | None) -> dict[str, Any]:
    """Write and diagnose one campaign; a row as of `strangers.run`."""
    drawn = case.drawn
    left_out = {c.name for c in case.bench.problem.pool} - {c.name for c in drawn.problem.pool}
    known = {"seed": seed, "words": case.words, **hidden(drawn)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "campaign.h5"
        try:
            write_campaign(path, rig_of(case, seed))
            began = time.process_time()
            result = diagnose(path, settings=replace(settings, skip=frozenset(left_out)))
        except TpjbError as error:
            return {**known, "failed": f"{type(error).__name__}: {error}"}
    spent, diagnosis = time.process_time() - began, result.diagnosis
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        stored = diagnosis.observations, result.setup, frozenset(left_out)
        (keep / f"{seed}.pickle").write_bytes(pickle.dumps(stored))
    verdict, comparison = diagnosis.verdict, diagnosis.comparison
    pairs = list(comparison.probabilities.items())[:6]
    return {
        **known, **said(verdict), "gap": verdict.gap, "reasons": list(verdict.reasons),
        "scale": comparison.best.posterior.scale, "below_floor": verdict.below_floor,
        "far": [(d.name, d.size, d.significance) for d in comparison.best.tolerances[:3]],
        "fits": [(f.label, f.posterior.total, p, f.p, f.posterior.scale) for f, p in pairs],
        "seconds": spent, "tried": len(comparison.fits),
    }  # fmt: skip


def main() -> None:
    """Draw, write, diagnose, and print the tables."""
    options = {"count": 100, "seed": 80000, "rows": Path("volts.jsonl"), "keep": Path}
    asked = study_parser(__doc__, **options).parse_args()
    stored, settings = Rows(asked.rows, "seed"), DiagnoseSettings(workers=1)
    for number in range(asked.count):
        seed, kind = asked.seed + number, KINDS[number % len(KINDS)]
        if (seed,) not in stored.known:
            case = case_of(kind, seed)
            if case is not None:
                stored.add({"kind": kind, **run(case, seed, settings, asked.keep)})
    rows = [*stored.known.values()]
    report(asked, "volts", tables([row for row in rows if "failed" not in row]))
    for row in rows:
        if "failed" in row:
            print(row["seed"], row["kind"], row["failed"])


if __name__ == "__main__":
    main()
