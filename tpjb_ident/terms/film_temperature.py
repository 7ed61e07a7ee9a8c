"""What the film's temperature does to H, where the runs of a point were not equally warm.

Warmer oil is thinner, and K and C are less. Runs whose directions were as warm on average lose nothing by it; where one
direction was measured on colder oil, the columns of H belong to two films, and the interval holds either. Runs of one
direction that differ in temperature tell the change, and H is then that at the mean of its runs; where they differ by
more than a supply does, nobody knows of which temperature it is meant.
"""

from collections.abc import Mapping

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Conditions, holding
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.equation import Blocks, Rig, State, entry_changes, entry_sizes, totals
from tpjb_ident.estimate.term import FilmTerm, Fitted, numbered

#: Change of H per kelvin, over its entries, one standard deviation: viscosity falls by 3 %, K goes with about the 0.4th
#: power of it, C with the 0.6th.
_USUAL = 0.015
#: Distance of a run's temperature from its point's mean that thermometers show of themselves, deviation that a supply
#: holds, and distance that is worth telling [K].
_SHOWN, _HELD, _TOLD = 0.5, 1.0, 3.0


class FilmTemperature(FilmTerm):
    """Change of every real and imaginary part of H by a run's temperature, and by its point's; for all points alike."""

    name = "film temperature"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        number = len(blocks.points)
        self.group = np.zeros(number, dtype=int)
        measured = np.isfinite(blocks.film_temperature)
        count = np.maximum(totals(blocks.point, measured, number), 1.0)
        self._mean = totals(blocks.point, np.nan_to_num(blocks.film_temperature), number) / count
        warmer = self._warmer(blocks)
        variance = totals(blocks.point, warmer**2, number) / count
        self._unsteady = np.sqrt(np.maximum(variance - _HELD**2, 0.0))
        self._farthest = float(np.abs(warmer).max(initial=0.0))
        if self._farthest > _SHOWN:
            self.parameters = numbered("change per kelvin", "1/K", [_USUAL] * NUMBERS)
            self.parameters += numbered("at the temperature that is meant", "1/K", [_USUAL] * NUMBERS)

    def _warmer(self, blocks: Blocks) -> np.ndarray:
        """By how much every block's film is warmer than those of its point on average, (n,) [K]."""
        return np.nan_to_num(blocks.film_temperature - self._mean[blocks.point])

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """Entries of H by their own size, per kelvin, of the run and of the point."""
        kelvins = np.stack([self._warmer(blocks), self._unsteady[blocks.point]], axis=1)
        sizes = entry_sizes(state.h[blocks.point])
        return entry_changes((kelvins[:, :, None] * sizes[:, None]).reshape(len(blocks), 2 * NUMBERS))

    def learnt_share(self, fitted: Mapping[str, Fitted]) -> FloatArray:
        """What the runs tell of the change holds at the temperature that is meant, too, (q,)."""
        change = fitted[self.name]
        size = np.hypot(change.value, change.deviation)[:NUMBERS] / _USUAL
        return np.concatenate([np.ones(NUMBERS), size])

    def conditions(self, fitted: Fitted) -> Conditions:
        """Films that were not equally warm."""
        text = f"the film of a run was {self._farthest:.1f} K warmer or colder than in its point's runs on average"
        return holding((self._farthest > _TOLD, "film-not-equally-warm", text))
