"""What `tpjb check` knows of the dynamic runs, carried to the operating points that it touches."""

from collections.abc import Iterable, Sequence

import numpy as np

from rigdata.campaign import Campaign
from rigdata.problem import Problem
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.findings import Verdicts, reach, verdicts
from tpjb_ident.check.observation import Observation, observe
from tpjb_ident.conditions import Condition
from tpjb_ident.runs.finished_runs import FinishedRuns

#: Runs that tell of the channels what dynamic runs cannot.
_STATIC = ("dry_pivot", "clearance", "locus")
_CONTRADICTED, _DOUBTFUL, _RUN_GAIN = "records-contradicted", "records-doubtful", "run-gain-off"


def check_finished(campaign: Campaign, finished: FinishedRuns) -> tuple[FinishedRuns, Verdicts]:
    """Judge all finished runs beside each other; those with an error of their own are left out."""
    observed = [observation for digest in finished.digests for observation in digest.observations]
    if not observed:  # runs that are no files
        return finished, Verdicts()
    result = campaign_verdicts(campaign, observed)
    return finished.without(result.unusable), result


def campaign_verdicts(campaign: Campaign, observations: Sequence[Observation]) -> Verdicts:
    """What the checks say of dynamic runs, by run; static runs say what they show of the channels."""
    static = [observe(run) for run in campaign.runs if run.kind in _STATIC]
    reports = [observation.report for observation in judged(campaign, [*observations, *static])[0]]
    reach(reports)
    result = verdicts([report for report in reports if report.run.kind == "dynamic"])
    for observation in static:
        for i in observation.pick("displacement") if observation.run.kind == "clearance" else ():
            result.swept[observation.run.id, observation.channels[i].name] = float(np.ptp(observation.spread[:, i])) / 2
    # without accelerometers the inertia stays in the force: that is told, and no reason to refuse
    optional = {f"channel {c.name}" for c in campaign.channels.values() if c.quantity == "acceleration"}
    for run, problems in result.shared.items():
        result.doubtful.setdefault(run, []).extend(p for p in problems if p.place in optional)
        problems[:] = [p for p in problems if p.place not in optional]
    return result


def check_conditions(result: Verdicts, runs: Iterable[str]) -> tuple[Condition, ...]:
    """What the checks say of one point."""
    members = list(runs)
    groups = ((_CONTRADICTED, result.shared), (_DOUBTFUL, result.doubtful), (_RUN_GAIN, result.run_gains))
    by_name = ((name, [p for run in members for p in by_run.get(run, ())]) for name, by_run in groups)
    return tuple(Condition(name, _sentence(problems)) for name, problems in by_name if problems)


def _sentence(problems: list[Problem]) -> str:
    """The first finding; how many more there are."""
    different = list(dict.fromkeys(f"{p.place} {p.what}".strip() for p in problems))
    first = f"{problems[0].run}: {different[0]}" if problems[0].run else different[0]
    more = f"; and {len(different) - 1} more (see tpjb check)" if len(different) > 1 else ""
    return f"{first}{more}. {problems[0].cure}"
