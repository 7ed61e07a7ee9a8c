"""Pivot curves, contact onset, clearance and refusals over many virtual campaigns, against their truth.

    python -m tests.studies.pivots [--seeds 100] [--first 1000] [--faults 4] [--programme up] [--write]

Every seed is a campaign of its own kind (rocker or sphere, alone or on a housing that gives);
its five pads differ by a factor of up to three. `--faults` draws that many faults per seed from all that one dry run
can have; a fault that leaves the record as it was (nothing to refuse) is told apart from a miss.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata.problem import RigDataError
from rigdata.virtual_rig import ClearanceSweep, DryTest, Fault
from tests.rigs.pivot_cases import (
    ANGLES,
    KINDS,
    LOADS,
    PROGRAMMES,
    UPPER_PADS,
    bearing,
    campaign,
    refusal_cases,
    true_onset,
)
from tests.studies import results
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.pivot import fit_pivots

AT = np.r_[LOADS, 8000.0]
CLEARANCE = 80e-6
COLUMNS = ("seed", "kind", "pad", "law", *(f"error{w:g}" for w in AT), *(f"se{w:g}" for w in AT), "valid_from",
           "onset", "onset_se", "onset_true", "miss", "miss_se", "pushed_miss", "seconds")  # fmt: skip


def one_campaign(seed: int, path: Path, programme: str = "up") -> list[tuple[float, ...]]:
    """Rows of the five pads of one campaign."""
    kind = seed % len(KINDS)
    laws = bearing(KINDS[kind], seed)
    test = DryTest(1) if programme == "up" else PROGRAMMES[programme]
    dry = tuple(replace(test, pad=pad) for pad in range(1, 6))
    source, truth = campaign(path, laws, seed, dry=dry, clearance=(ClearanceSweep(),))
    before = time.process_time()
    curves = fit_pivots(source, ANGLES)
    seconds = time.process_time() - before
    polygon = measure_clearance(source, ANGLES, curves)
    push = float(truth["runs"]["c-1"]["push_N"])
    rows = []
    for k, (curve, law) in enumerate(zip(curves, laws, strict=True)):
        gap = float(truth["runs"][curve.runs[0]]["contact_gap_m"])
        onset = true_onset(law, gap) if curve.pad in UPPER_PADS else 0.0
        rows.append((
            seed, kind, curve.pad, hash_of(curve.law.name), *np.log(curve.stiffness(AT) * law.compliance(AT)),
            *curve.relative_stiffness_se(AT), curve.valid_from, curve.onset_load, curve.onset_load_se, onset,
            polygon.clearance[k] - CLEARANCE, polygon.clearance_se[k],
            polygon.clearance_pushed[k] - CLEARANCE - float(law.deflection(push)), seconds,
        ))  # fmt: skip
    return rows


LAWS = ("hertz-line", "hertz-point", "power", "linear", "point-in-series", "bilinear", "spline")


def hash_of(law: str) -> int:
    """Number of a law."""
    return LAWS.index(law)


def one_fault(seed: int, fault: Fault, path: Path) -> str:
    """``refused``, or what the curves say for all that."""
    laws = bearing(KINDS[seed % len(KINDS)], seed)
    source, _ = campaign(path, laws, seed, faults=(fault,))
    try:
        curves = fit_pivots(source, ANGLES)
    except RigDataError:
        return "refused"
    wrong = [np.abs(np.log(c.stiffness(LOADS) * laws[c.pad - 1].compliance(LOADS))).max() for c in curves]
    return f"accepted, worst stiffness error {100 * max(wrong):.1f} %"


def report(rows: np.ndarray) -> list[str]:
    """Table of curves, lines on onset and clearance."""
    c = dict(zip(COLUMNS, rows.T, strict=True))
    upper = np.isin(c["pad"], UPPER_PADS)
    entries = []
    for name, mask in (("all", upper | ~upper), ("lower", ~upper), ("upper", upper)):
        for load in AT:
            error, se = c[f"error{load:g}"][mask], c[f"se{load:g}"][mask]
            sizes = [f"{100 * x:.2f} %" for x in (np.median(abs(error)), np.quantile(abs(error), 0.95), error.mean())]
            inside = f"{100 * np.mean(abs(error) < 1.96 * se):.1f} %"
            entries.append((name, f"{load:g}", mask.sum(), *sizes, inside))
    onset = c["onset"][upper] / c["onset_true"][upper] - 1.0
    score = (c["onset"] - c["onset_true"])[upper] / np.maximum(c["onset_se"][upper], 1e-9)
    miss = c["miss"] / c["miss_se"]
    head = ("pads", "load N", "n", "median error", "95 % below", "bias", "inside 95 %")
    return [
        results.table(head, entries),
        "",
        f"- contact onset: found on {100 * np.mean(c['onset'][upper] > 0):.1f} % of the upper and "
        f"{100 * np.mean(c['onset'][~upper] > 0):.1f} % of the other pads; median error "
        f"{100 * np.median(abs(onset)):.1f} %, its 95 % interval holds {100 * np.mean(abs(score) < 1.96):.1f} %",
        f"- clearance: root mean square error {1e6 * np.sqrt(np.mean(c['miss'] ** 2)):.3f} um, worst "
        f"{1e6 * abs(c['miss']).max():.3f} um, its 95 % interval holds {100 * np.mean(abs(miss) < 1.96):.1f} %; "
        f"pushed, worst {1e6 * abs(c['pushed_miss']).max():.3f} um",
        f"- five pads: median {np.median(c['seconds']):.2f} s of processor time, longest {c['seconds'].max():.2f} s",
    ]


def report_faults(found: list[tuple[Fault, int, str]]) -> list[str]:
    """How many faults were rejected, by kind, and every one that was not."""
    lines = []
    for kind in sorted({_label(fault) for fault, _, _ in found}):
        outcomes = [outcome for fault, _, outcome in found if _label(fault) == kind]
        lines.append(f"- rejected: {sum(o == 'refused' for o in outcomes)} of {len(outcomes)}: {kind}")
    for fault, seed, outcome in found:
        if outcome != "refused":
            lines.append(
                f"- seed {seed}: {fault.kind} {fault.run} {fault.channel or ''} {fault.value or ''}: {outcome}"
            )
    return lines


def _label(fault: Fault) -> str:
    what = {"X": "probes", "L": "cells"}.get((fault.channel or " ")[0], "")
    return f"{fault.kind} {what}".strip()


def main() -> None:
    """Run everything that the command line asks for."""
    parser = results.study_parser(__doc__, seeds=100, first=1000, faults=4)
    parser.add_argument("--programme", choices=("up", *PROGRAMMES), default="up", help="how the load goes")
    given = parser.parse_args()
    rows: list[tuple[float, ...]] = []
    found: list[tuple[Fault, int, str]] = []
    cases = refusal_cases()
    with tempfile.TemporaryDirectory(prefix="tpjb-") as folder:
        path = Path(folder) / "c.h5"
        for seed in range(given.first, given.first + given.seeds):
            rows += one_campaign(seed, path, given.programme)
            rng = np.random.default_rng(seed)
            drawn = rng.choice(len(cases), min(given.faults, len(cases)), replace=False)
            found += [(cases[k], seed, one_fault(seed, cases[k], path)) for k in drawn]
    lines = [*report(np.array(rows)), *report_faults(found)]
    results.report(given, "pivots", "\n".join(lines))


if __name__ == "__main__":
    main()
