"""Fig. 2: radial deformation of the pads in their middle plane, with their temperature where it is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from tpjb_ident.report.drawing.colours import style_of_pad
from tpjb_ident.report.drawing.picture import add_legend, label, new_pictures


def pad_deformation(
    angles: Sequence[ArrayLike],
    deformation: Sequence[ArrayLike],
    temperature: Sequence[ArrayLike] | None = None,
    *,
    title: str | None = None,
) -> Figure:
    """Draw the radial deformation of every pad over the angle (the paper's Fig. 2).

    Parameters
    ----------
    angles : sequence (pads) of (n,) array_like
        Along each pad's middle plane [rad]; pads may have different n. They are drawn as they come: give pads past a
        full turn without wrapping them.
    deformation : sequence (pads) of (n,) array_like
        Outward positive [m].
    temperature : sequence (pads) of (n,) array_like, optional
        Of the pads' surface at the same angles [degC]; adds a second panel.
    title : str, optional

    Raises
    ------
    ValueError
        When the sequences do not fit together.
    """
    rows = [("radial deformation, µm", 1e6, deformation)]
    if temperature is not None:
        rows.append(("temperature, °C", 1.0, temperature))
    for name, _, values in rows:
        if len(values) != len(angles) or any(np.shape(a) != np.shape(v) for a, v in zip(angles, values)):
            raise ValueError(f"{name.split(',')[0]} must hold one array per pad, as long as its angles")
    if not len(angles):
        raise ValueError("angles must hold at least one pad")
    figure, grid = new_pictures(len(rows), 1, title=title, width=6.4, height=2.9)
    for (axes,), (text, factor, values) in zip(grid, rows, strict=True):
        for pad, (angle, value) in enumerate(zip(angles, values, strict=True), 1):
            colour, dashes, _ = style_of_pad(pad)
            axes.plot(
                np.degrees(np.asarray(angle, float)), factor * np.asarray(value, float), color=colour,
                linestyle=dashes, linewidth=1.6, label=f"pad #{pad}",
            )  # fmt: skip
        label(axes, "angle around the bearing, deg", text)
        axes.margins(x=0.02)
    add_legend(grid[0][0], columns=min(len(angles), 5))
    return figure
