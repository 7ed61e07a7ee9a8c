"""The parts of `check_campaign`, each on data whose fault is known."""

import math
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigdata import load_campaign
from rigdata.calibration import Channel
from rigdata.channel_statistics import ChannelStatistics
from rigdata.problem import Problem
from rigdata.virtual_rig import Fault, Noise, Sensor
from tests.good_campaigns import PLAN, ROCKER_STIFFNESS, SMALL_PLAN, directions, rocker_rig, sample, stiff_rig
from tests.manifests import PROBES_AND_CELLS, SET_POINT, manifest, write_files
from tests.rigs import held_run
from tests.rigs.held_run import HeldReader, channels
from tests.seeds import first_quick
from tpjb_ident.check.campaign import _check_lengths, check_campaign
from tpjb_ident.check.findings import Finding, Reporter, explanation, indefiniteness, merge, reach, repairs
from tpjb_ident.check.observation import Observation, _at_rest, excitation_line, observe, steady_level
from tpjb_ident.check.signals import check_signal, is_spare
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.compensation import with_references
from tpjb_ident.phasors.line_fit import LineFitter
from tpjb_ident.phasors.run_phasors import run_phasors

#: Probes of the virtual rig.
PAIR = ("X1A", "X1B")
PROBES = (Channel("A", "displacement", axis=math.radians(45)), Channel("B", "displacement", axis=math.radians(135)))


def run_of(name="a", kind="dynamic"):
    """A run of two probes without samples."""
    return replace(held_run.run_of(HeldReader({}), {c.name: c for c in PROBES}, name=name), kind=kind)


def restated(campaign, names, change):
    """The campaign whose manifest says something else of some channels."""
    stated = {name: change(campaign.channels[name]) for name in names}
    runs = tuple(replace(run, channels=dict(run.channels) | stated) for run in campaign.runs)
    return replace(campaign, channels=dict(campaign.channels) | stated, runs=runs)


def seen(*blocks) -> ChannelStatistics:
    statistics = ChannelStatistics()
    for block in blocks:
        statistics.add(np.asarray(block, dtype=float))
    return statistics


@given(
    st.lists(st.sampled_from([0.0, 1.0, 2.0, math.nan, 1e300]), min_size=1, max_size=60),
    st.lists(st.integers(0, 60), max_size=4),
)
@settings(max_examples=60, deadline=None)
def test_statistics_do_not_depend_on_the_blocks(values, cuts):
    whole = seen(values)
    pieces = seen(*[values[a:b] for a, b in zip([0, *sorted(cuts)], [*sorted(cuts), len(values)])])
    for name in ("samples", "missing", "low", "high", "repeats"):
        assert getattr(whole, name) == getattr(pieces, name), name
    if whole.longest_flat > 1:
        assert (whole.longest_flat, whole.flat_start) == (pieces.longest_flat, pieces.flat_start)


@pytest.mark.parametrize(("kind", "named"), [("dry_pivot", False), ("dynamic", True)])
def test_a_load_that_is_held_on_one_step_of_the_converter_is_not_clipped(kind, named):
    """Ten holds of 200 readings with ramps of 40 between them; the last leaves its step for a reading now and then."""
    knots = np.cumsum(np.tile([40, 200], 10))
    steps = np.round(np.interp(np.arange(2400), np.r_[0, knots], np.r_[0, np.repeat(16.0 * np.arange(1, 11), 2)]))
    steps[-150::30] -= 1.0
    statistics, probe = seen(8.0 + 0.01 * steps), PROBES[0]
    assert statistics.clipped_share() > 0.05
    report = Reporter(run_of(kind=kind))
    check_signal(report, probe, statistics, False, PROBES)
    assert any("clipped" in f.key for f in report.findings) is named
    # a slow wave that meets a limit stands nowhere else
    wave = np.minimum(70.0 * np.sin(np.arange(2400) / 20.0), 60.0).round()
    check_signal(report, replace(probe, name="B"), seen(wave), False, PROBES)
    assert any(f.key == "clipped B" for f in report.findings)
    # a keyphasor knows two levels
    pulses = np.where(np.arange(2400) % 20 < 2, -12.0, 0.0)
    check_signal(report, Channel("K", "keyphasor", "V"), seen(pulses), False, PROBES)
    assert not any(f.key == "clipped K" for f in report.findings)


def test_coarse_converters_repeat_readings_without_being_stuck():
    rng = np.random.default_rng(1)
    coarse = np.round(8.0 + 0.4 * rng.normal(size=5000))
    statistics = seen(coarse)
    assert statistics.longest_flat < 10 * statistics.expected_flat()
    coarse[1000:2500] = coarse[1000]
    statistics = seen(coarse)
    assert statistics.longest_flat >= 1500 > 10 * statistics.expected_flat()


def test_channels_are_judged_at_their_own_times(tmp_path):
    """A logger that starts later misses nothing; of a thermometer ten readings alike are ten."""
    rng, starts, rates = np.random.default_rng(3), {"A": 0.0, "B": 0.137, "C": 0.0}, {"A": 1000, "B": 500, "C": 10}
    clocks = {"PX": "A", "PY": "A", "FX": "B", "FY": "B", "T": "C"}
    described = {name: {"quantity": "time", "unit": "s", "clock": name[-1]} for name in ("TA", "TB", "TC")}
    thermometer = {"T": {"quantity": "temperature", "unit": "degC"}}
    for name, keys in {**PROBES_AND_CELLS, **thermometer}.items():
        described[name] = {**keys, "clock": clocks[name]}
    columns = {f"T{clock}": starts[clock] + np.arange(2 * rate) / rate for clock, rate in rates.items()}
    for name, clock in clocks.items():
        columns[name] = 40.0 + rng.standard_normal(2 * rates[clock])
    columns["T"][5:15] = 40.0
    rows = [",".join(columns)]
    for k in range(2000):
        rows.append(",".join(f"{values[k]:.4f}" if k < len(values) else "" for values in columns.values()))
    drive = {"excitation_frequency": "25 Hz", "excitation_direction": "45 deg"}
    run = {"id": "d", "kind": "dynamic", "file": "d.csv", **SET_POINT, **drive}
    folder = write_files(tmp_path, manifest(described, run), {"d.csv": "\n".join(rows) + "\n"})
    keys = observe(load_campaign(folder).runs[0]).report.keys
    assert not [key for key in keys if key.startswith(("missing", "stuck"))]


def test_the_excitation_is_seen_through_bad_samples_and_gaps_channel_by_channel():
    rng = np.random.default_rng(2)
    time = np.arange(2000) / 1000
    wave = 3.0 + 0.5 * np.cos(2 * np.pi * 25 * time + 0.3) + 0.2 * np.sin(2 * np.pi * 22 * time)
    described = channels(("displacement", "force"))
    data = {name: wave + 0.01 * rng.normal(size=2000) for name in described}
    data["DX"][300:340] += 5.0
    data["DX"][900:1000] = np.nan
    data["DY"] = np.full(2000, np.nan)
    phasors = run_phasors(held_run.run_of(HeldReader(data, 1000.0), described))
    lines = excitation_line(phasors, 0, [described[name] for name in ("FX", "DX", "DY")])
    assert lines.mean[:2] == pytest.approx(3.0, abs=2e-3)
    assert lines.phasor[:2] == pytest.approx(0.5 * np.exp(0.3j), abs=2e-3)
    assert (lines.floor[:2] < 2e-3).all()
    assert lines.scatter[:2] == pytest.approx(0.01, rel=0.1)
    assert np.isnan([lines.mean[2], lines.floor[2], lines.scatter[2]]).all()
    assert np.isnan(lines.phasor[2])
    fit = LineFitter(2000, 1000.0, np.array([25.0, 22.0, 44.0])).fit(data["DX"][None, None], np.zeros(1))
    assert 2000 * fit.lost[0, 0] == pytest.approx(100 + 40 + 2 * 3)


def test_the_mean_of_a_run_without_excitation_leaves_the_shafts_lines_out():
    time = np.arange(1030) / 1000
    values = (3.0 + np.cos(2 * np.pi * 22 * time) + 0.3 * np.cos(2 * np.pi * 50 * time))[:, None]
    lines = steady_level(values, 1000.0, [22.0, 44.0, 50.0])
    assert lines.mean == pytest.approx(3.0, abs=1e-9)
    assert lines.scatter[0] < 1e-9
    assert np.isnan(lines.phasor).all()


@pytest.mark.parametrize("index", range(4))
def test_wiring_faults_are_named(index):
    words, fault = list(repairs(PROBES))[index]
    # H' = H inv(M): what the readings after the fault make of the stiffness; every fault is its own repair.
    measured = np.array([[3.0, 0.2], [-0.3, 4.5]]) @ np.linalg.inv(fault)
    assert indefiniteness(measured) > 20
    hint = explanation(repairs(PROBES), lambda repair: indefiniteness(measured @ np.linalg.inv(repair)), 7.0)
    assert hint == f"; as if {words}"


def test_what_many_runs_share_is_told_once():
    runs = [run_of(f"d-{i}") for i in range(9)] + [run_of("c-1", "clearance")]
    findings = []
    for run in runs[:4]:
        report = Reporter(run)
        report.note("dead X", "error", "channel X", "is dead", "Check it")
        findings += report.findings
    findings.append(Finding(Problem("note", "f", "p", "other", "cure", "d-1"), "other"))
    merged = merge(findings, runs)
    assert [(p.run, p.file) for p in merged] == [(None, runs[0].file), ("d-1", "f")]
    assert "in 4 runs (d-0, d-1, d-2, d-3)" in merged[0].what
    assert len(merge(findings[:2], runs)) == 2


#: Nine short runs.
TINY = replace(PLAN, directions=directions(5), locus=(), dry=PLAN.dry[:3], dynamic_seconds=1.0)


@pytest.mark.slow
def test_a_good_campaign_has_no_problem_and_progress_is_told(campaign_of):
    told = []
    path = campaign_of(stiff_rig(7, plan=TINY))
    assert check_campaign(path, progress=lambda done, total: told.append((done, total))) == []
    assert told == [(i + 1, 9) for i in range(9)]


@pytest.mark.slow
def test_noise_free_data_are_not_dead(campaign_of):
    found = check_campaign(campaign_of(stiff_rig(7, plan=TINY, noise=Noise.none())))
    assert {p.severity for p in found} == {"note"}


@pytest.mark.slow
def test_every_problem_is_reported_not_just_the_first(campaign_of):
    faults = (
        Fault("dead", "d-05000-25-02", "X1A"),
        Fault("wrong_load", "d-05000-25-03", value=1.6),
        Fault("missing_channel", "p-2-up", "L1H"),
        Fault("missing_file", "c-1"),
    )
    found = check_campaign(campaign_of(stiff_rig(7, *faults, plan=TINY)))
    assert {p.run for p in found if p.severity == "error"} == {"d-05000-25-02", "d-05000-25-03", "p-2-up", "c-1"}
    assert [p.severity for p in found] == sorted((p.severity for p in found), key=["error", "warning", "note"].index)
    assert all(p.what and p.cure and p.file for p in found)


@pytest.mark.slow
def test_shared_records_and_leftovers(campaign_of, tmp_path):
    path = Path(shutil.copyfile(campaign_of(stiff_rig(7, plan=TINY)), tmp_path / "c.h5"))
    with h5py.File(path, "r+") as file:
        file["runs"].copy("d-05000-25-02", "forgotten")
        file["runs/c-1/extra"] = np.zeros(5)
    found = {p.what: p.severity for p in check_campaign(path)}
    assert "error" not in found.values()
    assert {"no run names the group forgotten", "datasets without a description: extra"} <= set(found)


def test_a_record_that_ends_early_at_a_lines_end_is_told_where_the_others_are_of_one_length(campaign_of, tmp_path):
    folder = shutil.copytree(campaign_of(stiff_rig(7, plan=TINY), "csv-german"), tmp_path / "c")
    record = folder / "runs" / "d-05000-25-02.csv"
    lines = record.read_bytes().splitlines(keepends=True)
    record.chmod(0o644)
    record.write_bytes(b"".join(lines[: len(lines) * 6 // 10]))
    (problem,) = [p for p in check_campaign(folder) if p.severity != "note"]
    assert (problem.severity, problem.run, problem.place) == ("warning", "d-05000-25-02", "record")
    assert "the others of its kind 1 s: cut off, or not written to its end" in problem.what


@pytest.mark.parametrize(
    ("seconds", "short"),
    [((9, 10, 10), 0), ((6, 10, 10), 1), ((6, 10), 0), ((10, 10, 10, 30), 0), ((20, 35, 45, 60, 80), 0)],
)
def test_lengths_of_records_that_scatter_say_nothing(seconds, short):
    observations = [Observation(run, Reporter(run), seconds=s) for s in seconds for run in [run_of(str(s))]]
    _check_lengths(observations)
    assert sum(o.report.keys == ["short record"] for o in observations) == short
    assert sum(len(o.report.keys) for o in observations) == short


def test_a_problem_prints_itself_with_place_and_cure():
    problem = Problem("error", "runs/a.csv", "line 3, column 2 (X1A)", "'x' is not a number", "Mend it")
    assert str(problem) == "runs/a.csv, line 3, column 2 (X1A): 'x' is not a number. Mend it"
    assert str(replace(problem, place="")).startswith("runs/a.csv: ")


@pytest.mark.slow
@pytest.mark.samples
@pytest.mark.parametrize("name", ["rocker-baseline", "effect-b"])
def test_sample_campaigns_raise_no_alarm(name):
    assert [p for p in check_campaign(sample(name)) if p.severity != "note"] == []


def test_a_channel_is_spare_where_the_others_tell_the_plane():
    probes = [Channel(n, "displacement", axis=math.radians(a)) for n, a in (("A", 45), ("B", 135), ("C", 270))]
    cell = Channel("L", "force", axis=0.0)
    assert is_spare(probes[2], [*probes[:2], cell])
    assert not is_spare(probes[1], [probes[0], cell])
    assert not is_spare(probes[2], [probes[0], replace(probes[1], axis=probes[0].axis)])
    assert not is_spare(cell, probes)


@pytest.mark.slow
@pytest.mark.parametrize(("turned", "says"), [(0.0, None), (-10.0, "warning"), (30.0, "error"), (-45.0, "error")])
def test_probes_that_stand_elsewhere_than_stated_are_told_by_the_sweep_at_every_point(campaign_of, turned, says):
    campaign = load_campaign(campaign_of(stiff_rig(3, plan=replace(PLAN, dry=(), locus=()))))
    campaign = restated(campaign, PAIR, lambda c: replace(c, axis=c.axis + math.radians(turned)))
    found = [p for p in check_campaign(campaign) if "from where the load pushes it" in p.what]
    assert [(p.severity, p.run) for p in found] == ([] if says is None else [(says, "c-1")])
    (point,) = identify(campaign, IdentifySettings(methods=())).points
    reached = {"error": "records-contradicted", "warning": "records-doubtful"}.get(says or "")
    assert [c for c in point.quality if "from where the load pushes it" in c.detail] == ([reached] if reached else [])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "change", "words"),
    [
        (PAIR[:1], {}, []),
        (PAIR[:1], {"gain": 1.1}, ["X1A reads +1", "X1B reads -9"]),
        (PAIR[:1], {"turn": -12.0}, ["X1A stands +12"]),
        (("L1H",), {"gain": 1.12}, ["L1H reads +1", "L1V reads -1"]),
    ],
)
def test_a_sweep_holds_sensors_against_the_pads_of_the_bearing_file_and_intervals_hold_it(
    campaign_of, names, change, words
):
    """Of a campaign without dry runs."""
    campaign = load_campaign(campaign_of(rocker_rig(3, plan=replace(SMALL_PLAN, dry=(), locus=()))))
    gain, turn = change.get("gain", 1.0), math.radians(change.get("turn", 0.0))
    campaign = restated(campaign, names, lambda c: replace(c, gain=c.gain * gain, axis=c.axis + turn))
    problems = [f"{p.place} {p.what}" for p in check_campaign(campaign) if "clearance" in p.what]
    assert len(problems) == len(words)
    assert all(any(text in problem for problem in problems) for text in words), problems
    frame = identify(campaign, IdentifySettings(methods=())).to_frame()
    for column, true in (("kxx", ROCKER_STIFFNESS[0, 0]), ("kyy", ROCKER_STIFFNESS[1, 1])):
        low, high = frame[[f"{column}_N_per_m_lo", f"{column}_N_per_m_hi"]].to_numpy()[0]
        assert low < true < high
        assert (high - low > 0.1 * true) == bool(words)


def test_coefficients_without_a_reference_count_from_the_runs_mean_temperature(campaign_of):
    campaign = load_campaign(campaign_of(rocker_rig(3, plan=replace(SMALL_PLAN, dry=(), locus=()))))
    assert with_references(campaign) is campaign
    drifting = restated(campaign, PAIR, lambda c: replace(c, temperature_coefficient=3e-3))
    mean = np.mean([run.mean_temperature() for run in campaign.of_kind("dynamic")])
    for run in with_references(drifting).runs:
        assert run.channels["X1A"].temperature_reference == pytest.approx(mean, abs=1.0)


SPARE = (
    Sensor.of_type("probe", "X1C", axis=math.radians(90.0), zero=8.1),
    Sensor.of_type("probe", "X1D", axis=0.0, zero=7.9),
)


@pytest.mark.parametrize(
    ("gain", "dead", "expected"),
    first_quick(
        (1.1, False, [("error", None, "contradict one another"), ("warning", "c-1", "contradict one another")]),
        (1.0, False, []),
        (1.0, True, [("warning", "p-2-up", "is dead")]),
    ),
)
def test_spare_probes_that_contradict_the_others_are_told_of_dry_runs_and_sweep(campaign_of, gain, dead, expected):
    rig = stiff_rig(4, plan=replace(TINY, dynamic=(), dry=PLAN.dry), pivot_stiffness=1e8)
    spare = (SPARE[0].with_error(gain=gain), SPARE[1])
    instruments = replace(rig.instruments, sensors=(*rig.instruments.sensors, *spare))
    rig = replace(rig, instruments=instruments, faults=(Fault("dead", "p-2-up", "X1C"),) if dead else ())
    found = [p for p in check_campaign(campaign_of(rig)) if p.severity != "note"]
    assert [(p.severity, p.run) for p in found] == [told[:2] for told in expected], [str(p) for p in found]
    assert all(says in p.what for p, (_, _, says) in zip(found, expected))


def test_what_many_channels_are_off_by_alike_makes_each_more_uncertain():
    report = Reporter(run_of())
    report.ask("turned", 14.0, "A", "B", angle=14.0)
    report.ask("sensor gain", 0.1, "A", share=0.1, witness="loads")
    names, deviations = zip(*report.doubted)
    assert names == ("A", "B", "A")
    np.testing.assert_allclose(deviations[0], [0.0, math.sqrt(2) * math.radians(14.0) * CHANGE_AS_DEVIATION], rtol=2e-3)
    np.testing.assert_allclose(deviations[2], [0.1 * CHANGE_AS_DEVIATION])


def test_what_one_of_many_static_runs_shows_stays_its_own():
    def reports(kinds, concerned):
        made = [Reporter(run_of(f"r{i}", kind)) for i, kind in enumerate(kinds)]
        for i in concerned:
            made[i].note("signs A B", "error", "channels A and B", "go elsewhere", "Look", ["A", "B"])
        reach(made)
        return [len(report.findings) for report in made]

    assert reports(["clearance", "dynamic", "dynamic"], [0]) == [1, 1, 1]
    assert reports(["dry_pivot"] * 5 + ["dynamic"], [1]) == [0, 1, 0, 0, 0, 0]
    assert reports(["dry_pivot"] * 5 + ["dynamic"], [1, 2, 3]) == [0, 1, 1, 1, 0, 1]


def test_an_accelerometer_across_the_drive_may_read_nothing():
    """Where the housing does not move; not along the drive, not where both are dead, not on a floating housing."""
    axes = {"displacement": (45.0, 135.0), "force": (0.0, 90.0), "acceleration": (0.0, 90.0)}
    channels = tuple(Channel(f"{q} {a:g}", q, axis=math.radians(a)) for q, pair in axes.items() for a in pair)

    def resting(force, acceleration):
        z = np.array([[[1e-6, 1e-6, *force, *acceleration]]] * 5, dtype=complex)
        places = {"force": [2, 3], "acceleration": [4, 5]}
        return _at_rest(SimpleNamespace(z=z, channels=channels, pick=places.get, housing_mass=30.0))

    assert resting((900.0, 2.0), (0.1, 0.0)) == {"acceleration 90"}
    assert resting((900.0, 900.0), (1.0, 0.0)) == set()
    assert resting((900.0, 2.0), (0.0, 0.0)) == set()
    assert resting((900.0, 2.0), (15.0, 0.0)) == set()
