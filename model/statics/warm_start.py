"""Starting from a neighbour: its state as it is, or carried on along a sweep."""

from __future__ import annotations

import copy
from dataclasses import replace

from model.statics.equilibrium import Equilibrium


def extrapolated_state(before: Equilibrium, last: Equilibrium, share: float = 1.0) -> Equilibrium:
    """Where a sweep is heading: a start for its next point."""
    if not before.converged or [f.idle for f in before.films] != [f.idle for f in last.films]:
        return last
    films = []
    for old, new in zip(before.films, last.films, strict=True):
        film = copy.copy(new)
        film.tilt = new.tilt + share * (new.tilt - old.tilt)
        film.deflection = new.deflection + share * (new.deflection - old.deflection)
        film.bent = new.bent + share * (new.bent - old.bent)
        warmth = new.work.temperature
        film.work = new.work._replace(temperature=warmth + share * (warmth - old.work.temperature))
        films.append(film)
    return replace(last, position=last.position + share * (last.position - before.position), films=tuple(films))
