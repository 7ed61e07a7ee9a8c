"""Other programs on the paper's two bearings: the ROSS bearing engine (petrobras/ross, 2026-08), and the truth files of
the sample campaigns.

ROSS: finite elements, isoviscous mu = 0.03956 Pa s, Swift-Stieber rupture, 1320 rpm, load on pad #1, synchronous
reduction. Its mesh of 40 x 20 leaves 1.4 % in kxx, 0.7 % in kyy, 0.2 % in cxx, with flexible pivots another 1-2 %:
3 % here, for the rows and for the values that were extrapolated to a fine mesh (rocker, 5 kN).

Truth files: docs/theory.md pins the baseline down, so that K and C must agree to what meshes leave (0.5 %), positions
to 0.1 um, mid-length film temperatures to 0.05 K.
"""

import csv
import functools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.pivots import ScaledPivot, pivot_laws
from model.predict import Mesh, predict
from model.prediction import Prediction
from tests.good_campaigns import BEARINGS, SAMPLES, SHARED

REFERENCE = SHARED / "references" / "peer_predictions.csv"
SPEED = 2 * math.pi * 22.0
LIMIT = 0.03


def bearing(name: str) -> Bearing:
    one = load_bearing(BEARINGS / f"{name}.toml")
    return replace(one, oil=replace(one.oil, viscosity_40=0.03956))


def run(name: str, load: float, pivots: float | str, excitation: object = None) -> Prediction:
    return predict(bearing(name), load, speed=SPEED, excitation=excitation, pivots=pivots, thermal="isothermal")


def test_rocker_with_rigid_pivots_meets_the_extrapolated_values():
    p = run("rocker", 5000.0, "rigid")
    assert p.kxx == pytest.approx(6.69e7, rel=LIMIT)
    assert p.kyy == pytest.approx(21.5e7, rel=LIMIT)
    assert p.cxx == pytest.approx(7.20e5, rel=LIMIT)
    assert p.cyy == pytest.approx(13.97e5, rel=LIMIT)
    assert p.position[1] / 80e-6 == pytest.approx(-0.481, abs=0.005)
    assert p.max_pressure == pytest.approx(2.90e6, rel=0.01)
    np.testing.assert_allclose(p.pad_load[:3], [4565.0, 1329.0, 244.0], rtol=0.02)


@pytest.mark.parametrize(
    ("pivots", "kyy"),
    [("rigid", (25.9e7, 20.1e7, 11.5e7)), (1.35e9, (22.2e7, 19.3e7, 22.5e7)), (5e8, (17.7e7, 16.9e7, 25.0e7))],
    ids=["rigid", "1.35e9", "5e8"],
)
def test_what_frequency_does(pivots, kyy):
    p = run("rocker", 5000.0, pivots, 2 * math.pi * np.array([10.0, 25.0, 50.0]))
    np.testing.assert_allclose(p.kyy, kyy, rtol=LIMIT)


@pytest.mark.samples
def test_every_row_with_rigid_pads():
    with REFERENCE.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["pad_elastic"] == "rigid"]
    assert len(rows) >= 8
    for row in rows:
        stiffness = float(row["k_pivot_pads_1to5_N_per_m"].split()[0])
        p = run(row["bearing"], float(row["load_N"]), stiffness or "rigid")
        for name in ("kxx", "kyy", "cxx", "cyy"):
            assert getattr(p, name) == pytest.approx(float(row[name]), rel=LIMIT), (row["bearing"], row["load_N"], name)
        # its pivot deflections: secant stiffness at the bearing load on all pads, as here
        assert p.position[1] / 80e-6 == pytest.approx(float(row["yj_cb"]), abs=0.01)
        loads = [float(x) for x in row["pad_normal_load_N"].split()]
        np.testing.assert_allclose(p.pad_load, loads, rtol=LIMIT)
        assert p.max_pressure == pytest.approx(1e6 * float(row["pmax_MPa"]), rel=0.02)
        assert p.min_film == pytest.approx(1e-6 * float(row["hmin_um"]), rel=0.015)


TRUTH = SAMPLES / "truth"
#: Deflections of the measured-pivot campaign: Kirk-Reedy delta(W) over these (README of the samples).
SOFTER = (0.38, 0.45, 0.35, 0.40, 0.30)

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


@pytest.mark.samples
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


@pytest.mark.samples
@pytest.mark.slow
@pytest.mark.parametrize(("name", "key"), CASES)
def test_refined_mesh_stays(name, key):
    point = truth(name)[key][-1]
    p = solve(name, key, point, Mesh(160, 12))
    np.testing.assert_allclose(np.diag(p.k), np.diag(np.array(point["K"])), rtol=0.003)
    np.testing.assert_allclose(np.diag(p.c), np.diag(np.array(point["C"])), rtol=0.003)


@pytest.mark.samples
def test_locus():
    data = truth("rocker-measured-pivots")
    bearing = load_bearing(BEARINGS / data["bearing"])
    laws = softer(bearing)
    assert len(data["locus"]) == 20
    for row in data["locus"]:
        direction = math.radians(row["static_load_direction_deg"])
        p = predict(bearing, 5000.0, direction, 2 * math.pi * 22.0, pivots=laws)
        np.testing.assert_allclose(p.position, [row["x_m"], row["y_m"]], atol=1e-7)
