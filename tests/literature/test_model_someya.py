"""Four-pad bearings of the Journal-Bearing Databook (T. Someya, ed., Springer 1989).

Preload 0, isoviscous, massless pads of 80 deg, central pivots, synchronous reduction. S = mu N L D (R/C)^2 / W,
E = e/C, K = k C/W, B = c omega C/W. As transcribed in a public course repository (`someya_4pad_tpjb.csv`); the table
of load on pad says L/D 0.5 there, but only 1.0 fits. Tolerances: what another program reaches for 0.3 <= E <= 0.9,
|dE| <= 1.5 %, |dK| <= 8 % (model low), |dB| <= 5 %.

Three rows need more, all for reasons of the table: at L/D 0.5, E = 0.3 the unloaded upper pads of the table still
push (with a Reynolds film they cannot: a preload of 0 leaves them no convergent gap), so that S belongs to an E 4 %
smaller; at L/D 1.0, E = 0.85 and 0.9 B is 5.3 % and 5.9 % high with any mesh, where the column bends away from
its trend (the next row, 0.95, does so by 11 %).
"""

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.predict import predict
from model.prediction import Prediction
from tests.rigs.bearings import changed_pads, ring

CLEARANCE, DIAMETER, REVS, VISCOSITY = 1e-4, 0.1, 20.0, 0.03
LIMIT_E, LIMIT_K, LIMIT_B = 0.015, 0.08, 0.05
#: L/D, direction of the load, and on how many axes the printed numbers hold (both are alike between pads).
BETWEEN_PADS, ON_PAD = (0.5, -0.25 * math.pi, 2), (1.0, -0.5 * math.pi, 1)
LIMITS, BENT_DAMPING = (LIMIT_E, LIMIT_B), (LIMIT_E, 0.065)
# S, E, Kxx, Bxx; x along the load
ROWS = [
    (BETWEEN_PADS, 1.05, 0.4, 1.68, 3.61, LIMITS),
    (BETWEEN_PADS, 0.756, 0.5, 1.94, 3.33, LIMITS),
    (BETWEEN_PADS, 0.55, 0.6, 2.26, 3.21, LIMITS),
    (BETWEEN_PADS, 0.381, 0.7, 2.65, 3.06, LIMITS),
    (BETWEEN_PADS, 0.259, 0.8, 3.15, 3.01, LIMITS),
    (BETWEEN_PADS, 0.168, 0.9, 3.72, 2.97, LIMITS),
    (BETWEEN_PADS, 1.59, 0.3, 1.46, 4.37, (0.05, LIMIT_B)),  # the table's upper pads push
    (ON_PAD, 0.795, 0.3, 2.25, 5.39, LIMITS),
    (ON_PAD, 0.507, 0.4, 2.77, 4.93, LIMITS),
    (ON_PAD, 0.316, 0.5, 3.45, 4.67, LIMITS),
    (ON_PAD, 0.185, 0.6, 4.43, 4.57, LIMITS),
    (ON_PAD, 0.0987, 0.7, 5.83, 4.55, LIMITS),
    (ON_PAD, 0.0449, 0.8, 7.99, 4.73, LIMITS),
    (ON_PAD, 0.0272, 0.85, 10.3, 5.10, BENT_DAMPING),
    (ON_PAD, 0.0143, 0.9, 14.5, 5.86, BENT_DAMPING),
]


def databook_bearing(slenderness: float) -> Bearing:
    angles, size = np.radians([-90.0, 0.0, 90.0, 180.0]).tolist(), (DIAMETER, slenderness * DIAMETER)
    bearing = ring(angles, size, math.radians(80), (CLEARANCE, CLEARANCE), (VISCOSITY, 40.0))
    return changed_pads(bearing, mass=1e-9, moment_of_inertia=1e-12)


def solve(slenderness: float, sommerfeld: float, direction: float) -> tuple[Prediction, float]:
    bearing = databook_bearing(slenderness)
    ratio = (0.5 * DIAMETER / CLEARANCE) ** 2
    load = VISCOSITY * REVS * bearing.length * DIAMETER * ratio / sommerfeld
    p = predict(bearing, load, direction, 2 * math.pi * REVS, pivots="rigid", thermal="isothermal")
    assert p.converged
    return p, load


def numbers(slenderness: float, sommerfeld: float, direction: float) -> tuple[float, np.ndarray, np.ndarray]:
    """E, and the diagonals of K and B along and across the load."""
    p, load = solve(slenderness, sommerfeld, direction)
    turn = np.array([[math.cos(direction), math.sin(direction)], [-math.sin(direction), math.cos(direction)]])
    k = np.diag(turn @ p.k @ turn.T) * CLEARANCE / load
    b = np.diag(turn @ p.c @ turn.T) * CLEARANCE / load * 2 * math.pi * REVS
    return float(np.hypot(*p.position)) / CLEARANCE, k, b


@pytest.mark.parametrize(("place", "s", "e", "k", "b", "limits"), ROWS)
def test_row(place, s, e, k, b, limits):
    slenderness, direction, axes = place
    got_e, got_k, got_b = numbers(slenderness, s, direction)
    assert got_e == pytest.approx(e, rel=limits[0])
    assert got_k[:axes] == pytest.approx(k, rel=LIMIT_K)
    assert got_b[:axes] == pytest.approx(b, rel=limits[1])
    if limits == LIMITS:
        assert (got_k[:axes] / k < 1.01).all()  # one-sided


def test_pads_without_a_convergent_gap_idle_and_say_so():
    p, _ = solve(0.5, 0.381, -0.25 * math.pi)
    assert p.idle_pads == (3, 4)
    assert p.status == ("idle pads 3, 4",)
    p, _ = solve(1.0, 0.185, -0.5 * math.pi)
    assert p.idle_pads == (2, 3, 4)
    # two side pads that stand concentric have damping and no stiffness
    across = "nothing holds the journal across its load"
    assert p.status == ("pads 2, 4 stand concentric", across, "idle pads 2, 3, 4")


@pytest.mark.parametrize("s", [row[1] for row in ROWS if row[0] == ON_PAD])
def test_concentric_side_pads_damp_across_a_load_on_a_pad(s):
    # the table's Byy / S is 6.277 in every row: the side pads of a preload-free bearing stay concentric, tilt freely
    # and damp; 5.3 % high with any mesh, as in the deep rows
    _, k, b = numbers(1.0, s, -0.5 * math.pi)
    assert b[1] / s == pytest.approx(6.277, rel=0.065)
    assert abs(k[1]) < 0.01 * b[1]  # the table prints 0.02 to 0.5
