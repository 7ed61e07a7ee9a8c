"""Exports of strange laboratories become coefficients by few typed lines, and their drafts are true."""

import importlib

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.survey.exports import read_exports
from rigdata.survey.survey import survey
from tests.rigs.laboratories import through
from tests.rigs.strange_exports import CLEARANCES, KGF, LABORATORIES, LBF, PADS, deflection, planned_runs, write_exports
from tpjb_ident.clearance.measure import measure_clearance
from tpjb_ident.pivot.fit import fit_pivots

pytestmark = pytest.mark.slow

#: Typed lines at most: where cells and probes are in volts, and where the files state their units.
VOLTS, UNITS = 10, 3
NAMES = [laboratory.name for laboratory in LABORATORIES]


def needs_library(laboratory):
    for name, library in (("TDMS", "nptdms"), ("MATLAB", "scipy"), ("Parquet", "pyarrow")):
        if laboratory.name.startswith(name):
            importlib.import_module(library)


@pytest.fixture(scope="module", params=LABORATORIES, ids=NAMES)
def surveyed(request, tmp_path_factory):
    """A laboratory, and what is concluded from its files and the pads' angles."""
    needs_library(request.param)
    folder = tmp_path_factory.mktemp("records")
    write_exports(folder, request.param)
    problems = []
    exports = list(read_exports(folder, problems))
    assert not problems
    return request.param, survey(exports, pivots=PADS)


def direction(guess):
    """Where a sensor points [deg], its sign counted in."""
    return guess.axis.value + (180.0 if guess.polarity < 0 else 0.0)


def test_axes_and_signs_are_those_of_the_rig(surveyed):
    laboratory, result = surveyed
    for sensor in laboratory.sensors[:6]:
        guess = result.channels[sensor.name.partition(" [")[0]]
        assert guess.quantity.value == sensor.quantity
        assert "residual" in guess.axis.reason
        turned = direction(guess) - sensor.axis - (180.0 if sensor.gain < 0 else 0.0)
        assert abs((turned + 180.0) % 360.0 - 180.0) < 1e-9, f"{sensor.name}: {guess.axis}"


def test_runs_are_what_was_done(surveyed):
    laboratory, result = surveyed
    runs = {run.file.rpartition(".")[0]: run for run in result.runs}
    kinds = {"dry": "dry_pivot", "dynamic": "dynamic", "clearance": "clearance"}
    for test in planned_runs(laboratory):
        run = runs[laboratory.title(test)]
        assert run.kind.value == kinds[test.kind]
        if test.kind == "dry":
            assert run.pad.value == test.pad
            assert np.cos(np.radians(run.direction.value) - PADS[test.pad - 1]) > 1.0 - 1e-6
        if test.kind == "dynamic":
            assert run.speed.value == pytest.approx(22.0)
            assert run.excitation.value == test.frequency  # never what turns with the shaft
            assert run.load.value == pytest.approx(test.load, rel=0.005)
            units = {"kN": 1e3, "N": 1.0, "lbf": LBF, "kgf": KGF}
            assert run.load.text in [f"{round(test.load / size, 3):g} {unit}" for unit, size in units.items()]
            assert run.direction.value == -90.0


@pytest.mark.parametrize("laboratory", LABORATORIES, ids=NAMES)
def test_from_records_to_coefficients_with_few_lines_by_hand(laboratory, tmp_path):
    needs_library(laboratory)
    way = through(laboratory, tmp_path)
    assert way["lines"] <= (VOLTS if "volts" in laboratory.name else UNITS)
    assert way["messages"] <= (4 if "two devices" in laboratory.name else 1)
    assert way["K"] < 0.1
    assert way["C"] < 0.2


def test_static_tests_of_two_devices_meet_by_their_times(tmp_path):
    pytest.importorskip("nptdms")
    laboratory = next(lab for lab in LABORATORIES if "two devices" in lab.name)
    through(laboratory, tmp_path, last="check")
    campaign = load_campaign(tmp_path / "records")
    step = 10.0
    truth = step / (deflection(4000.0 + step / 2) - deflection(4000.0 - step / 2))
    for curve in fit_pivots(campaign, PADS):
        assert curve.stiffness(4000.0) == pytest.approx(truth, rel=0.02)
    clearance = measure_clearance(campaign, PADS)
    np.testing.assert_allclose(clearance.clearance, CLEARANCES, atol=1.5e-6)
