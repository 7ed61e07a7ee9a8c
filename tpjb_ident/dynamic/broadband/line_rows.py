"""Lines that a point's spectra give, and what each is estimated from: rows of displacement and force phasors.

A row is one period of a periodic excitation, or one bin of a whole record's transform next to the line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray, IntArray
from tpjb_ident.dynamic.broadband.run_spectra import RunSpectra
from tpjb_ident.errors import BadInputError

#: Lines over a band where a record resolves more, and bins that a line takes at least.
_LINES, _BINS = 60, 18
#: Bins of a line that must be left when those of shaft and mains are gone.
_LEAST_BINS = 12
#: Lines that a band must give.
_LEAST_LINES = 3


@dataclass(frozen=True)
class LinePlan:
    """Bins that belong to each line; no bin belongs to two, so that lines of a record err apart from each other."""

    bins: tuple[IntArray, ...]  #: (k,)
    frequencies: FloatArray  #: (n_lines,), Hz
    half_width: float


@dataclass(frozen=True)
class LineRows:
    """Rows of all runs at one line."""

    omega: float
    D: ComplexArray  #: (n, 2) complex, m
    F: ComplexArray  #: (n, 2) complex, N
    A: ComplexArray  #: (n, 2) complex
    command: ComplexArray | None  #: (n, 2) complex: what the actuators were told, along X and Y, in units of its own
    run: IntArray  #: (n,): place of the run that a row belongs to
    place: FloatArray  #: (n,)
    repeated: bool
    ends: bool
    step: float = 0.0

    @property
    def n_runs(self) -> int:
        """Runs behind the line."""
        return int(self.run.max()) + 1 if len(self.run) else 0

    def with_force(self, F: ComplexArray) -> LineRows:
        """The same rows with another force (n, 2) [N]."""
        return replace(self, F=F)

    def one_run(self, r: int) -> LineRows:
        """Rows of one run alone."""
        selected = self.run == r
        command = None if self.command is None else self.command[selected]
        zero = np.zeros(int(selected.sum()), dtype=int)
        return replace(
            self,
            D=self.D[selected],
            F=self.F[selected],
            A=self.A[selected],
            command=command,
            run=zero,
            place=self.place[selected],
        )


def line_plan(spectra: Sequence[RunSpectra]) -> LinePlan:
    """Lines of runs that have the same bins."""
    frequencies = spectra[0].frequencies
    free = ~np.any([s.taken for s in spectra], axis=0)
    if spectra[0].period is not None:
        chosen = np.flatnonzero(free)
        return LinePlan(tuple(np.array([k]) for k in chosen), frequencies[chosen], 0.0)
    n = len(frequencies)
    width = max(_BINS, math.ceil(n / _LINES))
    count = n // width
    if count < _LEAST_LINES:
        have = 1 / (frequencies[1] - frequencies[0]) if n > 1 else 0.0
        need = have * _LEAST_LINES * _BINS / max(n, 1)
        raise BadInputError(
            f"run {spectra[0].phasors.run}: {have:.3g} s resolve {n} bins of its band, {_LEAST_LINES * _BINS} are "
            f"needed; record {need:.3g} s or excite a wider band"
        )
    bins = [part[free[part]] for part in np.array_split(np.arange(n), count)]
    bins = [part for part in bins if len(part) >= _LEAST_BINS]
    middles = np.array([0.5 * (frequencies[b[0]] + frequencies[b[-1]]) for b in bins])
    return LinePlan(tuple(bins), middles, 0.5 * width * float(frequencies[1] - frequencies[0]))


def line_rows(spectra: Sequence[RunSpectra], plan: LinePlan, k: int, ends: bool) -> LineRows:
    """Rows of one line from all runs."""
    bins = plan.bins[k]
    counts = [len(s.D) * len(bins) for s in spectra]
    place = np.zeros(len(bins)) if not plan.half_width else _place(spectra[0].frequencies[bins], plan, k)

    def rows(name: str) -> np.ndarray:
        return np.concatenate([getattr(s, name)[:, bins].reshape(-1, 2) for s in spectra])

    return LineRows(
        2 * np.pi * float(plan.frequencies[k]),
        rows("D"),
        rows("F"),
        rows("A"),
        rows("command") if all(s.command is not None for s in spectra) else None,
        np.repeat(np.arange(len(spectra)), counts),
        np.concatenate([np.tile(place, len(s.D)) for s in spectra]),
        repeated=spectra[0].period is not None,
        ends=ends and spectra[0].period is None,
        step=2 * np.pi * plan.half_width,
    )


def _place(frequencies: FloatArray, plan: LinePlan, k: int) -> FloatArray:
    return np.asarray((frequencies - plan.frequencies[k]) / plan.half_width)
