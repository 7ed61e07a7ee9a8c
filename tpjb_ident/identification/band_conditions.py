"""What is to be said of a band: of its excitation, its instrument, its runs and the rig."""

from __future__ import annotations

import numpy as np

from tpjb_ident.conditions import Condition, merged
from tpjb_ident.identification.band_blocks import STRONG
from tpjb_ident.identification.band_point import BandPoint
from tpjb_ident.identification.band_solution import BandSolution
from tpjb_ident.identification.band_tables import SolvedBands

#: Share of the driven lines that must be told from noise.
_LEAST_LINES = 0.5
#: Condition number of the directions of motion from which errors are strongly amplified, and that of a line.
_ILL_CONDITIONED, _ONE_LINE = 30.0, 1e6
#: Coherence below which a band is doubted where no instrument speaks for it.
_LOW_COHERENCE = 0.9
#: Scatter of the runs' gains that is too much for one bearing.
_TOO_MUCH = 0.05


def run_conditions(point: BandPoint, solution: BandSolution) -> tuple[Condition, ...]:
    """What the records, the runs beside each other and the terms' tests say."""
    conditions = [condition for s in point.spectra for condition in s.phasors.conditions]
    if len(point.spectra) == 2:
        text = "with two runs the interval holds how their repeats differ, not how runs do"
        conditions.append(Condition("no-spare-direction", text))
    if solution.run_scatter > _TOO_MUCH:
        text = f"runs differ by {100 * solution.run_scatter:.1f} % in force over displacement"
        conditions.append(Condition("runs-disagree", text))
    return merged(tuple(conditions), solution.lines.conditions())


def band_conditions(point: BandPoint, solved: SolvedBands, b: int) -> tuple[Condition, ...]:
    """What the lines of one band say."""
    mine = np.flatnonzero(solved.data.band == b)
    driven = mine[solved.data.driven[mine]]
    usable = solved.usable(b)
    flags = []
    conditions = solved.first.condition[driven]
    if len(driven) and np.median(conditions) > _ONE_LINE:
        text = "the runs move the shaft along one line; excite in two directions, or with two actuators at once"
        flags.append(Condition("fewer-than-two-directions", text))
    elif len(usable) < max(_LEAST_LINES * len(driven), 1):
        text = f"{len(usable)} of {len(driven)} driven lines stand {STRONG:g} times (F ratio) above the noise"
        flags.append(Condition("excitation-too-weak", text))
    elif np.median(conditions) > _ILL_CONDITIONED:
        text = f"condition number {np.median(conditions):.0f} (median over the band)"
        flags.append(Condition("ill-conditioned", text))
    flags += [*_disturbances(point), *_instrument(point, solved, usable), *_baseline(solved, usable)]
    if point.spectra[0].phasors.acceleration is None and point.spectra[0].phasors.housing_mass > 0:
        flags.append(Condition("inertia-not-corrected", "no accelerometers"))
    return tuple(flags)


def _disturbances(point: BandPoint) -> list[Condition]:
    spectra = point.spectra[0]
    low, high = spectra.frequencies[0], spectra.frequencies[-1]
    held = [d for d in spectra.disturbances if low <= d.frequency <= high]
    if not held:
        return []
    named = ", ".join(f"{d.name} {d.frequency:.4g} Hz" for d in held[:6])
    more = f" and {len(held) - 6} more" if len(held) > 6 else ""
    return [Condition("lines-left-out", f"{named}{more}")]


def _instrument(point: BandPoint, solved: SolvedBands, usable: np.ndarray) -> list[Condition]:
    if point.method != "hv" or not len(usable):
        return []
    first = int(np.searchsorted(solved.data.band, solved.data.band[usable[0]]))
    low = float(np.median([point.classic[k - first].coherence.min() for k in usable]))
    text = f"no command channel, and nothing repeats: the intervals reach from H1 to H2 (coherence {low:.3f})"
    flags = [Condition("no-instrument", text)]
    if low < _LOW_COHERENCE:
        flags.append(Condition("low-coherence", f"{low:.2f}, median over the band"))
    return flags


def _baseline(solved: SolvedBands, usable: np.ndarray) -> list[Condition]:
    bare = solved.first.rig.bare
    if not len(bare.omega):
        return []
    unknown = int((~bare.known(solved.data.line_omega[usable])).sum())
    return [Condition("baseline-missing", f"at {unknown} of {len(usable)} lines of the band")] if unknown else []
