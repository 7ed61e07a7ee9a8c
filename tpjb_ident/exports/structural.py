"""Records as the structural-dynamics packages of SDyPy exchange them (SEP 005): a list of plain dictionaries.

```python
import tpjb_ident as ti
from tpjb_ident.exports.structural import sep005

run = ti.load_campaign("rigdata/samples/demo.h5").runs[0]
signals = sep005(run)
```
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rigdata.calibration import DIMENSIONS
from rigdata.units import SI_UNITS

if TYPE_CHECKING:
    from rigdata.run import Run

#: Steps of the clock that differ by less than this share of the mean step count as one rate.
_EVEN = 1e-3


def sep005(run: Run) -> list[dict[str, Any]]:
    """Every channel of a run, calibrated.

    Parameters
    ----------
    run : Run
        Of `rigdata.load_campaign`.

    Returns
    -------
    list of dict
        ``name``, ``data`` (n,), ``unit_str``, ``quantity``, ``fs`` [Hz], and ``direction_deg`` for channels that have
        one; where the clock is not even, ``time`` (n,) [s] stands in the place of ``fs``.
    """
    import numpy as np

    signals = []
    for name, channel in run.channels.items():
        if channel.quantity == "time" or channel.quantity not in DIMENSIONS:
            continue
        record = run.record(name)
        signal: dict[str, Any] = {
            "name": name,
            "data": record.values,
            "unit_str": SI_UNITS[DIMENSIONS[channel.quantity]],
            "quantity": channel.quantity,
            "group": run.id,
        }
        steps = np.diff(record.time)
        if len(steps) and np.ptp(steps) > _EVEN * abs(float(steps.mean())):
            signal["time"] = record.time
        else:
            signal["fs"] = record.rate
        if channel.axis is not None:
            signal["direction_deg"] = float(np.degrees(channel.axis))
        signals.append(signal)
    return signals
