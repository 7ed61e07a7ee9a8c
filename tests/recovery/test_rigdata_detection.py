"""Faults put into good campaigns of the virtual rig: each is found and named; good campaigns raise no alarm."""

from dataclasses import replace

import pytest

from rigdata.problem import Problem
from rigdata.virtual_rig import Fault, Noise, RigPlan
from tests.good_campaigns import PLAN, RUN, stiff_rig
from tpjb_ident.check.campaign import check_campaign

pytestmark = pytest.mark.slow
#: The run that is struck is the third, at 60 deg.
FOUR = (*PLAN.directions[:3], PLAN.directions[4])
#: What a fault in a dynamic run is seen by: the other directions, and one or two of the other kinds of run.
FEW = replace(PLAN, directions=FOUR, locus=PLAN.locus[:2], dry=PLAN.dry[:1], clearance=())
#: What a fault in a static run, or in all runs, is seen by: some of every kind.
ALL_KINDS = replace(PLAN, directions=FOUR, locus=PLAN.locus[:3])


def plan_for(name: str, plan: RigPlan) -> RigPlan:
    """Accelerometers are told by what most of six runs say of them."""
    return replace(plan, directions=PLAN.directions) if "accelerometer" in name else plan


@pytest.fixture
def check(campaign_of):
    def problems(*faults: Fault, seed: int = 1, layout: str = "hdf5", **rig: object) -> list[Problem]:
        return check_campaign(campaign_of(stiff_rig(seed, *faults, **rig), layout))

    return problems


@pytest.mark.parametrize("seed", range(4))
def test_good_campaigns_raise_no_alarm(check, seed):
    assert check(seed=seed) == []


@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_quiet_and_noisy_campaigns_raise_no_alarm(check, factor):
    assert {p.severity for p in check(noise=Noise.like_samples().scaled(factor))} <= {"note"}


ONE_RUN = {
    "dead probe": (Fault("dead", RUN, "X1A"), "error", "channel X1A", "is dead"),
    "dead cell": (Fault("dead", RUN, "L1H"), "error", "channel L1H", "is dead"),
    "dead accelerometer": (Fault("dead", RUN, "A1V"), "error", "channel A1V", "is dead"),
    "stuck": (Fault("stuck", RUN, "X1A", start=0.5, length=0.2),
              "warning", "channel X1A", "200 samples from sample 500"),
    "stuck for long": (Fault("stuck", RUN, "L1V", start=0.5), "error", "channel L1V", "stands still"),
    "clipped": (Fault("clipped", RUN, "L1H"), "error", "channel L1H", "clipped"),
    "slightly clipped": (Fault("clipped", RUN, "X1A", value=0.9), "warning", "channel X1A", "clipped"),
    "probes swapped": (Fault("swapped", RUN, "X1A", other="X1B"), "error", "displacement", "X1A and X1B were swapped"),
    "cells swapped": (Fault("swapped", RUN, "L1H", other="L1V"), "error", "mean force", "L1H and L1V were swapped"),
    "probe inverted": (Fault("inverted", RUN, "X1A"), "error", "displacement", "X1A had the wrong sign"),
    "cell across the load inverted": (Fault("inverted", RUN, "L1H"), "error", "force", "excitation shows along"),
    "cell along the load inverted": (Fault("inverted", RUN, "L1V"), "error", "mean force", "L1V had the wrong sign"),
    "probe ten times": (Fault("scaled", RUN, "X1A", value=10.0),
                        "error", "displacement", "X1A read ten times too large"),
    "cell a tenth": (Fault("scaled", RUN, "L1H", value=0.1), "error", "displacement", "L1H read ten times too small"),
    "gap without values": (Fault("nan_gap", RUN, "X1A", start=0.5, length=0.2),
                           "warning", "channel X1A", "200 of 2000"),
    "probe a tenth too much": (Fault("scaled", RUN, "X1A", value=1.1), "warning", "channel X1A", "% too much"),
    "cell a tenth too much": (Fault("scaled", RUN, "L1H", value=1.1), "warning", "channel L1H", "% too much"),
    "one probe late": (Fault("delayed", RUN, "X1A", value=0.003), "warning", "displacement", "differs by"),
    "crosstalk": (Fault("crosstalk", RUN, "L1H", value=0.3), "warning", "mean force", "points to"),
    "no excitation": (Fault("missing_excitation", RUN), "error", "force", "no line at the excitation frequency"),
    "other frequency": (Fault("wrong_frequency", RUN, value=3.0), "error", "force", "other line is near 25 Hz"),
    "other direction": (Fault("wrong_direction", RUN, value=0.4), "warning", "force", "excitation_direction says"),
    "load a tenth off": (Fault("wrong_load", RUN, value=1.1), "warning", "mean force", "other runs of the campaign"),
    "accelerometers swapped": (Fault("swapped", RUN, "A1H", other="A1V"),
                               "warning", "channels A1H and A1V", "the housing's mount and the other runs"),
    "accelerometer inverted": (Fault("inverted", RUN, "A1H"), "warning", "channels A1H", "A1H had the wrong sign"),
    "other load": (Fault("wrong_load", RUN, value=1.6), "error", "mean force", "static_load says 8000 N"),
    "copied run": (Fault("duplicate_run", RUN, other="d-05000-25-02"),
                   "error", "", "very samples of run d-05000-25-02"),
    "wrong pad direction": (Fault("wrong_direction", "p-2-up", value=1.2), "error", "force", "but its force grows"),
    "probe inverted, dry": (Fault("inverted", "p-2-up", "X1A"), "error", "channels", "X1A had the wrong sign"),
    "probes swapped, dry": (Fault("swapped", "p-2-up", "X1A", other="X1B"), "error", "channels", "were swapped"),
    "probes swapped, sweep": (Fault("swapped", "c-1", "X1A", other="X1B"),
                              "warning", "channels", "does not go to the side"),
    "channel missing": (Fault("missing_channel", RUN, "X1A"), "error", "dataset X1A", "missing"),
    "thermometer missing": (Fault("missing_channel", RUN, "T1"), "warning", "dataset T1", "missing"),
    "short channel": (Fault("short_channel", RUN, "X1A"), "error", "dataset X1A", "the others have 2000"),
    "group missing": (Fault("missing_file", RUN), "error", "", "group is missing"),
    "no samples": (Fault("empty_file", RUN), "error", "time", "only 0 samples"),
    "csv: time gap": (Fault("time_gap", RUN, start=0.5, length=0.2), "warning", "channel X1A", "200 of 2000"),
    "csv: jitter": (Fault("time_jitter", RUN), "warning", "", "jitters"),
    "csv: column twice": (Fault("duplicate_column", RUN, "X1A"), "error", "", "'X1A' is in columns 2, 14"),
    "csv: last line cut": (Fault("truncated_line", RUN), "warning", "", "cut off"),
    "csv: file missing": (Fault("missing_file", RUN), "error", "", "not there"),
    "csv: file empty": (Fault("empty_file", RUN), "error", "", "no samples"),
    "csv: column missing": (Fault("missing_channel", RUN, "L1V"), "error", "", "missing"),
}  # fmt: skip


@pytest.mark.parametrize("name", ONE_RUN)
def test_fault_in_one_run(check, name):
    fault, severity, place, says = ONE_RUN[name]
    layout = "csv-german" if name.startswith("csv") else "hdf5"
    found = check(fault, layout=layout, plan=plan_for(name, FEW if fault.run == RUN else ALL_KINDS))
    hits = [p for p in found if p.severity == severity and p.place.startswith(place) and says in p.what]
    assert [p.run for p in hits] == [fault.run], [str(p) for p in found]
    # Nothing is said of other runs.
    assert {p.run for p in found} == {fault.run}, [str(p) for p in found]


@pytest.mark.parametrize(("run", "named"), [("p-2-up", 3), ("p-4-up", 1), ("p-1-up", 5)])
def test_a_wrong_pad_number_is_named_at_its_run(check, run, named):
    found = check(Fault("wrong_pad", run, value=float(named)), plan=ALL_KINDS)
    assert [(p.run, p.severity, p.place) for p in found] == [(run, "error", "pad")], [str(p) for p in found]
    assert f"it is pad {run[2]}" in found[0].what


ALL_RUNS = {
    "probes swapped": (Fault("swapped", "*", "X1A", other="X1B"), "X1A and X1B were swapped"),
    "cells swapped": (Fault("swapped", "*", "L1H", other="L1V"), "L1H and L1V were swapped"),
    "probe A inverted": (Fault("inverted", "*", "X1A"), "X1A had the wrong sign"),
    "probe B inverted": (Fault("inverted", "*", "X1B"), "X1B had the wrong sign"),
    "vertical cell inverted": (Fault("inverted", "*", "L1V"), "L1V had the wrong sign"),
    "horizontal cell inverted": (Fault("inverted", "*", "L1H"), "L1H had the wrong sign"),
    "cells a tenth": (Fault("scaled", "*", "L1*", value=0.1), "10 times too large"),
    "probe ten times": (Fault("scaled", "*", "X1A", value=10.0), "one sensitivity were ten times off"),
    "accelerometer inverted": (Fault("inverted", "*", "A1H"), "they move with the cells' force"),
    "accelerometer dead": (Fault("dead", "*", "A1H"), "is dead"),
    "speed doubled": (Fault("scaled", "*", "K1", value=2.0), "shaft_speed says 22 Hz"),
}


@pytest.mark.parametrize("name", ALL_RUNS)
def test_fault_in_all_runs_is_told_once_for_the_campaign(check, name):
    fault, says = ALL_RUNS[name]
    found = check(fault, plan=plan_for(name, ALL_KINDS))
    assert any(p.run is None and says in p.what for p in found), [str(p) for p in found]
