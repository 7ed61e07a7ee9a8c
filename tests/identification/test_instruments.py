"""What records give away of their instruments: clocks, slower channels, accelerometers, cells that were not tared."""

import h5py
import numpy as np
import pytest
import statsmodels.api as sm
from scipy.interpolate import CubicSpline
from scipy.signal import chirp, lfilter

from rigdata import load_campaign
from tests.rigs.acquisition import EXACT, Acquisition
from tests.rigs.closed_form import Rig, channels_of, with_entries, write_rig
from tests.studies.field.battery import outcome
from tests.studies.field.conditions import bad_data, good_records, good_rigs
from tpjb_ident.check.set_points import cell_zero, without_static_part
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.plain import PlainSettings, plain_frame, plain_points, write_r_matrices
from tpjb_ident.phasors.compensation import SlowerChannel, slower_channel
from tpjb_ident.results.frequency_model import chance_of
from tpjb_ident.runs.static_load import StaticLoads

QUICK = Rig(frequencies=(25.0,), seconds=2.0)
SLOW = Acquisition(rate=1000.0, uncertainty=EXACT)
#: Of the battery of conditions elsewhere, one of each kind.
CONDITIONS = (
    "second clock, 100 ppm, stated", "probes from 400 Hz, held", "cells late by 0.3 ms, +-0.3 ms stated",
    "drive real at 25.13 Hz for 25", "drive on 1X", "drive wanders by 0.06 Hz", "two loads",
    "accelerometers exchanged, soft cells", "a probe 1 deg off, 1 deg stated", "cells without a static part",
    "springs beside the film, dry runs", "cells not tared", "probes behind capacitors",
)  # fmt: skip


def of_times(own, values, t):
    """What a logger program makes of readings at their own times: held, along lines, along splines; by order."""
    held = values[np.searchsorted(own, t, side="right") - 1]
    return {1: held, 2: np.interp(t, own, values), 4: CubicSpline(own, values)(t)}


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("slow", [150.0, 400.0])
@pytest.mark.parametrize("excited", ["sine", "band"])
def test_a_channel_that_was_filled_up_is_told_with_its_rate(slow, order, excited):
    rng = np.random.default_rng(1)
    t, own = np.arange(8000) / 2000.0, np.arange(-3, 700 * 4) / slow + 0.0007
    lines = np.arange(5.0, 60.0, 0.7) if excited == "band" else np.array([25.0])
    values = np.cos(2 * np.pi * np.outer(own, lines) + rng.uniform(0, 6, len(lines))).sum(axis=1)
    filled = of_times(own, values + 0.01 * rng.standard_normal(len(own)), t)[order]
    filled[[310, 7500]] = np.nan
    found = slower_channel(filled, 2000.0)
    assert found is not None
    assert found.order == order
    assert found.rate == pytest.approx(slow, rel=2e-4)


@pytest.mark.parametrize("step", [0.0, 1e-3, 0.05])
def test_a_channel_at_its_own_rate_is_not(step):
    rng = np.random.default_rng(2)
    t = np.arange(8000) / 2000.0
    values = np.sin(2 * np.pi * 25 * t) + 2 * np.sin(2 * np.pi * 22 * t) + 0.01 * rng.standard_normal(len(t))
    values = np.round(values / step) * step if step else values
    assert slower_channel(values, 2000.0) is None
    values[[2000, 2300, 5100]] += [9.0, -4.0, 7.0]
    assert slower_channel(values, 2000.0) is None


def test_what_a_converters_few_steps_make_of_lines_fills_no_channel():
    """All sums of 20 Hz agree, one of them by chance as a rate's do."""
    rng = np.random.default_rng(23)
    t, phases = np.arange(12799) / 5120.0, rng.uniform(0, 6, 3)
    lines = zip((3.02, 12.63, 1.06), (140.0, 200.0, 400.0), phases)
    values = sum(size * np.cos(2 * np.pi * f * t + phase) for size, f, phase in lines)
    assert slower_channel(np.round(values + 0.02 * rng.standard_normal(len(t))), 5120.0) is None


def test_blows_and_sweeps_fill_no_channel():
    t, noise = np.arange(8000) / 2000.0, 1e-3 * np.random.default_rng(3).standard_normal(8000)
    blows = np.zeros(8000)
    blows[[700, 2500, 5000]] = [1.0, 0.8, 0.9]
    for values in (lfilter([1.0], [1.0, -1.9, 0.95], blows), chirp(t, 5.0, 4.0, 120.0)):
        assert slower_channel(values + noise, 2000.0) is None


def test_what_the_film_makes_of_the_shaft_s_orbit_is_no_image():
    """A film that is not linear puts every line of a band at X - f and 2X - f again, as slow sampling does."""
    rng, t, speed = np.random.default_rng(4), np.arange(8000) / 2000.0, 97.0
    lines = np.arange(6.1, 70.0, 0.3)
    band = np.cos(2 * np.pi * np.outer(t, lines) + rng.uniform(0, 6, len(lines))).sum(axis=1)
    for order in (1, 2):
        values = band * (1 + 0.1 * np.cos(2 * np.pi * order * speed * t)) + 0.01 * rng.standard_normal(len(t))
        assert slower_channel(values, 2000.0, speed) is None


def test_straight_lines_make_a_sine_smaller_by_sinc_squared():
    assert SlowerChannel(300.0, 2000.0, 2).at(np.array([25.0]))[0] == pytest.approx(np.sinc(25 / 300) ** 2)
    held = SlowerChannel(250.0, 2000.0, 1).at(np.array([25.0]))[0]
    assert np.angle(held) == pytest.approx(-np.pi * 25 * (1 / 250 - 1 / 2000))


def test_a_zero_of_the_cells_is_told_from_a_gain_by_the_loads():
    rng = np.random.default_rng(3)
    loads = np.repeat([2500.0, 5000.0, 8750.0], 6) * -1j
    means = 1.01 * loads * (1 + 0.003 * rng.standard_normal(18)) + (120 - 300j)
    zero, error = cell_zero(means, loads)
    assert abs(zero - (120 - 300j)) < 40
    assert StaticLoads([np.zeros(1, complex)], 1.0, zero, error).conditions(0) == ("cells-not-tared",)
    assert cell_zero(means, loads, uncertainty=5.0) == (0, 0)  # a load that is really off
    assert cell_zero(1.01 * loads * (1 + 0.003 * rng.standard_normal(18)), loads) == (0, 0)
    assert cell_zero(means[:6], loads[:6]) == (0, 0)  # one load


def test_cells_without_static_part_are_no_cells_of_wrong_gain():
    rng = np.random.default_rng(4)
    assert without_static_part(1e-3 * (rng.standard_normal(12) + 1j * rng.standard_normal(12)))
    assert not without_static_part(0.01 * (1 + 0.003 * rng.standard_normal(12)) + 0j)


def test_chance_knows_how_well_covariances_are_known():
    assert chance_of(30.0, 20, (np.inf,) * 3) == pytest.approx(0.0699, abs=1e-3)
    assert chance_of(60.0, 20, (8.0,) * 3) > 100 * chance_of(60.0, 20, (np.inf,) * 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", CONDITIONS)
def test_a_condition_of_the_battery_is_right_or_reported_as_it_should(name):
    (condition,) = (c for c in [*good_rigs(), *good_records(), *bad_data()] if c.name == name)
    assert outcome(condition, 38_000)["word"] == condition.wanted


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """A campaign without a fault."""
    return load_campaign(write_rig(tmp_path_factory.mktemp("quick"), QUICK, setup=SLOW))


@pytest.mark.slow
def test_clocks_slower_cells_and_late_channels_are_named(tmp_path):
    def names(**entries):
        path = write_rig(tmp_path, QUICK, with_entries(channels_of(QUICK), "L1", **entries), SLOW)
        return {str(c) for p in identify(load_campaign(path)).points for c in p.quality}

    assert "clocks-differ" in names(ppm=300.0)
    assert "slower-channels" in names(rate=200.0, fill="linear")
    assert "cells-and-accelerometers-out-of-phase" in names(late=1e-3)


@pytest.mark.slow
def test_plain_is_statsmodels_on_the_r_matrix(quick, tmp_path):
    points = plain_points(quick, PlainSettings(0.5))
    write_r_matrices(tmp_path / "r.h5", points)
    with h5py.File(tmp_path / "r.h5") as file:
        R, f = file["point-000/R"][()], file["point-000/f"][()]
    X = np.block([[R.real, -R.imag], [R.imag, R.real]])[:, [0, 1, 4, 5]]
    rows_x = np.r_[0 : len(f) : 2, len(f) : 2 * len(f) : 2]
    y = np.concatenate([f.real, f.imag])[rows_x]
    scale = 1e8  # of order one, as statsmodels' tolerance is absolute
    own = sm.RLM(y, X[rows_x] * scale, M=sm.robust.norms.HuberT()).fit(maxiter=500, tol=1e-12)
    frame = plain_frame(points, PlainSettings(0.5))
    assert frame["kxx_N_per_m"][0] == pytest.approx(own.params[0] * scale, rel=1e-6)
    assert frame["kxx_N_per_m_se"][0] == pytest.approx(own.bse[0] * scale, rel=1e-4)


@pytest.mark.slow
def test_without_a_fault_nothing_is_named_and_the_budget_is_the_interval(quick):
    result = identify(quick)
    (p,) = result.points
    assert p.quality == ()
    total = np.sum([np.diag(part) for part in p.budget.values()], axis=0)
    whole = np.diag(p.stiffness.covariance) + np.diag(p.stiffness.systematic)
    np.testing.assert_allclose(total, whole, rtol=1e-9)
    assert result.budget_frame().groupby("coefficient")["share"].sum().to_numpy() == pytest.approx(1.0)
