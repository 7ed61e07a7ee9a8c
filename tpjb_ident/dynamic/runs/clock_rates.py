"""Clocks that run at different rates: seen in the phase of the forces against the displacements, which then drifts.

Within a run the film answers alike from the first window to the last. Where the cells are recorded by a device whose
clock is off by e, their excitation line turns against the probes' by 2 pi f e per second; over a record of 30 s that
bends the damping by tens of per cent. All runs of a campaign share e, so together they tell it to a part per million.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.point_data import PointData

#: Standard errors beyond which a difference is one,
_CLEAR = 6.0
#: and phase [rad] over a run of usual length that it must come to: less is nothing to the coefficients.
_NOTABLE = 2e-3
_MIN_WINDOWS = 4


@dataclass(frozen=True)
class RateSamples:
    """Rate differences that single runs show."""

    force: FloatArray  #: `force`, `acceleration` (n, 3), rad
    acceleration: FloatArray


@dataclass(frozen=True)
class ClockRates:
    """How much faster than the probes' clock those of cells and accelerometers run (relative); 0 where they do not."""

    force: float = 0.0
    acceleration: float = 0.0
    error: float = 0.0

    def apply(self, data: PointData) -> PointData:
        """The point's windows as if all channels had been recorded by one clock that was started with all others."""
        if not (self.force or self.acceleration):
            return data
        omega = 2 * np.pi * np.array([r.lines.excitation[i].frequency for r, i in zip(data.runs, data.lines)])
        time = np.concatenate([run.start + 0.5 * run.length for run in data.runs])
        phase = omega[data.run_index] * time
        cells = (data.F - data.mass * data.A) * np.exp(-1j * self.force * phase)[:, None]
        A = data.A * np.exp(-1j * self.acceleration * phase)[:, None]
        return replace(data, F=cells + data.mass * A, A=A)

    def doubt(self, data: PointData) -> float:
        """Standard deviation of the cells' lag [s] that the error of the rate leaves, in the middle of the windows."""
        if not self.force:
            return 0.0
        return self.error * float(np.mean(np.concatenate([run.start + 0.5 * run.length for run in data.runs])))

    def conditions(self) -> tuple[Condition, ...]:
        """What to say of it at every point."""
        if not (self.force or self.acceleration):
            return ()
        clocks = [f"cells {1e6 * self.force:+.1f} ppm (standard error {1e6 * self.error:.1f})"] if self.force else []
        clocks += [f"accelerometers {1e6 * self.acceleration:+.1f} ppm"] if self.acceleration else []
        return (
            Condition(
                "clocks-differ",
                f"against the probes' clock: {', '.join(clocks)}; put right from the start of each record on",
            ),
        )


def rate_samples(data: PointData) -> RateSamples:
    """What the runs of one point show of the clocks."""
    cells = data.F - data.mass * data.A
    table: dict[str, list[FloatArray]] = {"force": [], "acceleration": []}
    for i, (run, line) in enumerate(zip(data.runs, data.lines)):
        selected = data.run_index == i
        omega = 2 * np.pi * run.lines.excitation[line].frequency
        for name, z in (("force", cells[selected]), ("acceleration", data.A[selected])):
            drift = _drift(z, data.D[selected], run.start)
            if drift is not None:
                span = run.start[-1] - run.start[0] + run.length
                table[name].append(np.array([drift[0] / omega, drift[1] / omega, drift[0] * span]))
    return RateSamples(*(np.array(table[name]).reshape(-1, 3) for name in ("force", "acceleration")))


def _drift(z: ComplexArray, d: ComplexArray, start: FloatArray) -> tuple[float, float] | None:
    """Slope of the phase of `z` against `d` (n, 2) over time [rad/s], and its standard error."""
    good = np.isfinite(z).all(axis=1) & np.isfinite(d).all(axis=1)
    if good.sum() < _MIN_WINDOWS or not np.abs(z[good]).max() > 0 or not np.abs(d[good]).max() > 0:
        return None
    z, d, t = z[good], d[good], start[good]
    steps = np.angle(np.einsum("ni,ni->n", z[1:], z[:-1].conj()) * np.einsum("ni,ni->n", d[:-1], d[1:].conj()))
    phase = np.concatenate([[0.0], np.cumsum(steps)])
    middle = t - t.mean()
    weight = np.ones(len(t))
    for _ in range(5):
        design = np.stack([np.ones_like(middle), middle], axis=1) * np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(design, phase * np.sqrt(weight), rcond=None)[0]
        residual = np.abs(phase - solution[0] - solution[1] * middle)
        scale = 1.4826 * float(np.median(residual)) + 1e-15
        weight = np.minimum(1.0, 2.0 * scale / np.maximum(residual, 1e-300))
    spread = float(np.sum(weight * residual**2) / max(float(weight.sum()) - 2.0, 1.0))
    return float(solution[1]), float(np.sqrt(spread / np.sum(weight * middle**2)) + 1e-15)


def clock_rates(samples: Iterable[RateSamples]) -> ClockRates:
    """Differences that the runs of a campaign share; zero where none is clear."""
    names = list(samples)
    force = np.concatenate([s.force for s in names] or [np.empty((0, 3))])
    acceleration = np.concatenate([s.acceleration for s in names] or [np.empty((0, 3))])
    cells, error = _shared(force)
    if not cells:
        return ClockRates()
    housing, doubt = _shared(acceleration)
    if not housing and doubt > abs(cells) / 4:  # too weak to tell: as a rule they are recorded with the cells
        housing = cells
    return ClockRates(cells, housing, error)


def _shared(rates: FloatArray) -> tuple[float, float]:
    """Robust weighted mean and its error; zero where it is not clear, not notable, or not alike in the runs."""
    if len(rates) == 0:
        return 0.0, np.inf
    rate, error = rates[:, 0], rates[:, 1]
    floor = float(np.median(error))
    weight = 1 / np.hypot(error, floor) ** 2
    middle = float(np.median(rate))
    for _ in range(10):
        distance = np.abs(rate - middle)
        scale = max(1.4826 * float(np.median(distance)), floor)
        robust = weight * np.minimum(1.0, 1.5 * scale / np.maximum(distance, 1e-300))
        middle = float(np.sum(robust * rate) / np.sum(robust))
    spread = float(np.sum(robust * distance**2) / np.sum(robust)) / max(len(rate) - 1, 1)
    doubt = float(np.sqrt(max(1 / np.sum(weight), spread if len(rate) > 1 else 0.0)))
    notable = np.median(np.abs(rates[:, 2])) > _NOTABLE
    return (middle, doubt) if abs(middle) > _CLEAR * doubt and notable else (0.0, doubt)
