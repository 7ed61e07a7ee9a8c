"""What is said of a band as a whole, and how its runs differ from one another by a gain.

Line by line such a difference drowns in noise; over all lines it is told to a fraction of a per cent. Two runs are
needed for h itself: only from the third on anything is known of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student_t

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.band_result import BandLine
from tpjb_ident.dynamic.broadband.line_estimates import STRONG, LineEstimates
from tpjb_ident.dynamic.broadband.line_fit import LineFit
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra

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


#: Probability of chance below which runs differ,
DIFFERENT = 1e-3
#: and the relative difference that is too much for one bearing.
TOO_MUCH = 0.05


@dataclass(frozen=True)
class RunScatter:
    """How runs differ.

    Attributes
    ----------
    size : float
        Standard deviation of their gains, widened for the few runs that tell it; 0 where none is clear.
    draws : (n, n_runs, 2) ndarray
        Standard normal numbers, one per run and force axis.
    conditions : tuple of Condition
    """

    size: float
    draws: FloatArray
    conditions: tuple[Condition, ...] = ()

    @property
    def gains(self) -> FloatArray:
        """Relative change of every run's force along X and Y, (n, n_runs, 2)."""
        return self.size * self.draws

    def changes(self, fit: LineFit) -> FloatArray:
        """Change of the eight entries of h in every draw, (n, 8) [N/m].

        Parameters
        ----------
        fit : LineFit
        """
        if not self.size:
            return np.zeros((len(self.draws), 8))
        taken = np.einsum("ij,rjk->rik", fit.h, fit.share)
        moved = self.size * np.einsum("nri,rik->nik", self.draws, taken).reshape(-1, 4)
        return np.concatenate([moved.real, moved.imag], axis=1)


def run_scatter(fits: Sequence[LineFit], numbers: FloatArray) -> RunScatter:
    """What the lines of a point say of its runs together.

    Parameters
    ----------
    fits : sequence of LineFit
        Of the lines that count.
    numbers : (n, ...) ndarray
        As many draws as this has are made.
    """
    n_runs = len(fits[0].dof) if fits else 0
    half = np.random.default_rng(n_runs).standard_normal((max(len(numbers) // 2, 1), max(n_runs, 1), 2))
    draws = np.concatenate([half, -half])
    if n_runs < 2 or not fits:
        return RunScatter(0.0, draws)
    if n_runs == 2:
        told = "with two runs the interval holds how their repeats differ, not how runs do"
        return RunScatter(0.0, draws, (Condition("no-spare-direction", told),))
    apart = np.sum([fit.apart for fit in fits], axis=0)
    gain = apart[:, 0] / apart[:, 1]
    noise = apart[:, 2].real / apart[:, 1].real ** 2
    spare = 2 * (n_runs - 2)
    total = float(np.sum(2 * np.abs(gain) ** 2 / noise))
    if not chi2.sf(total, spare) < DIFFERENT:
        return RunScatter(0.0, draws)
    size = float(np.sqrt(np.sum(np.abs(gain) ** 2) / (n_runs - 2)))
    found: tuple[Condition, ...] = ()
    if size > TOO_MUCH:
        found = (Condition("runs-disagree", f"runs differ by {100 * size:.1f} % in force over displacement"),)
    return RunScatter(size * float(student_t.ppf(0.975, spare)) / 1.96, draws, found)
