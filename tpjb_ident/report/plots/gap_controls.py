"""Gap before and after on points that no fit has seen, beside its controls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import CHARACTER, FONT_SIZE, LEFT, new_picture, shrink

STYLE = {"before": ("grey", "////"), "after": ("blue", None), "control": ("orange", "....")}


def gap_controls(
    before: float,
    after: float,
    controls: Mapping[str, float | tuple[float, float, float] | Sequence[float]],
    *,
    noise_floor: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the held-out gap of baseline and updated model beside control models.

    Good controls are: the best wrong effect (must stay clearly above), a correction by a Gaussian process (what can be
    reached without a name; one that closes less than the named effect bounds nothing), and the same procedure on a
    campaign without an effect (must not improve).

    Parameters
    ----------
    before, after : float
        Held-out gap of the baseline and of the model with the effects found [sigma].
    controls : mapping of str to float or (value, low, high)
        Held-out gap of each control, with an interval where one is known.
    noise_floor : float, optional
        What measurement noise alone would leave.
    title : str, optional
    """
    rows: list[tuple[str, float, tuple[float, float] | None, str]] = [
        ("before: baseline", float(before), None, "before"), ("after: effects found", float(after), None, "after"),
    ]  # fmt: skip
    for name, value in controls.items():
        parts = np.atleast_1d(np.asarray(value, dtype=float))
        if parts.shape not in ((1,), (3,)):
            raise ValueError(f"control {name!r} must be one number or (value, low, high), got {value!r}")
        rows.append((name, float(parts[0]), (float(parts[1]), float(parts[2])) if len(parts) == 3 else None, "control"))
    figure, axes = new_picture("held-out gap, sigma", "", title=title, height=0.36 * len(rows) + 1.0)
    shrink(axes, left=max(CHARACTER * max(len(r[0]) for r in rows) + 0.2 - LEFT, 0.0), right=0.25)
    for y, (_, value, interval, kind) in enumerate(rows):
        colour, hatch = STYLE[kind]
        axes.barh(y, value, 0.6, color=LIGHT[colour] if hatch is None else LIGHT["paper"], hatch=hatch,
                  edgecolor=LIGHT[colour], linewidth=0.8)  # fmt: skip
        end = value
        if interval is not None:
            axes.errorbar(value, y, xerr=[[max(value - interval[0], 0.0)], [max(interval[1] - value, 0.0)]],
                          color=LIGHT["ink"], capsize=3, linewidth=1.1)  # fmt: skip
            end = max(value, interval[1])
        axes.annotate(f"{value:.3g}", (end, y), xytext=(4, 0), textcoords="offset points", va="center",
                      fontsize=FONT_SIZE - 1, color=LIGHT["ink"])  # fmt: skip
    axes.set_yticks(range(len(rows)), [r[0] for r in rows])
    axes.set_ylim(len(rows) - 0.2, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlim(left=0.0)
    if noise_floor is not None:
        axes.axvline(noise_floor, color=LIGHT["ink"], linestyle=(0, (2, 2)), linewidth=0.9)
        axes.annotate("noise floor", (noise_floor, 0.0), xycoords=("data", "axes fraction"), xytext=(3, 3),
                      textcoords="offset points", fontsize=FONT_SIZE - 1.5, color=LIGHT["ink"])  # fmt: skip
    return figure
