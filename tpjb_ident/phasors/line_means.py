"""Single lines of a run: what the film makes of the motion, and mains; kept when the windows' phasors are put away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray
from rigdata.vector import inverse_directions
from tpjb_ident.phasors.line_fit import usual_scale
from tpjb_ident.phasors.run_data import QUANTITIES, RunPhasors

#: Lines nearer than this are one [Hz].
_SAME_LINE = 1e-3
#: Sum of the windows' phasors over that of their sizes below which the drive wanders.
_COHERENT = 0.9
#: Part of a run that is its beginning [s].
_EARLY = 2.0
#: Windows farther than this from the middle one, in median distances, do not count.
_FAR = 4.0


@dataclass(frozen=True)
class FilmLine:
    """What a run holds at a line that a film which is not linear makes of the motion."""

    ratio: float  #: its frequency over that of the excitation
    displacement: ComplexArray  #: (2,) complex, m
    force: ComplexArray  #: (2,) complex, N: oil force


@dataclass(frozen=True)
class FilmLines:
    """One excitation line of a run, and the lines beside it by name: "2f", "3f", "2X-f"; those that stand alone."""

    force: float  #: N: size of the oil force at the excitation
    lines: dict[str, FilmLine]
    displacement_noise: float  #: m^2: mean square of the residual around the excitation, X and Y together
    force_noise: float  #: N^2


def film_lines(run: RunPhasors) -> tuple[FilmLines | None, ...]:
    """Every excitation line of a run with what the film makes of it; None where the whole record was not fitted."""
    if not len(run.record) or len(run.residual) < len(run.lines.excitation):
        return tuple(None for _ in run.lines.excitation)
    result = []
    for i, driven in enumerate(run.lines.excitation):
        wanted = {"2f": 2 * driven.frequency, "3f": 3 * driven.frequency}
        if run.lines.speed > 0:
            wanted["2X-f"] = abs(2 * run.lines.speed - driven.frequency)
        lines = {}
        for name, frequency in wanted.items():
            place = _alone(run, frequency, name)
            if place is not None:
                d, f = _plane(run, run.record[place])
                lines[name] = FilmLine(frequency / driven.frequency, d, f)
        bins = [_plane(run, row) for row in run.residual[i]]
        force = float(np.linalg.norm(_plane(run, run.record[i])[1]))
        result.append(FilmLines(force, lines, _mean_square([d for d, _ in bins]), _mean_square([f for _, f in bins])))
    return tuple(result)


def _mean_square(rows: list[ComplexArray]) -> float:
    """Mean over rows (2,) of their squared size, those without a value left out; zero where there is none."""
    sizes = [float(np.sum(np.abs(row) ** 2)) for row in rows if np.isfinite(row).all()]
    return float(np.mean(sizes)) if sizes else 0.0


def _alone(run: RunPhasors, frequency: float, name: str) -> int | None:
    """Place of a line of the whole record that nothing else shares; None where there is none."""
    own = "2X-f" if name == "2X-f" else "harmonic"
    places = [k for k, line in enumerate(run.lines.whole) if abs(line.frequency - frequency) < _SAME_LINE]
    named = [k for k in places if run.lines.whole[k].name.startswith(own)]
    return named[0] if named and len(places) == 1 and named[0] < len(run.record) else None


def _plane(run: RunPhasors, phasors: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Displacement and oil force, X and Y, of the channels' phasors (n_channels,)."""
    plane = {}
    for quantity in QUANTITIES:
        places = [k for k in run.pick(quantity) if np.isfinite(phasors[k])]
        axes = tuple(float(run.channels[k].axis or 0.0) for k in places)
        plane[quantity] = inverse_directions(axes) @ phasors[places] if len(places) > 1 else np.full(2, np.nan + 0j)
    inertia = run.housing_mass * plane["acceleration"]
    return plane["displacement"], plane["force"] + np.where(np.isfinite(inertia), inertia, 0.0)


def mains_lines(run: RunPhasors) -> tuple[ComplexArray | None, ComplexArray | None]:
    """Typical displacement [m] and oil force [N] (2,) at a run's mains line.

    None where a drive harmonic was merged into it, where it is not fitted, or where no window has them.
    """
    place = run.lines.place("mains")
    if place is None:
        return None, None
    mains = run.lines.whole[place]
    harmonics = (n * e.frequency for e in run.lines.excitation for n in (2, 3))
    if any(abs(f - mains.frequency) <= mains.wander for f in harmonics):
        return None, None
    typical: list[ComplexArray | None] = []
    for z in (run.displacement.phasors[:, place], run.oil_force(place)):
        whole = z[np.isfinite(z).all(axis=1)]
        typical.append(complex_median(whole) if len(whole) else None)
    return typical[0], typical[1]


def complex_median(z: ComplexArray) -> ComplexArray:
    """Median of real and imaginary parts over the first axis; `z` (n, ...)."""
    return np.asarray(np.median(z.real, axis=0) + 1j * np.median(z.imag, axis=0))


def channel_phasors(run: RunPhasors, line: int) -> ComplexArray:
    """Typical phasor of every channel at one line in a run's beginning, (n_channels,); NaN where a channel has none.

    Later on clocks that differ would have turned it. Where the drive wanders, the windows are turned to one phase
    first, by the pattern that all of them show.
    """
    present = np.flatnonzero(np.isfinite(run.z[:, line]).any(axis=1))
    early = [k for k in present if run.start[k] + run.length <= run.start[present[0]] + _EARLY]
    z = run.z[early if len(early) > 3 else present[:4], line]
    good = np.isfinite(z).all(axis=1)
    if good.sum() > 2:
        weighted = z[good] / np.maximum(usual_scale(run.scale), np.finfo(float).tiny)
        course = np.linalg.svd(weighted, full_matrices=False)[0][:, 0]
        if abs(course.sum()) < _COHERENT * np.abs(course).sum():
            z = z[good] * np.exp(-1j * np.angle(course))[:, None]
    typical = np.full(z.shape[1], np.nan + 0j)
    for k, windows in enumerate(z.T):
        present = windows[np.isfinite(windows)]
        if len(present):
            middle = complex_median(present)
            distance = np.abs(present - middle)
            typical[k] = present[distance <= _FAR * np.median(distance)].mean()
    return typical
