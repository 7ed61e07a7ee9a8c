"""A drive that turns with the shaft: runout is told from motion where phases and directions allow it, else refused."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.run import pulse_times
from tests.rigs.closed_form import Rig, write_rig
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.phasors.frequency import shaft_order

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
