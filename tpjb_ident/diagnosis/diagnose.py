"""Diagnose: observe -> compare -> decide, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from model.mirror import rotation_of
from model.setup import Setup
from rigdata.arrays import FloatArray
from rigdata.operating_point import OperatingPoint
from tpjb_ident.compare.comparison import joined
from tpjb_ident.diagnosis.comparison.fit import Fit
from tpjb_ident.diagnosis.comparison.problem import Problem, loosened
from tpjb_ident.diagnosis.comparison.search import Comparison, Progress, compare
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.diagnosis.comparison.unknowns import derivatives
from tpjb_ident.diagnosis.forward.candidates import candidates
from tpjb_ident.diagnosis.forward.forward import Forward, with_coarser_mesh
from tpjb_ident.diagnosis.forward.nuisance import nuisances
from tpjb_ident.diagnosis.forward.tolerances import Tolerances
from tpjb_ident.diagnosis.forward.workers import Map, workers
from tpjb_ident.diagnosis.next_test import Check, Design, Separation, options_for, ranked, say, separated, suggested
from tpjb_ident.diagnosis.observations.constants import Deciding
from tpjb_ident.diagnosis.observations.observe import Observations, Where
from tpjb_ident.diagnosis.verdict.decide import Decision, decide
from tpjb_ident.diagnosis.verdict.verdict import Verdict
from tpjb_ident.schema import COEFFICIENT_COLUMNS, HALF_INTERVAL, POINT_KEY, coefficient_column, with_endings

if TYPE_CHECKING:
    import pandas as pd

    from tpjb_ident.results.identification import Identification

#: Of equilibria while models are compared: far below any tolerance, and a third faster than the default. So are the
#: coarser solids of pads that bend, each of which another arc, length or pivot asks for anew.
ACCURACY = 1e-5
#: Names of the two models in the column ``pivots``, as pictures label them.
BEFORE, AFTER = "model before", "with the effects found"


@dataclass(frozen=True)
class Diagnosis:
    """A verdict and everything it rests on (for reports and next tests)."""

    verdict: Verdict
    problem: Problem = field(repr=False)
    comparison: Comparison = field(repr=False)
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
    quick = setup.change(accuracy=ACCURACY, mesh=replace(setup.mesh, fine_solid=False))
    forward = with_coarser_mesh(Forward(quick, observations.layout, observations.elements))
    problem = pose(observations, forward, settings)
    with workers(forward, problem, settings.workers) as run:
        comparison = compare(run, problem, progress)
        decision = decide(run, problem, comparison, settings.tolerances)
        words = _next_test(run, decision, comparison, quick, settings)
    return Diagnosis(replace(decision.verdict, next_test=words), problem, comparison, decision.after)


def pose(observations: Observations, forward: Forward, settings: DiagnoseSettings) -> Problem:
    """Set a campaign beside a model: baseline, nuisances, candidates."""
    base = forward()
    trusted = loosened(observations, forward.pad_shares())
    listed = nuisances(trusted.elements, forward.setup, settings.tolerances)
    # without a cold polygon the clearance of the file and that of the running bearing are one
    unseen = frozenset() if observations.layout.push_load is not None else frozenset({"clearance_error"})
    pool = candidates(forward.setup, settings.skip | unseen)
    problem = Problem(trusted, base, listed, np.zeros((len(base), len(listed))), pool)
    with workers(forward.of_differences, problem, settings.workers) as run:
        jobs = [((), np.zeros(len(listed)), (i,)) for i in range(len(listed))]
        for i, (column,) in enumerate(run(derivatives, jobs)):
            if column is not None:
                problem.columns[:, i] = column * problem.sigma
    return problem


def _next_test(run: Map, decision: Decision, comparison: Comparison, setup: Setup, settings: DiagnoseSettings) -> str:
    """What one more test would tell, in words: which explanation it is, or that it is the one named."""
    verdict, model = decision.verdict, decision.model
    if verdict.verdict == "consistent":
        return "none needed"
    if not verdict.effects:
        worst = verdict.disagreement[0]
        where = f"at {worst.where}, where the unknown shows most," if worst.where != "everywhere" else "everywhere"
        return f"repeat {worst.observable} {where} with another sensor set"
    rivals = _rivals(comparison, model)
    if not rivals:
        return ""
    others = [fit.effects for fit in rivals]
    coarser = setup.change(mesh=setup.mesh.coarser())  # what separates two is a difference: a mesh's error falls out

    def asked(options: Sequence[Design | Check], *tolerances: Tolerances) -> list[Separation]:
        tried = run(_separated, [(coarser, option, model.effects, others, *tolerances) for option in options])
        return ranked([separation for separation in tried if separation is not None])

    # tolerances blur what a test separates, and cost most of its predictions: asked where a test could still be best
    most = asked(options_for(setup, model.problem.observations.layout))
    tests = asked([test.design for test in most[:1]], settings.tolerances)
    least = tests[0].expected if tests and tests[0].expected >= Deciding.enough else 0.0
    tests = ranked([*tests, *asked([test.design for test in most[1:] if test.expected > least], settings.tolerances)])
    if not tests:
        return ""
    text = say(suggested(tests), model.label, *(fit.label for fit in rivals))
    return f"to confirm: {text}" if verdict.verdict == "named" else text


def _separated(forward: Forward, problem: Problem, *asked: Any) -> Separation | None:
    """Job: what one option would show between the first explanation and the others."""
    return separated(*asked)


def _rivals(comparison: Comparison, model: Fit) -> list[Fit]:
    """The likeliest other explanations, one per set of names; those that hold all of the model's say nothing else."""
    by_names: dict[frozenset[str], Fit] = {}
    for fit in comparison.fits:
        if fit.faults and not fit.on_bound and not model.labels <= fit.labels:
            by_names.setdefault(fit.names, fit)
    return list(by_names.values())[: Deciding.impostors]


def before_and_after(diagnosis: Diagnosis, identification: Identification | None) -> pd.DataFrame:
    """Make a table as comparison.csv of a diagnosis; K and C of a table stand in it as the table has them."""
    observations = diagnosis.observations
    models = {BEFORE: diagnosis.problem.base}
    if diagnosis.verdict.effects:
        models[AFTER] = diagnosis.after
    measured = _coefficients(observations, observations.value) if identification is None else identification.to_frame()
    measured = measured.reindex(columns=measured.columns.union(["static_load_measured_N", "quality"]))
    predictions = {}
    for name, vector in models.items():
        predicted = _coefficients(observations, vector)[[*POINT_KEY, *COEFFICIENT_COLUMNS]]
        predictions[name] = (
            measured[[*POINT_KEY]]
            .merge(predicted, how="left")
            .reindex(columns=[*predicted, "x_m", "y_m", "converged", "pivot_extrapolated", "status"])
        )
    return joined(measured, predictions)


def _coefficients(observations: Observations, vector: FloatArray) -> pd.DataFrame:
    """K and C of every operating point of a vector (n,) with the measured intervals' widths; NaN where it has none."""
    import pandas as pd

    half = HALF_INTERVAL * np.sqrt(np.diag(observations.covariance))
    rows: dict[Where, dict[str, Any]] = {}
    for element, value, width in zip(observations.elements, vector, half, strict=True):
        if element.family != "h":
            continue
        load, direction, speed, omega = (element.place(k) for k in ("load", "direction", "speed", "excitation"))
        point = OperatingPoint(load, direction, abs(speed), omega, rotation_of(speed))
        row = rows.setdefault(element.where, dict(zip(POINT_KEY, point.key, strict=True)))
        column, factor = coefficient_column(element.observable), omega if element.observable[0] == "c" else 1.0
        for end, sign in (("", 0.0), ("_lo", -1.0), ("_hi", 1.0)):
            row[column + end] = float(value + sign * width) / factor
    columns = [*POINT_KEY, *with_endings("", "_lo", "_hi")]
    return pd.DataFrame(list(rows.values()), columns=columns)


def median_deviations(table: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Median of predicted / measured - 1 before and after, of every direct coefficient."""
    from tpjb_ident.compare.summary import agreements

    if table.empty:
        return {}
    medians = agreements(table)[["median"]].droplevel(0, axis=1).dropna(axis=1)
    return {str(name): (float(off[BEFORE]), float(off.iloc[-1])) for name, off in medians.items()}
