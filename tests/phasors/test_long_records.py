"""Long records: read once, block by block; drives that turn with the shaft, whose runout is told or refused."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.run import pulse_times
from tests.identification.test_identify import rig
from tests.rigs.closed_form import Rig, write_rig
from tests.rigs.held_run import POINT, held_run
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.frequency import shaft_order
from tpjb_ident.phasors.line_fit import BLOCK, LineFitter, even_design
from tpjb_ident.phasors.lines import known_lines, line_design
from tpjb_ident.phasors.run_data import SHORT
from tpjb_ident.phasors.run_phasors import extract, run_phasors

FREQUENCIES = np.array([25.0, 22.0, 44.0, 50.0])


@pytest.fixture(scope="module")
def run(campaign_of):
    timing = {"dynamic_rate": 5000.0, "dynamic_seconds": 8.0}
    path = campaign_of(rig([(5000.0, 25.0)], seed=4, **timing, directions=(0.3,)))
    return load_campaign(path).of_kind("dynamic")[0]


@pytest.mark.parametrize("length", [BLOCK, 2 * BLOCK, 5 * BLOCK + 17, 6 * BLOCK - 1])
@pytest.mark.parametrize("drift", [1, 3])
def test_blocks_are_the_plain_columns(length, drift):
    expected = line_design(np.arange(length) / 1000.0, FREQUENCIES, drift)
    np.testing.assert_allclose(even_design(length, 1000.0, FREQUENCIES, drift), expected, rtol=0, atol=1e-11)


def test_a_kept_file_serves_many_requests_and_lets_go(run):
    reader = run.reader
    with reader.opened():
        parts = [reader.read(["X1A"], i, i + 500)[0] for i in range(0, 5000, 500)]
    np.testing.assert_array_equal(np.concatenate(parts), reader.read(["X1A"], 0, 5000)[0])
    assert reader.opened_members == {}
    with pytest.raises(KeyError, match="mine"), reader.opened():
        raise KeyError("mine")  # no fault of the file
    assert reader.opened_members == {}


@pytest.mark.slow
def test_a_long_run_is_read_once_and_says_the_same():
    """Beyond SHORT samples lines are looked for in the beginning; the shaft is off its set point here."""

    point = replace(POINT, shaft_speed=2 * np.pi * 22.01)
    long = held_run(5, 10_000.0, 40.0, point)
    assert long.length > 2 * SHORT
    once = run_phasors(long)
    # all six channels once, and the beginning for a look
    samples = sum(len(names) * (stop - start) for names, start, stop in long.reader.asked)
    assert samples < 6 * (long.length + SHORT + 2**15)
    plain = extract(long, known_lines((25.0,), 22.0, long.sample_rate))
    size = np.abs(plain.displacement[:, 0]).max()
    np.testing.assert_allclose(once.displacement[:, 0], plain.displacement[:, 0], atol=2e-4 * size)
    assert once.lines.frequencies[1] == pytest.approx(22.0, abs=1e-4)


def test_a_few_outliers_of_a_long_window_are_left_out_as_by_the_robust_fit():
    length = 8192
    fitter = LineFitter(length, 5000.0, FREQUENCIES)
    rng = np.random.default_rng(3)
    time = np.arange(length) / 5000.0
    rows = np.stack([np.cos(2 * np.pi * 25 * time), np.sin(2 * np.pi * 25 * time)]) + 0.01 * rng.standard_normal(
        (2, length)
    )
    spoiled = rows.copy()
    spoiled[0, 4000:4004] += 0.2
    block = fitter.fit(spoiled[:, None], np.zeros(1))
    keep = np.r_[0:3997, 4007:length]
    exact = np.linalg.lstsq(fitter.design[keep], rows[0, keep], rcond=None)[0]
    assert block.lost[0].tolist() == [pytest.approx(10 / length), 0.0]
    assert abs(block.z[0, 0, 0] - (exact[0] + 1j * exact[1])) < 1e-9


SIX = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)
TURNING = Rig(locked=True, runout=0.075, load_scatter=0.0, seconds=2.0, frequencies=(22.0,), directions=SIX)
PULSED = replace(TURNING, keyphasor=True)


def identified(folder, rig):
    (point,) = identify(load_campaign(write_rig(folder, rig, seed=5)), IdentifySettings(methods=())).points
    return point


@pytest.mark.parametrize(("frequency", "order"), [(22.0, 1), (44.05, 2), (66.0, 3), (88.0, 0), (25.0, 0)])
def test_which_line_of_the_shaft_an_excitation_stands_on(frequency, order):
    assert shaft_order(frequency, 22.0) == order
    assert shaft_order(frequency, 0.0) == 0


def test_pulses_tell_times_between_samples():
    t = np.arange(4000) / 2000.0
    turn = (22.3 * t + 0.41) % 1.0
    readings = np.clip(40 * (0.1 - np.abs(turn - 0.5)), 0, 2)
    found = pulse_times(readings, t)
    assert np.allclose(np.diff(found), 1 / 22.3, atol=2e-5)
    assert np.allclose((22.3 * found + 0.41) % 1.0, 0.425, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("order", "keyphasor"), [(1, True), (2, True), (2, False), (3, False)])
def test_runout_is_told_from_motion_by_the_shaft_s_phase(tmp_path, order, keyphasor):
    """Without it kxx would be off by tens of per cent: 6 um of runout beside 2 um of motion."""
    point = identified(tmp_path, replace(TURNING, keyphasor=keyphasor, frequencies=(22.0 * order,)))
    assert "shaft lines fitted" in point.quality
    assert not untrusted(point.quality)
    assert point.n_records == 6
    h = TURNING.film.h(22.0 * order, 5000.0)
    away = point.stiffness.vector - np.concatenate([h.real.ravel(), h.imag.ravel()])
    assert np.abs(away).max() < 0.02 * np.abs(h).max()
    assert np.mean(np.abs(away) <= 1.3 * point.stiffness.half_width()) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "cure"),
    [
        (TURNING, "no keyphasor"),
        (replace(PULSED, directions=(0.0, 90.0)), "3 directions at least"),
        (replace(PULSED, directions=(0.0, 90.0), repeats=2), "half a turn"),
    ],
)
def test_what_cannot_be_told_stays_refused_and_the_message_says_which_test_would(tmp_path, rig, cure):
    point = identified(tmp_path, rig)
    (told,) = [c for c in untrusted(point.quality) if c == "1X on excitation line"]
    assert cure in told.detail
