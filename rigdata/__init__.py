"""Rig exports: reading, checking, calibrating and writing test campaigns (`tpjb-rig/1`).

```python
campaign = rigdata.load_campaign("rocker-A")
run = campaign.run("d-05000-25-03")
run.record("X1A")  # one channel, SI
run.vector("displacement")  # two channels, turned into X and Y
```
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rigdata.calibration import Channel
    from rigdata.campaign import Campaign, load_campaign
    from rigdata.device import Device
    from rigdata.operating_point import OperatingPoint
    from rigdata.problem import Problem, RigDataError
    from rigdata.record import Record, VectorRecord
    from rigdata.run import Run

_HOMES = {
    "Campaign": "campaign",
    "Channel": "calibration",
    "Device": "device",
    "OperatingPoint": "operating_point",
    "Problem": "problem",
    "Record": "record",
    "RigDataError": "problem",
    "Run": "run",
    "VectorRecord": "record",
    "load_campaign": "campaign",
}

__all__ = [
    "Campaign",
    "Channel",
    "Device",
    "OperatingPoint",
    "Problem",
    "Record",
    "RigDataError",
    "Run",
    "VectorRecord",
    "load_campaign",
]


def __getattr__(name: str) -> object:
    """Import on first use: `import rigdata` alone stays quick."""
    if name not in _HOMES:
        raise AttributeError(f"module 'rigdata' has no attribute {name!r}")
    return getattr(importlib.import_module(f"rigdata.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
