"""Records that rigs really give: bad samples, a line beside the drive, a late or switched drive, channels apart; long
ones are read once, block by block; drives that turn with the shaft, whose runout is told or refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.calibration import ChannelResponse, parse_filter
from rigdata.device import Device
from rigdata.run import pulse_times
from tests.identification.test_identify import rig
from tests.rigs.closed_form import Rig, write_rig
from tests.rigs.held_run import POINT, HeldReader, channels, held_run, run_of
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.frequency import DRIFT, shaft_order
from tpjb_ident.phasors.line_fit import BLOCK, LineFitter, even_design
from tpjb_ident.phasors.lines import known_lines, line_design
from tpjb_ident.phasors.run_data import SHORT
from tpjb_ident.phasors.run_phasors import extract, run_phasors

RATE, SECONDS = 2000.0, 4.0
TIME = np.arange(round(RATE * SECONDS)) / RATE
QUANTITIES = ("displacement", "force", "acceleration")
#: Phasors of the excitation by channel, noise of a sample, runout or unbalance.
Z = {"DX": 2e-6 + 1e-6j, "DY": -1e-6 + 2e-6j, "FX": 300.0 + 40.0j, "FY": 200.0j - 100.0, "AX": 0.4j, "AY": 0.2 - 0.1j}
NOISE = {"D": 4e-8, "F": 3.0, "A": 0.02}
TURNING = {"D": 3e-6, "F": 20.0, "A": 0.0}
ALL = tuple(Z)


def reading(name, time, rng, drive=25.0, level=1.0, shaft=22.0):
    """Samples of a channel at its own times."""
    kind = name[0]
    wave = np.real(level * Z[name] * np.exp(2j * np.pi * drive * time))
    wave += TURNING[kind] * np.cos(2 * np.pi * shaft * time + (name[1] == "Y"))
    return wave + (700.0 if kind == "F" else 0.0) + NOISE[kind] * rng.standard_normal(len(time))


def record(seed=1, time=TIME, **drive):
    rng = np.random.default_rng(seed)
    return {name: reading(name, time, rng, **drive) for name in ALL}


def phasors_of(data, point=POINT):
    return run_phasors(run_of(HeldReader(data, RATE), channels(QUANTITIES), point))


def error(result, expected=Z, windows=None):
    """Largest error of the mean phasors, over the largest of the quantity."""
    z = result.z[:, 0] if windows is None else result.z[windows, 0]
    mean = {c.name: np.nanmean(z[:, k]) for k, c in enumerate(result.channels)}
    size = {kind: max(abs(v) for n, v in Z.items() if n[0] == kind) for kind in "DFA"}
    return max(abs(mean[name] - expected[name]) / size[name[0]] for name in ALL if name[0] != "A")


def test_channels_stand_in_order_and_make_the_vectors():
    result = phasors_of(record())
    assert [c.name for c in result.channels] == list(ALL)
    assert result.device == ("",) * 6
    assert error(result) < 1e-3
    np.testing.assert_allclose(result.displacement, result.z[:, :, :2])
    np.testing.assert_allclose(result.force[:, 0], result.z[:, 0, 2:4] + 30.0 * result.z[:, 0, 4:])
    # phasors of the whole record, with the film's own lines, and the noise beside the excitation
    of_shaft = [f"{n}X" for n in range(3, 11)]
    assert [line.name for line in result.lines.faint] == [*of_shaft, "harmonic 3", "2X-f", "2f-X"]
    assert result.record.shape == (len(result.lines.whole), 6)
    assert np.abs(result.record[0, :4] / np.array([Z[n] for n in ALL[:4]]) - 1).max() < 3e-3
    beside = result.residual[0]
    variance = np.mean(np.abs(beside) ** 2, axis=0)
    expected = np.array([4 * NOISE[n[0]] ** 2 / len(TIME) for n in ALL])
    assert (variance / expected).min() > 0.4
    assert (variance / expected).max() < 2.0


# a strong one's beat looks like a drive off its set point, and like a shaft that changes its speed
@pytest.mark.parametrize(
    ("distance", "share"), [(0.4, 0.12), (-0.3, 0.12), (0.8, 0.12), (-0.35, 0.8), (0.6, 0.9), (0.235, 0.5)]
)
def test_a_line_beside_the_drive_is_found_and_fitted_along(distance, share):
    data = record()
    for name in ("FX", "FY", "DX", "DY"):
        other = share * abs(Z[name]) * np.cos(2 * np.pi * (25.0 + distance) * TIME + 0.7)
        data[name] = data[name] + other
    result = phasors_of(data)
    assert error(result) < 2e-3
    assert "unexpected lines" in result.conditions
    found = [line.frequency for line in result.lines.nuisance if line.name == "found"]
    assert found == [pytest.approx(25.0 + distance, abs=0.01)]
    assert result.lines.driven == pytest.approx((25.0,), abs=0.01)
    assert not {"excitation off set point", DRIFT} & {str(condition) for condition in result.conditions}


@pytest.mark.parametrize("off", [0.1, 0.4, 1.5])
def test_a_drive_off_its_set_point_is_one_line_and_turns_no_shaft(off):
    result = phasors_of(record(drive=25.0 + off))
    assert error(result) < 1e-2  # a hundredth of a turn is no error of the frequency; all channels share it
    assert result.lines.driven == pytest.approx((25.0 + off,), abs=2e-3)
    assert {str(condition) for condition in result.conditions} == {"excitation off set point"}


SLOW_CHANGES = [1 + 0.1 * TIME / SECONDS, 1 + 0.03 * np.cos(2 * np.pi * 0.4 * TIME)]
SLOW_CHANGES += [np.exp(growth * TIME / SECONDS) for growth in (-4.0, -1.5, 1.8)]


# a decay looks like two lines on one another, which no window of whatever length tells apart
@pytest.mark.parametrize("level", SLOW_CHANGES)
def test_a_drive_that_grows_or_decays_or_wanders_is_no_second_line(level):
    result = phasors_of(record(level=level))
    assert "unexpected lines" not in result.conditions
    assert "found" not in [line.name for line in result.lines.nuisance]
    good = result.z[np.isfinite(result.z[:, 0]).all(axis=1), 0]
    assert len(good) >= 10
    assert np.median(good[:, 0] / good[:, 2]) == pytest.approx(Z["DX"] / Z["FX"], rel=0.02)


def test_a_shaft_at_twice_the_excitation_is_the_shafts():
    point = replace(POINT, shaft_speed=2 * np.pi * 50.1)
    result = phasors_of(record(shaft=50.1), point)
    assert [line.name for line in result.lines.nuisance].count("harmonic 2") == 0
    assert error(result) < 1e-3


class ApartReader(HeldReader):
    """Cells (and what else is named) at times of their own beside the probes."""

    def __init__(self, data, times, rate, letter=""):
        super().__init__(data, RATE)
        self.times, self.slow_rate, self.letter = times, rate, letter
        self.slow = tuple(name for name in data if len(data[name]) != len(TIME))

    def devices(self):
        own = tuple(name for name in self.data if name not in self.slow)
        apart = Device("B", self.slow, self.slow_rate, len(self.data[self.slow[0]]), self.times is None)
        return Device("", own, RATE, len(TIME), True), apart

    def apart(self):
        return frozenset(self.slow)

    def length(self):
        return len(TIME)

    def read(self, names, start, stop):
        assert not set(names) & set(self.slow), "nothing is interpolated"
        return super().read(names, start, stop)

    def read_device(self, names, start, stop):
        return [self.data[name][start:stop] for name in names]

    def device_time(self, name, start, stop):
        return self.times[start:stop]


@pytest.mark.parametrize("rate", [150.0, 300.0, 500.0])
@pytest.mark.parametrize("stamped", [True, False])
def test_cells_at_a_rate_of_their_own_are_fitted_at_their_own_times(rate, stamped):
    rng = np.random.default_rng(2)
    times = np.arange(round(rate * SECONDS)) / rate + (0.0013 if stamped else 0.0)
    data = {n: reading(n, times if n[0] == "F" else TIME, rng) for n in ALL}
    result = run_phasors(run_of(ApartReader(data, times if stamped else None, rate), channels(QUANTITIES)))
    assert result.device == ("", "", "B", "B", "", "")
    assert error(result) < 2e-3
    # 25 Hz again and again, error of a probes' phasor: 1e-4, of the cells at 150 Hz 1e-3
    assert not {"clocks-differ", "slower-channels"} & {str(c) for c in result.conditions}
    beside = result.residual[0]
    variance = np.mean(np.abs(beside[:, 2:4]) ** 2, axis=0)
    assert variance == pytest.approx(4 * NOISE["F"] ** 2 / len(times), rel=0.7)
    assert np.isfinite(result.record[0]).all()


def test_a_third_device_of_the_firsts_rate_is_cut_as_the_first(monkeypatch):
    times = np.arange(round(300.0 * SECONDS)) / 300.0
    rng = np.random.default_rng(2)
    data = {n: reading(n, times if n[0] == "F" else TIME, rng) for n in ALL}
    reader = ApartReader(data, None, 300.0)
    run = run_of(reader, channels(QUANTITIES))
    two = run_phasors(run)
    first, second = reader.devices()
    three = replace(first, channels=("DX", "DY")), second, replace(first, name="C", channels=("AX", "AY"))
    monkeypatch.setattr(reader, "devices", lambda: three)
    apart = run_phasors(run)
    assert apart.device == ("", "", "B", "B", "C", "C")
    np.testing.assert_allclose(apart.z[:, 0], two.z[:, 0], rtol=1e-9)


def test_a_device_that_ends_early_leaves_its_last_windows_empty():
    rng = np.random.default_rng(2)
    times = np.arange(round(300.0 * 3.0)) / 300.0
    data = {n: reading(n, times if n[0] == "F" else TIME, rng) for n in ALL}
    result = run_phasors(run_of(ApartReader(data, times, 300.0), channels(QUANTITIES)))
    late = result.start + result.length > 3.0
    assert np.isnan(result.z[late][:, :, 2:4]).all()
    assert np.isfinite(result.z[late][:, 0, :2]).all()
    assert error(result) < 2e-3


def filled(values, times, held, step=0.0, missing=0):
    """What a logger program makes of readings at their own times, on the export's."""
    if held:
        written = values[np.clip(np.searchsorted(times, TIME + 1e-9, side="right") - 1, 0, None)]
    else:
        written = np.interp(TIME, times, values)
    written = np.round(written / step) * step if step else written
    written[np.linspace(500, 7000, missing).astype(int)] = np.nan
    return written


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "drive", "held"),
    [(200.0, 25.0, True), (250.0, 25.0, True), (400.0, 45.0, True), (500.0, 45.0, True), (150.0, 25.0, False),
     (300.0, 25.0, False), (300.0, 45.0, False), (400.0, 45.0, False), (500.0, 45.0, False)],
)  # fmt: skip
def test_cells_filled_up_by_the_export_are_told_by_their_images(rate, drive, held):
    """Rounded after the filling, with readings missing."""
    rng = np.random.default_rng(3)
    data = record(drive=drive)
    times = np.arange(-2, round(rate * SECONDS) + 4) / rate
    for name in ("FX", "FY"):
        data[name] = filled(reading(name, times, rng, drive=drive), times, held, 0.5, 3)
    result = phasors_of(data, replace(POINT, excitation=2 * np.pi * drive))
    assert "slower-channels" in result.conditions
    assert result.device[2:4] == (f"{rate:g} Hz",) * 2
    assert error(result) < 2e-3
    assert "unexpected lines" not in result.conditions


def test_plain_channels_are_not_filled():
    for step in (0.0, 0.5, 20.0):
        data = record()
        for name in ("FX", "FY"):
            data[name] = np.round(data[name] / step) * step if step else data[name]
        assert "slower-channels" not in phasors_of(data).conditions


@pytest.mark.parametrize("level", [1.0, 0.01])
@pytest.mark.parametrize("line", [22.0, 50.0])
def test_orders_of_shaft_and_mains_are_no_images(line, level):
    """Sizes of scratches and of a rectifier go as 1 / order: five and seven stand as images of a rate of six would."""
    data = record(level=level)
    for name in ("DX", "DY", "FX", "FY"):
        for k in (1, 2, 3, 5, 7):
            size = (2.0 if k == 1 and line == 22.0 else 3.0) * TURNING[name[0]] / k
            data[name] = data[name] + size * np.cos(2 * np.pi * k * line * TIME + k + (name[1] == "Y"))
    result = phasors_of(data)
    assert "slower-channels" not in result.conditions
    assert level < 1.0 or error(result) < 0.01  # what windows take of lines four times above the drive, no filling


def shaped(values, response):
    """Samples through a response of frequency [Hz]."""
    return np.fft.irfft(np.fft.rfft(values) * response(np.fft.rfftfreq(len(values), 1 / RATE)), len(values))


def low_pass(corner, order=2):
    return lambda f: 1 / np.sqrt(1 + (f / corner) ** (2 * order))


FILTERS = {f"{corner:g} Hz, order {order}": low_pass(corner, order) for corner in (45.0, 150.0) for order in (2, 4)}
#: Noise that machines make.
COLOURS = {
    "white": np.ones_like,
    "1/f": lambda f: np.sqrt(100.0 / np.maximum(f, 1.0)),
    "1/f^2": lambda f: 30.0 / np.maximum(f, 0.3),
    "resonance": lambda f: np.abs(1 / (1 - (f / 150.0) ** 2 + 0.1j * f / 150.0)),
}


def with_noise(shape, seed, channels_shaped, drive=25.0):
    rng, data = np.random.default_rng(seed), {}
    for name in ALL:
        plain = reading(name, TIME, SimpleNamespace(standard_normal=np.zeros), drive)
        noise = rng.standard_normal(len(TIME))
        data[name] = plain + NOISE[name[0]] * (shaped(noise, shape) if name[0] in channels_shaped else noise)
    return data


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_that_nobody_states_is_told_by_the_noise(name):
    said = [phasors_of(with_noise(FILTERS[name], seed, "F")).conditions for seed in range(6)]
    assert sum("filter-unstated" in conditions for conditions in said) >= 4
    assert "the noise of FX, FY falls" in next(c.detail for cs in said for c in cs if c == "filter-unstated")
    assert "filter-unstated" not in phasors_of(with_noise(FILTERS[name], 7, "DFA")).conditions


def test_a_filter_that_is_stated_or_far_above_is_no_error():
    data, stated = with_noise(low_pass(150.0), 1, "F"), channels(QUANTITIES)
    for name in ("FX", "FY"):
        stated[name] = replace(stated[name], response=ChannelResponse((parse_filter("butterworth 2 low 150 Hz"),)))
    assert "filter-unstated" in phasors_of(data).conditions
    assert not untrusted(run_phasors(run_of(HeldReader(data, RATE), stated, POINT)).conditions)
    slow = phasors_of(with_noise(low_pass(500.0, 4), 1, "F", drive=3.0), replace(POINT, excitation=2 * np.pi * 3.0))
    assert "filter-above-excitation" in slow.conditions
    assert not untrusted(slow.conditions)


@pytest.mark.parametrize("colour", COLOURS)
def test_coloured_noise_is_no_filter(colour):
    for seed in range(8):
        for kinds in ("F", "D", "FA"):
            conditions = phasors_of(with_noise(COLOURS[colour], seed, kinds)).conditions
            assert not {"filter-unstated", "filter-above-excitation"} & {str(c) for c in conditions}


def test_a_housing_that_is_shaken_on_soft_cells_is_no_filter():
    """Its springs pass on what is below their resonance, damped by the film; accelerometers show the rest."""
    for seed in range(6):
        cells = with_noise(low_pass(100.0), seed, "F")
        shaken = with_noise(lambda f: 1 + (f / 50.0) ** 2 * low_pass(100.0)(f), seed, "A")
        conditions = phasors_of(cells | {name: shaken[name] for name in ("AX", "AY")}).conditions
        assert not {"filter-unstated", "filter-above-excitation"} & {str(c) for c in conditions}


@pytest.mark.parametrize(("begin", "end"), [(1.3, 4.0), (0.0, 2.45), (0.9, 3.3)])
def test_windows_without_drive_are_none(begin, end):
    """A drive that starts late, or stops: its windows alone count, and the whole record is that stretch."""
    result = phasors_of(record(level=((begin <= TIME) & (end > TIME)).astype(float)))
    assert result.span[0] == pytest.approx(begin, abs=0.5)
    assert result.span[1] == pytest.approx(end, abs=0.5)
    driven = np.isfinite(result.z[:, 0, 0])
    # what little of a window has no drive counts as bad samples of it
    assert (result.start[driven] >= begin - 0.05).all()
    assert (result.start[driven] + result.length <= end + 0.05).all()
    assert error(result) < 2e-3
    assert np.abs(result.record[0, :4] / np.array([Z[n] for n in ALL[:4]]) - 1).max() < 5e-3
    assert not result.conditions


def test_few_long_windows_tell_a_drive_that_starts_late():
    """One hertz beside the shaft's line, windows are long and few."""
    point = replace(POINT, excitation=2 * np.pi * 23.0)
    result = phasors_of(record(drive=23.0, level=(TIME >= 0.4 * SECONDS).astype(float)), point)
    driven = np.isfinite(result.z[:, 0, 0])
    assert 2 <= driven.sum() <= 4
    assert (result.start[driven] >= 0.4 * SECONDS - 0.1).all()
    assert error(result) < 3e-3


def test_a_drive_that_is_switched_over_gives_its_longest_stretch():
    """From one direction to the other after 2.2 s: both channels of a quantity change."""
    data = record()
    after = record(seed=2)
    swapped = {"DX": "DY", "DY": "DX", "FX": "FY", "FY": "FX", "AX": "AY", "AY": "AX"}
    for name in ALL:
        data[name] = np.where(TIME < 2.2, data[name], after[swapped[name]])
    result = phasors_of(data)
    assert result.span == (0.0, pytest.approx(2.2, abs=0.3))
    assert error(result) < 2e-3


@pytest.mark.parametrize("restart", [2.1, 2.7])
def test_a_drive_that_pauses_and_goes_on_with_another_phase_gives_its_longest_stretch(restart):
    """What stands idle between them belongs to neither side of the change."""
    level = np.where(TIME < 1.6, 1.0, np.where(restart > TIME, 0.0, -1.0))
    result = phasors_of(record(level=level))
    first = restart > 2.4
    assert result.span == (
        pytest.approx(0.0 if first else restart, abs=0.3),
        pytest.approx(1.6 if first else 4.0, abs=0.3),
    )
    assert error(result, Z if first else {name: -z for name, z in Z.items()}) < 2e-3


def test_a_channel_that_fails_for_a_while_is_no_change_of_the_drive():
    data = record()
    data["DX"] = data["DX"] + np.where(TIME > 2.0, 3e-6 * np.cos(2 * np.pi * 25 * TIME), 0.0)
    assert phasors_of(data).span is None
    assert phasors_of(record(level=1 + 0.3 * TIME / SECONDS)).span is None


def test_lines_that_drift_make_no_channel_slower():
    turns = 22.0 * TIME + 0.5 * 0.15 * (TIME - 2.0) ** 2
    data = record()
    for name in ("DX", "DY", "FX", "FY"):
        size = TURNING[name[0]]
        data[name] = data[name] + size * (np.cos(2 * np.pi * turns) + 0.5 * np.cos(4 * np.pi * turns))
    assert "slower-channels" not in phasors_of(data).conditions


@pytest.mark.parametrize("ppm", [0.0, 300.0, -300.0])
def test_a_device_whose_clock_runs_off_is_fitted_at_its_own_frequencies(ppm):
    """2X stands 1 Hz beside the drive, and would take up what lines of a wrong frequency leave in the windows."""
    rng, off, short = np.random.default_rng(3), 1 + 1e-6 * ppm, TIME[:-10]
    data = {n: reading(n, TIME if n[0] == "D" else off * short, rng, 45.0, shaft=44.0) for n in ALL}
    point = replace(POINT, excitation=2 * np.pi * 45.0)
    phasors = run_phasors(run_of(ApartReader(data, None, RATE), channels(QUANTITIES), point))
    middle = phasors.start + 0.5 * phasors.length
    for k, channel in enumerate(phasors.channels):
        fast = 1.0 if channel.name[0] == "D" else off
        true = Z[channel.name] * np.exp(2j * np.pi * (45.0 * fast - phasors.lines.frequencies[0]) * middle)
        assert abs(np.nanmean(phasors.z[:, 0, k] / true) - 1) < 3e-3


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
LOCKED = Rig(locked=True, runout=0.075, load_scatter=0.0, seconds=2.0, frequencies=(22.0,), directions=SIX)
PULSED = replace(LOCKED, keyphasor=True)


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
@pytest.mark.parametrize(
    ("order", "keyphasor", "beat"), [(1, True, 0.0), (2, True, 0.0), (2, False, 0.0), (3, False, 0.0), (2, True, 0.1)]
)
def test_runout_is_told_from_motion_by_the_shaft_s_phase(tmp_path, order, keyphasor, beat):
    """Without it kxx would be off by tens of per cent: 6 um of runout beside 2 um of motion.

    A drive that is not locked to the shaft beats with it, over less than a cycle in a record.
    """
    turned = replace(LOCKED, keyphasor=keyphasor, frequencies=(22.0 * order + beat,))
    point = identified(tmp_path, replace(turned, runout=0.02) if beat else turned)
    assert "shaft lines fitted" in point.quality
    assert not untrusted(point.quality)
    assert point.n_records == 6
    h = LOCKED.film.h(22.0 * order, 5000.0)
    away = point.stiffness.vector - np.concatenate([h.real.ravel(), h.imag.ravel()])
    assert np.abs(away).max() < 0.02 * np.abs(h).max()
    assert np.mean(np.abs(away) <= 1.3 * point.stiffness.half_width()) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "cure"),
    [
        (LOCKED, "no keyphasor"),
        (replace(PULSED, directions=(0.0, 90.0)), "3 directions at least"),
        (replace(PULSED, directions=(0.0, 90.0), repeats=2), "half a turn"),
    ],
)
def test_what_cannot_be_told_stays_refused_and_the_message_says_which_test_would(tmp_path, rig, cure):
    point = identified(tmp_path, rig)
    (told,) = [c for c in untrusted(point.quality) if c == "1X on excitation line"]
    assert cure in told.detail


@pytest.mark.parametrize(
    ("shape", "alone", "expected"),
    [
        (lambda f: low_pass(60.0)(f), False, ""),  # a mass under forces of all frequencies
        (lambda f: low_pass(60.0, 1)(f) * low_pass(120.0, 4)(f), False, "DX, DY"),
        (lambda f: low_pass(60.0, 1)(f) * low_pass(120.0, 4)(f), True, "DX"),
        (lambda f: low_pass(60.0)(f) * np.sinc(f / 95.0), False, "DX, DY"),  # means of 21 readings
    ],
    ids=["a mass", "filters of both probes", "a filter of one", "means"],
)
def test_beside_other_coloured_noise_a_filter_falls_faster_than_a_mass(shape, alone, expected):
    mild = low_pass(80.0, 1)
    for seed in range(4):
        probes = with_noise(shape, seed, "D")
        data = with_noise(mild, seed, "F") | {"DX": probes["DX"]}
        data["DY"] = with_noise(mild, seed, "D")["DY"] if alone else probes["DY"]
        details = {str(c): c.detail for c in phasors_of(data).conditions}
        if expected:
            assert f"noise of {expected} falls" in details["filter-unstated"]
        else:
            assert not {"filter-unstated", "filter-above-excitation"} & details.keys()
