"""All that a campaign's records say of its instruments, gathered in one pass over the points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rigdata.arrays import FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.dynamic.estimators.stiffness import DynamicStiffness
from tpjb_ident.dynamic.instruments.harmonics import FilmChange, film_change
from tpjb_ident.dynamic.instruments.housing_balance import Balance, balance_runs, balances, frequency_key
from tpjb_ident.dynamic.runs.clock_rates import ClockRates, clock_rates, rate_samples
from tpjb_ident.dynamic.runs.point_data import PointData
from tpjb_ident.dynamic.runs.point_source import PointSource

#: Devices with clocks of their own start together to half a sample at best; as a standard deviation of samples.
START = 1 / np.sqrt(12)


@dataclass(frozen=True)
class InstrumentFindings:
    """Clocks, and accelerometers against cells."""

    clocks: ClockRates = field(default_factory=ClockRates)
    balances: dict[float, Balance] = field(default_factory=dict)
    start: float = 0.0

    def conditions(self, data: PointData) -> tuple[Condition, ...]:
        """What to say of one point."""
        return (*self.clocks.conditions(), *self._balance(data).conditions)

    def spreads(self, data: PointData, est: DynamicStiffness) -> dict[str, FloatArray]:
        """Covariance (8, 8) by source that the findings add to one point [N^2/m^2]; only what is not zero."""
        table = {}
        balance = self._balance(data)
        if balance.phase:
            table["lag of the cells"] = balance.spread(est)
        if self.start:
            late = Balance(est.omega * self.start)
            table["start of the clocks"] = late.spread(est)
        doubt = self.clocks.doubt(data)
        if doubt:
            table["rate of the clocks"] = Balance(est.omega * doubt).spread(est)
        return table

    def _balance(self, data: PointData) -> Balance:
        return self.balances.get(frequency_key(data.runs[0].lines.excitation[data.lines[0]].frequency), Balance())


def inspect_instruments(
    sources: list[PointSource], delays_stated: bool = False
) -> tuple[InstrumentFindings, list[PointSource]]:
    """Findings, and the sources as they are to be read from then on: with one clock."""
    clocks = clock_rates(rate_samples(source.load()) for source in sources)
    read = [replace(source, clocks=clocks) for source in sources] if clocks.force else sources
    verdicts = balances([run for source in read for run in balance_runs(source.load())])
    start = 0.0
    if clocks.force and not delays_stated and not (verdicts and clocks.acceleration != clocks.force):
        start = START / min(digest.sample_rate for source in sources for digest in source.digests)
    return InstrumentFindings(clocks, verdicts, start), read


def film_change_at(source: PointSource, est: DynamicStiffness) -> FilmChange:
    """What the film's own harmonics say at one point."""
    pairs = [digest.harmonics[line] for digest, (_, line) in zip(source.digests, source.members) if digest.harmonics]
    return film_change([pair for pair in pairs if pair is not None], est)
