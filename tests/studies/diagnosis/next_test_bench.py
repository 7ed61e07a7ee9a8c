"""A bench of a campaign and of every test that could follow it: both are drawn at once, with the same errors.

Calibration errors, the oil and what the model gets wrong are the same in a campaign and in the test after it; only
noise is new. So a drawn test helps less than it would with instruments of its own, as on a rig.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from model.effects import Effect, kind_of
from model.setup import Setup
from tests.studies.diagnosis.bench import FINER, Bench
from tests.studies.diagnosis.surrogate import EffectTable, Surrogate, load_tables
from tpjb_ident.diagnose.diagnose import ACCURACY
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.forward.nuisance import Nuisances, nuisances
from tpjb_ident.diagnose.next_test.checks import Check
from tpjb_ident.diagnose.next_test.designs import Design
from tpjb_ident.diagnose.next_test.rank import options_for
from tpjb_ident.diagnose.observations.layout import Layout
from tpjb_ident.diagnose.observations.observe import Element, Observations
from tpjb_ident.diagnose.plan.data_sets import masks, part_of
from tpjb_ident.diagnose.search.problem import Problem, loosened
from tpjb_ident.diagnose.search.settings import DiagnoseSettings

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Part:
    """A test that could follow, tabled.

    Attributes
    ----------
    option : Design or Check
    seen : Observations
        Planned.
    nuisances : Nuisances
    surrogate : Surrogate
    finer : (n,) ndarray
        Change of the baseline by a finer mesh.
    """

    option: Design | Check
    seen: Observations = field(repr=False)
    nuisances: Nuisances = field(repr=False)
    surrogate: Surrogate = field(repr=False)
    finer: FloatArray = field(repr=False)


@dataclass(frozen=True)
class NextBench:
    """A campaign with all tests that could follow it.

    Attributes
    ----------
    whole : Bench
        Of everything.
    campaign : (n,) ndarray of bool
        Elements of the campaign.
    parts : tuple of Part
    masks : tuple of (n,) ndarray of bool
        Elements of every part.
    """

    whole: Bench = field(repr=False)
    campaign: BoolArray = field(repr=False)
    parts: tuple[Part, ...] = field(repr=False)
    masks: tuple[BoolArray, ...] = field(repr=False)

    @property
    def bench(self) -> Bench:
        """The campaign's alone."""
        return restricted_bench(self.whole, self.campaign)


def next_bench(bench: Bench, parts: Sequence[Part]) -> NextBench:
    """Put a campaign's bench and tests that could follow together."""
    sizes = [len(bench.observations), *(len(part.seen) for part in parts)]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    names = tuple(dict.fromkeys([*bench.posed.nuisances.names, *(n for p in parts for n in p.nuisances.names)]))
    columns = np.vstack([_aligned(n, names) for n in (bench.posed.nuisances, *(p.nuisances for p in parts))])
    posed = bench.posed
    seen = _joined([posed.observations, *(part.seen for part in parts)], bench.observations.layout)
    tables = tuple(
        EffectTable(t.amplitudes, np.hstack([t.changes, *(p.surrogate.tables[i].changes for p in parts)]))
        for i, t in enumerate(bench.surrogate.tables)
    )
    base = np.concatenate([posed.base, *(part.surrogate.base for part in parts)])
    surrogate = Surrogate(seen.elements, base, posed.pool, tables)
    whole = Bench(
        seen, Problem(seen, base, Nuisances(names, columns), posed.pool, posed.shape), surrogate,
        np.concatenate([bench.finer, *(part.finer for part in parts)]), bench.other,
    )  # fmt: skip
    masks = tuple(owner == k for k in range(1, len(sizes)))
    return NextBench(whole, owner == 0, tuple(parts), masks)


def _aligned(found: Nuisances, names: Sequence[str]) -> FloatArray:
    known = dict(zip(found.names, found.columns.T, strict=True))
    nothing = np.zeros(len(found.columns))
    return np.column_stack([known.get(name, nothing) for name in names])


def _joined(seen: Sequence[Observations], layout: Layout) -> Observations:
    covariance = block_diag(*(one.covariance for one in seen))
    return Observations(
        layout, np.concatenate([s.value for s in seen]), covariance, np.concatenate([s.sigma for s in seen]),
        np.concatenate([s.fine for s in seen]), tuple(e for s in seen for e in s.elements),
    )  # fmt: skip


def restricted(problem: Problem, mask: BoolArray) -> Problem:
    """A problem with a part of its elements."""
    seen = problem.observations
    kept = replace(
        seen, value=seen.value[mask], covariance=seen.covariance[np.ix_(mask, mask)], sigma=seen.sigma[mask],
        fine=seen.fine[mask], elements=_chosen(seen.elements, mask),
    )  # fmt: skip
    columns = replace(problem.nuisances, columns=problem.nuisances.columns[mask])
    return Problem(kept, problem.base[mask], columns, problem.pool, problem.shape)


def restricted_surrogate(surrogate: Surrogate, mask: BoolArray) -> Surrogate:
    """A surrogate that answers for a part of its elements."""
    tables = tuple(EffectTable(t.amplitudes, t.changes[:, mask]) for t in surrogate.tables)
    return Surrogate(_chosen(surrogate.elements, mask), surrogate.base[mask], surrogate.candidates, tables)


def restricted_bench(bench: Bench, mask: BoolArray, layout: Layout | None = None) -> Bench:
    """A bench with a part of its elements, and the layout that belongs to it."""
    posed = restricted(bench.posed, mask)
    posed = replace(posed, observations=replace(posed.observations, layout=layout or posed.observations.layout))
    return Bench(
        posed.observations, posed, restricted_surrogate(bench.surrogate, mask), bench.finer[mask], bench.other
    )  # fmt: skip


def _chosen(elements: Sequence[Element], mask: BoolArray) -> tuple[Element, ...]:
    return tuple(e for e, keep in zip(elements, mask, strict=True) if keep)


def tabled(setup: Setup, bench: Bench, option: Design | Check, store: Path | None = None) -> Part | None:
    """Table a test at the amplitudes of a bench's own tables; None where the model has no equilibrium for it.

    Parameters
    ----------
    setup : Setup
        Baseline of the bench.
    bench : Bench
    option : Design or Check
    store : Path, optional
        File that keeps the table between runs.
    """
    if isinstance(option, Check):
        return _tabled_check(bench, option)
    settings = DiagnoseSettings()
    try:
        seen = option.planned(setup)
        forward = option.forward(setup, seen)
        base = forward()
        finer = option.forward(setup.change(mesh=FINER), seen)() - base
        known = nuisances(forward, (), base, settings.certificates)
        seen = loosened(seen, forward.pad_shares(), settings.tolerance)
        surrogate = load_tables(store, seen.elements, bench.pool) if store is not None else None
        if surrogate is None:
            tables = tuple(
                _retabled(forward, base, option, c, t.amplitudes)
                for c, t in zip(bench.pool, bench.surrogate.tables, strict=True)
            )
            surrogate = Surrogate(seen.elements, base, bench.pool, tables)
            if store is not None:
                surrogate.save(store)
    except NoEquilibriumError:
        return None
    finer = np.where(seen.fine >= settings.tolerance.idle_temperature, 0.0, finer)
    return Part(option, seen, known, surrogate, finer)


def _retabled(
    forward: Forward, base: FloatArray, design: Design, candidate: Candidate, amplitudes: FloatArray
) -> EffectTable:
    """Change along one effect: solved at every other amplitude, from neutral outwards, and a spline through them."""
    (middle,) = np.flatnonzero(amplitudes == candidate.neutral)
    effects = (candidate.effect(float(amplitudes[0])),)
    if len(amplitudes) == 1 or not design.acting(effects) or not design.fits(effects):
        return EffectTable(amplitudes, np.zeros((len(amplitudes), len(base))))
    solved = {middle: np.zeros_like(base)}
    last = len(amplitudes) - 1
    for at in sorted({0, last, *range(middle % 2, last, 2)} - {middle}, key=lambda at: abs(at - middle)):
        change = _attempted(forward, base, candidate.effect(float(amplitudes[at])))
        if change is not None:
            solved[at] = change
    known = sorted(solved)
    coarse = EffectTable(amplitudes[known], np.array([solved[at] for at in known]))
    return EffectTable(amplitudes, np.array([coarse.at(float(a)) for a in amplitudes]))


def _attempted(forward: Forward, base: FloatArray, effect: Effect) -> FloatArray | None:
    try:
        return forward((effect,)) - base
    except NoEquilibriumError:
        return None


def _tabled_check(bench: Bench, check: Check) -> Part:
    """A reading of the parameter of every candidate that has the check's effect."""
    mine = [c for c in bench.pool if c.name == check.effect]
    elements = tuple(Element("check", f"check {c.label}", "check", ()) for c in mine)
    neutral = next(p.neutral for p in kind_of(check.effect).parameters if p.name == check.parameter)
    base = np.full(len(mine), neutral)
    n = len(mine)
    tables = []
    for c, table in zip(bench.pool, bench.surrogate.tables, strict=True):
        read = np.array([c.effect(float(a)).parameters.get(check.parameter, neutral) for a in table.amplitudes])
        changes = np.zeros((len(table.amplitudes), n))
        if c in mine:
            changes[:, mine.index(c)] = read - neutral
        tables.append(EffectTable(table.amplitudes, changes))
    seen = Observations(Layout(()), base, np.eye(n) * check.sigma**2, np.zeros(n), np.zeros(n), elements)
    surrogate = Surrogate(elements, base, bench.pool, tuple(tables))
    return Part(check, seen, Nuisances((), np.zeros((n, 0))), surrogate, np.zeros(n))


def of_data_set(bench: Bench, name: str) -> Bench:
    """A bench of which only one of the data sets A to D was measured."""
    layout = bench.observations.layout
    speeds = {t.speed for t in layout.dynamic}
    return restricted_bench(bench, masks(bench.observations.elements, speeds)[name], part_of(layout, name))


def followed_by_all(setup: Setup, bench: Bench, stores: Callable[[str], Path | None]) -> NextBench:
    """A bench with every test that could follow.

    Parameters
    ----------
    setup : Setup
        Baseline of the bench.
    bench : Bench
    stores : callable
        Where the tables of a design, by a name of its own, are kept between runs.
    """
    found = setup.change(accuracy=ACCURACY)
    parts = (tabled(found, bench, o, stores(_name(o))) for o in options_for(setup, bench.observations.layout))
    return next_bench(bench, [part for part in parts if part is not None])


def _name(option: Design | Check) -> str:
    if isinstance(option, Check):
        return option.effect
    told = repr((option.words, option.layout, sorted(option.blind), sorted(option.unsure)))
    return hashlib.sha256(told.encode()).hexdigest()[:16]
