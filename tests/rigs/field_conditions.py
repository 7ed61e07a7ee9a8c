"""Conditions of a rig elsewhere, and what becomes of its coefficients there: right, reported or silently wrong.

Twelve of the ninety of the first field battery (tests/studies/RESULTS.md), one of each kind.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.rigs.campaign_file import plans_of
from tests.rigs.field_rig import CHANNELS, Device, Plan, Rig
from tpjb_ident.cli.command import Command
from tpjb_ident.cli.identification import identify_settings, refuse_untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.identification.identify import identify
from tpjb_ident.results.identification import Identification

CELLS = tuple(name for name, (quantity, _) in CHANNELS.items() if quantity == "force")
RIG = Rig()
#: Turns with the drive, with much runout.
LOCKED = replace(RIG, locked=True, runout=(6e-6, 2e-6, 1e-6))
SOFT = replace(RIG, cell_stiffness=(5e7, 7e7), housing_mass=120.0)
SWAPPED = {"A1": Device(source="A2"), "A2": Device(source="A1")}


@dataclass(frozen=True)
class Row:
    """One condition: rig, runs, what the manifest says more."""

    name: str
    rig: Rig
    plans: Sequence[Plan] = field(default_factory=plans_of)
    extra: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


def with_cells(device: Device) -> Rig:
    """The rig with the same device on both cells."""
    return replace(RIG, devices=dict.fromkeys(CELLS, device))


def dry_runs() -> list[Plan]:
    """The same test without oil and rotation."""
    return [replace(plan, id=f"b-{plan.id}", load=500.0, dry=True) for plan in plans_of(loads=(500.0,))]


def rows() -> list[Row]:
    """All conditions."""
    late = replace(with_cells(Device(lag=1e-4)), channels=("D1", "D2", *CELLS), housing_mass=1.0)
    turned = {"D1": Device(turn=np.radians(1.0))}
    at_60 = plans_of(frequencies=(60.0,))
    return [
        Row("cells' clock 100 ppm off, 3 s", with_cells(Device(100 * 1e-6))),
        Row("cells at 250 Hz, held", with_cells(Device(slow=250.0, hold=True))),
        Row("cells 0.1 ms late, uncertainty 0.1 ms stated", late,
            extra={cell: {"delay_uncertainty": '"0.1 ms"'} for cell in CELLS}),
        Row("drive at 25.05 Hz, set point 25", replace(RIG, real_frequency=25.05)),
        Row("drive locked to 1X", LOCKED, plans_of(frequencies=(22.0,))),
        Row("drive locked to 1X, keyphasor, two directions", replace(LOCKED, keyphasor=True),
            plans_of(frequencies=(22.0,), directions=2, repeats=2)),
        Row("speed drifts 0.6 Hz, 1.5 s", replace(RIG, speed_drift=0.6, seconds=1.5)),
        Row("accelerometers swapped", replace(SOFT, devices=SWAPPED), at_60),
        Row("a probe turned 1 deg, 1 deg stated", replace(RIG, devices=turned),
            extra={"D1": {"axis_uncertainty": '"1 deg"'}, "D2": {"axis_uncertainty": '"1 deg"'}}),
        Row("piezo cells", replace(RIG, static=False)),
        Row("a stiffness beside the film, dry test in the campaign", replace(RIG, baseline=(2e7, 3e7)),
            [*plans_of(), *dry_runs()]),
        Row("one load, 8 directions", RIG, plans_of(loads=(5000.0,), directions=8)),
    ]  # fmt: skip


def judge(path: Path, rig: Rig) -> tuple[str, float]:
    """Identify one campaign as the command does; the word for it, and the largest error in half-intervals."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            campaign = load_campaign(path)
            result = identify(campaign, identify_settings(Command("identify", {}), campaign, "mm-eiv", None))
            result.to_frame()
    except (BadInputError, RigDataError):
        return "reported", 0.0
    trusted = [] if any(c.severity == "error" for c in result.conditions) else trusted_errors(result, rig)
    worst = max((float(ratio.max()) for ratio in trusted), default=0.0)
    if any((ratio <= 1).sum() < 5 or ratio.max() > 2.5 for ratio in trusted):
        return "silent", worst
    try:
        refuse_untrusted(result)
    except NotTrustedError:
        return "reported", worst
    return "right" if len(trusted) == len(result.points) else "reported", worst


def trusted_errors(result: Identification, rig: Rig) -> list[np.ndarray]:
    """Errors of K and C (8,) over their half-intervals at each point that no error stands against."""
    errors = []
    for p in result.points:
        est = p.stiffness
        if any(c.severity == "error" for c in p.quality) or not np.isfinite(est.h).all():
            continue
        omega = 2 * np.pi * (rig.real_frequency or p.point.excitation_hz)
        h = rig.bearing.h(omega, p.point.static_load)
        truth = np.concatenate([h.real.ravel(), h.imag.ravel() / omega])
        half = np.asarray(est.half_width()) / np.repeat([1.0, est.omega], 4)
        off = np.abs(np.concatenate([est.k.ravel(), est.c.ravel()]) - truth)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(half > 0, off / half, np.inf)
        errors.append(np.where(np.isfinite(half), ratio, 0.0))
    return errors
