"""Pictures of results: one function per figure, each takes result objects and returns a matplotlib figure.

No global style is set and pyplot is not needed: a figure saves itself (`savefig`) and shows itself in a notebook. Units
are in the axis labels, bands and bars are 95 % intervals, and line and marker tell curves apart without colour. What
each function shows, and which figure of the paper it is, docs/plots.md tells.
"""

from __future__ import annotations

import importlib
from typing import Any

from rigdata.near_names import nearest_name

#: File of each function, imported when it is first asked for.
_FILES = {
    "clearance_and_locus": "positions",
    "coefficient": "coefficients",
    "coherence": "points",
    "coherence_spectrum": "runs",
    "direct_coefficients": "coefficients",
    "frf": "coefficients",
    "gap": "diagnoses",
    "isolability": "diagnoses",
    "load_deflection": "pivot_tests",
    "orbit": "runs",
    "pad_projection": "pivot_tests",
    "pivot_stiffness": "pivot_tests",
    "residual_map": "residuals",
    "residual_series": "residuals",
    "spectra": "runs",
    "window_weights": "points",
}
__all__ = sorted(_FILES)


def __getattr__(name: str) -> Any:
    if name in _FILES:
        return getattr(importlib.import_module(f"{__name__}.{_FILES[name]}"), name)
    near = nearest_name(name, __all__)
    hint = f"; did you mean {near!r}?" if near else ""
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")


def __dir__() -> list[str]:
    return __all__
