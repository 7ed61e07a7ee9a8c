"""The model's side of a comparison and its report, in another process while this one identifies and writes tables.

That process takes over what needs no identification, loads what it draws with meanwhile, and is told what was
identified. On a fresh machine it compiles the film solver as well, which takes half a minute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpjb_ident.compare.model_side import Asked, ModelSide, model_side
from tpjb_ident.runtime.beside import Companion, Talk, companion
from tpjb_ident.runtime.executors import cores

if TYPE_CHECKING:
    from rigdata.campaign import Campaign
    from tpjb_ident.compare.comparison import CompareSettings, Comparison
    from tpjb_ident.dynamic.results.identification import Identification


def _nothing(_: Comparison) -> str:
    return ""


@dataclass(frozen=True)
class ReportOrder:
    """Where a report is written, and what stands in it beside the comparison."""

    folder: Path
    settings: Mapping[str, Any]
    inputs: Mapping[str, str]
    then: Callable[[Comparison], str] = field(default=_nothing)

    def carry_out(self, comparison: Comparison) -> None:
        """Write report.html and its figures."""
        from tpjb_ident.report.comparison_page import write_report

        write_report(self.folder, comparison, self.settings, self.inputs, self.then(comparison))


class OtherHalf:
    """What another process has done meanwhile; nothing, where there is none."""

    def __init__(self, process: Companion | None) -> None:
        self._process = process

    def side(self, settings: CompareSettings, identification: Identification) -> ModelSide | None:
        """Tell what was identified, and take the model's side; None: it must be worked out here."""
        if self._process is None:
            return None
        self._process.tell((settings, identification))
        side: ModelSide | None = self._process.hear()
        return side

    def reported(self) -> bool:
        """Whether the report is written; False: it must be written here."""
        return self._process is not None and self._process.hear() is True


@contextmanager
def comparison_beside(campaign: Campaign, bearing: Any, asked: Asked, order: ReportOrder) -> Iterator[OtherHalf]:
    """Let another process work out the model's side for the points that the manifest names, then draw the report."""
    if cores() < 2:
        yield OtherHalf(None)
        return
    with companion(_model_then_report, campaign, bearing, asked, order) as process:
        yield OtherHalf(process)


def _model_then_report(talk: Talk, campaign: Campaign, bearing: Any, asked: Asked, order: ReportOrder) -> bool:
    points = tuple(sorted({run.point for run in campaign.of_kind("dynamic")}))
    side = model_side(campaign, bearing, asked, points)
    talk.tell(side)
    from tpjb_ident.compare.comparison import joined
    from tpjb_ident.report.comparison_page import write_report  # noqa: F401  (loaded before it is needed)
    from tpjb_ident.report.figure import make_ready

    make_ready()
    settings, identification = talk.hear()
    order.carry_out(joined(campaign, bearing, settings, identification, side))
    return True
