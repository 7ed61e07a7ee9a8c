"""Which heat goes where, as a set-up asks for it; the equations are in `model.statics.compiled.heat`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from model.pad.bending import PadDeformation
from model.setup import Setup
from model.statics.compiled.heat import Conduction


def couples_heat(setup: Setup) -> bool:
    """Whether the films' temperatures depend on more than their own inlets."""
    return setup.thermal != "isothermal" and bool(
        setup.thermal == "thd" or setup.mixing or setup.options.conduction or setup.options.isothermal_journal
    )


@lru_cache(maxsize=8)
def stacked_conduction(bodies: tuple[PadDeformation, ...]) -> Conduction:
    """What the pads conduct, side by side; without bodies nothing."""
    if not bodies:
        nothing = np.zeros((0, 0, 0))
        return Conduction(np.zeros(0, dtype=np.int64), nothing, nothing)
    kinds = list(dict.fromkeys(bodies))
    which = np.array([kinds.index(b) for b in bodies])
    return Conduction(which, np.array([b.flux for b in kinds]), np.array([b.to_coarse for b in kinds]))
