"""What a run shows at the mains frequency, where nothing else sits on that line."""

from __future__ import annotations

import numpy as np

from tpjb_ident.arrays import ComplexArray
from tpjb_ident.dynamic.records.run_data import RunPhasors


def mains_line(run: RunPhasors) -> ComplexArray | None:
    """Typical displacement phasor (2,) at a run's mains line [m]; None where something else sits on it.

    Parameters
    ----------
    run : RunPhasors
    """
    place = _place(run)
    return None if place is None else _typical(run.displacement.phasors[:, place])


def mains_force(run: RunPhasors) -> ComplexArray | None:
    """The same of the oil force [N].

    Parameters
    ----------
    run : RunPhasors
    """
    place = _place(run)
    return None if place is None else _typical(run.oil_force(place))


def _place(run: RunPhasors) -> int | None:
    names = [line.name for line in run.lines.nuisance]
    if "mains" not in names or _shared(run, names.index("mains")):
        return None
    return len(run.lines.excitation) + names.index("mains")


def _typical(z: ComplexArray) -> ComplexArray | None:
    z = z[np.isfinite(z).all(axis=1)]
    return complex_median(z) if len(z) else None


def _shared(run: RunPhasors, index: int) -> bool:
    """Whether a drive harmonic was merged into the mains line of this run."""
    mains = run.lines.nuisance[index]
    return any(abs(n * e.frequency - mains.frequency) <= mains.wander for e in run.lines.excitation for n in (2, 3))


def complex_median(z: ComplexArray) -> ComplexArray:
    """Median of real and imaginary parts over the first axis.

    Parameters
    ----------
    z : (n, ...) complex ndarray
    """
    return np.asarray(np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0))
