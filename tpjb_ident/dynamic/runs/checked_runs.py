"""What `tpjb check` knows of the dynamic runs, carried to the operating points that it touches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rigdata.campaign import Campaign
from rigdata.problem import Problem
from tpjb_ident.check.campaign import judged
from tpjb_ident.check.findings import Verdicts, verdicts
from tpjb_ident.check.observation import Observation
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.runs.finished_runs import FinishedRuns

_CONTRADICTED, _DOUBTFUL = "records-contradicted", "records-doubtful"


def check_finished(campaign: Campaign, finished: FinishedRuns) -> Verdicts:
    """Judge all finished runs beside each other; those with an error of their own are left out."""
    observed = [observation for digest in finished.digests for observation in digest.seen]
    if not observed:  # runs that are no files
        return Verdicts()
    result = campaign_verdicts(campaign, observed)
    finished.leave_out_unusable(result.unusable)
    if not finished.places:
        raise finished.left_out[0].error
    return result


def campaign_verdicts(campaign: Campaign, observations: Sequence[Observation]) -> Verdicts:
    """What the checks say of dynamic runs beside each other, by run."""
    result = verdicts([observation.report for observation in judged(campaign, observations)])
    # without accelerometers the inertia stays in the force: that is told, and no reason to refuse
    optional = {f"channel {c.name}" for c in campaign.channels.values() if c.quantity == "acceleration"}
    for run, problems in result.shared.items():
        result.doubtful.setdefault(run, []).extend(p for p in problems if p.place in optional)
        problems[:] = [p for p in problems if p.place not in optional]
    return result


def check_conditions(result: Verdicts, runs: Iterable[str]) -> tuple[Condition, ...]:
    """What the checks say of one point."""
    members = list(runs)
    groups = ((_CONTRADICTED, result.shared), (_DOUBTFUL, result.doubtful))
    told = ((name, [p for run in members for p in by_run.get(run, ())]) for name, by_run in groups)
    return tuple(Condition(name, _sentence(problems)) for name, problems in told if problems)


def _sentence(problems: list[Problem]) -> str:
    """The first finding; how many more there are."""
    different = list(dict.fromkeys(f"{p.place} {p.what}".strip() for p in problems))
    first = f"{problems[0].run}: {different[0]}" if problems[0].run else different[0]
    more = f"; and {len(different) - 1} more (see tpjb check)" if len(different) > 1 else ""
    return f"{first}{more}. {problems[0].cure}"
