"""Residual maps before and after, and the gap by observable on held-out points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tpjb_ident.diagnose.gap import residuals
from tpjb_ident.report.figure import LIGHT, Panel, add_legend, new_panel

if TYPE_CHECKING:
    from tpjb_ident.diagnose.diagnose import Diagnosis

GROUP = "Where model and measurement part"
ENTRIES = tuple(f"{part}{entry}" for part in "kc" for entry in ("xx", "xy", "yx", "yy"))
#: Coefficients drawn per panel: those that disagree most with the baseline.
DRAWN = 3


def diagnosis_panels(diagnosis: Diagnosis) -> list[Panel]:
    """Draw the residuals over load and the gap by observable, before and after."""
    return [*_residual_panels(diagnosis), _gap_panel(diagnosis)]


def _residual_panels(diagnosis: Diagnosis) -> list[Panel]:
    panels = []
    for name, title, unit in (
        ("load", "Residuals over static load, the coefficients that disagree most", "static load, kN"),
        ("excitation", "Residuals over excitation frequency, the same coefficients", "excitation, Hz"),
    ):
        figure, axes = new_panel(unit, "(measured - predicted) / sigma")
        drawn = _draw_residuals(axes, diagnosis, name)
        if drawn:
            axes.axhspan(-2, 2, color=LIGHT["rule"], alpha=0.6, linewidth=0)
            add_legend(axes, columns=2)
            panels.append(Panel(f"residuals-{name}", title, figure, GROUP))
    return panels


def _draw_residuals(axes, diagnosis: Diagnosis, coordinate: str) -> bool:  # type: ignore[no-untyped-def]
    observations = diagnosis.observations
    elements = observations.elements
    factor = 1e-3 if coordinate == "load" else 1 / (2 * np.pi)
    other = "excitation" if coordinate == "load" else "load"
    values = [round(e.place(other), 6) for e in elements if e.family == "h"]
    common = max(set(values), key=values.count)
    any_drawn = False
    for observable, colour in zip(_worst(diagnosis), ("blue", "red", "green"), strict=True):
        mine = [
            i for i, e in enumerate(elements)
            if e.observable == observable and round(e.place(other), 6) == common
        ]  # fmt: skip
        if len(mine) < 2:
            continue
        any_drawn = True
        mine.sort(key=lambda i: elements[i].place(coordinate))
        x = factor * np.array([elements[i].place(coordinate) for i in mine])
        for prediction, marker, style in (
            (diagnosis.found.baseline.prediction, "o", (0, (4, 2))), (diagnosis.found.model.prediction, "D", "-"),
        ):  # fmt: skip
            z = residuals(observations, prediction)[mine]
            label = observable if style == "-" else f"{observable}, baseline"
            axes.plot(
                x, z, color=LIGHT[colour], marker=marker, linestyle=style, markersize=4, linewidth=1.2, label=label
            )
    return any_drawn


def _worst(diagnosis: Diagnosis) -> list[str]:
    z = residuals(diagnosis.observations, diagnosis.found.baseline.prediction)
    elements = diagnosis.observations.elements
    size = {name: sum(z[i] ** 2 for i, e in enumerate(elements) if e.observable == name) for name in ENTRIES}
    return sorted(ENTRIES, key=lambda name: -size[name])[:DRAWN]


def _gap_panel(diagnosis: Diagnosis) -> Panel:
    gaps = diagnosis.verdict.gap_by_observable
    names = list(gaps)
    figure, axes = new_panel("gap, sigma", "", height=max(3.0, 0.32 * len(names) + 1.2))
    box = axes.get_position()
    axes.set_position((0.34, box.y0, box.x1 - 0.34, box.height))  # room for the names
    y = np.arange(len(names))
    for offset, end, colour, label in (
        (0.2, "_before", "orange", "baseline"),
        (-0.2, "_after", "blue", "with the effect"),
    ):
        width = [next((v for k, v in gaps[n].items() if k.endswith(end)), 0.0) for n in names]
        axes.barh(y + offset, width, 0.38, color=LIGHT[colour], label=label)
    axes.set_yticks(y, [n.replace("_", " ") for n in names])
    axes.invert_yaxis()
    axes.axvline(1.0, color=LIGHT["ink"], linewidth=0.8, linestyle=(0, (2, 2)))
    add_legend(axes, columns=2)
    return Panel("gap-by-observable", "Gap by observable, held-out points where there are any", figure, GROUP)
