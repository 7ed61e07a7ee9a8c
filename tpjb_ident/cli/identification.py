"""An identification on the command line: its settings, tables on disk, tables at the terminal, and trust."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command
from tpjb_ident.cli.options import refuse_unknown
from tpjb_ident.conditions import led_by, untrusted
from tpjb_ident.errors import BadInputError
from tpjb_ident.rounding import counted
from tpjb_ident.schema import DAMPING, POINT_COLUMNS, STIFFNESS

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.arrays import BoolArray
    from rigdata.campaign import Campaign
    from tpjb_ident.identification.settings import IdentifySettings
    from tpjb_ident.results.identification import Identification

_CROSS_COUPLED = 0.1  # of the mean direct coefficient: from there on a cross-coupled one is shown
#: Columns of tables at the terminal: direct and cross-coupled coefficients, models, what tells points apart.
DIRECT = "kxx_N_per_m kyy_N_per_m cxx_Ns_per_m cyy_Ns_per_m"
_CROSS = "kxy_N_per_m kyx_N_per_m cxy_Ns_per_m cyx_Ns_per_m"
_MODELS = f"static_load_N model {DIRECT} mxx_kg myy_kg supported"
POINT = " ".join(POINT_COLUMNS)


def identify_settings(c: Command, campaign: Campaign) -> IdentifySettings:
    """Build `IdentifySettings` from ``--method`` and ``--norm``, with the clearance for the amplitude check."""
    from tpjb_ident.arguments import carried_bearing
    from tpjb_ident.estimators.estimate import METHODS, NORMS
    from tpjb_ident.identification.settings import IdentifySettings

    method, norm = c.typed.get("method", "mm-eiv"), c.typed.get("norm")
    refuse_unknown(method, METHODS, "--method")
    if norm is not None:
        refuse_unknown(norm, tuple(NORMS), "--norm")
        if method != "rlm":
            raise BadInputError(f"--norm: belongs to --method rlm, not to {method}.")
    if not campaign.of_kind("dynamic"):
        raise BadInputError(f"campaign {campaign.id}: has no dynamic runs. Use `tpjb pivot` or `tpjb locus`.")
    estimator = f"rlm:{norm or 'huber'}" if method == "rlm" else method
    bearing = carried_bearing(campaign, c.warn)
    return IdentifySettings(method=estimator, clearance=None if bearing is None else min(bearing.clearances))


def identified(c: Command, campaign: Campaign) -> Identification:
    """Identify a campaign."""
    from tpjb_ident.identification.identify import identify

    settings = identify_settings(c, campaign)
    with c.progress(f"identifying {campaign.id}") as show:
        return identify(campaign, settings, show)


def write_identification(c: Command, result: Identification) -> None:
    """Write coefficients, estimators, windows and the models over frequency; h over the band where one was excited."""
    from tpjb_ident.results.identification import frf_frame, models_frame

    if result.bands:
        c.table("frf", frf_frame(result.bands))
        c.table("frf_estimators", frf_frame(result.bands, every_method=True))
        c.table("frf_models", models_frame(result.bands))
    if result.points or not result.bands:
        c.table("coefficients", result.to_frame())
        c.table("estimators", result.estimators_frame())
        c.table("windows", result.windows_frame())
        c.table("frequency_fits", result.frequency_frame())
        c.table("budget", result.budget_frame())


def show_identification(c: Command, result: Identification) -> None:
    """Print what was identified: a summary, tables as they are on disk, in the units that people read, remarks."""
    flagged = sum(bool(quality) and not untrusted(quality) for _, quality, _ in result.places)
    trust = "" if result.doubt else ", all to be trusted"
    flags = f", {flagged} with flags" if flagged else ""
    points = counted(len(result.places), "operating point")
    for line in led_by(result.doubt, [f"{result.campaign}: {points}{trust}{flags}."]):
        c.print(line)
    frame = c.frames.get("coefficients")
    if frame is not None and len(frame):
        frame = frame.replace({"quality": {"ok": "-"}})
        point = f"{POINT} rotation" if "clockwise" in set(frame["rotation"]) else POINT
        title = f"{result.campaign}: {result.method}, 95 % intervals"
        c.show_frame(title, frame, f"{point} {DIRECT} outlier_fraction quality", "coefficients.csv")
        title = "cross-coupled, where they are more than a tenth of the direct ones"
        c.show_frame(title, frame[cross_coupling_matters(frame)], f"{point} {_CROSS}", "coefficients.csv")
    for name, over in (("frequency_fits", "frequency"), ("frf_models", "the band")):
        if name in c.frames:
            title = f"models over {over}, 95 % intervals; raw H: none, use frf.csv or the coefficients"
            c.show_frame(title, c.frames[name], _MODELS, f"{name}.csv")
    for k, remark in enumerate(result.remarks()):
        c.print(f"note: {remark}" if k < len(result.conditions) else f"flag: {remark}")


def cross_coupling_matters(frame: pd.DataFrame) -> BoolArray:
    """In which rows a cross-coupled term is beyond doubt more than a tenth of the direct ones (n,)."""
    import numpy as np

    matters = np.zeros(len(frame), dtype=bool)
    for kind in (STIFFNESS, DAMPING):
        xx, *cross, yy = kind.columns
        direct = 0.5 * (frame[xx].abs() + frame[yy].abs())
        for name in cross:
            half = 0.5 * (frame[f"{name}_hi"] - frame[f"{name}_lo"])
            matters |= (frame[name].abs() - half > _CROSS_COUPLED * direct).to_numpy()
    return matters
