"""Temperatures of Fillon, Bligoud and Frene, "Experimental study of tilting-pad journal bearings - comparison with
theoretical thermoelastohydrodynamic results", ASME J. Tribology 114(3), 1992, 579-588.

Four pads of 75 deg, load between pads, D 100 mm, L 70 mm, central pivots, preload 0.47, Cp 148 um, 10 kN. Peak pad
temperature, digitised to about 1 K; target: 4 K to their TEHD results, 8 K to their measurements.
"""

from __future__ import annotations

import math

import pytest

from model.bearing import Bearing, Oil, Pad, Pivot
from model.predict import Prediction, predict

#: rpm: measured, their TEHD [degC]
PEAK = {1000: (49.5, 43.7), 2000: (59.5, 53.4), 3000: (67.5, 63.2), 4000: (76.5, 72.9)}


def bearing() -> Bearing:
    cp = 148e-6
    pads = tuple(
        Pad(math.radians(angle), math.radians(75), 0.5, cp, (1 - 0.47) * cp, 0.02, 0.0, 0.02, 0.6, 3e-4)
        for angle in (-135, -45, 45, 135)
    )
    oil = Oil(0.0277, 0.0341, 860.0, 7e-4, 2000.0, 0.13, 40.0)
    return Bearing("Fillon", 0.1, 0.07, pads, Pivot(), oil)


def run(rpm: float, thermal: str) -> Prediction:
    p = predict(bearing(), 10e3, -math.pi / 2, rpm * math.pi / 30, pivots="rigid", thermal=thermal)
    assert p.converged
    return p


def test_adiabatic_film_heats_by_what_the_load_says():
    # without carry-over and without heat into the pads the rise of a film that carries W is bound to W, not to the
    # speed: mu U / h^2 is what carries. Film and power grow with speed as they must.
    runs = [run(rpm, "adiabatic") for rpm in PEAK]
    peaks = [p.max_temperature for p in runs]
    assert max(peaks) - min(peaks) < 3.0
    assert runs[0].max_temperature - 40.0 < 20.0
    assert [p.power_loss for p in runs] == sorted(p.power_loss for p in runs)
    assert [p.min_film for p in runs] == sorted(p.min_film for p in runs)


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="the film exchanges no heat with the pads and the inlet is fresh oil: 10 K too hot at 1000 rpm, where pads "
    "cool the film, 18 K too cold at 4000 rpm, where hot oil is carried over",
)
def test_peak_pad_temperatures():
    for rpm, (_, theirs) in PEAK.items():
        assert run(rpm, "tehd").max_temperature == pytest.approx(theirs, abs=4.0)
