"""Pictures of results: one file per figure, whose function takes result objects and returns a matplotlib figure.

No global style is set and pyplot is not needed: a figure saves itself (`savefig`) and shows itself in a notebook. Units
are in the axis labels, bands and bars are 95 % intervals, and line and marker tell curves apart without colour. What
each function shows, and which figure of the paper it is, docs/plots.md tells.
"""

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
