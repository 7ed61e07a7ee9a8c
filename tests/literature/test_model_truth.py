"""The baseline model against the truth files of the sample campaigns: the same physics by another program.

docs/theory.md pins the baseline down, so that K and C must agree to what meshes leave (0.5 %), positions to 0.1 um,
mid-length film temperatures to 0.05 K.
"""

import functools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.pivots import ScaledPivot, pivot_laws
from model.predict import Mesh, predict
from model.prediction import Prediction

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
TRUTH = SHARED / "samples" / "truth"
BEARINGS = Path(__file__).resolve().parents[2] / "model" / "bearings"
#: Deflections of the measured-pivot campaign: Kirk-Reedy delta(W) over these (README of the samples).
SOFTER = (0.38, 0.45, 0.35, 0.40, 0.30)

pytestmark = [pytest.mark.samples, pytest.mark.skipif(not TRUTH.exists(), reason="needs ../shared/samples")]

CASES = [
    ("rocker-baseline", "baseline_points"),
    ("rocker-measured-pivots", "points"),
    ("spherical-baseline", "baseline_points"),
]


@functools.cache
def truth(name: str) -> dict:
    return json.loads((TRUTH / f"{name}.json").read_text(encoding="utf-8"))


def softer(bearing: Bearing) -> tuple[ScaledPivot, ...]:
    return tuple(ScaledPivot(law, f) for law, f in zip(pivot_laws("kirk", bearing), SOFTER, strict=True))


def solve(name: str, key: str, point: dict, mesh: Mesh | None = None) -> Prediction:
    bearing = load_bearing(BEARINGS / truth(name)["bearing"])
    custom = key == "points" and truth(name)["pivots"] == "custom"
    laws = softer(bearing) if custom else pivot_laws("kirk", bearing)
    speed, excitation = (2 * math.pi * point[f"{name}_Hz"] for name in ("shaft_speed", "excitation"))
    return predict(bearing, point["static_load_N"], -math.pi / 2, speed, excitation, pivots=laws, mesh=mesh)


@pytest.mark.parametrize(("name", "key"), CASES)
def test_coefficients_positions_loads_and_temperatures(name, key):
    for point in truth(name)[key]:
        p = solve(name, key, point)
        assert p.converged
        assert list(p.idle_pads) == point["idle_pads"]
        k, c = np.array(point["K"]), np.array(point["C"])
        np.testing.assert_allclose(p.k, k, atol=0.005 * np.diag(k).min())
        np.testing.assert_allclose(p.c, c, atol=0.005 * np.diag(c).min())
        np.testing.assert_allclose(np.diag(p.k), np.diag(k), rtol=0.005)
        np.testing.assert_allclose(np.diag(p.c), np.diag(c), rtol=0.005)
        np.testing.assert_allclose(p.position, [point["x_m"], point["y_m"]], atol=1e-7)
        np.testing.assert_allclose(p.pad_load, point["pad_load_N"], rtol=0.005, atol=0.0005 * point["static_load_N"])
        carries = np.isin(np.arange(1, 6), point["idle_pads"], invert=True)
        warm = np.array(point["pad_temperature_C"])
        np.testing.assert_allclose(p.pad_temperature(0.75)[carries], warm[carries], atol=0.05)
        assert p.min_film == pytest.approx(point["h_min_m"], rel=0.003)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "key"), CASES)
def test_refined_mesh_stays(name, key):
    point = truth(name)[key][-1]
    p = solve(name, key, point, Mesh(160, 12))
    np.testing.assert_allclose(np.diag(p.k), np.diag(np.array(point["K"])), rtol=0.003)
    np.testing.assert_allclose(np.diag(p.c), np.diag(np.array(point["C"])), rtol=0.003)


def test_locus():
    data = truth("rocker-measured-pivots")
    bearing = load_bearing(BEARINGS / data["bearing"])
    laws = softer(bearing)
    assert len(data["locus"]) == 20
    for row in data["locus"]:
        direction = math.radians(row["static_load_direction_deg"])
        p = predict(bearing, 5000.0, direction, 2 * math.pi * 22.0, pivots=laws)
        np.testing.assert_allclose(p.position, [row["x_m"], row["y_m"]], atol=1e-7)


def test_pivot_curves():
    data = truth("rocker-measured-pivots")
    bearing = load_bearing(BEARINGS / data["bearing"])
    laws = softer(bearing)
    for curve in data["pivot_curves"]:
        law = laws[curve["pad"] - 1]
        delta = [law.deflection(w) for w in curve["force_N"]]
        np.testing.assert_allclose(delta, curve["deflection_m"], rtol=1e-6)
        tangent = [law.stiffness(w) for w in curve["force_N"]]
        np.testing.assert_allclose(tangent, curve["stiffness_N_per_m"], rtol=1e-6)
