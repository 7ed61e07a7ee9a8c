"""`tpjb locus`: mean shaft positions and the clearance polygon."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.errors import BadInputError, guarded
from tpjb_ident.cli.inputs import open_bearing, open_campaign
from tpjb_ident.cli.options import BearingOption, CampaignPath, Out, out_folder
from tpjb_ident.cli.outdir import output_folder
from tpjb_ident.cli.record import write_record
from tpjb_ident.cli.show import note_line, progress, say, table
from tpjb_ident.tables import write_table

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign
    from tpjb_ident.clearance import ClearancePolygon
    from tpjb_ident.pivot import PivotCurve


@guarded
def locus(campaign: CampaignPath, bearing: BearingOption = None, out: Out = None) -> None:
    """Measure the shaft centre locus and the clearance polygon by pad.

    Writes locus and clearance (.csv, .parquet) and a figure; positions count from the centre of the polygon. With
    several sweeps (hot and cold, two push loads) also clearance_runs and clearance_pairs.
    """
    source = open_campaign(campaign)
    if not (source.of_kind("locus") or source.of_kind("clearance")):
        raise BadInputError(f"campaign {source.id}: has neither locus nor clearance runs; there is nothing to measure.")
    drawn, given = open_bearing(source, bearing)
    import numpy as np

    from tpjb_ident.compare.comparison import measure_dry
    from tpjb_ident.report.figure import save_panels
    from tpjb_ident.report.position_panels import position_panels

    target = out_folder(out, "locus")
    with output_folder(target, "locus", (campaign,)) as folder:
        with progress("measuring positions"):
            curves, polygon, found = measure_dry(source, drawn)
            others = other_polygons(source, drawn, curves, polygon)
        if found is not None:
            write_table(folder, "locus", found.to_frame())
        if polygon is not None:
            write_table(folder, "clearance", polygon.to_frame())
        if polygon is not None and others:
            write_pairs(folder, polygon, others)
        pads = (np.array([p.pivot_angle for p in drawn.pads]), np.array([p.assembled_clearance for p in drawn.pads]))
        save_panels(position_panels(polygon, pads, found, {}, others), folder / "figures")
        write_record(folder, target, "locus", {"campaign": campaign, "bearing": bearing or source.bearing_name},
                     source.fingerprint() | given)  # fmt: skip
    if polygon is not None:
        show_clearance(polygon, drawn, source.id)
    if found is not None:
        say(str(found))
    for part in (polygon, found):
        for condition in part.status if part is not None else ():
            note_line("note", condition)
    for other in others:
        say(str(other))
    say(f"Results: {target}")


def other_polygons(
    source: Campaign, drawn: Bearing, curves: Sequence[PivotCurve], polygon: ClearancePolygon | None
) -> tuple[ClearancePolygon, ...]:
    """Polygons of the sweeps beside the one that counts."""
    from tpjb_ident.clearance import measure_run

    angles = [pad.pivot_angle for pad in drawn.pads]
    runs = [run for run in source.of_kind("clearance") if polygon is not None and run.id != polygon.run]
    return tuple(measure_run(run, angles, curves or None) for run in runs)


def write_pairs(folder: Path, polygon: ClearancePolygon, others: Sequence[ClearancePolygon]) -> None:
    """Write all polygons, and each beside the one that counts."""
    import pandas as pd

    from tpjb_ident.polygon_pairs import pairs_frame

    frames = [one.to_frame() for one in (polygon, *others)]
    write_table(folder, "clearance_runs", pd.concat(frames, ignore_index=True))
    write_table(folder, "clearance_pairs", pairs_frame(polygon, others))


def show_clearance(polygon: ClearancePolygon, bearing: Bearing, name: str) -> None:
    """Print the clearance per pad beside the drawing's."""
    rows = [
        [f"#{k + 1}", f"{1e6 * pad.assembled_clearance:.1f}", f"{1e6 * polygon.clearance[k]:.2f}",
         f"{1.96e6 * polygon.clearance_se[k]:.2f}", f"{1e6 * polygon.clearance_pushed[k]:.2f}"]
        for k, pad in enumerate(bearing.pads)
    ]  # fmt: skip
    table(f"{name}: clearance, µm", ["pad", "drawing", "measured", "± (95 %)", "pushed"], rows)
