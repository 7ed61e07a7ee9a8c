"""From which load on the shaft is fully in contact with the pad.

The shaft's weight keeps it off the upper pads at first (paper, Sec. 5, pads #3 and #4): it still has to
come down on the pad while the load already grows, and this way adds to the deflection. Contact counts as
complete once that adds less than a stated share (5 %) to the tangent compliance. The curve itself is the
pivot's alone; below the onset it is extrapolated.
"""

from __future__ import annotations

import numpy as np

from tpjb_ident.pivot.laws.law_fit import LawFit


def contact_onset(fit: LawFit, tolerance: float) -> float:
    """Load [N] from which incomplete contact adds less than `tolerance` to the compliance.

    Zero where no contact loss was fitted.

    Parameters
    ----------
    fit : LawFit
        The leading law.
    tolerance : float
        Share of the pivot's own compliance.
    """
    if not fit.contact:
        return 0.0
    gap, decay = float(fit.theta[-2]), float(np.exp(fit.theta[-1]))
    if gap <= 0.0:
        return 0.0
    load = decay
    for _ in range(60):
        # fixed point of (gap / F0) exp(-F / F0) = tolerance c(F): c changes slowly, so this contracts
        share = gap / decay / (tolerance * float(fit.compliance(np.array([max(load, 0.05 * decay)]))[0]))
        new = decay * float(np.log(max(share, 1e-300)))
        if abs(new - load) < 1e-6 * decay:
            break
        load = new
    return max(load, 0.0)


def contact_onset_se(fit: LawFit, tolerance: float) -> float:
    """Standard error of the onset [N], by finite differences through the parameters.

    Parameters
    ----------
    fit : LawFit
    tolerance : float
        Share of the pivot's own compliance.
    """
    if not fit.contact:
        return 0.0
    centre = contact_onset(fit, tolerance)
    gradient = np.zeros(len(fit.theta))
    steps = 0.1 * np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    for k, step in enumerate(steps):
        if step > 0.0:
            theta = fit.theta.copy()
            theta[k] += step
            moved = LawFit(fit.law, fit.reference_load, True, theta, fit.covariance, 0.0, 0.0, 1)
            gradient[k] = (contact_onset(moved, tolerance) - centre) / step
    return float(np.sqrt(gradient @ fit.covariance @ gradient))
