"""`uneven_pads`: workshop scatter of the pads' assembled clearances."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from model.effects.kind import EffectKind, EffectWords, Parameter
from model.setup import Setup


def apply(setup: Setup, **offsets: float) -> Setup:
    """Cb of pad k plus offset_k, less the part of all offsets that only shifts the bearing as a whole.

    Offsets ``n_k . s`` of the pads at n_k move the bearing by s, and the journal with it: no test tells them from a
    bearing centre that is elsewhere, since positions count from the bearing centre. That part is taken out (least
    squares), so that offsets which differ by a shift are one and the same effect.
    """
    pads = setup.bearing.pads
    clearances = np.array([offsets[f"offset_{k}"] for k in range(1, len(pads) + 1)])
    normals = np.array([[math.cos(p.pivot_angle), math.sin(p.pivot_angle)] for p in pads])
    without_shift = clearances - normals @ np.linalg.lstsq(normals, clearances, rcond=None)[0]
    return setup.change_pads(
        lambda number, pad: replace(pad, assembled_clearance=pad.assembled_clearance + float(without_shift[number - 1]))
    )


KIND = EffectKind(
    name="uneven_pads",
    side="bearing",
    parameters=(),
    apply=apply,
    source="Machining of pads and seats holds a few micrometres from pad to pad",
    per_pad=Parameter("offset", "m", "length", 0.0, -6e-05, 6e-05, 2.5e-06),
    words=EffectWords(
        finding="the pads stand unevenly: {offset}",
        physics=(
            "Machining of pads and seats leaves each pad at its own assembled clearance. The load shares itself out "
            "anew among them."
        ),
        on_the_rig="The clearance polygon is irregular; coefficients part where the load turns.",
        check="the clearance sweep, pad by pad",
    ),
)
