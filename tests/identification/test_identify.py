"""A campaign's records to its table: corrections, flags, columns, and what happens to bad windows."""

import pickle
import tracemalloc
from concurrent.futures import Executor, Future
from dataclasses import replace

import numpy as np
import pytest

from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Fault, Noise, RigPlan, RigTruth, VirtualRig, operating_points
from tests.rigs import closed_form as cf
from tests.rigs.held_run import HeldReader, channels, columns, lines_in_noise, run_of
from tpjb_ident.estimate.solve import Solver
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.frequency import speeds_from_runout
from tpjb_ident.phasors.lines import RecordTooShortError, known_lines
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.phasors.run_phasors import extract, run_phasors
from tpjb_ident.runtime.executors import PoolWorkers


def stiffness(point):
    """Depends on load like a bearing does, and a little on frequency."""
    w, omega = point.static_load / 5000.0, point.excitation
    k = np.array([[6e7 * w**0.5, 3e6], [-2e6, 1.8e8 * w**0.9]])
    c = np.array([[4.5e5, 1e4], [-1e4, 5e5 * w**0.1]])
    return k + 1j * omega * c


def rig(points, seed: int, noise: Noise | None = None, **plan) -> VirtualRig:
    truth = replace(RigTruth.constant(np.diag([2e8, 4e8]), np.diag([4e5, 6e5])), stiffness=stiffness)
    return VirtualRig(
        truth, RigPlan(dynamic=operating_points(points), **plan), noise=noise or Noise.like_samples(), seed=seed
    )


def true_vector(point) -> np.ndarray:
    return cf.vector(stiffness(point))


@pytest.fixture(scope="module")
def campaign(campaign_of):
    return load_campaign(campaign_of(rig([(3500.0, 25.0), (5000.0, 30.0), (5000.0, 50.0)], seed=11)))


@pytest.fixture(scope="module")
def result(campaign):
    return identify(campaign)


def only(campaign, point: str):
    """The campaign of that point's runs: where nothing is learnt from the others, it says the same of the point."""
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.id.startswith(point)))


def test_direct_coefficients_are_within_one_per_cent(result):
    assert len(result.points) == 3
    for p in result.points:
        truth = true_vector(p.point)
        np.testing.assert_allclose(p.stiffness.vector[[0, 3, 4, 7]], truth[[0, 3, 4, 7]], rtol=0.01)
        inside = np.abs(p.stiffness.vector - truth) <= p.stiffness.half_width(0.999)
        assert inside.all()


def test_mains_on_the_excitation_line_is_flagged_and_taken_off(campaign, result):
    coincident = result.points[-1]
    assert coincident.point.excitation_hz == 50
    assert "mains on excitation line" in coincident.quality
    assert "mains corrected" in coincident.quality
    assert "mains on excitation line" not in result.points[1].quality
    (plain,) = identify(only(campaign, "d-05000-50"), IdentifySettings(correct=False, methods=())).points
    assert "mains corrected" not in plain.quality
    truth = true_vector(coincident.point)
    with_it, without = (np.linalg.norm(p.stiffness.vector - truth) for p in (plain, coincident))
    assert without < 0.7 * with_it


def test_static_load_is_reported_as_measured_and_its_misses_are_known(result):
    for p in result.points:
        assert p.static_load_measured == pytest.approx(p.point.static_load, rel=0.01)
        assert 1e-4 < np.abs(p.load_miss.real).max() < 0.02


def test_tables_have_the_promised_columns(result):
    frame = result.to_frame()
    keys = ["static_load_N", "static_load_direction_deg", "shaft_speed_Hz", "excitation_Hz"]
    assert list(frame.columns[:4]) == keys
    for name in ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy"):
        unit = "N_per_m" if name[0] == "k" else "Ns_per_m"
        value = frame[f"{name}_{unit}"]
        assert (frame[f"{name}_{unit}_lo"] < value).all()
        assert (value < frame[f"{name}_{unit}_hi"]).all()
        assert (frame[f"{name}_{unit}_se"] > 0).all()
    for name in ("static_load_measured_N", "method", "n_records", "n_windows", "condition_number"):
        assert name in frame
    assert list(frame["quality"])[:2] == ["ok", "ok"]
    assert frame["static_load_N"].tolist() == [3500.0, 5000.0, 5000.0]
    assert (frame["n_records"] == 6).all()
    assert frame["outlier_fraction"].max() < 0.2
    np.testing.assert_allclose(frame["temperature_1_K"], 273.15 + 45 + frame["static_load_N"] / 2e3, atol=1.0)
    every = result.estimators_frame()
    assert set(every["method"]) == {"ols", "rlm:huber", "rlm:tukey", "mm", "mm-eiv", "iv"}
    assert len(every) == 18


def test_frequency_fits_cover_loads_run_at_several_frequencies(result):
    frame = result.frequency_frame()
    assert frame["model"].tolist() == ["K-C", "K-C-M"]
    assert (frame["static_load_N"] == 5000.0).all()
    # this truth is K-C exactly
    assert set(frame["supported"]) == {"K-C"}
    assert frame["kyy_N_per_m"][0] == pytest.approx(1.8e8, rel=0.01)


@pytest.mark.slow
def test_a_bad_window_is_listed_with_its_run_time_and_reason(tmp_path):
    """A false line in one run's displacements for a while, too regular for a glitch."""
    plan = cf.Rig(frequencies=(30.0,), directions=(0.0, 30.0, 60.0, 90.0, 120.0, 150.0), seconds=2.0)
    t = np.arange(4000) / 2000.0
    line = 0.8e-6 * np.cos(2 * np.pi * 30 * t + 1.0) * ((t >= 0.9) & (t < 1.4))
    struck = {"fault": lambda values, rng, number: values + line * (number == 2)}
    path = cf.write_rig(tmp_path, plan, cf.with_entries(cf.channels_of(plan), "X1", **struck))
    (point,) = identify(load_campaign(path), IdentifySettings(methods=())).points
    listed = [w for w in point.rejected if w.run == point.runs[2]]
    assert any(0.6 < w.time < 1.4 for w in listed)
    assert all("displacement" in w.reason for w in listed)
    truth = cf.vector(plan.film.h(30.0, 5000.0))
    np.testing.assert_allclose(point.stiffness.vector[[0, 3]], truth[[0, 3]], rtol=0.01)


def test_records_too_short_are_refused_with_the_length_needed(campaign):
    settings = IdentifySettings(phasors=PhasorSettings(excitation_lines=(22.25,)))
    with pytest.raises(RecordTooShortError, match=r"run d-03500-25-01: .*takes"):
        identify(only(campaign, "d-03500-25"), settings)


def test_a_campaign_without_dynamic_runs_is_refused(campaign):
    with pytest.raises(ValueError, match="no dynamic runs"):
        identify(replace(campaign, runs=()))


def test_excitation_off_its_set_point_is_found(campaign_of):
    calm = replace(Noise.like_samples(), glitches=Noise.none().glitches)
    run = load_campaign(campaign_of(rig([(5000.0, 25.0)], seed=2, noise=calm))).of_kind("dynamic")[0]
    wrong = replace(run, point=replace(run.point, excitation=2 * np.pi * 25.06))
    phasors = run_phasors(wrong)
    assert "excitation off set point" in phasors.conditions
    assert phasors.lines.excitation[0].frequency == pytest.approx(25.0, abs=0.01)
    assert run_phasors(run).conditions == ()


@pytest.mark.slow
def test_several_excitation_lines_in_one_record_are_told_apart(campaign_of):
    path = campaign_of(rig([(5000.0, f) for f in (15.0, 25.0, 36.0)], seed=3, joint_frequencies=True))
    found = identify(load_campaign(path), IdentifySettings(methods=()))
    for p in found.points:
        np.testing.assert_allclose(p.stiffness.vector[[0, 3, 4, 7]], true_vector(p.point)[[0, 3, 4, 7]], rtol=0.015)
        assert "unexpected lines" in p.quality


def drifting_run(drift, tach_noise):
    """The shaft slows down by 0.2 Hz in 20 s; the tachometer is noisier than that, or not there at all."""
    rate, seconds = 1000.0, 20.0
    data = lines_in_noise(3, rate, seconds)
    time = np.arange(round(seconds * rate)) / rate
    shaft = np.exp(2j * np.pi * (22.0 * time + 0.5 * drift * time**2))
    lines = np.outer(np.exp(2j * np.pi * 25.0 * time), [1.0, 0.5j]).real + np.outer(shaft, [2.0, -2.0j]).real
    rng = np.random.default_rng(3)
    data["displacement"] = 1e-6 * (lines + 0.05 * rng.standard_normal((len(time), 2)))
    turns = np.repeat((tach_noise or 0.0) * rng.standard_normal(20), 1000)
    speed = 2 * np.pi * (22.0 + turns + drift * time)
    described = channels(list(data), speed=tach_noise is not None)
    return run_of(HeldReader(columns(data) | {"K1": speed}, rate), described)


@pytest.mark.slow
@pytest.mark.parametrize("tach_noise", [0.05, None])
def test_a_drifting_shaft_is_followed_by_its_runout(tach_noise):
    run = drifting_run(-0.01, tach_noise)
    first = extract(run, known_lines((25.0,), 22.0, run.sample_rate))
    speeds, doubt = speeds_from_runout(first)
    expected = 22.0 - 0.01 * (first.start + first.length / 2)
    np.testing.assert_allclose(speeds, expected, atol=0.006)
    assert doubt < 1e-3
    phasors = run_phasors(run)
    assert "speed drifts" in phasors.conditions
    scatter = [p.displacement[:, 0].std(axis=0).max() for p in (first, phasors)]
    assert scatter[1] < 0.5 * scatter[0]


def test_a_noisy_tachometer_is_no_drift():
    assert "speed drifts" not in run_phasors(drifting_run(0.0, 0.05)).conditions


@pytest.mark.slow
def test_workers_change_no_number_even_when_jobs_are_lost(campaign):
    class Pool(Executor):
        """Runs jobs at once in this process, and loses every third with its worker."""

        jobs = 0

        def submit(self, fn, /, *args, **kwargs):
            future: Future = Future()
            Pool.jobs += 1
            if Pool.jobs % 3 == 0:
                future.set_exception(ConnectionError("worker lost"))
            else:
                future.set_result(fn(*args, **kwargs))
            return future

    few = replace(campaign, runs=campaign.of_kind("dynamic")[:6])
    settings = IdentifySettings(methods=())
    (plain,) = identify(few, settings).points
    (spread,) = identify(few, settings, workers=PoolWorkers(Pool, 2)).points
    assert Pool.jobs == 11  # six runs and two on their point, three of them lost at first
    np.testing.assert_array_equal(spread.stiffness.h, plain.stiffness.h)
    np.testing.assert_array_equal(spread.stiffness.covariance, plain.stiffness.covariance)


def test_a_refusal_travels_whole_between_processes():
    assert str(pickle.loads(pickle.dumps(RecordTooShortError("run a: takes 3 s")))) == "run a: takes 3 s"


@pytest.mark.slow
def test_memory_does_not_grow_with_the_record():
    class Stream(HeldReader):
        """Makes its samples when they are asked for."""

        def length(self):
            return 6_000_000

        def read(self, names, start, stop):
            index = np.arange(start, stop) % 50_000
            return [self.data[name][index] for name in names]

    # 5 s of lines that fit into the block a whole number of times
    block = lines_in_noise(1, 10_000.0, 5.0)
    stream = run_of(Stream(columns(block), 10_000.0), channels(list(block)))
    whole = 3 * 2 * 8 * stream.length
    tracemalloc.start()
    phasors = run_phasors(stream, PhasorSettings())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(phasors.start) > 50
    assert peak < 0.25 * whole
    assert peak < 80e6


@pytest.mark.slow
def test_cells_ten_times_off_in_all_runs_make_every_point_doubtful(campaign_of):
    wrong = replace(rig([(3500.0, 25.0)], seed=12), faults=(Fault("scaled", "*", "L1*", value=0.1),))
    [point] = identify(load_campaign(campaign_of(wrong)), IdentifySettings(methods=())).points
    assert "cells-contradict-set-points" in point.quality


@pytest.mark.slow
def test_where_the_iteration_runs_away_a_point_is_what_its_windows_say_and_not_trusted(small_campaign, monkeypatch):
    campaign = load_campaign(small_campaign)
    solved = identify(campaign)
    settled = Solver._settled

    def runs_away(solver):
        if solver.solvable.any():
            raise np.linalg.LinAlgError
        return settled(solver)

    monkeypatch.setattr(Solver, "_settled", runs_away)
    for point, whole in zip(identify(campaign).points, solved.points, strict=True):
        assert point.budget == {}
        assert "iteration-limit" in point.quality
        assert np.linalg.norm(point.stiffness.h - whole.stiffness.h) < 0.05 * np.linalg.norm(whole.stiffness.h)
