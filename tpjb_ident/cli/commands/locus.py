"""`tpjb locus`: mean shaft positions and the clearance polygon."""

from pathlib import Path

from tpjb_ident.cli.command import Command, command
from tpjb_ident.errors import BadInputError, NotTrustedError


@command("tpjb locus {DEMO}")
def locus(c: Command, campaign: Path, bearing: Path | None = None) -> None:
    """Measure the shaft centre locus and the clearance polygon by pad.

    Writes locus and clearance (.csv, .parquet) and a figure; positions count from the centre of the polygon. With
    several sweeps (hot and cold, two push loads) also clearance_runs and clearance_pairs.
    """
    source = c.open(campaign)
    if not (source.of_kind("locus") or source.of_kind("clearance")):
        raise BadInputError(f"campaign {source.id}: has neither locus nor clearance runs; there is nothing to measure.")
    drawing = c.bearing_of(source)
    import numpy as np
    import pandas as pd

    from tpjb_ident.clearance.measure import pairs_frame
    from tpjb_ident.compare.static_tests import measure_static, wrong_scale
    from tpjb_ident.report.comparison_page import clearance_table
    from tpjb_ident.report.sections import position_panels

    angles, drawn = np.array([drawing.pivot_angles, drawing.clearances])
    with c.results("measuring positions"):
        static = measure_static(source, drawing, every_sweep=True)
        measured = {"clearance": static.clearance, "locus": static.locus}
        parts = {name: part for name, part in measured.items() if part is not None}
        if not parts:
            raise BadInputError("; ".join(condition.detail for condition in static.left_out))
        for name, part in parts.items():
            c.table(name, part.to_frame())
        polygons = static.other_sweeps
        if static.clearance is not None and polygons:
            frames = [polygon.to_frame() for polygon in (static.clearance, *polygons)]
            c.table("clearance_runs", pd.concat(frames, ignore_index=True))
            c.table("clearance_pairs", pairs_frame(static.clearance, polygons))
        c.draw(position_panels(static.clearance, (angles, drawn), static.locus, {}, polygons))
    c.print(f"{source.id}: {' and '.join(f'the {name} is measured' for name in parts)}.")
    if static.clearance is not None:
        c.show_table(clearance_table(static.clearance, drawn), source.id)
    c.next("compare" if source.of_kind("dynamic") else "check", campaign)
    if static.locus is not None:
        c.print(f"locus: {str(static.locus).partition('; ')[0]}")
    for polygon in polygons:
        c.print(str(polygon))
    problems = []
    for polygon in (static.clearance, *polygons) if static.clearance is not None else ():
        run = next(run for run in source.runs if run.id == polygon.run)
        problems += wrong_scale(run, polygon, drawing)
    wrong = c.warn_of(problems)
    c.judge({name: part.status for name, part in parts.items()} | {"left out": static.left_out}, wrong)
    if static.clearance is None and source.of_kind("clearance"):
        raise NotTrustedError(
            "no clearance run can be used: positions count from the probes' zero, not from the centre."
        )
