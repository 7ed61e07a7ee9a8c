"""Creep within the holds of dry tests: named and taken off where all runs show it, and drift is not taken for it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pivot.test_assemble import LEVELS, record
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.blocks import Blocks, Hold
from tpjb_ident.pivot.creep import without_creep

NOISE = NoiseModel(white=1e-17, flicker=1e-17, drift=1e-9)
#: Blocks of a hold, and its length [s].
PER, LONG = 10, 20.0
PADS = range(1, 6)


def campaign(creep=0.0, drift=0.0, creeping=PADS):
    """Staircases with holds of twenty seconds; deflections creep anew in every hold, probes drift either way."""
    made = []
    for pad in PADS:
        rng, one = np.random.default_rng(pad), record(pad)
        time = (np.arange(len(LEVELS) * PER) + 0.5) * LONG / PER
        load = np.repeat(LEVELS, PER)
        deflection = 4e-9 * load * (1.0 + creep * (pad in creeping) * -np.expm1(-(time % LONG) / 30.0))
        deflection += drift * rng.choice([-1.0, 1.0]) * time
        n, zeros = len(time), np.zeros(len(time))
        duration = np.full(n, LONG / PER)
        deflection += np.linalg.cholesky(NOISE.covariance(time, duration)) @ rng.standard_normal(n)
        hold, branch = np.repeat(np.arange(len(LEVELS)), PER), np.ones(n, dtype=int)
        blocks = Blocks(time, duration, load, zeros, deflection, zeros, zeros, zeros, hold, branch)
        holds = tuple(Hold(LONG * k, LONG * (k + 1), level) for k, level in enumerate(LEVELS))
        made.append(replace(one, blocks=blocks, holds=holds, good=np.ones(n, dtype=bool)))
    return made


@pytest.mark.parametrize(("creep", "drift"), [(0.0, 0.0), (0.0, 2e-9), (0.02, 0.0), (0.02, 2e-9)])
def test_what_all_holds_show_alike_is_taken_off_and_drift_is_not(creep, drift):
    given = campaign(creep, drift)
    less, _, conditions = without_creep(given, NOISE)
    assert conditions == dict.fromkeys(PADS, ("deflection-creeps",) if creep else ())
    if not creep:
        assert less == given
        return
    assert all(0.005 < one.creep < 0.06 for one in less)
    if not drift:
        slopes = [np.polyfit(one.blocks.load, one.blocks.deflection, 1)[0] for one in less]
        np.testing.assert_allclose(slopes, 4e-9, rtol=0.03)


def test_records_without_holds_tell_no_creep():
    ramps = [replace(one, holds=()) for one in campaign(0.02)]
    assert without_creep(ramps, NOISE) == (ramps, NOISE, dict.fromkeys(PADS, ()))


@pytest.mark.parametrize("creeping", [(2,), (3, 5), (1, 2, 3, 4)])
def test_what_a_pad_alone_shows_is_taken_off_and_the_others_stay(creeping):
    given = campaign(0.1, creeping=creeping)
    less, _, conditions = without_creep(given, NOISE)
    assert conditions == {pad: ("deflection-creeps",) if pad in creeping else () for pad in PADS}
    for pad, before, after in zip(PADS, given, less, strict=True):
        assert (after is before) == (pad not in creeping)
        slope = np.polyfit(after.blocks.load, after.blocks.deflection, 1)[0]
        assert abs(slope / 4e-9 - 1.0) < max(1.5 * after.creep, 0.03)


@pytest.mark.parametrize("size", [-2e-6, -0.3e-6, 0.3e-6, 2e-6])
@pytest.mark.parametrize("place", [0.32, 0.55, 0.88])
def test_a_jump_within_one_hold_is_no_creep(size, place):
    """It read as a creep of 200 %, which left nothing of the deflection: a pivot of 1e23 N/m."""
    given = campaign()
    blocks = given[1].blocks
    after = blocks.time > place * blocks.time[-1]
    given[1] = replace(given[1], blocks=replace(blocks, deflection=blocks.deflection + size * after))
    less, _, conditions = without_creep(given, NOISE)
    assert less == given
    assert not any(conditions.values())
