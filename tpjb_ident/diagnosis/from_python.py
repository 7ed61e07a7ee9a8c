"""`ti.diagnose` and `ti.plan`: the diagnosis and the plan of a campaign in one call, paths welcome."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect
from model.mirror import as_it_turns
from model.pivots import pivot_laws
from model.setup import Setup
from rigdata.near_names import unknown_name
from rigdata.operating_point import OperatingPoint
from rigdata.units import to_si
from tpjb_ident.arguments import as_bearing, as_campaign
from tpjb_ident.diagnosis.campaign import Baseline, CampaignDiagnosis, diagnose_campaign
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.observations.observe import DynamicTest, Layout
from tpjb_ident.diagnosis.plan import CampaignPlan
from tpjb_ident.diagnosis.plan import plan as work_out
from tpjb_ident.diagnosis.planned import around, dry, dynamic
from tpjb_ident.errors import ArgumentError

if TYPE_CHECKING:
    from rigdata.campaign import Campaign

#: Set points of a plan, in the order of an operating point, and what they must be.
_POINT = {"load": "force", "load_direction": "angle", "speed": "speed", "excitation": "speed"}


def diagnose(
    campaign: Campaign | str | Path,
    bearing: Bearing | str | Path | None = None,
    *,
    pivots: Any = "kirk",
    thermal: str = "adiabatic",
    effects: Sequence[Effect] = (),
    settings: DiagnoseSettings | None = None,
) -> CampaignDiagnosis:
    """Identify a campaign and find what its model lacks.

    Parameters
    ----------
    campaign : Campaign, str or Path
    bearing : Bearing, str or Path, optional
        Default: the one that the campaign carries.
    pivots : object
        Where to start from: ``"kirk"``, ``"rigid"``, ``"measured"``, a path or laws.
    thermal : {"isothermal", "adiabatic", "tehd", "thd"}
    effects : sequence of Effect
        Already in the model.
    settings : DiagnoseSettings, optional
        Default: tolerances as in `docs/diagnosis.md`, all cores; another one is stated by
        ``DiagnoseSettings(tolerances=Tolerances().states({"model": 0.03}, "script"))``.

    Returns
    -------
    CampaignDiagnosis
        Its ``diagnosis.verdict`` says what was found; ``summary()`` in words.

    Raises
    ------
    ComparisonError
        The campaign has no dynamic runs.
    ArgumentError
        No campaign, or no bearing anywhere.

    Examples
    --------
    Asked about two effects; without settings about all of the library.

    >>> from model.effects import known_effects
    >>> from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
    >>> others = frozenset(known_effects()) - {"pivot_flexibility", "soft_pivot"}
    >>> result = ti.diagnose(demo, settings=DiagnoseSettings(skip=others))
    >>> print(result.summary().split(" and ")[0])
    demo: All pivots have 37.6 ± 2.1 % of the formula's stiffness
    """
    opened = as_campaign(campaign, "campaign")
    return diagnose_campaign(opened, _bearing_of(opened, bearing), Baseline(pivots, thermal, tuple(effects)), settings)


def plan(
    bearing: Bearing | str | Path,
    points: Sequence[OperatingPoint] | Mapping[str, Any],
    *,
    pivots: Any = "kirk",
    locus: int = 20,
    dry_tests: bool = True,
    push: Any = 200.0,
    temperatures: bool = True,
) -> CampaignPlan:
    """Tell which effects a planned campaign could see, from which size on, and which it would mix up.

    Parameters
    ----------
    bearing : Bearing, str or Path
    points : sequence of OperatingPoint, or mapping
        Of the dynamic runs; or ``{"load": .., "speed": .., "excitation": .., "load_direction": ..}``, single values or
        lists, SI or pint quantities: every combination is a point. The direction is straight down where none is given.
    pivots : object
        As of `diagnose`.
    locus : int
        Load directions of the shaft locus; 0: none.
    dry_tests : bool
        Dry load-deflection tests on all pads.
    push : float or pint quantity
        Push load of the clearance sweep [N]; 0: none.
    temperatures : bool
        A temperature sensor in every pad.

    Raises
    ------
    ArgumentError
        No dynamic runs.

    Examples
    --------
    >>> points = {"load": [2500.0, 7500.0], "speed": 138.0, "excitation": 157.0}
    >>> campaign = ti.plan(rocker, points, locus=0, dry_tests=False)
    >>> campaign.to_frame().columns[:3].tolist()
    ['effect', 'parameter', 'unit']
    """
    tests = points_of(points) if isinstance(points, Mapping) else points
    drawn = as_it_turns(as_bearing(bearing, "bearing"), {point.rotation for point in tests})
    static = (locus, dry_tests, float(to_si(push, "force", "push")), temperatures)
    return work_out(Setup(drawn, pivot_laws(pivots, drawn)), planned_layout(drawn, tests, static))


def points_of(given: Mapping[str, Any]) -> list[OperatingPoint]:
    """Every combination of loads, directions, speeds and excitation frequencies."""
    for name in given:
        if name not in _POINT:
            raise ArgumentError(f"points: {unknown_name('set point', name, _POINT)}")
    lists = {}
    for name, dimension in _POINT.items():
        if name not in given and name != "load_direction":
            raise ArgumentError(f"points: {name} is missing. Give load, speed and excitation.")
        value = given.get(name, -math.pi / 2)
        lists[name] = np.atleast_1d(np.asarray(to_si(value, dimension, f"points: {name}"), dtype=float)).tolist()
    combinations = itertools.product(*lists.values())
    return [OperatingPoint(load, angle, speed, line) for load, angle, speed, line in combinations]


def planned_layout(bearing: Bearing, points: Sequence[OperatingPoint], static: tuple[int, bool, float, bool]) -> Layout:
    """Lay out the tests of a plan."""
    directions, with_dry, push, sensors = static
    if not points:
        raise ArgumentError("points: the plan has no dynamic runs. Give at least one operating point.")
    pads = len(bearing.pads)
    keys = sorted({(p.static_load, p.static_load_direction, p.spin) for p in points})
    tests: list[DynamicTest] = []
    for w, direction, omega in keys:
        lines = sorted({p.excitation for p in points if (p.static_load, p.spin) == (w, omega)})
        tests += dynamic([w], lines, omega, direction, pads if sensors else 0)
    middle = keys[len(keys) // 2]
    return Layout(
        tuple(tests),
        around(middle[0], directions, middle[2]) if directions else (),
        dry(range(1, pads + 1)) if with_dry else (),
        push if push > 0 and math.isfinite(push) else None,
    )


def _bearing_of(campaign: Campaign, given: Bearing | str | Path | None) -> Bearing:
    """The bearing given, or the one that a campaign carries."""
    if given is not None:
        return as_bearing(given, "bearing")
    if not campaign.bearing_text:
        raise ArgumentError(f"bearing: campaign {campaign.id} carries no bearing file. Give one, or its path.")
    return load_bearing(campaign.bearing_text)
