"""Pictures of results: one function per figure, each takes result objects and returns a matplotlib figure.

No global style is set and pyplot is not needed: a figure saves itself (`savefig`) and shows itself in a notebook. Units
stand in the axis labels, bands and bars are 95 % intervals, and line and marker tell curves apart without colour. What
each function shows, and which figure of the paper it is, stands in docs/plots.md.

A picture's file bears its function's name and is imported when it is first asked for; `plots.coefficient` means the
function, whoever imported the file first.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

from rigdata.near_names import nearest_name

if TYPE_CHECKING:
    from tpjb_ident.report.plots.clearance_and_locus import clearance_and_locus
    from tpjb_ident.report.plots.coefficient import coefficient
    from tpjb_ident.report.plots.coherence import coherence
    from tpjb_ident.report.plots.coherence_spectrum import coherence_spectrum
    from tpjb_ident.report.plots.direct_coefficients import direct_coefficients
    from tpjb_ident.report.plots.frf import frf
    from tpjb_ident.report.plots.gap import gap
    from tpjb_ident.report.plots.isolability import isolability
    from tpjb_ident.report.plots.load_deflection import load_deflection
    from tpjb_ident.report.plots.orbit import orbit
    from tpjb_ident.report.plots.pad_projection import pad_projection
    from tpjb_ident.report.plots.pivot_stiffness import pivot_stiffness
    from tpjb_ident.report.plots.residual_map import residual_map
    from tpjb_ident.report.plots.residual_series import residual_series
    from tpjb_ident.report.plots.spectra import spectra
    from tpjb_ident.report.plots.window_weights import window_weights

__all__ = [
    "clearance_and_locus",
    "coefficient",
    "coherence",
    "coherence_spectrum",
    "direct_coefficients",
    "frf",
    "gap",
    "isolability",
    "load_deflection",
    "orbit",
    "pad_projection",
    "pivot_stiffness",
    "residual_map",
    "residual_series",
    "spectra",
    "window_weights",
]


class _Plots(ModuleType):
    """Where Python binds a file that was imported, its function stands."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in __all__ and isinstance(value, ModuleType):
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Plots


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(importlib.import_module(f"{__name__}.{name}"), name)
    near = nearest_name(name, __all__)
    hint = f"; did you mean {near!r}?" if near else ""
    raise AttributeError(f"module 'tpjb_ident.report.plots' has no attribute {name!r}{hint}")


def __dir__() -> list[str]:
    return __all__
