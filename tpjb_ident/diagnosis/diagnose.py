"""Diagnose: observe -> screen -> fit -> decide, in one call."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from model.effects import Effect, apply_effects
from model.setup import Mesh, Setup
from rigdata.arrays import FloatArray
from tpjb_ident.diagnosis.forward.candidates import candidates
from tpjb_ident.diagnosis.forward.forward import Forward, ForwardModel, NoEquilibriumError
from tpjb_ident.diagnosis.forward.nuisance import Nuisance, column_of, nuisances
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.forward.workers import Map, workers
from tpjb_ident.diagnosis.next_test import Separation, options_for, ranked, say, separated, suggested
from tpjb_ident.diagnosis.observations.observe import Layout, Observations
from tpjb_ident.diagnosis.search.fit import Fit
from tpjb_ident.diagnosis.search.problem import Problem, loosened
from tpjb_ident.diagnosis.search.search import Search, search
from tpjb_ident.diagnosis.search.selection import Progress
from tpjb_ident.diagnosis.search.settings import DiagnoseSettings
from tpjb_ident.diagnosis.verdict.decide import decide
from tpjb_ident.diagnosis.verdict.verdict import Verdict
from tpjb_ident.dynamic.results.identification import coefficient_columns, point_columns
from tpjb_ident.schema import DAMPING, ENTRIES, STIFFNESS, coefficient_column

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.dynamic.results.identification import Identification

#: Of equilibria while models are compared: far below any tolerance, and a third faster than the default.
ACCURACY = 1e-5
#: Film mesh while models are compared: 0.02 % from the default in the coefficients, at half the time.
MESH = Mesh(48, 4)
#: Other explanations that a confirming test is chosen against.
_IMPOSTORS = 2
#: Load directions per load and speed that are enough: the locus of five pads has five waves, two directions to each.
_DIRECTIONS = 10
#: Names of the two models in the column ``pivots``, as pictures label them.
BEFORE, AFTER = "model before", "with the effects found"


@dataclass(frozen=True)
class Diagnosis:
    """A verdict and everything it rests on (for reports and next tests)."""

    verdict: Verdict
    problem: Problem = field(repr=False)
    found: Search = field(repr=False)
    after: FloatArray = field(repr=False)  #: (n,): what the model predicts with exactly the effects that are named

    @property
    def observations(self) -> Observations:
        """What was measured."""
        return self.problem.observations


def diagnose(
    observations: Observations, setup: Setup, settings: DiagnoseSettings | None = None, progress: Progress | None = None
) -> Diagnosis:
    """Find the effects that a baseline lacks to describe a campaign."""
    settings = settings or DiagnoseSettings()
    observations = _thinned(observations)
    quick = setup.change(accuracy=ACCURACY, mesh=MESH if setup.mesh == Mesh() else setup.mesh)
    forward = Forward(quick, observations.layout, observations.elements)
    problem = pose(observations, forward, settings)
    with workers(forward, problem, settings.workers) as run:
        search_result = search(run, problem, settings, progress)
        exact = _exact(forward, search_result)
        verdict = decide(problem, search_result, settings, exact)
        verdict = replace(
            verdict, next_test=_next_test(run, verdict, search_result, (quick, observations.layout), settings)
        )
    after = problem.base if not verdict.effects or exact is None else exact
    return Diagnosis(verdict, problem, search_result, after)


def _exact(forward: Forward, found: Search) -> FloatArray | None:
    """What the model predicts with the effects of a search and nothing else; None where it has no equilibrium."""
    try:
        return forward.fresh()(found.effects.effects)
    except NoEquilibriumError:
        return None


def pose(observations: Observations, forward: Forward, settings: DiagnoseSettings) -> Problem:
    """Set a campaign beside a model: baseline, nuisances, candidates."""
    base = forward()
    trusted = loosened(observations, forward.pad_shares(), settings.tolerance)
    listed = nuisances(trusted.elements, forward.setup, settings.tolerances)
    with workers(forward, base, settings.workers) as run:
        columns = np.column_stack([np.zeros((len(base), 0)), *run(_column, [(listed, i) for i in range(len(listed))])])
    return Problem(trusted, base, listed, columns, candidates(forward.setup.bearing, settings.skip))


def _column(forward: ForwardModel, base: FloatArray, unknowns: tuple[Nuisance, ...], index: int) -> FloatArray:
    return column_of(forward, (), unknowns, np.zeros(len(unknowns)), base, index)


def _next_test(
    run: Map, verdict: Verdict, result: Search, baseline: tuple[Setup, Layout], settings: DiagnoseSettings
) -> str:
    """What one more test would tell, in words: which explanation it is, or that it is the one named."""
    if verdict.verdict == "consistent":
        return "none needed"
    if not verdict.effects:
        worst = verdict.disagreement[0]
        return f"repeat {worst.observable} at {worst.where}, where the unknown shows most, with another sensor set"
    setup, layout = baseline
    rivals = _rivals(result)
    if not rivals:
        return ""
    model = _possible(setup, result.model)
    alternatives = [e for r in rivals if (e := _possible(setup, r)) is not None]
    if model is None or not alternatives:
        return ""
    count = len(options_for(setup, layout))
    tried = run(_separated, [(setup, i, (model, *alternatives), settings.tolerances) for i in range(count)])
    tests = ranked([separation for separation in tried if separation is not None])
    if not tests:
        return ""
    text = say(suggested(tests), result.model.label, *(r.label for r in rivals))
    return f"to confirm: {text}" if verdict.verdict == "named" else text


def _separated(
    forward: Forward, problem: Problem, setup: Setup, index: int, told: Sequence[tuple[Effect, ...]], known: Tolerances
) -> Separation | None:
    """What one option would show between the first explanation and the others."""
    return separated(setup, options_for(setup, forward.layout)[index], told[0], told[1:], known)


def _possible(setup: Setup, fitted: Fit):  # type: ignore[no-untyped-def]
    try:
        apply_effects(setup, fitted.effects)
    except ValueError:
        return None
    return fitted.effects


def _rivals(result: Search) -> list[Fit]:
    """The likeliest other explanations, one per name."""
    rows = sorted((r for row in result.rivals for r in row if not r.at_bound), key=lambda f: -f.evidence)
    by_names: dict[frozenset[str], Fit] = {}
    for r in rows:
        if r.names != result.model.names:
            by_names.setdefault(r.names, r)
    return list(by_names.values())[:_IMPOSTORS]


def _thinned(observations: Observations) -> Observations:
    """Keep every second, third .. load direction of a locus that has more than `_DIRECTIONS`."""
    used_places = set()
    tests: dict[tuple[float, float], list[float]] = {}
    for locus_test in observations.layout.locus:
        tests.setdefault((locus_test.load, locus_test.speed), []).append(locus_test.direction)
    for (load, speed), directions in tests.items():
        around = sorted(set(directions), key=lambda a: a % (2 * np.pi))
        step = -(-len(around) // _DIRECTIONS)
        used_places |= {(load, speed, a) for a in around[::step]}
    selected = np.array([
        e.family not in {"locus", "load"} or (e.place("load"), e.place("speed"), e.place("direction")) in used_places
        for e in observations.elements
    ])  # fmt: skip
    if selected.all():
        return observations
    locus = tuple(t for t in observations.layout.locus if (t.load, t.speed, t.direction) in used_places)
    return replace(
        observations, layout=replace(observations.layout, locus=locus), value=observations.value[selected],
        covariance=observations.covariance[np.ix_(selected, selected)], sigma=observations.sigma[selected],
        elements=tuple(e for e, m in zip(observations.elements, selected, strict=True) if m),
    )  # fmt: skip


def before_and_after(diagnosis: Diagnosis, identification: Identification | None) -> pd.DataFrame:
    """Make a table as comparison.csv of a diagnosis."""
    import pandas as pd

    models = [(BEFORE, diagnosis.problem.base)]
    models += [(AFTER, diagnosis.after)] if diagnosis.verdict.effects else []
    frames = []
    for name, prediction in models:
        predicted = _by_point(diagnosis, prediction)
        for p in identification.points if identification is not None else ():
            own = predicted.get((round(p.point.static_load, 6), round(p.point.excitation, 6)), {})
            row: dict[str, Any] = {"pivots": name, **point_columns(p), **coefficient_columns(p.stiffness)}
            for kind, omega in ((STIFFNESS, 1.0), (DAMPING, p.point.excitation)):
                for entry in ENTRIES:
                    column = kind.column(entry)
                    row[f"{column}_predicted"] = own.get(f"{kind.symbol}{entry}", math.nan) / omega
                    row[f"{column}_ratio"] = row[f"{column}_predicted"] / row[column]
            frames.append(row)
    return pd.DataFrame(frames)


def _by_point(diagnosis: Diagnosis, prediction: FloatArray) -> dict[tuple[float, float], dict[str, float]]:
    """Re h and Im h [N/m] by load [N] and excitation [rad/s]."""
    out: dict[tuple[float, float], dict[str, float]] = {}
    for element, value in zip(diagnosis.observations.elements, prediction, strict=True):
        if element.family == "h":
            key = (round(element.place("load"), 6), round(element.place("excitation"), 6))
            out.setdefault(key, {})[element.observable] = float(value)
    return out


def median_deviations(table: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Median of predicted / measured - 1 before and after, of every direct coefficient."""
    medians: dict[str, tuple[float, float]] = {}
    if table.empty:
        return medians
    for name in ("kxx", "kyy", "cxx", "cyy"):
        off = (table[f"{coefficient_column(name)}_ratio"] - 1.0).groupby(table["pivots"]).median()
        if BEFORE in off and np.isfinite(off[BEFORE]):
            medians[name] = (float(off[BEFORE]), float(off.get(AFTER, off[BEFORE])))
    return medians
