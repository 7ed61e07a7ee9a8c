"""Virtual campaigns with dry tests whose pivot laws are plain functions: for recovery tests and benchmarks.

The virtual rig knows nothing of `tpjb_ident`; what it is given here is all the truth there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rigdata.campaign import Campaign, load_campaign
from rigdata.virtual_rig import (
    CampaignTruth,
    DryTest,
    Fault,
    Instruments,
    Noise,
    RigPlan,
    RigTruth,
    VirtualRig,
    write_campaign,
)

ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])
LOADS = np.array([1000.0, 2000.0, 4000.0])
CONTACT_LOAD = 500.0
CONTACT_TOLERANCE = 0.05
KINDS = ("rocker", "rocker on housing", "sphere", "sphere on housing")


#: Load programmes, one test each; `dataclasses.replace` gives them another pad.
PROGRAMMES = {
    "down": DryTest(1, branch="down"),
    "cycle": DryTest(1, branch="cycle"),
    "unequal": DryTest(1, hold=(0.5, 2.0, 1.0, 0.6, 3.0, 1.0, 0.8, 1.5, 0.5, 2.0), overshoot=0.1, load_drift=-0.003),
    "few": DryTest(1, levels=(1000.0, 2500.0, 5000.0), hold=3.0, ramp=1.0),
    "ramp": DryTest(1, levels=(5000.0,), hold=0.1, ramp=12.0),
}


class Line:
    """Rocker: the printed formula's shape, softer by `f`, with a housing of compliance `housing` in series."""

    def __init__(self, f: float = 1.0, housing: float = 0.0) -> None:
        self.c, self.housing = 7.0e-11 / f, housing

    def deflection(self, load):
        """Deflection [m] under a load [N]."""
        load = np.asarray(load, dtype=float)
        return self.c * load * (18.95 - np.log(np.maximum(load, 1e-6))) + self.housing * load

    def compliance(self, load):
        """Tangent compliance [m/N] under a load [N]."""
        return self.c * (17.95 - np.log(load)) + self.housing


class Sphere:
    """Point contact, with a housing of compliance `housing` in series."""

    def __init__(self, f: float = 1.0, housing: float = 0.0) -> None:
        self.c, self.housing = 6.03e-8 / f, housing

    def deflection(self, load):
        """Deflection [m] under a load [N]."""
        return self.c * np.cbrt(np.asarray(load, dtype=float)) ** 2 + self.housing * load

    def compliance(self, load):
        """Tangent compliance [m/N] under a load [N]."""
        return self.c * 2.0 / 3.0 / np.cbrt(load) + self.housing


def bearing(kind: str, seed: int) -> list:
    """Five laws of one make, each pad with a stiffness of its own."""
    rng = np.random.default_rng(seed)
    factors = rng.uniform(0.3, 1.0, 5)
    return {
        "rocker": [Line(f) for f in factors],
        "rocker on housing": [Line(f, 3e-10) for f in factors],
        "sphere": [Sphere(f) for f in factors],
        "sphere on housing": [Sphere(f, 5e-10) for f in factors],
    }[kind]


def truth_of(laws: Sequence) -> RigTruth:
    """Physics of a bearing with these pivots."""
    return RigTruth.constant(
        np.diag([2e8, 4e8]),
        np.diag([4e5, 6e5]),
        pivot_deflection=lambda pad, load: laws[pad - 1].deflection(load),
    )


def campaign(path: Path | str, laws: Sequence, seed: int, **changes) -> tuple[Campaign, CampaignTruth]:
    """Write a campaign with dry tests and open it; gives its truth too."""
    plan = RigPlan(
        dry=changes.pop("dry", tuple(DryTest(p) for p in range(1, 6))), clearance=changes.pop("clearance", ())
    )
    rig = VirtualRig(
        truth_of(laws),
        plan,
        instruments=changes.pop("instruments", Instruments.like_paper(seed=seed)),
        noise=changes.pop("noise", Noise.like_samples()),
        seed=seed,
        **changes,
    )
    Path(path).unlink(missing_ok=True)
    written = write_campaign(path, rig)
    return load_campaign(path), written


def true_onset(law, gap: float) -> float:
    """Load from which the contact loss adds less than 5 % to the compliance [N]."""
    load = np.linspace(20.0, 7000.0, 70_000)
    missing = gap / CONTACT_LOAD * np.exp(-load / CONTACT_LOAD) > CONTACT_TOLERANCE * law.compliance(load)
    return float(load[missing].max())


def refusal_cases() -> list[Fault]:
    """Every way in which one dry run, or all of them, can be other than they claim."""
    cases = []
    for pad in range(1, 6):
        run = f"p-{pad}-up"
        for channel, other in (("X1A", "X1B"), ("L1H", "L1V")):
            cases.append(Fault("swapped", run, channel, other=other))
            cases += [Fault("inverted", run, name) for name in (channel, other)]
        cases += [Fault("wrong_pad", run, value=other) for other in range(1, 6) if other != pad]
    cases.append(Fault("swapped", "p-*", "X1A", other="X1B"))
    cases.append(Fault("swapped", "p-*", "L1H", other="L1V"))
    return cases
