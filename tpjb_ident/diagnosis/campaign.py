"""From a campaign to a diagnosis: identify, measure the static tests, observe, diagnose."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from model.effects import Effect, apply_effects
from model.instruments import Instruments
from model.mirror import as_it_turns, rotation_of
from model.pivots import NAMED_LAWS, pivot_laws
from model.setup import Setup
from tpjb_ident.compare.comparison import ComparisonError
from tpjb_ident.compare.predictions import measured_laws
from tpjb_ident.compare.static_tests import measure_static
from tpjb_ident.conditions import led_by
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.diagnose import Diagnosis, before_and_after, diagnose, median_deviations
from tpjb_ident.diagnosis.forward.forward import SENSOR
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.observations.observe import observe, observe_table
from tpjb_ident.errors import BadInputError
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.presentation import Presented

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd

    from model.bearing import Bearing
    from model.pivots import PivotLaw
    from rigdata.campaign import Campaign
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.compare.static_tests import StaticTests
    from tpjb_ident.results.identification import Identification


@dataclass(frozen=True)
class Baseline:
    """Where a diagnosis starts from."""

    pivots: Any = "kirk"
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()

    @property
    def from_measured(self) -> bool:
        """Whether the pivots were measured: what is found on them counts from there."""
        return not isinstance(self.pivots, float) and self.pivots not in NAMED_LAWS


@dataclass(frozen=True, repr=False)
class CampaignDiagnosis(Presented):
    """A diagnosis with what it was made from."""

    name: str  #: of the campaign, or of the table
    diagnosis: Diagnosis
    identification: Identification | None
    setup: Setup

    def to_dataframe(self) -> pd.DataFrame:
        """K and C measured, predicted before, and predicted with the effects found: columns as comparison.csv."""
        return before_and_after(self.diagnosis, self.identification)

    @property
    def doubt(self) -> str:
        """Why it is not to be trusted; "" where it is."""
        return "" if self.identification is None else self.identification.doubt

    def summary(self) -> str:
        """What was found, and what it rests on."""
        from tpjb_ident.report.diagnosis_page import verdict_sentences

        off = median_deviations(self.to_dataframe())
        return "\n".join(led_by(self.doubt, verdict_sentences(self.name, self.diagnosis.verdict, off)))

    def plot(self, **options: Any) -> Any:
        """Draw the gap by observable, before and after; see `tpjb_ident.report.plots.gap`."""
        from tpjb_ident.report import plots

        return plots.gap(self.diagnosis, **options)


def diagnose_campaign(
    campaign: Campaign,
    bearing: Bearing,
    baseline: Baseline | None = None,
    settings: DiagnoseSettings | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    ahead: Callable[[], StaticTests | None] | None = None,
) -> CampaignDiagnosis:
    """Identify a campaign and find what its model lacks.

    Parameters
    ----------
    campaign : Campaign
    bearing : Bearing
    baseline : Baseline, optional
    settings : DiagnoseSettings, optional
        Tolerances that the bearing file and the campaign's manifest state take the place of defaults.
    progress : callable, optional
        ``progress(text, done, total)``.
    ahead : callable, optional
        Gives what `measure_static` has found meanwhile; None: nothing was.

    Raises
    ------
    ComparisonError
        The campaign has no dynamic runs.

    Examples
    --------
    >>> from model.effects import known_effects
    >>> from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
    >>> campaign = ti.load_campaign(demo)
    >>> others = frozenset(known_effects()) - {"pivot_flexibility", "soft_pivot"}
    >>> bearing = ti.load_bearing(campaign.bearing_text)
    >>> found = diagnose_campaign(campaign, bearing, Baseline("measured"), DiagnoseSettings(skip=others))
    >>> print(found.diagnosis.verdict.verdict)
    consistent
    """
    settings, baseline = settings or DiagnoseSettings(), baseline or Baseline()
    report = progress or (lambda text, done, total: None)
    rotations = {run.rotation for run in campaign.runs if run.point.shaft_speed}
    bearing = as_it_turns(bearing, rotations, campaign.rotation)
    identification, static = measure_campaign(campaign, bearing, report, ahead)
    tolerances = _stated_tolerances(campaign, bearing, settings.tolerances)
    if static.clearance is None and static.locus is not None:
        tolerances = replace(tolerances, centre=unknown_centre(static.locus))
    settings = replace(settings, tolerances=tolerances)
    from_dry_tests = baseline.pivots == "measured"
    laws = measured_laws(static.curves, len(bearing.pads), campaign.id) if from_dry_tests else None
    setup = _before(bearing, baseline, laws, _instruments(campaign, identification))
    # curves that the model was given cannot testify about it
    curves = () if from_dry_tests else static.curves
    observations = observe(identification, curves, static.locus, static.clearance, settings.tolerances["model"])
    layout = replace(observations.layout, temperature_position=_sensor_positions(campaign, bearing))
    result = diagnose(
        replace(observations, layout=layout), setup, settings,
        lambda text, share: report(f"diagnosing, {text}", 30 + int(70 * share), 100),
    )  # fmt: skip
    return CampaignDiagnosis(campaign.id, result, identification, setup)


def _before(bearing: Bearing, baseline: Baseline, laws: tuple[PivotLaw, ...] | None, instruments: Instruments) -> Setup:
    """The model that a diagnosis starts from; `laws` where pivots were measured."""
    laws = pivot_laws(baseline.pivots, bearing) if laws is None else laws
    return apply_effects(Setup(bearing, laws, baseline.thermal, instruments=instruments), baseline.effects)


def measure_campaign(
    campaign: Campaign,
    bearing: Bearing,
    report: Callable[[str, int, int], None],
    ahead: Callable[[], StaticTests | None] | None = None,
) -> tuple[Identification, StaticTests]:
    """Identify a campaign and measure its static tests."""
    if not campaign.of_kind("dynamic"):
        raise ComparisonError(f"campaign {campaign.id} has no dynamic runs; there is nothing to diagnose")
    identification = identify(
        campaign,
        IdentifySettings(clearance=min(bearing.clearances)),
        lambda text, done, total: report(f"identifying, {text}", 20 * done, 100 * total),
    )
    report("pivot curves, clearance and locus", 20, 100)
    static = (ahead() if ahead is not None else None) or measure_static(campaign, bearing)
    return replace(identification, conditions=identification.conditions + static.left_out), static


def diagnose_table(
    path: Path,
    bearing: Bearing,
    baseline: Baseline | None = None,
    settings: DiagnoseSettings | None = None,
    reading_error: float | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> CampaignDiagnosis:
    """Find what a model lacks to give the K and C of a table."""
    baseline, settings = baseline or Baseline(), settings or DiagnoseSettings()
    report = progress or (lambda text, done, total: None)
    if baseline.pivots == "measured":
        raise BadInputError("--pivots measured: a table holds no dry tests. Give kirk, rigid or a pivots.toml.")
    settings = replace(settings, tolerances=settings.tolerances.layered(bearing))
    observations = observe_table(path, reading_error, settings.tolerances["model"])
    bearing = as_it_turns(bearing, {rotation_of(test.speed) for test in observations.layout.dynamic})
    setup = _before(bearing, baseline, None, Instruments())
    result = diagnose(observations, setup, settings, lambda text, share: report(text, int(100 * share), 100))
    return CampaignDiagnosis(path.stem, result, None, setup)


def unknown_centre(locus: Locus) -> float:
    """How far the bearing's centre may lie from where positions are counted when no clearance sweep tells it [m].

    Positions then count from the probes' own zero, and only their differences say something about the bearing.
    """
    return max(1e-3, 3.0 * max(math.hypot(*p.position) for p in locus.points))


def _stated_tolerances(campaign: Campaign, bearing: Bearing, known: Tolerances) -> Tolerances:
    """Tolerances by the weight of their source: command line, bearing file, manifest, defaults."""
    tolerances = known.layered(bearing)
    for quantity, name in (("displacement", "probe_gain"), ("force", "cell_gain")):
        read = [c for c in campaign.channels.values() if c.quantity == quantity and c.axis is not None]
        gains = [float(channel.uncertainty) for channel in read if channel.uncertainty]
        if gains and tolerances.stated[name].source == "default":
            tolerances = tolerances.states({name: max(gains)}, "manifest")
    return tolerances


def _sensor_positions(campaign: Campaign, bearing: Bearing) -> tuple[float, ...]:
    """Fraction of the arc at which every pad carries its thermometer, as the manifest states it; else 0.75."""
    table = {int(c.pad): float(c.position) for c in campaign.channels.values()
             if c.quantity == "temperature" and c.pad is not None and c.position is not None}  # fmt: skip
    return tuple(table.get(k, SENSOR) for k in range(1, len(bearing.pads) + 1))


def _instruments(campaign: Campaign, identification: Identification) -> Instruments:
    """The rig's housing mass, cell stiffness and probe axes; what the campaign does not show stays as assumed."""
    measured: dict[str, Any] = {}
    axes = [float(c.axis) for c in campaign.channels.values() if c.quantity == "displacement" and c.axis is not None]
    if len(axes) == 2 and abs(math.sin(axes[0] - axes[1])) > 0.05:
        measured["probe_axes"] = tuple(axes)
    if math.isfinite(campaign.housing_mass):
        measured["housing_mass"] = campaign.housing_mass
    if identification.cell_stiffness is not None:
        measured["cell_stiffness"] = identification.cell_stiffness
    return Instruments(**measured)
