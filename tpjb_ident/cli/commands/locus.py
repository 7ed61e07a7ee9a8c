"""`tpjb locus`: mean shaft positions and the clearance polygon."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.options import DEMO
from tpjb_ident.conditions import sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError

if TYPE_CHECKING:
    from model.bearing import Bearing
    from rigdata.arrays import FloatArray
    from rigdata.campaign import Campaign
    from tpjb_ident.clearance.measure import ClearancePolygon
    from tpjb_ident.compare.static_tests import StaticTests


@command(f"tpjb locus {DEMO}")
def locus(c: Command, campaign: Path, bearing: Path | None = None) -> None:
    """Measure the shaft centre locus and the clearance polygon by pad.

    Writes locus and clearance (.csv, .parquet) and a figure; positions count from the centre of the polygon. With
    several sweeps (hot and cold, two push loads) also clearance_runs and clearance_pairs.
    """
    source = c.open(campaign)
    if not (source.of_kind("locus") or source.of_kind("clearance")):
        raise BadInputError(f"campaign {source.id}: has neither locus nor clearance runs; there is nothing to measure.")
    drawing = c.bearing_of(source, bearing)
    import numpy as np

    from tpjb_ident.compare.static_tests import measure_static
    from tpjb_ident.report.panels import position_panels

    with c.results("measuring positions"):
        static = measure_static(source, drawing)
        polygons, refused = _other_polygons(source, drawing, static)
        if static.clearance is None and static.locus is None:
            raise BadInputError("; ".join(condition.detail for condition in static.left_out))
        _write_tables(c, static, polygons)
        angles = np.array([pad.pivot_angle for pad in drawing.pads])
        clearances = np.array([pad.assembled_clearance for pad in drawing.pads])
        c.draw(position_panels(static.clearance, (angles, clearances), static.locus, {}, polygons))
    parts = [f"the {name} is measured" for name in ("clearance", "locus") if getattr(static, name) is not None]
    c.print(f"{source.id}: {' and '.join(parts)}.")
    _show(c, static, clearances, source.id, refused)
    c.next("compare" if source.of_kind("dynamic") else "check", campaign)
    for polygon in polygons:
        c.print(str(polygon))
    if static.clearance is None and source.of_kind("clearance"):
        raise NotTrustedError(
            "no clearance run can be used: positions count from the probes' zero, not from the centre."
        )
    bad = []
    for part in (static.clearance, static.locus):
        if part is not None:
            bad += [condition.sentence() for condition in untrusted(part.status)]
    if bad:
        raise NotTrustedError("; ".join(bad))


def _other_polygons(
    source: Campaign, drawing: Bearing, static: StaticTests
) -> tuple[tuple[ClearancePolygon, ...], list[str]]:
    """Polygons of the sweeps besides the one that counts, and what is wrong with those that cannot be used."""
    from rigdata.problem import RigDataError
    from tpjb_ident.clearance.measure import measure_run

    angles = [pad.pivot_angle for pad in drawing.pads]
    polygons: list[ClearancePolygon] = []
    refused: list[str] = []
    for run in source.of_kind("clearance"):
        if static.clearance is None or run.id == static.clearance.run:
            continue
        try:
            polygons.append(measure_run(run, angles, static.curves or None))
        except RigDataError as error:
            refused.append(f"runs-refused: {run.id} ({error.problems[0]})")
    return tuple(polygons), refused


def _write_tables(c: Command, static: StaticTests, polygons: tuple[ClearancePolygon, ...]) -> None:
    """Write the locus and all polygons, and each of the others with the one that counts."""
    if static.locus is not None:
        c.table("locus", static.locus.to_frame())
    if static.clearance is None:
        return
    c.table("clearance", static.clearance.to_frame())
    if polygons:
        import pandas as pd

        from tpjb_ident.clearance.measure import pairs_frame

        frames = [polygon.to_frame() for polygon in (static.clearance, *polygons)]
        c.table("clearance_runs", pd.concat(frames, ignore_index=True))
        c.table("clearance_pairs", pairs_frame(static.clearance, polygons))


def _show(c: Command, static: StaticTests, drawn: FloatArray, name: str, refused: list[str]) -> None:
    """Print the clearance per pad and the drawing's, the locus, and what is wrong with either."""
    from tpjb_ident.report.comparison_page import clearance_table

    polygon = static.clearance
    if polygon is not None:
        # a table's reader has no other place that says how far the probes' gains are known
        c.show_table(clearance_table(polygon, drawn, calibrated=True), name)
    printed: tuple[str, ...] = ()
    if static.locus is not None:
        c.print(f"locus: {static.locus}")
        printed = sentences(static.locus.status)
    for condition in polygon.status if polygon is not None else ():
        c.note(condition.sentence())
    for text in dict.fromkeys([*(condition.sentence() for condition in static.left_out), *refused]):
        if text not in printed:
            c.note(text)
