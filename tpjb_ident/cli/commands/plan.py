"""`tpjb plan`: what a planned campaign could and could not tell, before any test is run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.inputs import operating_points, pivot_choice, rotation_choice
from tpjb_ident.columns import Column, words
from tpjb_ident.rounding import counted, signed

if TYPE_CHECKING:
    from model.effects.kind import Parameter
    from tpjb_ident.diagnosis.plan import CampaignPlan


@command("tpjb plan {ROCKER}", 'tpjb plan {ROCKER} --load "5, 10 kN" --excitation "20..60:10 Hz" --locus 0')
def plan(
    c: Command,
    bearing: Path,
    pivots: str = "kirk",
    load: str = "2.5, 3.75, 5, 6.25, 7.5, 8.75 kN",
    load_direction: str = "-90 deg",
    speed: str = "22 Hz",
    rotation: str | None = None,
    excitation: str = "10, 25, 40 Hz",
    locus: int = 20,
    dry: bool = True,
    push: float = 200.0,
    temperatures: bool = True,
    data_sets: bool = False,
) -> None:
    """Tell which effects a planned campaign could see.

    From which size on, and which it would mix up.

    Writes plan.json, effects (detection floor and look-alikes) and isolability (the matrix of separations), each as
    .csv and .parquet, and the matrix as a picture; with --data-sets also data_sets: what the direct coefficients alone
    (A), all of h (B), with locus and polygon (C), everything planned (D) and a second speed beside it (E) could tell,
    and a matrix and a picture of each.
    """
    drawing = c.bearing(bearing)
    from model.pivots import pivot_laws
    from model.setup import Setup
    from tpjb_ident.diagnosis import plan as planning
    from tpjb_ident.diagnosis.from_python import planned_layout
    from tpjb_ident.report.figure import Panel
    from tpjb_ident.report.plots.residuals import isolability

    points = operating_points(load, load_direction, speed, excitation, rotation_choice(c, drawing))
    tests = planned_layout(drawing, points, (locus, dry, push, temperatures))
    with c.results("planning") as show:
        show("every effect of the library", 0, 1)
        setup = Setup(drawing, pivot_laws(pivot_choice(c), drawing))
        result = planning.plan(setup, tests)
        plans = {"isolability": result}
        if data_sets:
            show("parts of the campaign", 1, 2)
            table, parts = planning.data_sets(setup, tests)
            c.table("data_sets", table)
            for name, part in parts.items():
                plans[f"isolability_{name}"] = part
        c.table("effects", result.to_frame())
        panels = []
        for name, part in plans.items():
            c.table(name, part.matrix())
            panels.append(Panel(name.replace("_", "-"), f"Isolability, {name}", isolability, part))
        c.draw(panels)
        c.json("plan.json", result.to_dict())
    _show(c, result)
    c.next("simulate", bearing)


def _detected_from(size: float, parameter: Parameter) -> str:
    """The size from which an effect is seen; a factor as its distance from one."""
    from tpjb_ident.compare.effect_words import shown_unit

    if math.isnan(size):
        return "never"
    unit, scale = shown_unit(parameter.unit)
    if unit == "%" and parameter.neutral == 1.0:
        return f"{signed(100 * (size - 1.0))} %"
    return f"{float(f'{size / scale:.3g}'):g} {unit}".replace(" °", "°")


def _show(c: Command, result: CampaignPlan) -> None:
    from tpjb_ident.compare.effect_words import label_in_words

    rows = []
    for row, candidate in zip(result.to_frame().to_dict("records"), result.candidates, strict=True):
        size = _detected_from(row["seen_from"], candidate.parameter)
        like = label_in_words(row["mistaken_for"]) or "-"
        rows.append([label_in_words(row["effect"]), row["typical_size_sigma"], size, like])
    c.print(
        f"{len(rows) - len(result.below_floor)} of {counted(len(rows), 'effect')} would be seen at a typical size; "
        f"{len(result.confusable)} of {result.pairs} pairs could not be told apart."
    )
    columns = [*words("effect"), Column("sigma", ".1f"), "seen from", *words("like")]
    c.show("What this campaign could tell", columns, rows)
    c.print("sigma: standard deviations that the effect is seen with at a typical size; like: what looks the same.")
    blind = ", ".join(label_in_words(name) for name in result.below_floor)
    c.print(f"Below the floor at a size that would not surprise: {blind or 'nothing'}.")
    c.print(
        "Pairs are told apart from a distance of 3 on: standard deviations between what the two leave in the "
        "data, each at the size at which they look most alike, seen with 6 (docs/guide/planning.md)."
    )
