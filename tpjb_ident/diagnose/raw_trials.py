"""Raw trials: whole campaigns as raw volts from the virtual rig, identified and diagnosed like any other.

The truth has a finer film mesh, oil, clearances and supply temperature that miss their stated values as certificates
allow, sensors with drawn gains and zeros, and all the noise of a rig.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.effects import Effect, EffectKind, register
from model.setup import Setup
from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments, Noise, RigPlan, VirtualRig, write_campaign
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth
from tpjb_ident.diagnose.bench import FINER, Bench, seed
from tpjb_ident.diagnose.campaign import diagnose_campaign
from tpjb_ident.diagnose.closure import closure
from tpjb_ident.diagnose.nuisance import Certificates
from tpjb_ident.diagnose.settings import DiagnoseSettings
from tpjb_ident.diagnose.trials import Trial, sized, summary

#: An effect that only truths have.
MESH_NAME = "finer_mesh_of_the_truth"


def raw_trials(labels: Sequence[str], count: int) -> list[Trial]:
    """List `count` trials: nothing hidden, d' = 12, the same left out, d' = 6 or 36, over all candidates in turn."""
    order = [labels[i] for i in np.random.default_rng(5).permutation(len(labels))]
    out: list[Trial] = []
    for i in range(math.ceil(count / 4)):
        label = (order[i % len(order)],)
        again = i // len(order)
        out.append(Trial("none", noise=(1.0, 2.0)[i % 2], number=i))
        out.append(Trial("hidden", label, 12.0, 1.0, again))
        out.append(Trial("left out", label, 12.0, 1.0, again))
        out.append(Trial("hidden", label, (6.0, 36.0)[i % 2], 1.0, again))
    return out[:count]


def run_raw_trial(bench: Bench, bearing: Bearing, trial: Trial) -> dict[str, Any]:
    """Write a campaign, identify and diagnose it; a row as of `trials.run_trial`.

    Parameters
    ----------
    bench : Bench
        Of the paper's layout: gives effects their sizes.
    bearing : Bearing
        As drawn.
    trial : Trial
    """
    rng = seed("raw", *asdict(trial).values())
    chosen = [next(c for c in bench.pool if c.label == label) for label in trial.truth]
    effects = sized(bench, chosen, trial, rng)
    row: dict[str, Any] = {**asdict(trial), "rung": "raw volts", "names": tuple(c.name for c in chosen)}
    if effects is None:
        return {**row, "verdict": "unreachable"}
    skip = frozenset({MESH_NAME, *(row["names"] if trial.kind == "left out" else ())})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "campaign.h5"
        write_campaign(path, _rig(bearing, effects, rng, trial.noise))
        result = diagnose_campaign(load_campaign(path), bearing, settings=DiagnoseSettings(skip=skip, workers=1))
    found = result.diagnosis.found
    row |= summary(result.diagnosis.verdict, effects)
    row["p_before"], row["p_after"] = found.before.structure.p, found.after.structure.p
    row["held_p"], row["scale"] = found.after.held_p, found.after.scale
    measured = closure(result.diagnosis.problem, found)
    if measured is not None:
        row |= {"closed": measured.closed, "closed_wrong": measured.wrong, "closed_ceiling": measured.ceiling}
    return row


def _rig(bearing: Bearing, effects: tuple[Effect, ...], rng: np.random.Generator, noise: float) -> VirtualRig:
    number = int(rng.integers(2**31))
    settings = ModelSettings(effects=(_finer_mesh(), *effects))
    instruments = Instruments.like_paper(len(bearing.pads), number).with_drawn_errors(number)
    return VirtualRig(
        truth=rig_truth(_as_built(bearing, rng), settings),
        instruments=erring_instruments(instruments, effects),
        plan=RigPlan.like_paper(),
        noise=Noise.like_samples().scaled(noise),
        seed=number,
    )


def _as_built(bearing: Bearing, rng: np.random.Generator) -> Bearing:
    """The bearing with what its drawing and the oil's grade leave open."""
    known = Certificates()
    miss = rng.standard_normal(4)
    oil = replace(
        bearing.oil,
        viscosity_40=bearing.oil.viscosity_40 * (1.0 + known.viscosity * miss[0]),
        supply_temperature=bearing.oil.supply_temperature + known.supply_temperature * miss[1],
    )
    pads = tuple(
        replace(
            pad,
            assembled_clearance=pad.assembled_clearance + known.assembled_clearance * miss[2],
            pad_clearance=pad.pad_clearance + known.pad_clearance * miss[3],
        )
        for pad in bearing.pads
    )
    return replace(bearing, oil=oil).with_pads(pads)


def _finer_mesh() -> Effect:
    def apply(setup: Setup) -> Setup:
        return setup.change(mesh=FINER)

    register(EffectKind(MESH_NAME, "bearing", (), apply))
    return Effect(MESH_NAME)
