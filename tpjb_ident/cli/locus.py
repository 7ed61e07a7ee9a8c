"""`tpjb locus`: mean shaft positions and the clearance polygon."""

from __future__ import annotations

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
    from tpjb_ident.clearance import ClearancePolygon


@guarded
def locus(campaign: CampaignPath, bearing: BearingOption = None, out: Out = None) -> None:
    """Measure the shaft centre locus and the clearance polygon by pad.

    Writes locus and clearance, each as .csv and .parquet; positions count from the centre of the polygon.
    """
    source = open_campaign(campaign)
    if not (source.of_kind("locus") or source.of_kind("clearance")):
        raise BadInputError(f"campaign {source.id}: has neither locus nor clearance runs; there is nothing to measure.")
    drawn, given = open_bearing(source, bearing)
    from tpjb_ident.compare.comparison import measure_dry

    target = out_folder(out, "locus")
    with output_folder(target, "locus", (campaign,)) as folder:
        with progress("measuring positions"):
            _, polygon, found = measure_dry(source, drawn)
        if found is not None:
            write_table(folder, "locus", found.to_frame())
        if polygon is not None:
            write_table(folder, "clearance", polygon.to_frame())
        write_record(folder, target, "locus", {"campaign": campaign, "bearing": bearing or source.bearing_name},
                     source.fingerprint() | given)  # fmt: skip
    if polygon is not None:
        show_clearance(polygon, drawn, source.id)
    if found is not None:
        say(str(found))
    for part in (polygon, found):
        for condition in part.status if part is not None else ():
            note_line("note", condition)
    say(f"Results: {target}")


def show_clearance(polygon: ClearancePolygon, bearing: Bearing, name: str) -> None:
    """Print the clearance per pad beside the drawing's."""
    rows = [
        [f"#{k + 1}", f"{1e6 * pad.assembled_clearance:.1f}", f"{1e6 * polygon.clearance[k]:.2f}",
         f"{1.96e6 * polygon.clearance_se[k]:.2f}", f"{1e6 * polygon.clearance_pushed[k]:.2f}"]
        for k, pad in enumerate(bearing.pads)
    ]  # fmt: skip
    table(f"{name}: clearance, µm", ["pad", "drawing", "measured", "± (95 %)", "pushed"], rows)
