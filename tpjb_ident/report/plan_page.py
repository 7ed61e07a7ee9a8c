"""Pictures of a plan: which effects it could tell apart, whole and from parts of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.report.figure import panel, save_panels
from tpjb_ident.report.plots.isolability import isolability

if TYPE_CHECKING:
    from tpjb_ident.diagnose.plan.plan import CampaignPlan

GROUP = "Isolability"


def save_isolability(folder: Path, plans: Mapping[str, CampaignPlan]) -> None:
    """Draw the isolability matrix of every plan as ``figures/NAME.svg`` and ``.png``.

    Parameters
    ----------
    folder : Path
        Existing.
    plans : mapping of str to CampaignPlan
        By file name.
    """
    panels = [panel(name.replace("_", "-"), f"Isolability, {name}", isolability(p), GROUP) for name, p in plans.items()]
    save_panels(panels, folder / "figures")
