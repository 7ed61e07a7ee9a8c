"""Bench: campaigns drawn as observation vectors, by the hundred, to see how often a diagnosis is right.

The model is tabled once (`surrogate`). What is drawn differs from it as a campaign written by another program would:
a finer film mesh, a smooth difference in every coefficient, effects whose shape is a little off; then calibration
errors from the certificates and noise from the covariance of identification. The decision code is that of `diagnose`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from model.bearing import Bearing
from model.effects import Effect
from model.pivots import pivot_laws
from model.setup import Mesh, Setup
from tests.studies.diagnosis.surrogate import Surrogate, load_tables, tabulate
from tpjb_ident.diagnose.diagnose import ACCURACY, pose
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import Forward
from tpjb_ident.diagnose.forward.nuisance import whitener
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.observations.observe import Observations
from tpjb_ident.diagnose.plan.planned import ExpectedNoise, around, dry, dynamic, planned_observations
from tpjb_ident.diagnose.search.directions import direct_scale, directions
from tpjb_ident.diagnose.search.problem import Problem
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

FloatArray = NDArray[np.float64]
HZ = 2 * math.pi
SPEED = 22 * HZ
#: Whitened size out to which effects are tabled.
REACH = 40.0
FINER = Mesh(112, 8)


@dataclass(frozen=True)
class OtherProgram:
    """How far the program that writes a campaign is from ours, one standard deviation.

    Two programs that solve the same equations were found 0.05 % apart in the direct coefficients, 0.02 um
    in positions, 0.005 K in temperatures, and closer than 1 % in what effects do.

    Attributes
    ----------
    stiffness : float
        Share of the direct coefficients, smooth over load and frequency.
    single : float
        Of every element by itself, as a share of its fine tolerance.
    shape : float
        Of an effect, relative, per observable.
    """

    stiffness: float = 0.0005
    single: float = 0.33
    shape: float = 0.01


@dataclass(frozen=True)
class Bench:
    """One bearing with one layout, prepared.

    Attributes
    ----------
    observations : Observations
        Planned; their values are the model's.
    posed : Problem
        With the planned values; `problem` puts drawn ones in.
    surrogate : Surrogate
    finer : (n,) ndarray
        Change of the baseline by a finer mesh.
    other : OtherProgram
    """

    observations: Observations
    posed: Problem = field(repr=False)
    surrogate: Surrogate = field(repr=False)
    finer: FloatArray = field(repr=False)
    other: OtherProgram = field(default_factory=OtherProgram)

    @property
    def pool(self) -> tuple[Candidate, ...]:
        """Every candidate."""
        return self.posed.pool

    def factor(self, noise: float) -> FloatArray:
        """Cholesky factor of the covariance for inference at a noise level, (n, n)."""
        return whitener(self._noisier(noise), self.posed.nuisances.columns)

    def size(self, effects: Sequence[Effect], factor: FloatArray) -> float:
        """d': whitened size of effects."""
        return float(np.linalg.norm(np.linalg.solve(factor, self.surrogate(effects) - self.surrogate.base)))

    def sized(self, candidate: Candidate, wanted: float, sign: float, factor: FloatArray) -> Effect | None:
        """Effect of a candidate with the wanted d' (within 2 %); None if the table does not reach it on that side."""
        table = self.surrogate.tables[self.pool.index(candidate)]
        ends = table.amplitudes[[0, -1]] - candidate.neutral
        end = float(ends[1] if sign > 0 else ends[0])
        if abs(end) < 1e-12 * candidate.step:
            return None
        low, high = 0.0, end
        if self.size((candidate.effect(candidate.neutral + end),), factor) < wanted:
            return None
        for _ in range(40):
            middle = 0.5 * (low + high)
            now = self.size((candidate.effect(candidate.neutral + middle),), factor)
            if abs(now / wanted - 1.0) < 0.02:
                break
            low, high = (middle, high) if now < wanted else (low, middle)
        return candidate.effect(candidate.neutral + middle)

    def problem(self, effects: Sequence[Effect], rng: np.random.Generator, noise: float) -> Problem:
        """A drawn campaign beside the model."""
        noisy = self._noisier(noise)
        value = self._clean(effects, rng)
        columns = self.posed.nuisances.columns
        value = value + columns @ rng.standard_normal(columns.shape[1])
        value += np.sqrt(np.diag(noisy.covariance)) * rng.standard_normal(len(value))
        return replace(self.posed, observations=replace(noisy, value=value))

    def _clean(self, effects: Sequence[Effect], rng: np.random.Generator) -> FloatArray:
        elements, base, other = self.observations.elements, self.surrogate.base, self.other
        names = sorted({e.observable for e in elements})
        off = dict(zip(names, 1.0 + other.shape * rng.standard_normal(len(names)), strict=True))
        shape = np.array([off[e.observable] for e in elements])
        value = base + self.finer + shape * (self.surrogate(effects) - base)
        scale = direct_scale(elements, base)
        for group in directions(elements, base)[:8]:
            smooth = group.columns @ rng.standard_normal(group.columns.shape[1])
            size = float(np.sqrt(np.mean((smooth / scale)[smooth != 0] ** 2)))
            value = value + other.stiffness * smooth / size
        return np.asarray(value + other.single * self.posed.observations.fine * rng.standard_normal(len(value)))

    def _noisier(self, noise: float) -> Observations:
        return replace(self.posed.observations, covariance=self.posed.observations.covariance * noise**2)


def paper_layout(pads: int = 5) -> Layout:
    """The paper's campaign: six loads at 25 Hz, six frequencies at 5 kN, a locus, dry tests, a clearance sweep."""
    lines = [HZ * f for f in (10.0, 20.0, 25.0, 30.0, 40.0, 50.0)]
    sweep = dynamic([5000.0], lines, SPEED, -math.pi / 2, pads)
    loads = dynamic([2500.0, 3750.0, 6250.0, 7500.0, 8750.0], [HZ * 25.0], SPEED, -math.pi / 2, pads)
    tests = tuple(sorted((*sweep, *loads), key=lambda t: t.load))
    return Layout(tests, around(5000.0, 20, SPEED), dry(range(1, pads + 1)), 200.0)


def prepare(bearing: Bearing, layout: Layout, store: Path | None = None) -> Bench:
    """Table a bearing for a layout.

    Parameters
    ----------
    bearing : Bearing
    layout : Layout
    store : Path, optional
        File that keeps the tables between runs.
    """
    setup = Setup(bearing, pivot_laws("kirk", bearing), accuracy=ACCURACY)
    settings = DiagnoseSettings()
    planned = planned_observations(setup, layout, settings.tolerance, ExpectedNoise())
    forward = Forward(setup, layout, planned.elements)
    posed = pose(planned, forward, settings)
    surrogate = load_tables(store, planned.elements, posed.pool) if store is not None else None
    if surrogate is None:
        factor = whitener(posed.observations, posed.nuisances.columns)
        tables = tuple(tabulate(forward, posed.base, c, factor, REACH) for c in posed.pool)
        surrogate = Surrogate(planned.elements, posed.base, posed.pool, tables)
        if store is not None:
            surrogate.save(store)
    finer = Forward(setup.change(mesh=FINER), layout, planned.elements)() - posed.base
    trusted = np.where(posed.observations.fine >= settings.tolerance.idle_temperature, 0.0, finer)
    return Bench(planned, replace(posed, base=surrogate.base), surrogate, trusted)


def seed(*parts: object) -> np.random.Generator:
    """Random numbers that depend on what a trial is, not on when or where it runs."""
    return np.random.default_rng([zlib.crc32("|".join(map(str, parts)).encode()), 61])
