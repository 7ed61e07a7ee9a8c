"""Pictures of results: a function for each, which takes result objects and returns a matplotlib figure.

No global style is set and pyplot is not needed: a figure saves itself (`savefig`) and shows itself in a notebook. Each
takes ``title=``, which stands above all panels. Units are in the axis labels, bands and bars are 95 % intervals, and
line and marker tell curves apart without colour. What each function shows, and which figure of the paper it is,
docs/plots.md tells.
"""

from tpjb_ident.report.plots.coefficients import coefficient, direct_coefficients, frf
from tpjb_ident.report.plots.records import coherence, coherence_spectrum, orbit, spectra, window_weights
from tpjb_ident.report.plots.residuals import gap, isolability, residual_map, residual_series
from tpjb_ident.report.plots.static_tests import clearance_and_locus, load_deflection, pad_projection, pivot_stiffness

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
