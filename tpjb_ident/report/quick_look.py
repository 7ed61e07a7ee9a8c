"""A first picture of a record: every channel over time and its spectrum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tpjb_ident.report.drawing.colours import LIGHT
from tpjb_ident.report.drawing.picture import FONT_SIZE
from tpjb_ident.report.figure import panel, save_panels
from tpjb_ident.runtime.tables import printable

if TYPE_CHECKING:
    from rigdata.readers.series import Series
    from rigdata.survey.spectrum import Look

#: A picture of more channels could not be read.
MOST = 24
_ROW, _WIDTH = 1.15, 9.0
_POINTS = 4000


def write_quick_look(folder: Path, title: str, series: Sequence[Series], looks: Mapping[str, Look]) -> None:
    """Write ``figures/quick-look.svg`` and ``.png``."""
    save_panels([panel("quick-look", title, quick_look(title, series, looks), "")], folder / "figures")


def quick_look(title: str, series: Sequence[Series], looks: Mapping[str, Look]) -> Figure:
    """Draw one row per channel: left over time (minima and maxima where samples are many), right its spectrum."""
    shown = list(series)[:MOST]
    height = _ROW * len(shown) + 0.9
    figure = Figure(figsize=(_WIDTH, height))
    figure.suptitle(printable(title), fontsize=FONT_SIZE + 1, color=LIGHT["ink"], y=1.0 - 0.15 / height)
    for i, one in enumerate(shown):
        bottom = 1.0 - (0.45 + _ROW * (i + 1) - 0.12) / height
        size = (_ROW - 0.32) / height
        last = i == len(shown) - 1
        left = figure.add_axes((0.11, bottom, 0.42, size))
        right = figure.add_axes((0.62, bottom, 0.36, size))
        _time(left, one)
        look = looks[one.name]
        if len(look.amplitude) > 4:
            right.semilogy(
                look.frequency[4:], np.maximum(look.amplitude[4:], 1e-300), color=LIGHT["blue"], linewidth=0.7
            )
        name = f"{one.name}, {one.unit}" if one.unit else one.name
        left.set_ylabel(printable(name), fontsize=FONT_SIZE - 1, color=LIGHT["ink"])
        for axes, label in ((left, "time, s"), (right, "frequency, Hz")):
            axes.tick_params(labelsize=FONT_SIZE - 2, colors=LIGHT["ink"])
            axes.grid(True, color=LIGHT["rule"], linewidth=0.5)
            axes.margins(x=0.0)
            axes.yaxis.get_major_locator().set_params(**({"nbins": 3} if axes is left else {"numticks": 4}))
            if last:
                axes.set_xlabel(label, fontsize=FONT_SIZE - 1, color=LIGHT["ink"])
    return figure


def _time(axes: Axes, series: Series) -> None:
    time = np.arange(len(series), dtype=float) if series.time is None else series.time
    step = max(1, len(series) // _POINTS)
    if step == 1:
        axes.plot(time, series.values, color=LIGHT["ink"], linewidth=0.6)
        return
    count = len(series) // step
    blocks = np.ma.masked_invalid(series.values[: count * step].reshape(count, step))
    ends = time[: count * step : step]
    axes.fill_between(ends, blocks.min(axis=1), blocks.max(axis=1), color=LIGHT["ink"], linewidth=0.4)
