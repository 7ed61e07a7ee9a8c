"""Rig exports: reading, checking, calibrating and writing test campaigns (`tpjb-rig/1`).

```python
campaign = rigdata.load_campaign("rocker-A")
run = campaign.run("d-05000-25-03")
run.record("X1A")  # one channel, SI
run.vector("displacement")  # two channels, turned into X and Y
```
"""

import importlib
from typing import Any

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

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Import on first use: `import rigdata` alone stays quick."""
    if name not in _HOMES:
        raise AttributeError(f"module 'rigdata' has no attribute {name!r}")
    return getattr(importlib.import_module(f"rigdata.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
