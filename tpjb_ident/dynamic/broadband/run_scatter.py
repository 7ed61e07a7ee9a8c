"""How a band's runs differ from one another by a gain.

Line by line such a difference drowns in noise; over all lines it is told to a fraction of a per cent. h takes a part of
every run's gain, so what is left shows only some of it, and that with few degrees of freedom: both are worked out from
the runs' own shares in h. Two runs are needed for h itself: only from the third on anything is known of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, stdtrit

from tpjb_ident.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.broadband.line_fit import LineFit

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
    draws : (n, n_runs) ndarray
        Standard normal numbers, one per run.
    conditions : tuple of Condition
    """

    size: float
    draws: FloatArray
    conditions: tuple[Condition, ...] = ()

    @property
    def gains(self) -> FloatArray:
        """Relative change of every run's force, (n, n_runs)."""
        return self.size * self.draws

    def changes(self, fit: LineFit) -> FloatArray:
        """Change of the eight entries of h in every draw, (n, 8) [N/m].

        Parameters
        ----------
        fit : LineFit
        """
        if not self.size:
            return np.zeros((len(self.draws), 8))
        moved = np.einsum("nr,rik->nik", self.gains, fit.h @ fit.share).reshape(-1, 4)
        return np.concatenate([moved.real, moved.imag], axis=1)


def run_scatter(fits: Sequence[LineFit], n: int) -> RunScatter:
    """What the lines of a point say of its runs together.

    Parameters
    ----------
    fits : sequence of LineFit
        Of the lines that count.
    n : int
        Draws.
    """
    n_runs = len(fits[0].dof) if fits else 0
    half = np.random.default_rng(n_runs).standard_normal((max(n // 2, 1), max(n_runs, 1)))
    draws = np.concatenate([half, -half])
    if n_runs < 2 or not fits:
        return RunScatter(0.0, draws)
    if n_runs == 2:
        told = "with two runs the interval holds how their repeats differ, not how runs do"
        return RunScatter(0.0, draws, (Condition("no-spare-direction", told),))
    power = np.sum([fit.apart.power for fit in fits], axis=0)
    gain = np.sum([fit.apart.left for fit in fits], axis=0) / power
    noise = np.sum([fit.apart.variance for fit in fits], axis=0) / power**2
    spare = 2 * (n_runs - 2)
    if not chdtrc(spare, float(np.sum(2 * np.abs(gain) ** 2 / noise))) < DIFFERENT:
        return RunScatter(0.0, draws)
    shown = left_of_gains(fits)
    # of gains with variance s^2 the residuals show s^2 tr(A^T A); Satterthwaite's degrees of freedom of that sum
    part = shown.T @ shown
    dof = float(np.trace(part) ** 2 / np.trace(part @ part))
    size = float(np.sqrt(np.sum(np.abs(gain) ** 2) / np.trace(part)))
    found: tuple[Condition, ...] = ()
    if size > TOO_MUCH:
        found = (Condition("runs-disagree", f"runs differ by {100 * size:.1f} % in force over displacement"),)
    return RunScatter(size * float(stdtrit(dof, 0.975)) / 1.96, draws, found)


def left_of_gains(fits: Sequence[LineFit]) -> FloatArray:
    """What a gain of every run's force leaves in the residuals' gains once h has taken its part, (2 n_runs, n_runs).

    Parameters
    ----------
    fits : sequence of LineFit
        Of the lines that count. Real parts first.
    """
    n_runs = len(fits[0].dof)
    power = np.sum([fit.apart.power for fit in fits], axis=0)
    taken = np.zeros((n_runs, n_runs), dtype=complex)
    for fit in fits:
        turned = fit.h @ fit.share @ np.linalg.inv(fit.h)
        taken += np.einsum("sij,rji->rs", turned, fit.apart.force)
    left = np.eye(n_runs) - taken / power[:, None]
    return np.concatenate([left.real, left.imag])
