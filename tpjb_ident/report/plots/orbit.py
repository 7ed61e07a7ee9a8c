"""Draw the shaft's path about its mean position, and the ellipse at the excitation frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from tpjb_ident.columns import per, symbol
from tpjb_ident.report.drawing.colours import BLUE, GREY
from tpjb_ident.report.drawing.picture import add_legend, new_picture

if TYPE_CHECKING:
    from rigdata.run import Run

#: More samples could not be told apart.
_MOST_SAMPLES = 4000


def orbit(run: Run, *, title: str | None = None) -> Figure:
    """Draw the shaft's path about its mean position, and the ellipse at the excitation frequency.

    Parameters
    ----------
    run : Run
        With two displacement channels.
    title : str, optional

    Raises
    ------
    ValueError
        When the run has no finite displacements.
    """
    record = run.vector("displacement")
    path = np.asarray(record.values, float)
    good = np.isfinite(path).all(axis=1)
    if good.sum() < 2:
        raise ValueError(f"run {run.id} has no displacements to draw")
    path = per("length") * (path - np.median(path[good], axis=0))
    figure, axes = new_picture(f"x, {symbol('length')}", f"y, {symbol('length')}", title=title)
    shown = path[:_MOST_SAMPLES]
    axes.plot(shown[:, 0], shown[:, 1], color=GREY, linewidth=0.5, label="as measured")
    drive = run.point.excitation
    if drive:
        time = np.asarray(record.time, float)[good]
        waves = np.column_stack([np.ones_like(time), np.cos(drive * time), np.sin(drive * time)])
        _, cosine, sine = np.linalg.lstsq(waves, path[good], rcond=None)[0]
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        ellipse = np.outer(np.cos(turn), cosine) + np.outer(np.sin(turn), sine)
        name = f"at the excitation, {run.point.excitation_hz:g} Hz"
        axes.plot(ellipse[:, 0], ellipse[:, 1], color=BLUE, linewidth=1.8, label=name)
    axes.set_aspect("equal", adjustable="datalim")
    add_legend(axes)
    return figure
