"""One operating point's broadband runs: which belong together, read and transformed, and the lines that they give.

No bin belongs to two lines, so lines err apart from each other.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigdata.arrays import FloatArray, IntArray
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run
from tpjb_ident.bands.classic import ClassicLine, classic_line
from tpjb_ident.bands.run_spectra import OPEN_ENDS, RunSpectra, run_spectra
from tpjb_ident.errors import BadInputError
from tpjb_ident.phasors.run_data import PhasorSettings
from tpjb_ident.runs.finished_runs import ExcludedRun
from tpjb_ident.runs.point_data import RunsOfPoint

#: Lines over a band where a record resolves more, and bins that a line takes at least.
_LINES, _BINS = 60, 12
#: Bins of a line that must be left when those of shaft and mains are gone.
_LEAST_BINS = 8
#: Lines that a band must give.
_LEAST_LINES = 4


@dataclass(frozen=True)
class BandPoint(RunsOfPoint):
    """Runs at one operating point, excited alike and transformed."""

    kind: str
    spectra: list[RunSpectra]
    bins: tuple[IntArray, ...]  #: of every line: one of a period, or some neighbouring ones of a whole record

    @property
    def frequencies(self) -> FloatArray:
        """Of the lines, (n_lines,) [Hz]."""
        return np.array([self.spectra[0].frequencies[bins].mean() for bins in self.bins])

    @property
    def resolution(self) -> float:
        """Width of a line [Hz]."""
        return max(map(len, self.bins), default=1) / self.spectra[0].phasors.length

    @property
    def method(self) -> str:
        """What tells noise from motion: the periods, the command, or nothing."""
        if self.spectra[0].period is not None:
            return "periods"
        return "iv" if all(s.command is not None for s in self.spectra) else "hv"

    @property
    def members(self) -> list[list[int]]:
        """Runs that are taken together: each by itself, all of them where nothing tells noise from motion."""
        places = list(range(len(self.spectra)))
        return [places] if self.method == "hv" else [[place] for place in places]

    @property
    def open(self) -> bool:
        """Whether the records may begin and end in motion."""
        return self.kind in OPEN_ENDS

    @cached_property
    def classic(self) -> list[ClassicLine]:
        """Every line by the methods of analysers."""
        return [classic_line(self.spectra, bins, self.open) for bins in self.bins]


def read_point(
    runs: Sequence[Run], housing_mass: float, settings: PhasorSettings, fast: Mapping[str, float]
) -> tuple[BandPoint | None, list[ExcludedRun]]:
    """Transform the runs of a point, and name those that cannot be used; None where there is no other.

    `fast`: rates of the channels' clocks by name, relative.
    """
    spectra: list[RunSpectra] = []
    unusable = []
    first, band = runs[0], _common_band(runs)
    seconds = min(run.length / run.sample_rate for run in runs)
    for run in runs:
        try:
            spectra.append(run_spectra(run, housing_mass, band, seconds, settings, fast))
        except RigDataError as error:
            unusable.append(ExcludedRun(run.id, run.point, error))
    if not spectra:
        return None, unusable
    _refuse_unlike(spectra)
    point = replace(first.point, excitation=0.0)
    phasors = tuple(s.phasors for s in spectra)
    return BandPoint(point, phasors, first.excitation_kind, spectra, bins_of_lines(spectra)), unusable


def _common_band(runs: Sequence[Run]) -> tuple[float, float]:
    """What the bands of some runs have in common [Hz]."""
    bands = np.array([run.band for run in runs if run.band is not None])
    low, high = float(bands[:, 0].max()), float(bands[:, 1].min())
    first = runs[0]
    if not low < high:
        text = f"runs at {first.point} have no common excitation_band"
        raise RigDataError(Problem("error", first.file, "excitation_band", text, "Check the bands", first.id))
    return low, high


def _refuse_unlike(spectra: Sequence[RunSpectra]) -> None:
    """Runs of one point have the same bins."""
    first = spectra[0]
    for spectrum in spectra[1:]:
        is_same = len(spectrum.frequencies) == len(first.frequencies)
        if not is_same or np.abs(spectrum.frequencies / first.frequencies - 1).max() > 1e-3:
            sentences = [
                f"{s.phasors.run} {'none' if s.period is None else f'{s.period:.4g} s'}" for s in (first, spectrum)
            ]
            raise BadInputError(
                f"runs at {first.phasors.point} repeat with different periods ({', '.join(sentences)}); "
                "excite the runs of one point with one period, or list them as different kinds of excitation"
            )


def band_groups(runs: Sequence[Run]) -> list[list[Run]]:
    """Group broadband runs by operating point and kind of excitation, sorted."""
    groups: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        groups.setdefault((*run.point.static_key, run.excitation_kind), []).append(run)
    return [groups[key] for key in sorted(groups, key=repr)]


def bins_of_lines(spectra: Sequence[RunSpectra]) -> tuple[IntArray, ...]:
    """Bins of the lines of runs that have the same bins."""
    free = ~np.any([s.disturbed for s in spectra], axis=0)
    if spectra[0].period is not None:
        return tuple(np.flatnonzero(free)[:, None])
    n = len(free)
    count = n // max(_BINS, math.ceil(n / _LINES))
    if count < _LEAST_LINES:
        have = spectra[0].phasors.length
        need = have * _LEAST_LINES * _BINS / max(n, 1)
        raise BadInputError(
            f"run {spectra[0].phasors.run}: {have:.3g} s resolve {n} bins of its band, {_LEAST_LINES * _BINS} are "
            f"needed; record {need:.3g} s or excite a wider band"
        )
    lines = [part[free[part]] for part in np.array_split(np.arange(n), count)]
    return tuple(part for part in lines if len(part) >= _LEAST_BINS)
