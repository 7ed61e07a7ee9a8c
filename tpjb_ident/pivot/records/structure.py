"""A structure that gives way: one compliance between bearing and probes that bends the displacements of all dry tests.

Where a pad at phi with normal n is pushed with the load W, a structure with the symmetric compliance S moves the shaft
by W S n beside what the pivot gives, W c n. Across the pad that is

    t . S n = (S_yy - S_xx) / 2 sin 2 phi + S_xy cos 2 phi,

two numbers for all pads. Exchanged channels make a similar pattern, but one that no spring can: a spring of this size
along its own direction would move the shaft further along some pads than it moved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tpjb_ident.pivot.records.projection import PadDirection

#: Pads that must be there: two numbers are fitted.
FEWEST = 4
#: Slack when the spring's own movement is compared with what was read, as a share of it.
SLACK = 0.1


@dataclass(frozen=True)
class Structure:
    """A compliance that explains the directions of all dry tests.

    Attributes
    ----------
    compliance : float
        Difference of its principal values [m/N].
    direction : float
        Of the softer one [rad], within -90 .. 90 degrees.
    """

    compliance: float
    direction: float

    def across(self, angle: float) -> float:
        """What it moves a shaft across a pad at an angle [rad], per newton [m/N].

        Parameters
        ----------
        angle : float
            Angle of the pad [rad].
        """
        return -0.5 * self.compliance * math.sin(2.0 * (angle - self.direction))

    def along(self, angle: float) -> float:
        """What it moves at least along the pad [m/N].

        Parameters
        ----------
        angle : float
            Angle of the pad [rad].
        """
        return self.compliance * math.cos(angle - self.direction) ** 2

    def __str__(self) -> str:
        return (
            f"a structure that gives {1e9 * self.compliance:.2g} nm/N more along {math.degrees(self.direction):.0f} "
            "deg than across it explains the displacement directions of all dry tests"
        )


def structure_behind(
    angles: Sequence[float], slopes: Sequence[float], moved: Sequence[PadDirection], limit: float
) -> Structure | None:
    """Look for one compliance behind displacements that point elsewhere than at their pads.

    Parameters
    ----------
    angles : sequence of float
        Directions of the pads that were pushed [rad], one per record.
    slopes : sequence of float
        Growth of the displacement along each pad with the load [m/N].
    moved : sequence of PadDirection
        Directions of the displacements from their pads.
    limit : float
        Angle that a displacement may still be off once the structure is allowed for [rad].

    Returns
    -------
    Structure or None
        None where too few pads were pushed, a shaft moved away from its pad, or the pattern is not that of a spring.
    """
    phi, along = np.asarray(angles, float), np.asarray(slopes, float)
    if len(set(np.round(phi, 6))) < FEWEST or np.any(along <= 0.0):
        return None
    if any(abs(d.angle) >= 0.5 * math.pi for d in moved):
        return None
    across = along * np.tan([d.angle for d in moved])
    design = np.column_stack([np.sin(2 * phi), np.cos(2 * phi)])
    p, q = np.linalg.lstsq(design, across, rcond=None)[0]
    # t . S n = -(D / 2) sin 2 (phi - psi) = -(D / 2) (sin 2 phi cos 2 psi - cos 2 phi sin 2 psi)
    found = Structure(2.0 * math.hypot(p, q), 0.5 * math.atan2(q, -p))
    left = np.array([a - found.across(float(f)) for f, a in zip(phi, across, strict=True)])
    own = np.array([a - found.along(float(f)) for f, a in zip(phi, along, strict=True)])
    if np.any(own < -SLACK * along) or np.any(np.abs(left) > math.tan(limit) * along):
        return None
    return found
