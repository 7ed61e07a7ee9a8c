"""From samples to phasors of windows: the joint line fit, channels read together, chunks, clocks, glitches, gaps."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.calibration import Channel
from rigdata.operating_point import OperatingPoint
from rigdata.problem import RigDataError
from rigdata.run import Run
from tests.rigs import held_run
from tests.rigs.held_run import HeldReader, channels, columns
from tests.seeds import seeds
from tpjb_ident.phasors import line_fit, run_phasors
from tpjb_ident.phasors.compensation import compensated
from tpjb_ident.phasors.frequency import ShaftCourse
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
from tpjb_ident.phasors.run_phasors import MAX_JITTER, extract

RATE = 1000.0
#: No whole number of cycles in a second, so that a wrong origin of time shows.
DRIVEN = 33.7
POINT = OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22.0, 2 * math.pi * DRIVEN)


def run_of(data, channels, stamps=None):
    described = {c.name: c for c in channels}
    return replace(held_run.run_of(HeldReader(data, RATE, stamps), described, POINT, "r"), excitation_direction=0.3)


def probes(axes, zero=0.0, polarity=1):
    return [Channel(f"X{k}", "displacement", "um", 1e-6 * (k + 1), zero * k, polarity if k else 1, math.radians(a))
            for k, a in enumerate(axes)]  # fmt: skip


def readings(count, n=50, seed=1):
    return {f"X{k}": np.random.default_rng([seed, k]).standard_normal(n) for k in range(count)}


@pytest.mark.parametrize("bad", [np.nan, 3e38, -3e38, np.inf])
@pytest.mark.parametrize("name", ["X0", "X1"])
def test_a_reading_that_is_none_is_none(bad, name):
    data = readings(2)
    data[name][20] = bad
    run = run_of(data, probes((45.0, 135.0)), stamps=0.5 + np.arange(50) / RATE)
    whole = run.vector("displacement", 10, 40)
    assert np.isnan(whole.values[10]).all()
    np.testing.assert_allclose(run.vector("displacement", 30, 40).values, whole.values[20:], rtol=1e-12)
    assert run.vector("displacement", 5, 5).values.shape == (0, 2)
    np.testing.assert_array_equal(whole.time, 0.5 + np.arange(10, 40) / RATE)


def test_a_channel_without_an_axis_is_no_part_of_the_vector():
    other = Channel("T", "displacement", "um", 1e-6)
    two, three = probes((45.0, 135.0)), readings(2) | {"T": np.zeros(50)}
    expected = run_of(readings(2), two).vector("displacement").values
    np.testing.assert_array_equal(run_of(three, [*two, other]).vector("displacement").values, expected)
    for axes in ((45.0, 47.5), (45.0, 225.0)):
        with pytest.raises(RigDataError, match="all measure along one line"):
            run_of(readings(2), probes(axes)).vector("displacement")


LINES = known_lines((DRIVEN,), 22.0, RATE)
Z = {"displacement": 1e-6 * np.array([1.0 + 0.5j, -0.4j]), "force": np.array([300.0j, 200.0 - 80.0j])}
RUNOUT = 2e-6 * np.array([1.0, 1.0j])


def held(seconds=4.0, stamps=None, turns=None, late=0.0, quantities=("displacement", "force")) -> Run:
    """A run in memory: the excitation, runout of a shaft whose phase is given, a steady load."""
    length = round(seconds * RATE)
    t = np.arange(length) / RATE if stamps is None else np.nan_to_num(stamps)
    shaft = np.exp(2j * math.pi * (22.0 * t if turns is None else turns))
    data = {}
    for quantity in quantities:
        z = Z.get(quantity, np.array([0.02, 0.01j]))
        own = t - (late if quantity == "force" else 0.0)
        wave = np.outer(np.exp(2j * math.pi * DRIVEN * own), z).real
        wave += np.outer(shaft, RUNOUT).real * (quantity == "displacement")
        data[quantity] = wave + (1e-4 if quantity == "displacement" else 700.0)
    reader = HeldReader(columns(data), RATE, stamps)
    return replace(held_run.run_of(reader, channels(quantities), POINT, "r"), excitation_direction=0.3)


FIXED = 0.4


def taken(run, follow=None):
    return extract(run, LINES, follow, window=FIXED)


def exact(result, quantity="displacement", but=(), tolerance=1e-9):
    """Whether windows have the excitation's own phasor."""
    block = result.plane(quantity, result.z)
    windows = np.delete(np.arange(len(block)), list(but))
    off = block[windows, 0] - Z[quantity]
    np.testing.assert_allclose(off / np.abs(Z[quantity]).max(), 0.0, atol=tolerance)


@pytest.mark.parametrize("chunk", [1, 400, 1000, 2**15])
def test_windows_are_the_same_in_chunks_of_any_length(monkeypatch, chunk):
    monkeypatch.setattr(run_phasors, "CHUNK", chunk)
    found = taken(held())
    exact(found)
    exact(found, "force")
    np.testing.assert_allclose(found.start, 0.4 * np.arange(10))
    np.testing.assert_allclose(found.means("force"), 700.0, rtol=1e-9)
    np.testing.assert_array_equal(found.lost, 0.0)
    assert (found.length, found.run, found.direction, found.pick("acceleration")) == (0.4, "r", 0.3, [])
    more = taken(held(quantities=("displacement", "force", "acceleration")))
    np.testing.assert_allclose(more.plane("acceleration", more.z)[:, 0], np.tile([0.02, 0.01j], (10, 1)), atol=1e-10)


def test_a_channel_recorded_late_is_put_back():
    late = 3e-3
    run = held(late=late)
    found = compensated(taken(run), run, {}, {"force": late})
    exact(found, "force")
    exact(found)
    plain = taken(held(late=late))
    turned = np.exp(-2j * math.pi * DRIVEN * late) * Z["force"]
    np.testing.assert_allclose(plain.plane("force", plain.z)[:, 0], np.tile(turned, (10, 1)), rtol=1e-9)
    np.testing.assert_allclose(found.means("force"), plain.means("force"))


def test_a_clock_may_start_anywhere_and_stray_within_a_window():
    even = np.arange(4000) / RATE
    later = taken(held(stamps=5.0 + even))
    exact(later)
    np.testing.assert_allclose(later.start, 5.0 + 0.4 * np.arange(10))
    rng = np.random.default_rng(2)
    astray = even.copy()
    astray[800:1200] += rng.uniform(-0.3, 0.3, 400) / RATE
    astray[801:805] = np.sort(astray[801:805])
    exact(taken(held(stamps=astray)), tolerance=1e-6)
    # what strays by less than a fiftieth of a sample is taken for even: all but the first of a window come late here
    for share, own in ((0.9, False), (1.1, True)):
        little = even.copy()
        little[801:1200] += share * MAX_JITTER / RATE
        error = np.abs(taken(held(stamps=little)).displacement[2, 0] - Z["displacement"]).max()
        late = 2 * math.pi * DRIVEN * share * MAX_JITTER / RATE * np.abs(Z["displacement"]).max()
        assert error == pytest.approx(0.0 if own else late, abs=0.02 * late)


def test_stamps_that_are_missing_leave_their_samples_out():
    stamps = np.arange(4000) / RATE
    stamps[[400, 850, 900, 1190]] = np.nan
    stamps[1200:1600] = np.nan
    stamps[1210:1225] = np.arange(1210, 1225) / RATE
    found = taken(held(stamps=stamps))
    exact(found, but=(2, 3))
    np.testing.assert_allclose(found.displacement[2, 0], Z["displacement"], atol=1e-12)
    np.testing.assert_allclose(found.start, 0.4 * np.arange(10))


def test_a_shaft_that_creeps_is_followed_window_by_window():
    """Speeds of 22 to 22.9 Hz, steady within a window, the phase running on."""
    speeds = 22.0 + 0.1 * np.arange(10)
    turns = np.concatenate([[0.0], np.cumsum(np.repeat(speeds, 400) / RATE)[:-1]])
    run = held(turns=turns)
    middles = (np.arange(10) + 0.5) * 400 / RATE
    followed = taken(run, ShaftCourse(middles, speeds))
    exact(followed)
    plain = taken(run)
    assert np.abs(plain.displacement[-1, 0] - Z["displacement"]).max() > 0.02e-6
    # where the speed is not known the run's own is taken; as in the first window
    holes = np.where(np.arange(10) == 9, np.nan, speeds)
    some = taken(run, ShaftCourse(middles, holes))
    exact(some, but=(9,))
    np.testing.assert_allclose(some.displacement[9], plain.displacement[9], atol=1e-15)
    np.testing.assert_allclose(some.displacement[0], plain.displacement[0], atol=1e-14)


def test_a_long_disturbance_is_told_by_the_other_windows(monkeypatch):
    """A fifth of one window moves by itself, at the excitation's own frequency: with chunks of one window too."""
    for chunk in (400, 2**15):
        monkeypatch.setattr(run_phasors, "CHUNK", chunk)
        run = held()
        probes_in_memory = [run.reader.data[name] for name in ("DX", "DY")]
        noise = 2e-8 * np.random.default_rng(3).standard_normal((4000, 2)).T
        wave = 4e-6 * np.cos(2 * math.pi * DRIVEN * np.arange(1300, 1380) / RATE)
        for values, own in zip(probes_in_memory, noise):
            values += own
            values[1300:1380] += wave
        found = taken(run)
        exact(found, tolerance=0.02)
        assert found.lost[3, :2].max() > 0.15
        assert found.lost[[0, 1, 2, 4, 5, 6, 7, 8, 9], :2].max() < 0.05


FREQUENCIES = np.array([25.3, 22.0])


def pieces(length, n=6, noise=0.01, unit=1.0, seed=4):
    rng = np.random.default_rng(seed)
    t = np.arange(n * length) / RATE
    z = unit * np.array([1.0 + 0.5j, 20.0j])
    rows = np.stack([(a * np.exp(2j * math.pi * 25.3 * t)).real for a in z]) + 700.0 * unit
    rows = rows + noise * np.abs(z)[:, None] * rng.standard_normal(rows.shape)
    return rows.reshape(2, n, length), z, np.arange(n) * length / RATE


@pytest.mark.parametrize("length", [400, 1024])
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_a_fifth_of_a_window_may_be_wrong_whatever_the_units(length, unit):
    """In short windows and in long ones, for quantities of micrometres and of newtons, and axes that differ."""
    rows, z, start = pieces(length, unit=unit)
    rows[0, 2, 100 : 100 + length // 5] += 3.0 * unit
    rows[1, 4, 7] += 300.0 * unit
    fitter = LineFitter(length, RATE, FREQUENCIES)
    found = fitter.fit(rows, start)
    np.testing.assert_allclose(found.z[:, 0] / z, 1.0, atol=0.01)
    assert found.lost[2, 0] == pytest.approx(0.2, abs=0.03)
    # an isolated sample takes no other with it, and none of the other channel
    assert found.lost[4].tolist() == [0.0, pytest.approx(1 / length)]
    assert found.lost[2, 1] == 0.0
    np.testing.assert_array_equal(found.lost[[0, 1, 3, 5]], 0.0)
    np.testing.assert_allclose(found.mean / unit, 700.0, atol=0.1)
    np.testing.assert_allclose(found.scale / (0.01 * np.abs(z)), 1.0, atol=0.45)


@pytest.mark.parametrize(("missing", "told"), [(200, True), (201, False)])
def test_half_of_a_window_may_be_missing(missing, told):
    rows, z, start = pieces(400, noise=0.0)
    rows[0, 1, :missing] = np.nan
    found = LineFitter(400, RATE, FREQUENCIES).fit(rows, start)
    assert np.isfinite(found.z[1, :, 0]).all() == told
    assert np.isfinite(found.z[1, :, 1]).all()
    if told:
        np.testing.assert_allclose(found.z[1, 0], z, atol=1e-9)
    assert found.lost[1].tolist() == [pytest.approx(missing / 400), 0.0]
    np.testing.assert_allclose(np.delete(found.z, 1, axis=0)[:, 0], np.tile(z, (5, 1)), atol=1e-10)


def test_a_window_of_its_own_clock_has_its_mean_and_noise():
    rng = np.random.default_rng(5)
    t = 3.0 + np.sort(rng.uniform(0.0, 0.5, 500))
    z = np.array([2.0 - 1.0j, 0.5j])
    values = np.outer(np.exp(2j * math.pi * 25.3 * t), z).real + [700.0, -30.0] + 0.01 * rng.standard_normal((500, 2))
    values[40, 0] = np.nan
    found = LineFitter(len(t), RATE, FREQUENCIES, time=t).fit(values.T[:, None], t[:1] - 1.0)
    # phasors count from the origin, two seconds before the first sample
    np.testing.assert_allclose(found.z[0, 0], z * np.exp(2j * math.pi * 25.3 * 1.0), atol=5e-3)
    np.testing.assert_allclose(found.mean[0], [700.0, -30.0], atol=5e-3)
    np.testing.assert_allclose(found.scale[0], 0.01, rtol=0.2)
    assert found.lost[0].tolist() == [pytest.approx(1 / 500), 0.0]


@pytest.mark.parametrize("slow", [0.02, 0.3, 2.0])
def test_a_line_that_does_not_turn_once_in_a_window_leaves_its_mean_alone(slow):
    length = 250
    time = np.arange(length) / RATE
    rows = (7.0 + np.cos(2 * np.pi * 25.0 * time) + 1e-3 * np.random.default_rng(0).standard_normal(length))[None, None]
    frequencies = np.array([25.0, slow])
    even = LineFitter(length, RATE, frequencies).fit(rows, np.zeros(1))
    assert even.mean[0, 0] == pytest.approx(7.0, abs=1e-3)
    uneven = LineFitter(length, RATE, frequencies, time=time).fit(rows, np.zeros(1))
    assert uneven.mean[0, 0] == pytest.approx(7.0, abs=1e-3)


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


def test_lines_that_coincide_are_merged_or_reported():
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


def test_a_record_too_short_is_refused_with_the_length_it_takes():
    close = known_lines((22.4,), 22.0, RATE)
    with pytest.raises(RecordTooShortError, match="takes at least") as caught:
        plan_windows(1000, RATE, close)
    needed = float(re.search(r"at least (\S+) s", str(caught.value))[1])
    assert needed > 1.0
    length, _ = plan_windows(int(needed * RATE * 1.05), RATE, close)
    assert length / RATE >= needed * 0.99


def test_lines_that_nearly_coincide_are_refused_in_bounded_time():
    """Windows of days would have more samples than memory."""
    lines = known_lines((440.0, 440.000001), 22.0, RATE)
    with pytest.raises(RecordTooShortError, match=r"nearest to the excitation is 1e-06 Hz away; it takes at least"):
        plan_windows(8000, RATE, lines)


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
