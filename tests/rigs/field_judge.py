"""Runs `identify` on a campaign and says what became of every point: right, told, silently wrong, or a crash."""

from __future__ import annotations

import traceback
import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigdata import load_campaign
from rigdata.problem import RigDataError
from tests.rigs.field_rig import Rig
from tpjb_ident.errors import BadInputError, NotTrustedError


@dataclass
class Outcome:
    """Of one campaign: points by what became of them, entries inside their intervals, conditions that were named."""

    right: int = 0
    told: int = 0
    wrong: int = 0
    flagged: int = 0
    crash: str = ""
    inside: int = 0
    entries: int = 0
    worst: float = 0.0
    width: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    @property
    def word(self) -> str:
        if self.crash:
            return "crash"
        return "silent" if self.wrong else "told" if self.told else "right"


def judge(path: Path, rig: Rig) -> Outcome:
    """Identify one campaign and hold it against the truth."""
    from tpjb_ident.cli.command import Command
    from tpjb_ident.cli.identification import identify_settings, refuse_untrusted
    from tpjb_ident.identification.identify import identify

    outcome = Outcome()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            campaign = load_campaign(path)
            result = identify(campaign, identify_settings(Command("identify", {}), campaign, "mm-eiv", None))
            result.to_frame()
    except (BadInputError, RigDataError) as error:
        outcome.told, outcome.names = 1, [str(error).splitlines()[0][:80]]
        return outcome
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        outcome.crash = f"{type(error).__name__} in {Path(where.filename).name}:{where.lineno}: {error}"[:110]
        return outcome
    campaign_refused = _campaign_refused(result)
    for p in result.points:
        _judge_point(outcome, p, rig, campaign_refused)
    try:
        refuse_untrusted(result)
    except NotTrustedError:
        outcome.told = max(outcome.told, 1)
    return outcome


def _campaign_refused(result: object) -> bool:
    return any(_severity(c) == "error" for c in result.conditions)  # type: ignore[attr-defined]


def _severity(condition: object) -> str:
    return str(condition.severity)  # type: ignore[attr-defined]


def _judge_point(outcome: Outcome, p: object, rig: Rig, campaign_refused: bool) -> None:
    conditions = p.quality  # type: ignore[attr-defined]
    outcome.names += [str(c) for c in conditions if _severity(c) != "note"]
    severities = {_severity(c) for c in conditions}
    est = p.stiffness  # type: ignore[attr-defined]
    outcome.flagged += bool(severities & {"error", "warning"})
    if campaign_refused or "error" in severities or not np.isfinite(est.h).all():
        outcome.told += 1
        return
    omega = 2 * np.pi * (rig.real_frequency or p.point.excitation_hz)  # type: ignore[attr-defined]
    h = rig.bearing.h(omega, p.point.static_load)  # type: ignore[attr-defined]
    truth = np.concatenate([h.real.ravel(), h.imag.ravel() / omega])
    value = np.concatenate([est.k.ravel(), est.c.ravel()])
    half = np.asarray(est.half_width()) / np.repeat([1.0, est.omega], 4)
    off = np.abs(value - truth)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(half > 0, off / half, np.inf)
    ratio = np.where(np.isfinite(half), ratio, 0.0)
    outcome.inside += int((ratio <= 1).sum())
    outcome.entries += 8
    outcome.worst = max(outcome.worst, float(ratio.max()))
    scale = np.repeat([np.abs(np.diag(h.real)).mean(), np.abs(np.diag(h.imag)).mean() / omega], 4)
    outcome.width.append(float(np.max(half / scale)))
    good = (ratio <= 1).sum() >= 5 and ratio.max() <= 2.5
    outcome.right += bool(good)
    outcome.wrong += not good
