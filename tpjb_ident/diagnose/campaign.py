"""From a campaign to a diagnosis: identify, measure the static tests, observe, diagnose."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from tpjb_ident.compare.comparison import ComparisonError
from tpjb_ident.compare.measured_pivots import measured_laws
from tpjb_ident.compare.static_tests import measure_static
from tpjb_ident.diagnose.diagnose import Diagnosis, diagnose
from tpjb_ident.diagnose.forward.nuisance import Certificates
from tpjb_ident.diagnose.observations.housing import with_housing
from tpjb_ident.diagnose.observations.observe import observe
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.dynamic.identify import IdentifySettings, identify
from tpjb_ident.presentation import Presented

from model.effects import Effect, apply_effects  # isort: skip
from model.pivots import pivot_laws  # isort: skip
from model.instruments import Instruments  # isort: skip
from model.setup import Setup  # isort: skip

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from model.bearing import Bearing
    from rigdata.campaign import Campaign
    from tpjb_ident.clearance.locus import Locus
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.diagnose.forward.memory import Memory
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.pivot import PivotCurve


@dataclass(frozen=True)
class Baseline:
    """Where a diagnosis starts from.

    Attributes
    ----------
    pivots : object
        ``"kirk"``, ``"rigid"``, ``"measured"``, a path or laws.
    thermal : str
    effects : tuple of Effect
        Already in the model.
    """

    pivots: Any = "kirk"
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()


@dataclass(frozen=True, repr=False)
class CampaignDiagnosis(Presented):
    """A diagnosis with what it was made from."""

    diagnosis: Diagnosis
    identification: Identification
    setup: Setup

    def to_dataframe(self) -> pd.DataFrame:
        """K and C measured, predicted before, and predicted with the effects found: columns as comparison.csv."""
        from tpjb_ident.report.diagnosis_coefficients import before_and_after

        return before_and_after(self.diagnosis, self.identification)

    def summary(self) -> str:
        """What was found, and what it rests on."""
        from tpjb_ident.report.diagnosis_coefficients import median_deviations
        from tpjb_ident.report.diagnosis_words import verdict_sentences

        off = median_deviations(self.to_dataframe())
        return "\n".join(verdict_sentences(self.identification.campaign, self.diagnosis.verdict, off))

    def plot(self, **options: Any) -> Any:
        """Draw the gap by observable, before and after; see `tpjb_ident.report.plots.gap`.

        Parameters
        ----------
        **options
            ``logarithmic``, ``title``.
        """
        from tpjb_ident.report.plots import gap

        return gap(self.diagnosis, **options)


@dataclass(frozen=True)
class Measured:
    """All that a diagnosis needs of a campaign, without its records; it can be kept and diagnosed again.

    Attributes
    ----------
    identification : Identification
    curves : tuple of PivotCurve
    polygon : ClearancePolygon or None
    locus : Locus or None
    instruments : Instruments
        Housing mass and stiffness of the cells under it, as the campaign shows them.
    certificates : Certificates
    """

    identification: Identification = field(repr=False)
    curves: tuple[PivotCurve, ...] = field(repr=False)
    polygon: ClearancePolygon | None = field(repr=False)
    locus: Locus | None = field(repr=False)
    instruments: Instruments
    certificates: Certificates


def diagnose_campaign(
    campaign: Campaign,
    bearing: Bearing,
    baseline: Baseline | None = None,
    settings: DiagnoseSettings | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    estimator: IdentifySettings | None = None,
) -> CampaignDiagnosis:
    """Identify a campaign and find what its model lacks.

    Parameters
    ----------
    campaign : Campaign
    bearing : Bearing
    baseline : Baseline, optional
    settings : DiagnoseSettings, optional
        Certificates of probes and cells are read from the campaign's manifest.
    progress : callable, optional
        ``progress(text, done, total)``.
    estimator : IdentifySettings, optional

    Raises
    ------
    ComparisonError
        The campaign has no dynamic runs.
    """
    settings = settings or DiagnoseSettings()
    measured = measure_campaign(campaign, bearing, settings.certificates, progress, estimator)
    return diagnose_measured(measured, bearing, baseline, settings, progress)


def measure_campaign(
    campaign: Campaign,
    bearing: Bearing,
    known: Certificates | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    estimator: IdentifySettings | None = None,
) -> Measured:
    """Identify a campaign and measure its static tests.

    Parameters
    ----------
    campaign, bearing, progress, estimator
        As of `diagnose_campaign`.
    known : Certificates, optional
        What counts where the manifest is silent.

    Raises
    ------
    ComparisonError
        The campaign has no dynamic runs.
    """
    tell = progress or (lambda text, done, total: None)
    if not campaign.of_kind("dynamic"):
        raise ComparisonError(f"campaign {campaign.id} has no dynamic runs; there is nothing to diagnose")
    least = min(pad.assembled_clearance for pad in bearing.pads)
    chosen = replace(estimator or IdentifySettings(), clearance=least)
    found = identify(campaign, chosen, lambda text, done, total: tell(f"identifying, {text}", 20 * done, 100 * total))
    tell("pivot curves, clearance and locus", 20, 100)
    static = measure_static(campaign, bearing)
    curves, polygon, locus = static.curves, static.clearance, static.locus
    found = replace(found, conditions=found.conditions + static.left_out)
    housing = with_housing(Setup(bearing, pivot_laws("rigid", bearing)), campaign).instruments
    certain = certificates(campaign, known or Certificates())
    if polygon is None and locus is not None:
        certain = replace(certain, centre=unknown_centre(locus))
    return Measured(found, tuple(curves), polygon, locus, housing, certain)


def diagnose_measured(
    measured: Measured,
    bearing: Bearing,
    baseline: Baseline | None = None,
    settings: DiagnoseSettings | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    memory: Memory | None = None,
) -> CampaignDiagnosis:
    """Find what the model of an identified campaign lacks.

    Parameters
    ----------
    measured : Measured
    bearing, baseline, settings, progress
        As of `diagnose_campaign`; the certificates are those of `measured`.
    memory : Memory, optional
        Answers of the model at this bearing's baseline, known from before.
    """
    baseline, settings = baseline or Baseline(), settings or DiagnoseSettings()
    tell = progress or (lambda text, done, total: None)
    found, curves = measured.identification, measured.curves
    given = baseline.pivots == "measured"
    laws = measured_laws(curves, len(bearing.pads), found.campaign) if given else pivot_laws(baseline.pivots, bearing)
    plain = Setup(bearing, laws, baseline.thermal, instruments=measured.instruments)
    setup = apply_effects(plain, baseline.effects)
    # curves that the model was given cannot testify about it
    observations = observe(
        found, () if given else curves, measured.locus, measured.polygon, settings.tolerance
    )  # fmt: skip
    certain = replace(settings, certificates=measured.certificates)
    result = diagnose(
        observations, setup, certain, lambda text, share: tell(f"diagnosing, {text}", 30 + int(70 * share), 100), memory
    )
    return CampaignDiagnosis(result, found, setup)


def unknown_centre(locus: Locus) -> float:
    """How far the bearing's centre may lie from where positions are counted when no clearance sweep tells it [m].

    Positions then count from the probes' own zero, and only their differences say something about the bearing.
    """
    return max(1e-3, 3.0 * max(math.hypot(*p.position) for p in locus.points))


def certificates(campaign: Campaign, known: Certificates) -> Certificates:
    """Calibration uncertainties that a manifest states; where it is silent the defaults stay."""
    probes = [c for c in campaign.channels.values() if c.quantity == "displacement" and c.axis is not None]
    cells = [c for c in campaign.channels.values() if c.quantity == "force" and c.uncertainty]
    if len(probes) == 2 and abs(math.sin(float(probes[0].axis or 0.0) - float(probes[1].axis or 0.0))) > 0.05:
        axes = (float(probes[0].axis or 0.0), float(probes[1].axis or 0.0))
        gains = tuple(float(p.uncertainty or g) for p, g in zip(probes, known.probe_gain, strict=True))
        known = replace(known, probe_axes=axes, probe_gain=(gains[0], gains[1]))
    if cells:
        known = replace(known, cell_gain=max(float(c.uncertainty or 0.0) for c in cells))
    return known
