"""Lines of a run looked at once more: frequency errors, shafts that drift, lines that nobody mentioned."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from tests.phasors.phasor_cases import complex_normal, vector_channels
from tpjb_ident.phasors.frequency import (
    MAX_RETUNED,
    MAX_SLIP,
    MAX_WINDOW_SLIP,
    phase_advance,
    retuned,
    speeds_from_runout,
    tuned,
)
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.lines import known_lines
from tpjb_ident.phasors.run_data import PhasorSettings, RunPhasors
from tpjb_ident.phasors.whole_record import MAX_LINES, MIN_SHARE, REACH, _rounding, fitted_whole, unexpected_lines

RATE, LENGTH, WINDOWS = 1000.0, 0.4, 12
START = LENGTH * np.arange(WINDOWS)
SPAN = WINDOWS * LENGTH
LINES = known_lines((25.0,), 22.0, RATE)
NAMES = ["excitation", *(line.name for line in LINES.nuisance)]
POINT = OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22.0, 2 * math.pi * 25.0)
#: What is asked of a run.
ASKED = SimpleNamespace(sample_rate=RATE, length=round(SPAN * RATE))


def block(turns, size=1.0):
    """Phasors of all lines, each turning as `turns` says of its name [cycles at the windows' starts]."""
    z = size * complex_normal(np.random.default_rng(1), len(NAMES), 2)
    z /= np.linalg.norm(z, axis=1)[:, None] / size
    phase = np.stack([np.broadcast_to(turns.get(name, 0.0), WINDOWS) for name in NAMES], axis=1)
    return z * np.exp(2j * math.pi * phase)[:, :, None]


def run_of(force=None, displacement=None, noise=1e-3):
    z = np.concatenate([block(displacement or {}), block(force or {}, 100.0)], axis=2)
    return in_channels(z, np.full((WINDOWS, 4), noise), START, LENGTH)


def in_channels(z, scale, start, length):
    """A run of probes and cells along X and Y."""
    none, described = np.zeros(scale.shape), vector_channels(("displacement", "force"))
    return RunPhasors("r", POINT, 0.0, LINES, start, length, described, z, none, scale, none, 30.0, sample_rate=RATE)


def frequency_slip(phasors, start, noise):
    advance = phase_advance(phasors, start, noise)
    return 0.0 if advance is None else advance.slip


def test_a_frequency_error_is_the_advance_of_the_phase():
    """At any spacing of the windows, with windows missing, either way; two windows tell nothing."""
    t = np.cumsum(np.random.default_rng(2).uniform(0.2, 0.6, 9))
    z = np.array([1.0 + 1j, 0.3])
    for slip in (0.013, -0.4):
        phasors = z * np.exp(2j * math.pi * slip * t)[:, None]
        assert frequency_slip(phasors, t, 1e-9) == pytest.approx(slip, rel=1e-9)
        phasors[4, 1] = np.nan
        assert frequency_slip(phasors, t, 1e-9) == pytest.approx(slip, rel=1e-9)
        assert frequency_slip(phasors[:3], t[:3], 1e-9) == pytest.approx(slip, rel=1e-9)
        assert frequency_slip(phasors[:2], t[:2], 1e-9) == 0.0
    # a single window that is off does not matter
    phasors[6] *= np.exp(1.0j)
    assert frequency_slip(phasors, t, 1e-9) == pytest.approx(-0.4, rel=1e-9)


@pytest.mark.parametrize(("ratio", "told"), [(9.5, False), (10.5, True)])
def test_a_line_of_ten_times_its_noise_tells_its_frequency(ratio, told):
    phasors = np.array([3.0, 4.0j]) * np.exp(2j * math.pi * 0.01 * START)[:, None]
    assert (frequency_slip(phasors, START, 5.0 / ratio) != 0.0) is told


@pytest.mark.parametrize(("errors", "told"), [(3.8, False), (4.2, True)])
def test_a_slip_is_believed_beyond_four_standard_errors_of_its_median(errors, told):
    spread, steps = 1e-3, 12
    slip = errors * 1.4826 * spread / math.sqrt(steps)
    phase = np.cumsum(np.r_[0.0, slip + spread * np.resize([-1.0, 0.0, 1.0], steps)])
    found = frequency_slip(np.exp(2j * math.pi * phase)[:, None] * [1.0, 1.0], np.arange(13.0), 1e-9)
    assert found == pytest.approx(slip if told else 0.0, rel=1e-6)


def test_phasors_are_turned_to_other_frequencies_as_a_new_fit_would():
    t = np.arange(round(SPAN * RATE)) / RATE
    true = known_lines((25.008,), 22.0, RATE)
    wave = np.outer([2.0, -1.0], np.cos(2 * math.pi * 25.008 * t + 0.4))
    rows = wave.reshape(2, WINDOWS, -1)
    rows = np.concatenate([rows, rows])
    fits = [LineFitter(400, RATE, lines.frequencies).fit(rows, START) for lines in (LINES, true)]
    run = in_channels(fits[0].z, fits[0].scale, START, LENGTH)
    corrected = retuned(run, true)
    assert np.abs(fits[0].z - fits[1].z)[:, 0].max() > 0.1
    np.testing.assert_allclose(corrected.z[:, 0], fits[1].z[:, 0], atol=2e-3)
    np.testing.assert_array_equal(corrected.z[:, 1], fits[0].z[:, 1])
    assert corrected.lines is true
    for share, done in ((0.99, True), (1.01, False), (-1.01, False)):
        other = known_lines((25.0 + share * MAX_RETUNED / LENGTH,), 22.0, RATE)
        assert (retuned(run, other) is not None) is done
    assert retuned(run, known_lines((25.0,), 22.0, RATE, extra=(33.0,))) is None


def test_a_run_that_fits_needs_no_second_look():
    assert tuned(ASKED, run_of(), (25.0,), PhasorSettings()) is None
    # a slip of a hundredth of a turn over the whole run is borne, and five hundredths of the shaft's
    turning = {"excitation": 0.99 * MAX_SLIP / SPAN * START, "1X": 4.9 * MAX_SLIP / SPAN * START}
    calm = run_of(turning, turning)
    assert tuned(ASKED, calm, (25.0,), PhasorSettings()) is None


def test_a_second_fit_takes_the_frequencies_that_the_phases_show():
    slip = 1.05 * MAX_SLIP / SPAN
    turning = {"excitation": slip * START}
    found = tuned(ASKED, run_of(turning, turning), (25.0,), PhasorSettings())
    assert found.lines.excitation[0].frequency == pytest.approx(25.0 + slip, abs=1e-9)
    assert found.lines.speed == 22.0
    assert found.follow is None
    assert found.conditions == ("excitation off set point",)
    assert "excitation found at 25.002 Hz, set point 25 Hz" in found.conditions[0].detail
    turning_shaft = {"1X": -5.1 * MAX_SLIP / SPAN * START}
    shaft = tuned(ASKED, run_of(turning_shaft, turning_shaft), (25.0,), PhasorSettings())
    assert shaft.lines.speed == pytest.approx(22.0 - 5.1 * MAX_SLIP / SPAN, abs=1e-9)
    assert shaft.lines.excitation[0].frequency == 25.0
    assert shaft.conditions == ()
    # what an earlier round has put right stays so
    later = replace(run_of(turning_shaft, turning_shaft), lines=known_lines((25.0,), 22.05, RATE))
    speed = tuned(ASKED, later, (25.0,), PhasorSettings()).lines.speed
    assert speed == pytest.approx(22.05 - 5.1 * MAX_SLIP / SPAN, abs=1e-9)
    # lines that were found before are fitted along again
    extra = known_lines((25.0,), 22.0, RATE, extra=(71.5,))
    wide = run_of(turning, turning)
    more = np.pad(wide.z, ((0, 0), (0, 1), (0, 0)))
    again = tuned(ASKED, replace(wide, lines=extra, z=more), (25.0,), PhasorSettings())
    assert [line.frequency for line in again.lines.nuisance if line.name == "found"] == [71.5]


def bent(rate):
    """Cycles that a shaft is ahead whose speed changes evenly, by `rate` [Hz/s], through the middle of a run."""
    middle = 0.5 * START[-1]
    return 0.5 * rate * (START - middle) ** 2


def test_a_shaft_that_changes_its_speed_is_followed_by_its_runout():
    rate = 0.01
    speeds, doubt = speeds_from_runout(run_of({}, {"1X": bent(rate)}))
    true = 22.0 + rate * (START - 0.5 * START[-1])
    np.testing.assert_allclose(speeds[1:-1], true[1:-1], atol=1e-9)
    np.testing.assert_allclose(speeds[[0, -1]], true[[0, -1]] + [rate * LENGTH / 2, -rate * LENGTH / 2], atol=1e-9)
    # error of a phasor component over its size, in radians, over the time between windows
    assert doubt == pytest.approx(1e-3 / math.sqrt(LENGTH * RATE) / (2 * math.pi * LENGTH))
    gap = run_of({}, {"1X": bent(rate)})
    gap.z[5] = np.nan
    holed, _ = speeds_from_runout(gap)
    assert np.flatnonzero(np.isnan(holed)).tolist() == [5]
    np.testing.assert_allclose(np.delete(holed, [0, 4, 5, 6, 11]), np.delete(true, [0, 4, 5, 6, 11]), atol=1e-9)


@pytest.mark.parametrize(("noise", "told"), [(1.9, True), (2.1, False)])
def test_a_runout_below_ten_times_its_noise_tells_no_speed(noise, told):
    one = run_of({}, {}, noise=noise)
    assert (speeds_from_runout(one) is not None) is told


def test_where_there_is_no_runout_line_nothing_is_followed():
    coincident = known_lines((22.0,), 22.0, RATE)
    few = replace(run_of(), lines=coincident)
    assert speeds_from_runout(few) is None
    short = run_of()
    short.z[2:] = np.nan
    assert speeds_from_runout(short) is None
    assert tuned(ASKED, few, (22.0,), PhasorSettings()) is None


@pytest.mark.parametrize(("share", "followed"), [(0.95, False), (1.05, True)])
@pytest.mark.parametrize("noise", [1e-3, 0.5])
def test_a_drift_counts_once_it_turns_a_window_or_is_clear_of_the_noise(share, followed, noise):
    doubt = noise / math.sqrt(LENGTH * RATE) / (2 * math.pi * LENGTH)
    limit = max(MAX_WINDOW_SLIP / LENGTH, 4 * doubt)
    assert (limit > MAX_WINDOW_SLIP / LENGTH) is (noise > 0.1)
    rate = share * 2 * limit / (START[-2] - START[0])  # the ends are half a window short on either side
    given = run_of({}, {"1X": bent(rate)}, noise=noise)
    found = tuned(ASKED, given, (25.0,), PhasorSettings())
    assert (found is not None and found.follow is not None) is followed
    assert not followed or "shaft speed between 2" in found.conditions[-1].detail


N = 4096
NONE = np.empty(0)
TIME = np.arange(N) / RATE


def heard(force=(), displacement=(), noise=1e-4):
    """Excitation of unit size, runout and mains known; `force` and `displacement` list (frequency, amplitude)."""
    rng = np.random.default_rng(3)
    known = np.cos(2 * math.pi * 25 * TIME + 0.3) + 0.4 * np.cos(2 * math.pi * 22 * TIME)
    rows = []
    for lines in (force, displacement):
        wave = known + sum(a * np.cos(2 * math.pi * f * TIME + f) for f, a in lines)
        values = np.stack([wave, 0.6 * wave], axis=1)
        rows.append(values + 3.0 * TIME[:, None] + 700.0 + noise * rng.standard_normal((N, 2)))
    force, displacement = rows
    return np.concatenate([displacement.T, force.T])


def fitted(rows):
    """The record in one fit, and as a run of one window."""
    frequencies = np.array([line.frequency for line in LINES.whole])
    record = fitted_whole(rows, 0.0, RATE, LINES, frequencies, [0, 1, 2, 3])
    windows = record.z[None, : len(LINES.frequencies)]
    return (record,), in_channels(windows, np.full((1, 4), 1e-3), np.zeros(1), N / RATE)


def lines_in(*args, **keywords):
    return unexpected_lines(*fitted(heard(*args, **keywords)), NONE)


def test_lines_that_nobody_mentioned_are_found_in_either_quantity():
    assert lines_in() == ((), ())
    extra, conditions = lines_in([(71.33, 0.05)], [(33.71, 0.02), (71.33, 0.05)])
    np.testing.assert_allclose(extra, [33.71, 71.33], atol=0.01)
    assert conditions == ("unexpected lines",)
    assert "lines at 33.71, 71.33 Hz; fitted along" in conditions[0].detail


@pytest.mark.parametrize(("frequency", "found"), [(98.0, True), (102.0, False), (26.5, True), (25.7, False)])
def test_lines_are_looked_for_up_to_four_times_the_excitation_and_beside_known_ones(frequency, found):
    """Within four bins of a known line is its own window's lobe."""
    assert REACH * 25.0 == 100.0
    extra, _ = lines_in([(frequency, 0.05)])
    assert [round(f, 1) for f in extra] == ([frequency] if found else [])


@pytest.mark.parametrize(("share", "found"), [(0.85, False), (1.25, True)])
def test_a_line_too_small_to_bend_the_excitation_does_not_matter(share, found):
    extra, _ = lines_in([(61.037, share * MIN_SHARE)], noise=1e-6)
    assert (len(extra) == 1) is found


def test_glitches_and_slow_movements_hide_no_line_and_make_none():
    rows = heard([(61.3, 0.02)])
    rows[:, 1000:1003] += 5.0
    rows += 2.0 * (TIME - 1.5) ** 3
    extra, _ = unexpected_lines(*fitted(rows), NONE)
    np.testing.assert_allclose(extra, [61.3], atol=0.02)
    rows[2, 17] = np.nan
    rows[:2] += 0.1 * np.cos(2 * math.pi * 36.4 * TIME)
    np.testing.assert_allclose(unexpected_lines(*fitted(rows), NONE)[0], [36.4, 61.3], atol=0.02)
    record, result = fitted(heard([], [(61.3, 0.02)]))
    empty = replace(result, z=result.z * np.array([np.nan, np.nan, 1.0, 1.0]))
    assert unexpected_lines(record, empty, NONE) == ((), ())


def test_a_second_harmonic_on_the_excitation_is_told():
    extra, conditions = lines_in([(12.5, 0.05), (80.0, 0.05)])
    assert len(extra) == 2
    assert conditions == ("unexpected lines", "harmonic on excitation line")
    assert "the line at 12.5 Hz" in conditions[1].detail
    assert lines_in([(12.6, 0.05)])[1] == ("unexpected lines",)


def test_no_more_lines_are_taken_than_can_be_fitted_the_lowest_first():
    many = [(f, 0.05) for f in (29.1, 33.3, 36.2, 39.9, 46.7, 54.0, 57.3, 61.9, 64.4, 70.3, 77.7, 83.2)]
    extra, _ = lines_in(many)
    assert len(extra) == MAX_LINES == 10
    np.testing.assert_allclose(extra, [f for f, _ in many][:10], atol=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2])
def test_steps_put_no_more_on_a_harmonic_than_they_can(noise):
    """Of a sine of a few steps, whose own roundings are no noise that would dither it."""
    rng, time = np.random.default_rng(9), np.arange(8000) / 2000.0
    rows = np.array([size * np.sin(2 * np.pi * 20.0 * time) for size in (2.0, 3.0, 4.0, 5.0, 6.0)])
    rows = np.round(rows + noise * rng.standard_normal(rows.shape))
    third = np.abs(rows @ np.exp(-2j * np.pi * 60.0 * time)) * 2 / len(time)
    most = np.sqrt(_rounding(rows))
    assert (third < 1.5 * most).all()
    assert (most < 0.2).all()
    assert (_rounding(np.round(rows + 0.6 * rng.standard_normal(rows.shape))) < 1e-4).all()


def test_faint_lines_that_stood_out_stay_where_the_drive_is_off_its_set_point():
    """The third harmonic of the shaft 1.9 Hz beside a drive: without it every window's phasor beats."""
    lines = known_lines((80.0,), 27.3, RATE, extra=(33.0, 81.9), duration=4.0)
    again = known_lines((80.003,), 27.3, RATE, extra=lines.found, duration=4.0)
    assert [line.name for line in again.nuisance] == [line.name for line in lines.nuisance]
    assert again.place("3X") is not None
