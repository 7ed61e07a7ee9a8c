"""What pads tell each other, and what the mains tells of channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tpjb_ident.pivot.dry_record import measure_pickup
from tpjb_ident.pivot.law_fit import (
    FitData,
    ShapePrior,
    fit_law,
    posterior_weights,
    with_shared_shape,
)
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.pivot.refusals import mistakes

REFERENCE = 2000.0
NAMES = ("hertz-point", "point-in-series", "power")


def data(lam, low=250.0, seed=0, noise=1.5e-8):
    """Blocks of a sphere on a housing with linear share `lam`, from `low` [N] up."""
    load = np.linspace(low, 5000.0, 120)
    law = LAWS["point-in-series"]
    deflection = 3e-9 * REFERENCE * law.phi(load / REFERENCE, np.array([lam]))[0]
    deflection = deflection + noise * np.random.default_rng(seed).standard_normal(120)
    return FitData(load, deflection - deflection[0], np.ones(120), np.eye(120) / noise, REFERENCE, (0.0, 1e-4))


def fits(one):
    return [fit_law(LAWS[name], False, one) for name in NAMES]


def test_a_pad_that_shows_half_its_law_takes_the_shape_from_the_others():
    pads = [data(0.12, seed=k) for k in range(4)] + [data(0.12, low=2600.0, seed=11, noise=4e-8)]
    found = [fits(one) for one in pads]
    weights = posterior_weights(found)
    shared = with_shared_shape(found, weights, pads)
    series = NAMES.index("point-in-series")
    assert abs(shared[4][series].shape[0] - 0.12) < abs(found[4][series].shape[0] - 0.12)
    assert posterior_weights(shared)[4][NAMES.index("hertz-point")] < weights[4][NAMES.index("hertz-point")]


def test_a_pad_of_its_own_kind_keeps_its_own_shape():
    pads = [data(0.1, seed=k) for k in range(4)] + [data(0.85, seed=12)]
    found = [fits(one) for one in pads]
    shared = with_shared_shape(found, posterior_weights(found), pads)
    series = NAMES.index("point-in-series")
    assert shared[4][series].shape == pytest.approx(found[4][series].shape, abs=1e-6)
    # half the weight is lost to the prior that does not fit
    assert shared[4][series].log_evidence > found[4][series].log_evidence - np.log(2.0) - 1e-6


def test_evidence_is_that_of_the_prior_given():
    one = data(0.3)
    law = LAWS["point-in-series"]
    known = ShapePrior(law.prior_mean, law.prior_precision)
    assert fit_law(law, False, one, known).log_evidence == pytest.approx(fit_law(law, False, one).log_evidence)
    sharp = replace(known, mean=np.array([0.3]), precision=np.array([[400.0]]))
    assert fit_law(law, False, one, sharp).log_evidence > fit_law(law, False, one).log_evidence


RATE, PHASES = 500.0, {"A": 0.3, "B": 1.9, "H": -0.7, "V": 2.6}


def run(seed, frequency=50.0, size=4e-8, mistake=None, noise=3.5e-8):
    """Mains line of four channels; the phase of the mains itself is chance."""
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / RATE
    start = rng.uniform(0, 2 * np.pi)
    ramp = 1e-6 * np.clip(np.interp(t, [0, 2, 2.3, 5, 5.3, 8], [0, 0, 1, 1, 2, 2]), 0, 2)
    values = {
        name: ramp + size * np.cos(2 * np.pi * (frequency + 0.01 * seed) * t + phase + start)
        + noise * rng.standard_normal(len(t))
        for name, phase in PHASES.items()
    }  # fmt: skip
    if mistake == "exchanged":
        values["A"], values["B"] = values["B"], values["A"]
    if mistake == "reversed":
        values["H"] = -values["H"]
    return measure_pickup(values, np.ones(len(t), dtype=bool), RATE)


@pytest.mark.parametrize(
    ("mistake", "said"), [(None, None), ("exchanged", "A and B are exchanged"), ("reversed", "H is reversed")]
)
def test_a_mistake_in_one_run_is_named(mistake, said):
    runs = [run(k) for k in range(4)] + [run(4, mistake=mistake)]
    found = mistakes(runs, [("A", "B"), ("H", "V")])
    assert found[:4] == [None] * 4
    assert (None if found[4] is None else found[4][0]) == said


@pytest.mark.slow
def test_phases_of_chance_are_no_signature():
    rng = np.random.default_rng(0)
    found = []
    for seed in range(40):
        runs = []
        for k in range(5):
            one = run(10 * seed + k)
            runs.append(replace(one, size=one.size * np.exp(2j * np.pi * rng.uniform(size=4))))
        found += mistakes(runs, [("A", "B"), ("H", "V")])
    assert found == [None] * 200


def test_no_pickup_and_short_records_say_nothing():
    assert measure_pickup({"A": np.zeros(200)}, np.ones(200, dtype=bool), RATE) is None
    quiet = [run(k, size=0.0, mistake="exchanged" if k == 2 else None) for k in range(5)]
    assert mistakes(quiet, [("A", "B"), ("H", "V")]) == [None] * 5
    assert mistakes([run(0), None, None], [("A", "B")]) == [None] * 3
