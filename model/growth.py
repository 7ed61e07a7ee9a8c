"""Running clearances: journal, housing and pads grow with their temperatures.

The drawing's clearances hold at the temperature they were measured at. A journal that is hotter takes its growth from
Cb and Cp alike; a housing that is hotter gives it to Cb; pads that are hotter take their thickness from Cb and give
their larger radius to Cp. What pads grow above the oil's supply temperature, unevenly, is `model.pad.bending`.
"""

from dataclasses import dataclass, replace

from model.bearing import Bearing, BearingError, Pad
from model.errors import OptionError


@dataclass(frozen=True)
class Growth:
    """Temperatures that set the running clearances."""

    reference: float = 20.0
    housing: float | None = None
    journal: float | None = None
    expansion: tuple[float, float] = (11.5e-6, 11.5e-6)

    def __post_init__(self) -> None:
        temperatures = [t for t in (self.reference, self.housing, self.journal) if t is not None]
        if not all(-50.0 <= t <= 300.0 for t in temperatures):
            raise OptionError(f"temperatures of Growth must lie between -50 and 300 degC, got {temperatures}")
        if len(self.expansion) != 2 or not all(0.0 <= a < 1e-4 for a in self.expansion):
            raise OptionError(f"expansion must be two numbers from 0 to 1e-4 1/K, got {self.expansion!r}")

    def closing(self, bearing: Bearing) -> float:
        """What a kelvin of the journal's takes from every clearance [m/K]."""
        return self.expansion[0] * bearing.journal_radius


def grown(bearing: Bearing, growth: Growth, supply: float, journal: float) -> Bearing:
    """Bearing with its clearances as they run."""
    by_housing = growth.expansion[1]
    warm = supply - growth.reference
    outward = supply if growth.housing is None else growth.housing
    out = growth.closing(bearing) * (journal - growth.reference)

    def run(number: int, pad: Pad) -> Pad:
        bore = bearing.journal_radius + pad.pad_clearance
        seat_growth = by_housing * (bore + pad.thickness) * (outward - growth.reference)
        thicker = pad.backing.thermal_expansion * pad.thickness * warm
        wider = pad.backing.thermal_expansion * bore * warm
        assembled = pad.assembled_clearance + seat_growth - thicker - out
        machined = pad.pad_clearance + wider - out
        if not (assembled > 0.0 and machined > 0.0):
            raise BearingError(
                f"{bearing.name}: pad #{number} has no clearance left with the journal at {journal:.0f} degC "
                f"(Cb {assembled * 1e6:.1f} um, Cp {machined * 1e6:.1f} um). Check the clearances and their "
                "reference temperature."
            )
        return replace(pad, assembled_clearance=assembled, pad_clearance=machined)

    return bearing.with_pads(tuple(run(k, pad) for k, pad in enumerate(bearing.pads, start=1)))
