"""Curves, tables and pivots.toml, made from a law that is known exactly."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from tests.pivot.test_tables import curve as stated_curve
from tpjb_ident.pivot import pivot_table, write_pivots
from tpjb_ident.pivot.curve import measure_loop
from tpjb_ident.pivot.law_fit import FitData, fit_law, keep_likely, posterior_weights
from tpjb_ident.pivot.laws import LAWS

REFERENCE = 2000.0
LOADS = np.array([50.0, 250.0, 1000.0, 2000.0, 4000.0, 8000.0])


def data(load, deflection, noise=2e-8):
    return FitData(load, deflection, np.ones(len(load)), np.eye(len(load)) / noise, REFERENCE, (0.0, 1e-4))


def rocker(load):
    return 7e-11 * load * (18.95 - np.log(load))


def fit(name="hertz-line", contact=False, gap=0.0, seed=0, noise=2e-8):
    load = np.linspace(250.0, 5000.0, 120)
    deflection = rocker(load) - gap * np.exp(-load / 500.0) + 3e-5
    deflection = deflection + noise * np.random.default_rng(seed).standard_normal(len(load))
    return fit_law(LAWS[name], contact, data(load, deflection, noise))


def curve(**changes):
    return stated_curve(**{"fits": (fit(),), "valid_from": 250.0, **changes})


def test_standard_errors_are_those_of_repeated_fits():
    fits = [fit(seed=s) for s in range(60)]
    scatter = np.std([np.log(f.compliance(LOADS[2:5])) for f in fits], axis=0)
    gradient = fits[0].log_compliance_gradient(LOADS[2:5])
    stated = np.sqrt(np.einsum("ij,jk,ik->i", gradient, fits[0].covariance, gradient))
    assert stated == pytest.approx(scatter, rel=0.4)


def test_evidence_prefers_the_true_law_and_sees_contact_loss():
    load = np.linspace(250.0, 5000.0, 120)
    noise = 2e-8
    rng = np.random.default_rng(4)
    sphere = 5e-8 * load ** (2 / 3) + noise * rng.standard_normal(120)
    upper = sphere - 3e-6 * np.exp(-load / 500.0)
    pads = [
        [fit_law(law, contact, data(load, x, noise)) for law in LAWS.values() for contact in (False, True)]
        for x in (sphere, sphere, upper)
    ]
    for fits, weights, contact in zip(pads, posterior_weights(pads), (False, False, True), strict=True):
        likely, shares = keep_likely(fits, weights)
        assert likely[0].name == "hertz-point"
        assert likely[0].contact is contact
        assert shares.sum() == pytest.approx(1.0)
        assert np.all(np.diff(shares) <= 0)


def test_tangent_and_secant():
    c = curve()
    step = 0.1
    slope = 2 * step / (c.deflection(LOADS + step) - c.deflection(LOADS - step))
    assert c.stiffness(LOADS) == pytest.approx(slope, rel=1e-5)
    assert c.secant(LOADS) == pytest.approx(LOADS / c.deflection(LOADS), rel=1e-12)
    assert np.all(c.stiffness(LOADS) > c.secant(LOADS))


@pytest.mark.parametrize("bad", [-1.0, np.nan, [100.0, -5.0]])
def test_impossible_loads_are_refused(bad):
    with pytest.raises(ValueError, match="load"):
        curve().stiffness(bad)
    with pytest.raises(ValueError, match="deflection"):
        curve().load(bad)


def test_table_has_the_contract_columns_and_the_formula_beside():
    frame = pivot_table([curve(), curve(pad=2)], formula=lambda pad, load: (2e9 * pad, 4e9))
    needed = {"pad", "force_N", "deflection_m", "stiffness_N_per_m", "stiffness_N_per_m_lo", "stiffness_N_per_m_hi"}
    assert needed <= set(frame.columns)
    assert {2000.0, 4000.0} <= set(frame.force_N)
    assert frame.extrapolated.any()
    assert not frame[frame.force_N == 4000.0].extrapolated.any()
    assert (frame.formula_tangent_N_per_m == 4e9).all()
    second = frame[frame["pad"] == 2]
    assert (second.formula_secant_N_per_m == 4e9).all()


def test_toml_carries_the_tangent(tmp_path):
    path = write_pivots(tmp_path / "pivots.toml", [curve(pad=2), curve()], 'campaign "A"\n')
    found = tomllib.loads(path.read_text())
    assert found["schema"] == "tpjb-pivots/1"
    assert found["source"] == 'campaign "A"\n'
    assert found["includes_housing"] is True
    assert [p["pad"] for p in found["pads"]] == [1, 2]
    pad = found["pads"][0]
    assert (pad["valid_from_N"], pad["valid_to_N"]) == (250.0, 5000.0)
    assert pad["force_N"][0] == pad["deflection_m"][0] == 0.0
    assert pad["force_N"][-1] >= 10_000.0
    law = PchipInterpolator(pad["force_N"], pad["deflection_m"])
    loads = np.linspace(200.0, 10_000.0, 997)
    assert law(loads) == pytest.approx(curve().deflection(loads), rel=1e-5)
    assert 1.0 / law.derivative()(loads) == pytest.approx(curve().stiffness(loads), rel=1e-3)
    assert list(tmp_path.iterdir()) == [path]


def test_a_drift_from_up_to_down_is_an_error_of_the_whole_loop():
    load = np.linspace(500.0, 5000.0, 10)
    both, branch = np.r_[load, load[::-1]], np.r_[np.ones(10, dtype=int), -np.ones(10, dtype=int)]
    shift = np.outer(branch < 0, branch < 0) * 1e-7**2
    loop = measure_loop(both, 1e-9 * both, shift, branch)
    assert loop.energy_se == pytest.approx(1e-7 * 4500.0, rel=1e-6)
    assert "loop from 500 to 5000 N" in str(loop)


def test_steps_show_what_the_law_says_with_its_way_into_contact():
    law = fit(contact=True, gap=3e-6, seed=5)
    one = curve(fits=(law,), onset_load=2000.0, valid_from=2000.0)
    load = np.array([500.0, 2500.0, 5000.0, 7500.0])
    value, lo, hi = one.reading_band(load)
    applied = load / (1.0 - law.theta[1])
    assert value == pytest.approx(law.reading(applied, np.ones(4)) - law.theta[0])
    assert value[0] < one.deflection(500.0) - 0.8e-6
    width = hi - lo
    # tight among the points, wider beyond them
    assert width[2] < 0.05e-6
    assert width[3] > 2 * width[2]
