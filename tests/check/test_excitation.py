"""What drives a run is judged beside the runs of its own operating point, along force or displacement."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rigdata.operating_point import OperatingPoint
from rigdata.vector import directions
from tpjb_ident.check.findings import Reporter
from tpjb_ident.check.set_points import check_excitation


def observation(load, size, stated=0.0, force=0.0, displacement=45.0, frequency=25.0):
    """A run driven along `stated`, whose force and displacement act along other angles [deg]."""
    point = OperatingPoint(load, -np.pi / 2, 138.0, 2 * np.pi * frequency)
    run = SimpleNamespace(id="r", file="r.csv", point=point, excitation_direction=np.radians(stated))
    lines = {"displacement": 1e-6 * directions(np.radians(displacement)), "force": size * directions(np.radians(force))}
    return SimpleNamespace(
        run=run, report=Reporter(run), other_line=np.nan, shows=lambda quantity: True,
        film_force=lambda mass: lines["force"], line=lines.get, names=lambda quantity: ["L1H", "L1V"],
        of=lambda quantity: [],
    )  # fmt: skip


def findings(runs):
    check_excitation(runs, 30.0)
    return [[finding.key for finding in run.report.findings] for run in runs]


def test_strength_is_that_of_the_operating_point():
    """Of a rig whose drive is as strong at 250 N as at 8 kN, and one whose shaker fades with the frequency."""
    loads = [observation(load, 1000.0) for load in (250.0, 8000.0) for _ in range(4)]
    fading = [observation(5000.0, size, frequency=f) for size, f in ((1000.0, 20.0), (60.0, 90.0)) for _ in range(4)]
    assert findings(loads + fading) == [[]] * 16
    idle = [*(observation(8000.0, 1000.0) for _ in range(4)), observation(8000.0, 60.0)]
    assert findings(idle) == [[]] * 4 + [["no excitation"]]


@pytest.mark.parametrize(
    ("force", "displacement", "named"), [(26.0, 1.0, []), (4.0, 30.0, []), (26.0, 30.0, ["excitation direction"])]
)
def test_force_or_displacement_acts_along_the_stated_direction(force, displacement, named):
    assert findings([observation(5000.0, 1000.0, 0.0, force, displacement)]) == [named]
