"""Joint line fit: phasors, their sign, glitches, gaps, and lines close together."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.problem import RigDataError
from tests.seeds import seeds
from tpjb_ident.phasors import line_fit, run_phasors
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.lines import (
    MAX_INFLATION,
    RecordTooShortError,
    known_lines,
    plan_windows,
    shortest_window,
    variance_inflation,
)
from tpjb_ident.phasors.run_data import PhasorSettings

RATE = 1000.0
TRUE = {25.0: (3.0 - 1.0j, 0.5 + 2.0j), 22.0: (1.0j, 2.0), 44.0: (0.3, 0.1j), 50.0: (0.2 + 0.2j, -0.1)}


def record(n: int, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    t = np.arange(n) / RATE
    rng = np.random.default_rng(seed)
    values = np.empty((n, 2))
    for axis in range(2):
        wave = sum((z[axis] * np.exp(2j * np.pi * f * t)).real for f, z in TRUE.items())
        values[:, axis] = wave + 700.0 + 4.0 * t + noise * rng.standard_normal(n)
    return values


def fit(values: np.ndarray, length: int):
    count = len(values) // length
    fitter = LineFitter(length, RATE, np.array(list(TRUE)))
    return fitter.fit(values[: count * length].T.reshape(2, count, length), np.arange(count) * length / RATE)


def test_exact_lines_are_found_in_every_window_with_the_phase_of_the_run():
    block = fit(record(1000), 250)
    for i, z in enumerate(TRUE.values()):
        np.testing.assert_allclose(block.z[:, i], np.tile(z, (4, 1)), rtol=0, atol=1e-11)
    np.testing.assert_allclose(block.mean[:, 0], 700 + 4 * (np.arange(4) + 0.4995 - 0.0) * 0.25, atol=2e-3)


def test_phasors_have_the_sign_of_a_positive_damper():
    omega, k, c = 2 * np.pi * 25, 2e8, 4e5
    t = np.arange(500) / RATE
    x = 1e-6 * np.cos(omega * t + 0.7)
    velocity = -1e-6 * omega * np.sin(omega * t + 0.7)
    fitter = LineFitter(500, RATE, np.array([25.0]))
    d = fitter.fit(np.stack([x, x])[:, None], np.zeros(1)).z[0, 0, 0]
    f = fitter.fit(np.stack([k * x + c * velocity] * 2)[:, None], np.zeros(1)).z[0, 0, 0]
    assert (f / d).imag / omega == pytest.approx(c, rel=1e-9)


@pytest.mark.parametrize("seed", seeds(6))
def test_leaving_out_few_samples_gives_what_the_long_robust_way_gives(seed: int, monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(seed)
    values = record(8000, 0.02, seed)
    for at in rng.integers(0, 7800, 4):  # bursts and needles, up to 9 % of a window
        values[at : at + rng.integers(1, 90), rng.integers(2)] += rng.choice((-1, 1)) * 10 ** rng.uniform(-0.7, 3)
    quick = fit(values, 4000)
    monkeypatch.setattr(line_fit, "_FEW", -1.0)
    robust = fit(values, 4000)
    assert (quick.lost < 0.1).all()
    assert np.abs(quick.z - robust.z).max() < 2e-4  # the noise of a phasor is 4e-4
    assert np.abs(quick.lost - robust.lost).max() < 3e-3
    monkeypatch.undo()
    clean = fit(record(8000, 0.02, seed), 4000)
    assert np.abs(quick.z - clean.z).max() < 2e-3


def test_uneven_times_are_fitted_where_they_are():
    rng = np.random.default_rng(3)
    t = np.sort(np.arange(400) / RATE + rng.uniform(-3e-4, 3e-4, 400)) + 0.2
    keep = np.ones(400, dtype=bool)
    keep[100:140] = False
    values = np.stack(
        [sum((z[a] * np.exp(2j * np.pi * f * t)).real for f, z in TRUE.items()) for a in range(2)], axis=1
    )
    own = t[keep]
    fitter = LineFitter(len(own), RATE, np.array(list(TRUE)), time=own)
    block = fitter.fit(values[keep].T[:, None], own[:1])
    np.testing.assert_allclose(block.z[0, 0], TRUE[25.0], atol=1e-9)


def test_lines_that_coincide_are_merged_or_reported():
    lines = known_lines((25.0,), 22.0, RATE)
    assert [line.name for line in lines.nuisance] == ["1X", "2X", "mains"]  # 2 x 25 Hz is the mains line
    coincident = known_lines((50.0,), 22.0, RATE)
    assert coincident.conditions == ("mains on excitation line",)
    assert "move the excitation" in coincident.conditions[0].detail
    assert known_lines((50.0,), 22.0, RATE, 60.0).conditions == ()


def test_window_length_follows_from_the_variance_that_is_accepted():
    lines = known_lines((25.0,), 22.0, RATE)
    shortest = shortest_window(lines, RATE)
    assert 0.1 < shortest < 0.5
    assert variance_inflation(lines.frequencies, 1, shortest, RATE) <= MAX_INFLATION
    length, count = plan_windows(2000, RATE, lines)
    assert count == int(2.0 / shortest)
    assert length * count <= 2000
    # a long record is cut into the wished number, not into the shortest possible windows
    assert plan_windows(60_000, RATE, lines) == (3000, 20)


def test_a_record_too_short_is_refused_with_the_length_it_takes():
    close = known_lines((22.4,), 22.0, RATE)
    with pytest.raises(RecordTooShortError, match="takes at least") as caught:
        plan_windows(1000, RATE, close)
    needed = float(re.search(r"at least (\S+) s", str(caught.value))[1])
    assert needed > 1.0
    length, _ = plan_windows(int(needed * RATE * 1.05), RATE, close)
    assert length / RATE >= needed * 0.99
    with pytest.raises(RecordTooShortError, match="cannot tell the lines apart"):
        plan_windows(60_000, RATE, close, 0.03)


def test_gaps_at_other_places_in_every_channel_need_no_robust_fit(monkeypatch):
    """The samples present are fitted by the normal equations less the missing ones: 20 times quicker, and exact."""
    rng = np.random.default_rng(8)
    fitter = LineFitter(2000, 1000.0, np.array([20.0, 35.0, 70.0]))
    rows = rng.standard_normal((3, 2, 8)) @ fitter.design.T + 0.1 * rng.standard_normal((3, 2, 2000))
    spoiled = rows.copy()
    spoiled[0, 0, 300:420] = np.nan
    spoiled[1, 1, 900:960] = np.nan
    spoiled[1, 1, [100, 1500]] += 9.0
    spoiled[2, 0, 100:800] = np.nan
    calls = []
    robust = line_fit.absolute_residual
    monkeypatch.setattr(line_fit, "absolute_residual", lambda *parts: calls.append(1) or robust(*parts))
    fit, residual = fitter.fit_with_residual(spoiled, np.zeros(2))
    assert len(calls) == 1  # a third of a window is missing: the few are no longer few
    for k, i, bad in ((0, 0, []), (1, 1, [100, 1500]), (2, 0, [])):
        used = np.isfinite(spoiled[k, i])
        used[bad] = False
        exact = np.linalg.lstsq(fitter.design[used], spoiled[k, i][used], rcond=None)[0]
        assert np.allclose(fit.z[i, :, k], exact[0:6:2] + 1j * exact[1:6:2], rtol=1e-9)
        assert fit.lost[i, k] == pytest.approx(1 - used.mean())
        assert not residual[k, i][~used].any()


def fit_at(rate):
    """A run's fit before its first step."""
    fit = object.__new__(run_phasors._RunFit)
    fit.run = SimpleNamespace(file="r1.csv", id="r1", sample_rate=rate, length=4000)
    fit.settings, fit.speed = PhasorSettings(), 20.0
    return fit


def test_a_time_column_in_the_wrong_unit_is_named_with_file_and_cure():
    """Milliseconds called seconds make a record of one sample a second."""
    with pytest.raises(RigDataError, match=r"r1.csv, time: 1 samples per second .* 35 Hz.*ms called s"):
        fit_at(1.0)._lines((35.0,), ())


@pytest.mark.parametrize("frequencies", [(0.0,), (-5.0,), (450.0,), (600.0,), (25.0, 460.0)])
def test_excitations_outside_the_band_are_refused(frequencies):
    with pytest.raises(RigDataError, match=f"cannot show an excitation of {frequencies[-1]:g} Hz"):
        fit_at(1000.0)._lines(frequencies, ())
    assert fit_at(1000.0)._lines((449.0,), ()).driven == (449.0,)
