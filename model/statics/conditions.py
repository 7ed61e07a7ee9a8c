"""Conditions of an operating point that deserve a name: a load that nothing can hold, a film thinner than surfaces are.

Equations have solutions where bearings have none. These are told from the drawing and from the films, apart from how
the iteration went.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from model.setup import Setup
from model.statics.pad_film import PadFilm

FloatArray = NDArray[np.float64]

#: Below this film the surfaces touch: three times the combined roughness, 1 um, of ground journal and bored pad [m].
THINNEST_FILM = 3e-6
#: Above this pressure tin babbitt yields, cold (0.2 % proof stress of SnSb8Cu4, ISO 4381) [Pa].
HIGHEST_PRESSURE = 45e6
#: Above this film temperature tin babbitt creeps; machines are tripped at pad temperatures of 115 to 130 [degC].
HOTTEST_FILM = 150.0


def unsupported(setup: Setup, load: FloatArray) -> bool:
    """Whether no pads can hold a load, wherever the journal goes: free pads push along their pivots only.

    Parameters
    ----------
    setup : Setup
    load : (2,) ndarray
        [N]
    """
    size = float(np.hypot(load[0], load[1]))
    if size == 0.0 or setup.rotational_stiffness > 0.0:
        return False
    from scipy.optimize import nnls

    angles = np.array([pad.pivot_angle for pad in setup.bearing.pads])
    _, missing = nnls(np.array([np.cos(angles), np.sin(angles)]), np.asarray(load, float) / size)
    return bool(missing > 1e-9)


def overloaded_pads(films: tuple[PadFilm, ...] | list[PadFilm]) -> list[int]:
    """Numbers of the pads whose film is too thin, whose pressure too high or whose oil too hot for a pad to live."""
    return [
        f.number
        for f in films
        if not f.idle
        and (
            float(f.work.thickness.min()) < THINNEST_FILM
            or float(f.work.pressure.max()) > HIGHEST_PRESSURE
            or float(f.work.temperature.max()) > HOTTEST_FILM
        )
    ]
