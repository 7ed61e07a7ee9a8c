"""Single lines of a run: what the film makes of the motion, and mains; kept when the windows' phasors are put away."""

from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.phasors.run_data import RunPhasors, complex_median

#: Lines nearer than this are one [Hz].
_SAME_LINE = 1e-3


@dataclass(frozen=True)
class FilmLine:
    """What a run holds at a line that a film which is not linear makes of the motion."""

    ratio: float  #: its frequency over that of the excitation
    displacement: ComplexArray  #: (2,) complex, m
    force: ComplexArray  #: (2,) complex, N: oil force
    displacement_noise: float  #: m^2: mean square of the residual around the line, X and Y together
    force_noise: float  #: N^2


@dataclass(frozen=True)
class FilmLines:
    """One excitation line of a run, and the lines beside it by name: "2f", "3f", "2X-f"; those that stand alone."""

    force: float  #: N: size of the oil force at the excitation
    lines: dict[str, FilmLine]


def film_lines(run: RunPhasors) -> tuple[FilmLines | None, ...]:
    """Every excitation line of a run with what the film makes of it; None where the whole record was not fitted."""
    if not len(run.record) or len(run.residual) < len(run.record):
        return tuple(None for _ in run.lines.excitation)
    displacement, force = run.plane("displacement", run.record), run.film_force(run.record)
    # the square that rounding puts on a line is the sum over the channels
    steps = np.diag(np.sqrt(len(run.rounding) * run.rounding)).astype(complex)

    def noise(rows: ComplexArray) -> FloatArray:
        return np.array([_mean_square(run.plane("displacement", rows)), _mean_square(run.film_force(rows))])

    result = []
    for i, driven in enumerate(run.lines.excitation):
        crossed = abs(2 * run.lines.speed - driven.frequency)
        wanted = {"2f": 2 * driven.frequency, "3f": 3 * driven.frequency, "2X-f": crossed}
        lines = {}
        for name, frequency in wanted.items():
            place = _alone(run, frequency, name)
            if place is not None:
                noises = noise(run.residual[place]) + noise(steps)
                lines[name] = FilmLine(frequency / driven.frequency, displacement[place], force[place], *noises)
        result.append(FilmLines(float(np.linalg.norm(force[i])), lines))
    return tuple(result)


def _mean_square(rows: ComplexArray) -> float:
    """Mean over rows (n, 2) of their squared size, those without a value left out; zero where there is none."""
    sizes = np.sum(np.abs(rows) ** 2, axis=1)
    return float(np.mean(sizes, where=np.isfinite(sizes))) if np.isfinite(sizes).any() else 0.0


def _alone(run: RunPhasors, frequency: float, name: str) -> int | None:
    """Place of a line of the whole record that nothing else shares; None where there is none."""
    kind = "2X-f" if name == "2X-f" else "harmonic"
    places = np.flatnonzero(np.abs(run.lines.whole_frequencies - frequency) < _SAME_LINE).tolist()
    return places[0] if len(places) == 1 and run.lines.whole[places[0]].name.startswith(kind) else None


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
    for z in (run.displacement[:, place], run.oil_force(place)):
        complete = z[np.isfinite(z).all(axis=1)]
        typical.append(complex_median(complete) if len(complete) else None)
    return typical[0], typical[1]
