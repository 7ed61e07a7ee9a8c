"""Noise levels are as stated; each kind goes where it belongs and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import virtual_rig as vr
from rigdata.virtual_rig.rig import channel_noise, converter_step, draw_glitches, flicker, slow_drift
from tests.good_campaigns import CROSS_DAMPING as C
from tests.good_campaigns import CROSS_STIFFNESS as K

TRUTH = vr.RigTruth.constant(K, C)


def rig(noise: vr.Noise, **changes) -> vr.VirtualRig:
    plan = vr.RigPlan(
        dynamic=vr.operating_points([(5000.0, 25.0)]), directions=(0.5,), locus=vr.locus_points(1), locus_seconds=20.0
    )
    return vr.VirtualRig(TRUTH, replace(plan, **changes), vr.Instruments.like_paper(), noise, seed=11)


def values(noise: vr.Noise, run: str = "l-05000-01") -> dict[str, np.ndarray]:
    """Readings of one run in SI units, less what they are without noise."""
    noisy, quiet = rig(noise).simulate(run).readings, rig(vr.Noise.none()).simulate(run).readings
    sensors = {s.name: s for s in vr.Instruments.like_paper().sensors}
    return {n: sensors[n].polarity * (noisy.columns[n] - quiet.columns[n]) / sensors[n].scale for n in noisy.columns}


def amplitude(series: np.ndarray, frequency: float, rate: float = 1000.0) -> float:
    time = np.arange(len(series)) / rate
    return abs(2 * np.mean((series - series.mean()) * np.exp(-2j * np.pi * frequency * time)))


def test_white_noise_has_its_rms_and_is_independent_between_channels():
    found = values(replace(vr.Noise.none(), displacement=vr.ChannelNoise(white=2e-8), force=vr.ChannelNoise(white=3.0)))
    for name, level in {"X1A": 2e-8, "X1B": 2e-8, "L1H": 3.0, "L1V": 3.0}.items():
        # 20 000 samples: the rms is known to 0.5 % (one sigma)
        assert np.std(found[name]) == pytest.approx(level, rel=0.02)
    for name in ("A1H", "T1", "K1"):
        assert np.ptp(found[name]) == 0.0
    assert abs(np.corrcoef(found["X1A"], found["X1B"])[0, 1]) < 0.03
    lag = np.corrcoef(found["X1A"][1:], found["X1A"][:-1])[0, 1]
    assert abs(lag) < 0.03


def test_flicker_has_its_density_over_three_decades():
    series = flicker(np.random.default_rng(3), 120, 4000, 1000.0)
    density = np.mean(np.abs(np.fft.rfft(series * np.hanning(4000))) ** 2, axis=0)
    density *= 2 / (1000.0 * np.sum(np.hanning(4000) ** 2))
    frequency = np.fft.rfftfreq(4000, 1e-3)
    band = (frequency > 1.0) & (frequency < 450.0)
    assert np.mean(density[band] * frequency[band]) == pytest.approx(1.0, rel=0.03)
    slope = np.polyfit(np.log(frequency[band]), np.log(density[band]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.03)


def test_flicker_does_not_return_to_its_start_and_drift_is_slow_and_has_its_size():
    series = flicker(np.random.default_rng(4), 500, 500, 500.0)
    ends, neighbours = series[:, -1] - series[:, 0], series[:, 1] - series[:, 0]
    assert np.std(ends) > 1.5 * np.std(neighbours)
    series = slow_drift(np.random.default_rng(5), 3000, np.arange(500) / 500)
    assert np.std(series[:, -1] - series[:, 0]) == pytest.approx(1.0, rel=0.05)
    np.testing.assert_allclose(series.mean(axis=1), 0.0, atol=1e-12)
    assert np.abs(np.diff(series, axis=1)).max() < 0.05


def test_mains_has_its_amplitude_its_harmonics_and_a_phase_of_chance():
    noise = replace(vr.Noise.none(), force=vr.ChannelNoise(mains=4.0), mains_harmonics=(0.0, 0.25))
    found = values(noise)["L1H"]
    assert amplitude(found, 50.0) == pytest.approx(4.0, rel=0.11)
    assert amplitude(found, 150.0) == pytest.approx(1.0, rel=0.11)
    assert amplitude(found, 100.0) < 1e-9
    sensors = vr.Instruments.like_paper().of("force")
    time = np.arange(1000) / 1000
    runs = [channel_noise(sensors, noise, time, 1, f"r{i}") for i in range(40)]
    phases = np.angle([np.sum(r * np.exp(-2j * np.pi * 50 * time), axis=1) for r in runs])
    assert abs(np.mean(np.exp(1j * phases[:, 0]))) < 0.4
    # cabling: the two channels keep their phase to each other in the whole campaign
    between = np.exp(1j * (phases[:, 1] - phases[:, 0]))
    np.testing.assert_allclose(between, between[0], rtol=1e-9)


def test_mains_frequency_wanders_from_run_to_run():
    noise = replace(vr.Noise.none(), force=vr.ChannelNoise(mains=1.0), mains_scatter=0.05)
    time = np.arange(4000) / 200
    sensors = vr.Instruments.like_paper().of("force")
    grid = np.linspace(49.7, 50.3, 121)
    kernel = np.exp(-2j * np.pi * np.outer(grid, time))
    peaks = [grid[np.argmax(np.abs(kernel @ channel_noise(sensors, noise, time, 1, f"r{i}")[0]))] for i in range(20)]
    assert np.std(peaks) == pytest.approx(0.05, rel=0.4)


def test_converter_rounds_to_its_steps_and_limits():
    columns = rig(replace(vr.Noise.like_samples(), bits=12)).simulate("l-05000-01").readings.columns
    for sensor in vr.Instruments.like_paper().sensors:
        step = converter_step(sensor, 12)
        codes = columns[sensor.name] / step
        np.testing.assert_allclose(codes, np.rint(codes), atol=1e-6)
        assert np.abs(columns[sensor.name]).max() <= sensor.span
    far = replace(vr.Noise.none(), bits=16, glitches=vr.Glitches(1.0, 500, 500, displacement=0.1, force=1e6))
    extremes = rig(far).simulate("d-05000-25-01").readings.columns
    assert max(np.abs(extremes[n]).max() for n in ("X1A", "X1B", "L1H", "L1V")) == pytest.approx(10.0, rel=1e-4)


def test_runout_is_in_the_probes_only_and_unbalance_goes_through_the_film():
    runout = values(replace(vr.Noise.none(), runout=(1e-6, 0.3e-6)))
    assert amplitude(runout["X1A"], 22.0) == pytest.approx(1e-6, rel=1e-6)
    assert amplitude(runout["X1B"], 44.0) == pytest.approx(0.3e-6, rel=1e-6)
    for name in ("L1H", "L1V", "A1H", "A1V"):
        assert np.abs(runout[name]).max() < 1e-9
    # a point of the surface passes the probe at 135 deg a quarter turn after the one at 45 deg
    quarter = round(1000 / 22 / 4 * 22) / 22
    shifted = np.interp(np.arange(1000) + quarter, np.arange(len(runout["X1B"])), runout["X1B"])
    np.testing.assert_allclose(shifted, runout["X1A"][:1000], atol=2e-8)

    omega = 2 * np.pi * 22.0
    found = values(replace(vr.Noise.none(), unbalance=25.0 / omega**2))
    force = np.stack([found["L1H"] + 30 * found["A1H"], found["L1V"] + 30 * found["A1V"]])
    np.testing.assert_allclose(np.hypot(*force), 25.0, rtol=1e-9)
    turning = np.unwrap(np.arctan2(force[1], force[0]))
    assert np.all(np.diff(turning) > 0)  # counter-clockwise, with the shaft
    time = np.arange(force.shape[1]) / 1000
    d = np.stack([found["X1A"] - found["X1B"], found["X1A"] + found["X1B"]]) / np.sqrt(2)
    phasors = [2 * np.mean(v * np.exp(-1j * omega * time), axis=1) for v in (force, d)]
    np.testing.assert_allclose((K + 1j * omega * C) @ phasors[1], phasors[0], rtol=1e-8)


def test_actuator_harmonics_and_cross_talk():
    harmonic = values(replace(vr.Noise.none(), actuator_harmonics=(0.02,)), "d-05000-25-01")
    force = harmonic["L1H"] + 30 * harmonic["A1H"]
    assert amplitude(force, 50.0) == pytest.approx(500.0 * 0.02 * np.cos(0.5), rel=1e-6)
    noise = replace(vr.Noise.none(), actuator_scatter=0.03, cross_talk=0.05)
    directions = tuple(np.linspace(0.0, 3.1, 200))
    talk = rig(noise, directions=directions, dynamic_seconds=0.01)
    along, across = [], []
    for run in talk.runs[:200]:
        oil_force = talk.simulate(run.id).motion.lines[0].oil_force / 500.0
        turn = np.exp(-1j * run.direction)
        unit = np.array([turn.real, -turn.imag])
        along.append(abs(oil_force @ unit))
        across.append(abs(oil_force @ np.array([-unit[1], unit[0]])))
    assert np.std(along) == pytest.approx(0.03, rel=0.15)
    assert np.sqrt(np.mean(np.square(across))) == pytest.approx(0.05, rel=0.15)


def test_set_points_are_missed_by_as_much_as_stated():
    noise = replace(vr.Noise.none(), load_miss=0.003, direction_miss=0.0035, speed_miss=0.001)
    plan = replace(vr.RigPlan(locus=vr.locus_points(300)), locus_seconds=0.02)
    many = vr.VirtualRig(TRUTH, plan, vr.Instruments.like_paper(), noise, seed=2)
    facts = [many.simulate(run.id).motion.facts for run in many.runs]
    assert np.std([f["static_load_N"] / 5000 for f in facts]) == pytest.approx(0.003, rel=0.15)
    assert np.std([f["shaft_speed_Hz"] / 22 for f in facts]) == pytest.approx(0.001, rel=0.15)
    off = [f["static_load_direction_deg"] - p.static_load_direction_deg for f, p in zip(facts, plan.locus)]
    assert np.std(np.radians(off)) == pytest.approx(0.0035, rel=0.15)


def test_glitches_are_as_many_as_long_and_as_large_as_stated():
    instruments = vr.Instruments.like_paper()
    noise = replace(vr.Noise.none(), glitches=vr.Glitches(share=0.2))
    drawn = [draw_glitches(instruments, noise, 2000, 1, f"r{i}") for i in range(3000)]
    assert np.mean([bool(g) for g in drawn]) == pytest.approx(0.2, rel=0.12)
    flat = [g for run in drawn for g in run]
    assert {g.count for g in flat} == set(range(3, 51))
    assert {g.channel for g in flat} == {"X1A", "X1B", "L1H", "L1V"}
    assert all(g.first + g.count <= 2000 for g in flat)
    sizes = np.array([abs(g.size) for g in flat if g.channel.startswith("X")])
    assert sizes.min() > 0.4 * 65e-6
    assert sizes.max() <= 65e-6
    assert draw_glitches(instruments, replace(noise, glitches=vr.Glitches(1.0)), 2, 1, "short")[0].count == 2


def test_a_glitch_stands_where_the_truth_says():
    noise = replace(vr.Noise.none(), glitches=vr.Glitches(1.0))
    record = rig(noise).simulate("d-05000-25-01")
    found = values(noise, "d-05000-25-01")
    total = {name: np.zeros(2000) for name in found}
    for glitch in record.glitches:
        total[glitch.channel][glitch.first : glitch.first + glitch.count] += glitch.size
    for name in total:
        np.testing.assert_allclose(found[name], total[name], atol=1e-9 * max(1.0, np.abs(total[name]).max()))


def test_scaling_scales_channel_noise_and_nothing_else():
    base = vr.Noise.like_samples()
    twice = base.scaled(2.0)
    assert twice.displacement == vr.ChannelNoise(*(2 * v for v in (35e-9, 10e-9, 39e-9, 0.15e-6)))
    channels = ("displacement", "force", "acceleration", "temperature", "speed")
    assert replace(twice, **{name: getattr(base, name) for name in channels}) == base
    white = replace(vr.Noise.none(), displacement=vr.ChannelNoise(white=1e-8))
    np.testing.assert_allclose(values(white.scaled(3.0))["X1A"], 3 * values(white)["X1A"], rtol=1e-6, atol=1e-15)
