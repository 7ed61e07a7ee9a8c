"""Identified figures of the sample campaigns against their truth: shares inside the intervals and errors.

python -m tests.studies.sample_accuracy [--write]
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import rigdata
from model.bearing_file import parse_bearing
from tests.studies.results import report, study_parser, table
from tpjb_ident.clearance.locus import measure_locus
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.identification.identify import identify
from tpjb_ident.pivot import fit_pivots

SAMPLES = Path(__file__).resolve().parents[3] / "shared" / "samples"
NAMES = ("rocker-baseline", "rocker-measured-pivots.h5", "spherical-baseline.h5")
LOADS = (1000.0, 2000.0, 4000.0)


def row(path: Path, truth: dict[str, Any]) -> list[str]:
    """One campaign."""
    campaign = rigdata.load_campaign(path)
    bearing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
    angles = [pad.pivot_angle for pad in bearing.pads]
    curves = fit_pivots(campaign, angles)
    polygon = measure_clearance(campaign, angles, curves)
    clearance = 1e6 * np.abs(polygon.clearance - np.array(truth["clearance_cold_m"])).max()
    return [
        path.stem,
        *coefficients(identify(campaign), truth),
        *pivots(curves, truth),
        f"{clearance:.2f} um",
        f"{locus_error(measure_locus(campaign, polygon), truth):.2f} um",
    ]


def coefficients(identification: Any, truth: dict[str, Any]) -> tuple[str, str]:
    """Entries of K and C inside their intervals; largest error of a direct one, mains line apart."""
    points = {(p["static_load_N"], p["excitation_Hz"]): p for p in truth["points"]}
    inside, errors = [], []
    for p in identification.points:
        true = points[round(p.point.static_load, 3), round(p.point.excitation_hz, 6)]
        k, c = np.array(true["K_apparent"]), np.array(true["C_apparent"])
        interval = p.stiffness.interval(0.95)
        vector = np.concatenate([k.ravel(), p.point.excitation * c.ravel()])
        inside += list((np.ravel(interval.lo) <= vector) & (vector <= np.ravel(interval.hi)))
        if abs(p.point.excitation_hz - 50.0) > 0.5:
            errors += [*np.diag(p.stiffness.k / k - 1), *np.diag(p.stiffness.c / c - 1)]
    return f"{sum(inside)} of {len(inside)}", f"{100 * np.abs(errors).max():.2f} %"


def pivots(curves: Any, truth: dict[str, Any]) -> tuple[str, str]:
    """Tangents inside their band, largest error."""
    true = {p["pad"]: p for p in truth["pivot_curves"]}
    inside, errors = [], []
    for curve in curves:
        exact = np.interp(LOADS, true[curve.pad]["force_N"], true[curve.pad]["stiffness_N_per_m"])
        low, high = curve.stiffness_band(np.array(LOADS))
        inside += list((low <= exact) & (exact <= high))
        errors += list(curve.stiffness(np.array(LOADS)) / exact - 1)
    return f"{sum(inside)} of {len(inside)}", f"{100 * np.abs(errors).max():.1f} %"


def locus_error(locus: Any, truth: dict[str, Any]) -> float:
    """Largest distance of a position from the truth [um]."""
    true = {p["static_load_direction_deg"]: (p["x_m"], p["y_m"]) for p in truth["locus"]}
    distances = []
    for p in locus.points:
        direction = p.point.static_load_direction_deg
        nearest = min(true, key=lambda d, at=direction: abs((d - at + 180) % 360 - 180))
        distances.append(1e6 * np.hypot(*(p.position - true[nearest])))
    return max(distances)


def main() -> None:
    asked = study_parser(__doc__).parse_args()
    rows = []
    for name in NAMES:
        truth = json.loads((SAMPLES / "truth" / f"{name.removesuffix('.h5')}.json").read_text("utf-8"))
        rows.append(row(SAMPLES / name, truth))
    head = ("campaign", "K, C in 95 %", "largest error", "pivots in band", "largest error", "clearance", "locus")
    report(asked, "samples", table(head, rows))


if __name__ == "__main__":
    main()
