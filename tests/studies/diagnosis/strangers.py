"""Strangers: bearings, plans and faults by a generator that nothing of the decision was made for.

    python -m tests.studies.diagnosis.strangers [--first 0] [--bearings 8] [--count 30] [--seed 0] [--rows FILE]
        [--least 0.0005] [--most 0.002] [--write]

Every bearing is drawn: 3 to 6 pads, load on or between them, central or offset pivots, journals of 60 to 250 mm, five
oils. Every plan is drawn: 2 to 12 operating points, one or two speeds, with or without locus, polygon, dry tests and
thermometers. What is stated scatters as stated, uncut. Kinds: ``scatter``; ``one`` and ``two`` effects of the library;
``channel`` (one probe, cell or thermometer, one pad's bore); ``file`` (pivots elsewhere along the arc, the next oil
grade); a third lies ``outside`` (an effect taken out of the library, a cross-coupled stiffness, growth in proportion to
the load), some with an effect of the library ``beside``. Truth and fits share one emulator of the model (additive in
the logarithms of K and C), so that the decision is tested and not the model; the model is wrong smoothly by a share of
K and C between ``--least`` and ``--most``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.bench import (
    SKIPPED,
    SMOOTH,
    Bench,
    Drawn,
    hidden,
    measured,
    noise,
    said,
    seen_sizes,
    solve,
)
from tests.studies.diagnosis.emulated import emulate
from tests.studies.diagnosis.tables import tables
from tests.studies.results import Rows, report, study_parser
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.diagnose import ACCURACY, pose
from tpjb_ident.diagnosis.forward.candidates import TERMS, Candidate
from tpjb_ident.diagnosis.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnosis.observations.model_error import usual_factor
from tpjb_ident.diagnosis.observations.observe import Layout
from tpjb_ident.diagnosis.planned import around, dry, dynamic, planned_observations

HZ, DOWN = 2 * math.pi, -math.pi / 2
KINDS = (
    "one", "outside", "scatter", "channel", "two", "outside", "file", "one", "beside", "scatter",
    "channel", "outside", "two", "one", "beside",
)  # fmt: skip
BEYOND = ("left out", "cross-coupled", "growth with the load")
#: ISO grade: viscosity at 40 degC [Pa s] of an oil of 860 kg/m^3.
GRADES = {22: 0.0189, 32: 0.0275, 46: 0.0396, 68: 0.0585, 100: 0.086}
#: Deviations of everything else from which a fault can be asked for.
ASKED = 6.0

TEXT = """
schema = "tpjb-bearing/1"
name = "{name}"
[journal]
diameter = "{diameter} m"
[bearing]
length = "{length} m"
assembled_clearance = "{clearance} m"
pad_clearance = "{bore} m"
[pads]
pivot_angles = {angles}
arc = "{arc} deg"
pivot_offset = {offset}
thickness = "{thickness} m"
babbitt_thickness = "2 mm"
mass = "{mass} kg"
moment_of_inertia = "{inertia} kg m^2"
back_convection = "50 W/m^2/K"
[pads.backing]
youngs_modulus = "206 GPa"
poissons_ratio = 0.3
thermal_expansion = "12e-6 1/K"
conductivity = "54 W/m/K"
[pads.babbitt]
youngs_modulus = "40 GPa"
poissons_ratio = 0.3
thermal_expansion = "24e-6 1/K"
conductivity = "26 W/m/K"
[pivot]
kind = "rocker"
contact_length = "{contact} m"
housing_diameter = "{housing} m"
pivot_diameter = "{pivot} m"
youngs_modulus = "206 GPa"
poissons_ratio = 0.3
[oil]
grade = "ISO VG {grade}"
supply_temperature = "{supply} degC"
viscosity_40C = "{viscosity} Pa s"
viscosity_exponent = "{exponent} 1/K"
density_40C = "860 kg/m^3"
thermal_expansion = "7.0e-4 1/K"
specific_heat = "2000 J/kg/K"
conductivity = "0.13 W/m/K"
"""


@dataclass(frozen=True)
class Stranger:
    """A bearing with the model of its plan."""

    bench: Bench
    grade: int
    words: str
    text: str  #: its file


def bearing_of(rng: np.random.Generator) -> tuple[str, int, str]:
    """Draw a bearing's file."""
    pads, between = int(rng.integers(3, 7)), bool(rng.integers(2))
    diameter, grade = float(rng.uniform(0.06, 0.25)), int(rng.choice(list(GRADES)))
    pitch = 360.0 / pads
    offset = float(rng.choice([0.5, 0.5, 0.55, 0.6]))
    clearance = diameter / 2 * float(rng.uniform(1.1e-3, 1.8e-3))
    preload, arc = float(rng.uniform(0.05, 0.5)), pitch * float(rng.uniform(0.78, 0.88))
    thickness = 0.16 * diameter
    length = diameter * float(rng.uniform(0.5, 0.9))
    mass = 7800.0 * thickness * length * math.radians(arc) * diameter / 2
    words = (
        f"{pads} pads, load {'between' if between else 'on'}, offset {offset:g}, {1e3 * diameter:.0f} mm, VG {grade}"
    )
    text = TEXT.format(
        name=words, diameter=diameter, length=length, clearance=clearance, bore=clearance / (1.0 - preload),
        angles=[f"{-90.0 + pitch * (k + between / 2):.4f} deg" for k in range(pads)], arc=arc, offset=offset,
        thickness=thickness, mass=mass, inertia=mass * (math.radians(arc) * diameter / 2) ** 2 / 12.0,
        contact=0.6 * length, housing=1.33 * diameter, pivot=1.33 * diameter * float(rng.uniform(0.8, 0.92)),
        grade=grade, supply=float(rng.uniform(35.0, 50.0)), viscosity=GRADES[grade],
        exponent=float(rng.uniform(0.028, 0.036)),
    )  # fmt: skip
    return text, grade, words


def plan_of(bearing: Bearing, rng: np.random.Generator) -> tuple[Layout, str]:
    """Draw a plan of 2 to 12 operating points for a bearing."""
    pads, size = len(bearing.pads), bearing.journal_diameter
    speed = 2.0 * float(rng.uniform(12.0, 45.0)) / size
    area = size * bearing.length
    count = int(rng.integers(2, 13))
    warm = pads if rng.random() < 0.8 else 0
    loads = area * np.sort(rng.uniform(0.35e6, 1.4e6, max(1, count // 2)))
    lines = speed * np.sort(rng.uniform(0.4, 2.2, count - len(loads) + 1))
    tests = [*dynamic(loads[:1], list(lines), speed, DOWN, warm)]
    tests += [*dynamic(loads[1:], [1.1 * speed], speed, DOWN, warm)]
    if rng.random() < 0.35:
        tests += [*dynamic([float(loads[-1])], [1.1 * speed], 1.4 * speed, DOWN, warm)]
    directions, with_dry, with_polygon = int(rng.choice([0, 6, 10])), rng.random() < 0.7, rng.random() < 0.75
    top = float(loads[-1])
    layout = Layout(
        tuple(tests), around(float(loads[0]), directions, speed) if directions else (),
        dry(range(1, pads + 1), (0.2 * top, 0.5 * top, top)) if with_dry else (), 0.04 * top if with_polygon else None,
    )  # fmt: skip
    points = sum(len(test.excitation) for test in tests)
    rest = [f"locus {directions}", "dry" * with_dry, "polygon" * with_polygon, "warm" * bool(warm)]
    return layout, f"{points} points, {', '.join(word for word in rest if word)}"


def stranger(number: int, folder: Path | None) -> Stranger:
    """Draw bearings and plans until the model has an equilibrium everywhere.

    With a folder the model is emulated, and its table kept there.
    """
    rng = np.random.default_rng([number, 40])
    while True:
        text, grade, words = bearing_of(rng)
        bearing = load_bearing(text)
        layout, plan = plan_of(bearing, rng)
        setup = Setup(bearing, pivot_laws("kirk", bearing), mesh=Mesh(32, 4), accuracy=ACCURACY)
        try:
            observations = planned_observations(setup, layout)
            model = Forward(setup, layout, observations.elements)
            model()
            break
        except NoEquilibriumError:
            continue
    table_of = None if folder is None else folder / f"stranger-{number}.table"
    cache = model.cache if table_of is None else emulate(model, table_of)
    forward = Forward(setup, layout, observations.elements, cache)
    problem = pose(observations, forward, DiagnoseSettings(workers=1, skip=SKIPPED))
    return Stranger(Bench(problem, forward, seen_sizes(problem, forward)), grade, f"{words}; {plan}", text)


def faults(one: Stranger, kind: str, rng: np.random.Generator) -> list[Effect]:
    """Draw what is hidden of the library."""
    pool, sign = one.bench.problem.pool, float(rng.choice([-1.0, 1.0]))
    pad = int(rng.integers(1, 1 + len(one.bench.forward.setup.bearing.pads)))
    which = int(rng.integers(1, 3))
    if kind == "channel":
        return [
            [
                Effect("one_probe_gain", probe=which, factor=1.0 + sign * float(rng.uniform(0.03, 0.1))),
                Effect("one_cell_gain", cell=which, factor=1.0 + sign * float(rng.uniform(0.02, 0.08))),
                Effect("thermometer_offset", pad=pad, offset=sign * float(rng.uniform(3.0, 10.0))),
                Effect("pad_bore", pad=pad, pad_clearance_change=sign * float(rng.uniform(15e-6, 35e-6))),
            ][int(rng.integers(4))]
        ]
    if kind == "file":
        others = [g for g in GRADES if 0.3 < abs(math.log(GRADES[g] / GRADES[one.grade])) < 0.45]
        if rng.random() < 0.5:
            return [Effect("oil_viscosity", factor=GRADES[int(rng.choice(others))] / GRADES[one.grade])]
        return [Effect("pivot_offset_error", offset_change=sign * float(rng.choice([0.05, 0.1])))]
    able = [c for c in pool if c.name not in TERMS and len(c.steps) == 1 and 2.5 * one.bench.seen[c.label] >= ASKED]
    names = rng.choice(sorted({c.name for c in able}), {"one": 1, "two": 2, "beside": 1}.get(kind, 0), replace=False)
    return [_sized([c for c in able if c.name == name], rng) for name in names]


def _sized(able: Sequence[Candidate], rng: np.random.Generator) -> Effect:
    """One place of an effect, its size between 0.7 and 3 typical ones, as likely small as large."""
    one = able[int(rng.integers(len(able)))]
    (low,), (high,) = one.limits
    size = float(one.steps[0]) * float(np.exp(rng.uniform(math.log(0.7), math.log(3.0))))
    ends = [one.neutral + sign * size for sign in rng.permutation([-1.0, 1.0])]
    amplitude = next((end for end in ends if low < end < high), 0.5 * (one.neutral + high))
    parameters = one.values(np.array([amplitude]))
    if "direction" in parameters:
        parameters["direction"] = float(rng.uniform(0.0, math.pi))
    return Effect(one.name, **parameters)


def draw(one: Stranger, kind: str, rng: np.random.Generator, smooth: Sequence[float] = SMOOTH) -> Drawn | None:
    """Draw a campaign; None where it has no equilibrium, or a fault of the library that nothing could see."""
    bench, problem = one.bench, one.bench.problem
    truth = faults(one, kind, rng)
    everything, pool, outside, growth = list(truth), problem.pool, "", 0.0
    if kind in {"outside", "beside"}:
        # at one load, growth with the load is growth
        several = len({test.load for test in problem.observations.layout.dynamic}) > 1
        outside = str(rng.choice(BEYOND if several else BEYOND[:2]))
        if outside == "left out":
            (gone,) = faults(one, "one", rng)
            everything.append(gone)
            outside, pool = f"left out: {gone.name}", tuple(c for c in pool if c.name != gone.name)
        elif outside == "cross-coupled":
            stiffness = max(abs(v) for e, v in zip(problem.observations.elements, problem.base) if e.family == "h")
            size = stiffness * float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.08))
            everything.append(Effect("parallel_stiffness", xx=0.0, xy=size, yx=-size, yy=0.0))
        else:
            growth = float(rng.uniform(0.08, 0.2)) * bench.forward.setup.bearing.pads[0].assembled_clearance
    if any(e.name not in {c.name for c in pool} for e in truth):
        return None
    size = rng.standard_normal(len(problem.nuisances))
    factor = usual_factor(problem.observations, problem.columns)
    try:
        value = measured(bench, everything, size, growth)
        changes = [value - measured(bench, [h for h in everything if h is not e], size, growth) for e in truth]
    except NoEquilibriumError:
        return None
    seen = [float(np.linalg.norm(np.linalg.solve(factor, change))) for change in changes]
    if min(seen, default=ASKED) < ASKED:
        return None
    observations = replace(problem.observations, value=value + noise(problem.observations, value, rng, smooth))
    return Drawn(
        tuple(truth), outside, replace(problem, observations=observations, pool=pool), tuple(s**2 for s in seen), size,
        tuple(everything), growth,
    )  # fmt: skip


def run(
    one: Stranger, number: int, seed: int, settings: DiagnoseSettings, smooth: Sequence[float] = SMOOTH
) -> dict[str, Any] | None:
    """Draw and diagnose one campaign; a flat row with what came out."""
    rng, kind = np.random.default_rng([seed, number, 140]), KINDS[seed % len(KINDS)]
    drawn = next((d for d in (draw(one, kind, rng, smooth) for _ in range(12)) if d is not None), None)
    if drawn is None:
        return None
    began = time.process_time()
    decision, comparison = solve(drawn.problem, one.bench.forward, settings)
    verdict = decision.verdict
    return {
        "kind": kind, "bearing": number, "seed": seed, "words": one.words, **hidden(drawn), **said(verdict),
        "gap": verdict.gap, "reasons": list(verdict.reasons), "scale": decision.model.posterior.scale,
        "far": [(d.name, d.size, d.significance) for d in decision.model.tolerances[:3]],
        "fits": [(f.label, f.posterior.total, p) for f, p in list(comparison.probabilities.items())[:6]],
        "seconds": time.process_time() - began, "tried": len(comparison.fits),
    }  # fmt: skip


def main() -> None:
    """Draw, diagnose, and print the tables; rows that are there are not drawn again."""
    low, high = SMOOTH
    rows = Path("strangers.jsonl")
    options = {"first": 0, "bearings": 8, "count": 30, "seed": 0, "rows": rows, "least": low, "most": high}
    asked = study_parser(__doc__, **options).parse_args()
    settings, stored = DiagnoseSettings(workers=1, skip=SKIPPED), Rows(asked.rows, "bearing", "seed")
    for number in range(asked.first, asked.first + asked.bearings):
        missing = [seed for seed in range(asked.seed, asked.seed + asked.count) if (number, seed) not in stored.known]
        one = stranger(number, asked.rows.parent) if missing else None
        for seed in missing:
            row = None if one is None else run(one, number, seed, settings, (asked.least, asked.most))
            if row is not None:
                stored.add(row)
    report(asked, "strangers", tables([*stored.known.values()]))


if __name__ == "__main__":
    main()
