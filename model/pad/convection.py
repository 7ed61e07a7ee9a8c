"""Operators of a pad at any convection of its free faces, from a few: a fit of it need not solve a solid at every step.

Conduction with convection h is (K + h M) T = 0 about a given film face, so that every temperature in the pad is a sum
of c_i h / (h_i + h). The smallest h_i is about the conductivity over the thickness, h_0: in x = h / (h + h_0) the sum
is smooth up to x = 1, where the faces are as cold as the oil, and a polynomial through a few x follows it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from model.pad.mesh import MeshDensity, PadGeometry
from model.pad.operators import PadOperators, operators_at, pad_operators

#: Eight nodes: expansion to 2e-6, heat into the pad to 3e-4 (`tests/model/test_convection.py`).
NODES = 8
#: Largest convection between the nodes [W/m^2/K]; above it a pad is solved for its own.
LARGEST = 1e4


def pad_operators_between(geometry: PadGeometry, density: MeshDensity, even: bool) -> PadOperators:
    """As `pad_operators`, interpolated between a few convections: the first time costs more, every other nothing."""
    if geometry.back_convection > LARGEST:
        return pad_operators(geometry, density, even)
    through = geometry.backing.conductivity / geometry.backing_thickness
    last = LARGEST / (LARGEST + through)
    nodes = 0.5 * last * (1.0 - np.cos(np.pi * np.arange(NODES) / (NODES - 1)))
    convections = tuple(float(h) for h in through * nodes / (1.0 - nodes))
    known = _known(replace(geometry, back_convection=0.0), density, even, convections)
    x = geometry.back_convection / (geometry.back_convection + through)
    weights = [float(np.prod([(x - other) / (node - other) for other in nodes if other != node])) for node in nodes]
    mixed = {
        name: sum(w * getattr(one, name) for w, one in zip(weights, known, strict=True))
        for name in ("expansion", "flux")
    }
    return replace(known[0], **mixed)


_known = lru_cache(maxsize=3)(operators_at)  # 13 MB each
