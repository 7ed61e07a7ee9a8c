"""Film temperatures over a run, pad by pad."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigdata.run import Run

#: Samples from which a run's temperatures are taken.
TEMPERATURE_SAMPLES = 2**17


def mean_temperatures(run: Run) -> dict[int, float]:
    """Mean temperature per pad over a run [K]; pads with several sensors give their mean.

    Parameters
    ----------
    run : Run
    """
    found: dict[int, list[float]] = {}
    for sensor in run.temperatures():
        if sensor.pad is None:
            continue
        values = run.record(sensor.channel, 0, TEMPERATURE_SAMPLES).values
        known = values[np.isfinite(values)]
        if len(known):
            found.setdefault(sensor.pad, []).append(float(known.mean()))
    return {pad: float(np.mean(values)) for pad, values in sorted(found.items())}


def pad_means(runs: Sequence[dict[int, float]]) -> dict[int, float]:
    """Mean temperature by pad over the runs that have it [K].

    Parameters
    ----------
    runs : sequence of dict
        Temperature by pad number, per run.
    """
    pads = sorted({pad for run in runs for pad in run})
    return {pad: float(np.mean([run[pad] for run in runs if pad in run])) for pad in pads}
