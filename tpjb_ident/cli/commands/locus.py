"""`tpjb locus`: mean shaft positions and the clearance polygon."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import open_bearing, open_campaign
from tpjb_ident.cli.common.options import BearingOption, CampaignPath, Out, out_folder
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import note_line, print_line, progress, table
from tpjb_ident.conditions import sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.tables import write_table

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.campaign import Campaign
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.static_tests import StaticTests


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

    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.report.figure import save_panels
    from tpjb_ident.report.panels import position_panels

    target = out_folder(out, "locus")
    with output_folder(target, "locus", (campaign,)) as folder:
        with progress("measuring positions"):
            static = measure_static(source, drawn)
            polygon, found = static.clearance, static.locus
            others, refused = _other_polygons(source, drawn, static)
        if polygon is None and found is None:
            raise BadInputError("; ".join(c.detail for c in static.left_out))
        if found is not None:
            write_table(folder, "locus", found.to_frame())
        if polygon is not None:
            write_table(folder, "clearance", polygon.to_frame())
        if polygon is not None and others:
            _write_pairs(folder, polygon, others)
        pads = (np.array([p.pivot_angle for p in drawn.pads]), np.array([p.assembled_clearance for p in drawn.pads]))
        save_panels(position_panels(polygon, pads, found, {}, others), folder / "figures")
        write_record(folder, target, "locus", {"campaign": campaign, "bearing": bearing or source.bearing_name},
                     source.fingerprint() | given)  # fmt: skip
    if polygon is not None:
        _show_clearance(polygon, drawn, source.id)
    if found is not None:
        print_line(f"locus: {found}")
    for condition in polygon.status if polygon is not None else ():  # those of the locus stand in its line
        note_line("note", condition.sentence())
    for sentence in dict.fromkeys([*(c.sentence() for c in static.left_out), *refused]):
        if found is None or sentence not in sentences(found.status):
            note_line("note", sentence)
    for other in others:
        print_line(str(other))
    print_line(f"Results: {target}")
    if polygon is None and source.of_kind("clearance"):
        raise NotTrustedError(
            "no clearance run can be used: positions count from the probes' zero, not from the centre."
        )
    bad = [c.sentence() for part in (polygon, found) if part is not None for c in untrusted(part.status)]
    if bad:
        raise NotTrustedError("; ".join(bad))


def _other_polygons(
    source: Campaign, drawn: Bearing, static: StaticTests
) -> tuple[tuple[ClearancePolygon, ...], tuple[str, ...]]:
    """Polygons of the sweeps beside the one that counts, and what is wrong with those that cannot be used."""
    from rigdata.problem import RigDataError
    from tpjb_ident.clearance.measure import measure_run

    angles = [pad.pivot_angle for pad in drawn.pads]
    first = static.clearance
    found, refused = [], []
    for run in source.of_kind("clearance"):
        if first is None or run.id == first.run:
            continue
        try:
            found.append(measure_run(run, angles, static.curves or None))
        except RigDataError as error:
            refused.append(f"runs-refused: {run.id} ({error.problems[0]})")
    return tuple(found), tuple(refused)


def _write_pairs(folder: Path, polygon: ClearancePolygon, others: Sequence[ClearancePolygon]) -> None:
    """Write all polygons, and each beside the one that counts."""
    import pandas as pd

    from tpjb_ident.clearance.measure import pairs_frame

    frames = [one.to_frame() for one in (polygon, *others)]
    write_table(folder, "clearance_runs", pd.concat(frames, ignore_index=True))
    write_table(folder, "clearance_pairs", pairs_frame(polygon, others))


def _show_clearance(polygon: ClearancePolygon, bearing: Bearing, name: str) -> None:
    """Print the clearance per pad beside the drawing's."""
    rows = [
        [f"#{k + 1}", f"{1e6 * pad.assembled_clearance:.1f}", f"{1e6 * polygon.clearance[k]:.2f}",
         f"{1.96e6 * polygon.clearance_se[k]:.2f}", f"{1e6 * polygon.clearance_pushed[k]:.2f}"]
        for k, pad in enumerate(bearing.pads)
    ]  # fmt: skip
    table(f"{name}: clearance, µm", ["pad", "drawing", "measured", "± (95 %)", "pushed"], rows)
