"""Raw trials: what is kept, what is made anew, and the model's memory."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from model.bearing_file import load_bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from rigdata.virtual_rig import Instruments, VirtualRig
from tests.studies.diagnosis import raw_rows as module
from tests.studies.diagnosis.other_plans import PLANS
from tests.studies.diagnosis.raw_rows import raw_rows, read_rows
from tests.studies.diagnosis.raw_trials import RawBench, raw_trials
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.compare.rig_from_model import rig_truth
from tpjb_ident.diagnose.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.plan.planned import around, dry, dynamic, planned_observations
from tpjb_ident.runtime.executors import InProcessWorkers
from tpjb_ident.runtime.workers import open_workers

BEARING = load_bearing(Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml")
LABELS = ["a", "b", "c"]


def drawn_rows(shared, group):
    """A row that depends on the trial alone, as the real one does."""
    number = float(np.random.default_rng(len(group) + group[0].number).random())
    return [{**asdict(trial), "rung": "raw", "names": trial.truth, "verdict": "consistent", "p": number}
            for trial in group]  # fmt: skip


def refused(shared, group):
    raise AssertionError(f"{group} was there already")


@pytest.fixture
def shared(tmp_path):
    return RawBench(bench=None, bearing=None, keep=tmp_path / "kept")


def test_a_torn_line_swallows_none_that_follow(tmp_path):
    file = tmp_path / "new" / "rows.jsonl"
    module.append_lines(file, ["1", "2"])
    file.write_bytes(file.read_bytes() + b'{"to')
    module.append_lines(file, ["3"])
    assert file.read_text() == '1\n2\n{"to\n3\n'


def test_rounds_hold_every_kind_and_share_campaigns():
    groups = raw_trials(LABELS, 120)
    trials = [trial for group in groups for trial in group]
    assert len(set(trials)) == len(trials) >= 120
    assert {t.kind for t in trials} == {"none", "hidden", "left out", "two"}
    assert {t.size for t in trials if t.kind == "left out"} == {12.0, 24.0}
    assert {t.plan for t in trials} == {"paper", *PLANS}
    for group in groups:
        assert len({(t.truth, t.size, t.noise, t.number, t.plan) for t in group}) == 1


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_rows_do_not_depend_on_the_workers(monkeypatch, shared, count):
    monkeypatch.setattr(module, "run_raw_trials", drawn_rows)
    groups = raw_trials(LABELS, 12)
    here = raw_rows(InProcessWorkers(), replace(shared, keep=None), groups)
    with open_workers(count) as workers:
        assert raw_rows(workers, shared, groups) == here
    assert [tuple(r["truth"]) for r in here] == [t.truth for g in groups for t in g]


@pytest.mark.slow
def test_rows_on_a_dask_cluster_are_the_same(monkeypatch, shared):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(module, "run_raw_trials", drawn_rows)
    groups = raw_trials(LABELS, 12)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster, open_workers(scheduler=cluster.scheduler_address) as workers:  # fmt: skip
        assert raw_rows(workers, shared, groups) == raw_rows(InProcessWorkers(), replace(shared, keep=None), groups)


def test_a_killed_evaluation_goes_on(monkeypatch, shared):
    monkeypatch.setattr(module, "run_raw_trials", drawn_rows)
    groups = raw_trials(LABELS, 12)
    whole = raw_rows(InProcessWorkers(), shared, groups)
    file = shared.keep / "rows.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-1]) + lines[-1][:20])  # torn by the kill
    told = []
    assert raw_rows(InProcessWorkers(), shared, groups, told.append) == whole
    assert len(told) == len(groups[-1])


def test_rows_of_this_code_are_not_made_again_and_rows_of_older_code_are(monkeypatch, shared):
    monkeypatch.setattr(module, "run_raw_trials", drawn_rows)
    groups = raw_trials(LABELS, 6)
    whole = raw_rows(InProcessWorkers(), shared, groups)
    monkeypatch.setattr(module, "run_raw_trials", refused)
    assert raw_rows(InProcessWorkers(), shared, groups) == whole
    file = shared.keep / "rows.jsonl"
    older = [json.dumps({**json.loads(line), "code": "older"}) + "\n" for line in file.read_text().splitlines()]
    file.write_text("".join(older))
    assert len(read_rows(file)) == len(whole)
    with pytest.raises(AssertionError, match="was there already"):
        raw_rows(InProcessWorkers(), shared, groups)


@pytest.mark.parametrize("name", sorted(PLANS))
def test_every_other_plan_can_be_run(name):
    test = PLANS[name](BEARING)
    instruments = Instruments.like_paper(len(test.bearing.pads))
    rig = VirtualRig(rig_truth(test.bearing, ModelSettings()), test.plan, instruments)
    assert any(run.kind == "dynamic" for run in rig.runs())
    assert {t.pad for t in test.plan.dry} <= set(range(1, len(test.bearing.pads) + 1))


@pytest.fixture(scope="module")
def forward():
    setup = Setup(BEARING, pivot_laws("kirk", BEARING), mesh=Mesh(24, 4), accuracy=1e-7)
    lines = [2 * math.pi * f for f in (15.0, 45.0)]
    speed = 2 * math.pi * 22
    tests = dynamic([2500.0, 5000.0], lines, speed, -math.pi / 2, 5)
    layout = Layout(tests, around(5000.0, 4, speed), dry(range(1, 6)), 200.0)
    return Forward(setup, layout, planned_observations(setup, layout).elements)


@pytest.mark.parametrize(
    "effect",
    [
        Effect("probe_gain", factor=1.05),
        Effect("loadcell_crosstalk", fraction=0.03),
        Effect("channel_delay", delay=1e-4),
        Effect("housing_flexibility", stiffness=2e9),
        Effect("oil_viscosity", factor=1.1),
    ],
    ids=lambda e: e.name,
)
def test_what_is_remembered_is_what_would_be_solved(forward, effect):
    warm = forward.fresh()
    warm()
    first, again = warm((effect,)), warm((effect,))
    assert np.array_equal(first, again)
    np.testing.assert_allclose(first, Forward(forward.setup, forward.layout, forward.elements)((effect,)), rtol=1e-4,
                               atol=1e-9)  # fmt: skip


def test_sensor_errors_cost_no_equilibrium(forward):
    warm = forward.fresh()
    warm()
    before = len(warm.memory.solved)
    warm((Effect("probe_gain", factor=1.05),))
    assert len(warm.memory.solved) == before
    warm((Effect("oil_viscosity", factor=1.1),))
    assert len(warm.memory.solved) > before


def test_a_copy_learns_nothing_from_what_another_solves(forward):
    warm = forward.fresh()
    warm()
    copy = warm.fresh()
    warm((Effect("oil_viscosity", factor=1.1),))
    assert len(copy.memory.solved) < len(warm.memory.solved)


def test_no_equilibrium_is_told(forward):
    layout = replace(forward.layout, dynamic=(replace(forward.layout.dynamic[0], load=5e7),), locus=())
    with pytest.raises(NoEquilibriumError, match="50000000 N"):
        Forward(forward.setup, layout, ())()
