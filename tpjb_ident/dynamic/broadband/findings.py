"""What is said of a band as a whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.band_result import BandLine
from tpjb_ident.dynamic.broadband.line_estimates import STRONG, LineEstimates
from tpjb_ident.dynamic.broadband.spectra.run_spectra import RunSpectra

#: Share of the lines that must be told from noise.
LEAST_LINES = 0.5
#: Condition number of the directions of motion from which errors are strongly amplified.
ILL_CONDITIONED = 30.0
#: Coherence below which a band is doubted where no instrument speaks for it.
LOW_COHERENCE = 0.9


def band_conditions(
    spectra: Sequence[RunSpectra], estimates: Sequence[LineEstimates], lines: Sequence[BandLine]
) -> tuple[Condition, ...]:
    """Conditions of one operating point.

    Parameters
    ----------
    spectra : sequence of RunSpectra
    estimates : sequence of LineEstimates
        Of all lines.
    lines : sequence of BandLine
        Those that count.
    """
    found = []
    conditions = np.array([line.fit.condition for line in estimates])
    if len(estimates) and np.median(conditions) > 1e6:
        told = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
        found.append(Condition("fewer-than-two-directions", told))
    elif len(lines) < LEAST_LINES * len(estimates):
        told = f"{len(lines)} of {len(estimates)} lines stand {STRONG:g} times (F ratio) above the noise"
        found.append(Condition("excitation-too-weak", told))
    elif np.median(conditions) > ILL_CONDITIONED:
        told = f"condition number {np.median(conditions):.0f} (median over the band)"
        found.append(Condition("ill-conditioned", told))
    if spectra[0].disturbances:
        held = [d for d in spectra[0].disturbances if _inside(spectra[0], d.frequency)]
        if held:
            named = ", ".join(f"{d.name} {d.frequency:.4g} Hz" for d in held[:6])
            more = f" and {len(held) - 6} more" if len(held) > 6 else ""
            found.append(Condition("lines-left-out", f"{named}{more}"))
    if lines and lines[0].method == "hv":
        low = float(np.median([line.coherence.min() for line in lines]))
        told = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {low:.3f})"
        found.append(Condition("no-instrument", told))
        if low < LOW_COHERENCE:
            found.append(Condition("low-coherence", f"{low:.2f}, median over the band"))
    if spectra[0].phasors.acceleration is None and spectra[0].phasors.housing_mass > 0:
        found.append(Condition("inertia-not-corrected", "no accelerometers"))
    return tuple(found)


def _inside(spectra: RunSpectra, frequency: float) -> bool:
    return bool(spectra.frequencies[0] <= frequency <= spectra.frequencies[-1])
