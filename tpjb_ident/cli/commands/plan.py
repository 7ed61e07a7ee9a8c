"""`tpjb plan`: what a planned campaign could and could not tell, before any test is run."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated

import typer

from tpjb_ident.cli.commands.predict import operating_points, pivot_choice
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import refuse_special
from tpjb_ident.cli.common.options import (
    BearingPath,
    LoadDirections,
    Loads,
    Out,
    PivotChoice,
    Speeds,
    as_given,
    out_folder,
)
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress, table
from tpjb_ident.compare.effect_words import UNITS, label_in_words
from tpjb_ident.rounding import signed
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_table, write_text

if TYPE_CHECKING:
    from pathlib import Path

    from model.effects.kind import Parameter
    from model.setup import Setup
    from tpjb_ident.diagnosis.observations.observe import Layout
    from tpjb_ident.diagnosis.plan import CampaignPlan


@guarded
def plan(
    bearing: BearingPath,
    pivots: PivotChoice = "kirk",
    load: Loads = "2.5, 3.75, 5, 6.25, 7.5, 8.75 kN",
    load_direction: LoadDirections = "-90 deg",
    speed: Speeds = "22 Hz",
    excitation: Annotated[str, typer.Option(help="Excitation frequencies, each at every load.")] = "10, 25, 40 Hz",
    locus: Annotated[int, typer.Option(min=0, max=360, help="Load directions of the shaft locus; 0: none.")] = 20,
    dry: Annotated[bool, typer.Option(help="Dry load-deflection tests on all pads.")] = True,
    push: Annotated[float, typer.Option(min=0.0, help="Push load of the clearance sweep [N]; 0: none.")] = 200.0,
    temperatures: Annotated[bool, typer.Option(help="A temperature sensor in every pad.")] = True,
    data_sets: Annotated[bool, typer.Option("--data-sets", help="Also: what parts of it could tell, A to E.")] = False,
    out: Out = None,
) -> None:
    """Tell which effects a planned campaign could see.

    From which size on, and which it would mix up.

    Writes plan.json, effects (detection floor and look-alikes) and isolability (the matrix of separations), each as
    .csv and .parquet, and the matrix as a picture; with --data-sets also data_sets: what the direct coefficients alone
    (A), all of h (B), with locus and polygon (C), everything planned (D) and a second speed beside it (E) could tell,
    and a matrix and a picture of each.
    """
    options = as_given(locals())
    refuse_special(bearing)
    from model.bearing_file import load_bearing
    from model.pivots import pivot_laws
    from model.setup import Setup
    from tpjb_ident.diagnosis.from_python import planned_layout
    from tpjb_ident.diagnosis.plan import plan as work_out
    from tpjb_ident.report.panels import save_isolability

    drawn = load_bearing(bearing)
    points = operating_points(load, load_direction, speed, excitation)
    tests = planned_layout(drawn, points, (locus, dry, push, temperatures))
    target = out_folder(out, "plan")
    with output_folder(target, "plan") as folder:
        with progress("planning") as show:
            show("every effect of the library", 0, 1)
            setup = Setup(drawn, pivot_laws(pivot_choice(pivots), drawn))
            found = work_out(setup, tests)
            plans = {"isolability": found}
            if data_sets:
                show("parts of the campaign", 1, 2)
                plans |= _parts(folder, setup, tests)
        frame = found.to_frame()
        write_table(folder, "effects", frame)
        for name, one in plans.items():
            write_table(folder, name, one.matrix())
        save_isolability(folder, plans)
        write_text(folder / "plan.json", json.dumps(found.to_dict(), indent=2, allow_nan=False) + "\n")
        write_record(folder, target, "plan", options, {bearing.name: sha256(bearing)})
    _show(found)
    print_line(f"Results: {target}")


def _parts(folder: Path, setup: Setup, tests: Layout) -> dict[str, CampaignPlan]:
    """Write the table of data sets; what each could tell with calibration errors free, by file name."""
    import pandas as pd

    from tpjb_ident.diagnosis.plan import data_sets

    found = data_sets(setup, tests)
    write_table(folder, "data_sets", pd.DataFrame([one.to_row() for one in found]))
    return {f"isolability_{one.name}": one.free for one in found}


def _seen_from(at: float, parameter: Parameter) -> str:
    """The size from which an effect is seen; a factor as its distance from one."""
    if math.isnan(at):
        return "never"
    unit, scale = UNITS.get(parameter.unit, (parameter.unit, 1.0))
    if unit == "%" and parameter.neutral == 1.0:
        return f"{signed(100 * (at - 1.0))} %"
    return f"{float(f'{at / scale:.3g}'):g} {unit}".replace(" °", "°")


def _show(found: CampaignPlan) -> None:
    rows = []
    for row, candidate in zip(found.to_frame().to_dict("records"), found.candidates, strict=True):
        like = label_in_words(row["mistaken_for"]) or "-"
        rows.append(
            [
                label_in_words(row["effect"]),
                f"{row['typical_size_sigma']:.1f}",
                _seen_from(float(row["seen_from"]), candidate.parameter),
                like,
            ]
        )
    table("What this campaign could tell", ["effect", "sigma", "seen from", "like"], rows, (0, 3))
    print_line("sigma: standard deviations that the effect is seen with at a typical size; like: what looks the same.")
    blind = [label_in_words(name) for name in found.below_floor]
    print_line(f"Below the floor at a size that would not surprise: {', '.join(blind) if blind else 'nothing'}.")
    print_line(f"Pairs it could not tell apart at d' = 6: {len(found.confusable)} of {found.pairs}.")
