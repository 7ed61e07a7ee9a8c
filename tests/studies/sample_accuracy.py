"""Identified figures of the sample campaigns against their truth: share inside the interval and relative errors.

python tests/studies/sample_accuracy.py ../shared/samples [campaign ..]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import rigdata
from model.bearing_file import parse_bearing
from tpjb_ident.clearance.locus import measure_locus
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.dynamic.identify import identify
from tpjb_ident.pivot import fit_pivots


def report(path: Path, truth: dict) -> None:
    """Print one campaign."""
    campaign = rigdata.load_campaign(path)
    bearing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
    angles = [pad.pivot_angle for pad in bearing.pads]
    _coefficients(identify(campaign), truth)
    curves = fit_pivots(campaign, angles)
    _pivots(curves, truth)
    polygon = measure_clearance(campaign, angles, curves)
    error = 1e6 * (polygon.clearance - np.array(truth["clearance_cold_m"]))
    print("  clearance per pad, error um:", np.round(error, 3))
    true = {p["static_load_direction_deg"]: (p["x_m"], p["y_m"]) for p in truth["locus"]}
    locus = measure_locus(campaign, polygon)
    off = [1e6 * np.hypot(*(p.position - true[_degrees(p, true)])) for p in locus.points]
    print(f"  locus, distance from truth um: median {np.median(off):.3f}, largest {max(off):.3f}")


def _degrees(point, true: dict) -> float:  # type: ignore[no-untyped-def]
    mine = point.point.static_load_direction_deg
    return min(true, key=lambda d: abs((d - mine + 180) % 360 - 180))


def _coefficients(found, truth: dict) -> None:  # type: ignore[no-untyped-def]
    table = {(p["static_load_N"], p["excitation_Hz"]): p for p in truth["points"]}
    inside, total, errors, mains = 0, 0, [], []
    for p in found.points:
        true = table[(round(p.point.static_load, 3), round(p.point.excitation_hz, 6))]
        k, c = np.array(true["K_apparent"]), np.array(true["C_apparent"])
        interval = p.stiffness.interval(0.95)
        omega = p.point.excitation
        vector = np.concatenate([k.ravel(), omega * c.ravel()])
        low, high = np.asarray(interval.lo).ravel(), np.asarray(interval.hi).ravel()
        inside += int(np.sum((low <= vector) & (vector <= high)))
        total += 8
        e = [p.stiffness.k[0, 0] / k[0, 0], p.stiffness.k[1, 1] / k[1, 1],
             p.stiffness.c[0, 0] / c[0, 0], p.stiffness.c[1, 1] / c[1, 1]]  # fmt: skip
        on_mains = abs(p.point.excitation_hz - 50.0) < 0.5
        (mains if on_mains else errors).append(np.array(e) - 1)
        if on_mains:
            print(f"  50 Hz flagged: {[str(q) for q in p.quality][:2]}")
    print(f"  K, C entries inside the 95 % interval: {inside} of {total}")
    print("  kxx kyy cxx cyy, largest error %:", np.round(100 * np.abs(errors).max(axis=0), 2),
          "median %:", np.round(100 * np.median(np.abs(errors), axis=0), 2))  # fmt: skip
    if mains:
        print("  at 50 Hz (mains) %:", np.round(100 * np.abs(mains).max(axis=0), 2))


def _pivots(curves, truth: dict) -> None:  # type: ignore[no-untyped-def]
    rows = []
    for curve in curves:
        true = next(p for p in truth["pivot_curves"] if p["pad"] == curve.pad)
        for load in (1000.0, 2000.0, 4000.0):
            exact = float(np.interp(load, true["force_N"], true["stiffness_N_per_m"]))
            low, high = curve.stiffness_band(load)
            value = float(np.ravel(curve.stiffness(load))[0])
            inside = float(np.ravel(low)[0]) <= exact <= float(np.ravel(high)[0])
            rows.append((curve.pad, 100 * (value / exact - 1), inside))
    for pad in sorted({r[0] for r in rows}):
        errors = ", ".join(f"{r[1]:+.2f}" for r in rows if r[0] == pad)
        print(f"  pivot of pad {pad}, tangent stiffness at 1, 2, 4 kN, error %: {errors}")
    print(f"  inside the 95 % band: {sum(r[2] for r in rows)} of {len(rows)}")


def main() -> None:
    """Run over the sample folder."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/samples")
    names = sys.argv[2:] or ["rocker-baseline", "rocker-measured-pivots.h5", "spherical-baseline.h5"]
    for name in names:
        print(name)
        report(folder / name, json.loads((folder / "truth" / f"{name.removesuffix('.h5')}.json").read_text()))


if __name__ == "__main__":
    main()
