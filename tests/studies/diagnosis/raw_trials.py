"""Raw trials: whole campaigns as raw volts from the virtual rig, identified and diagnosed like any other.

The truth has a finer film mesh, oil, clearances and supply temperature that miss their stated values as certificates
allow, sensors with drawn gains and zeros, and all the noise of a rig. An effect is hidden once and its campaign
diagnosed twice where it is also left out of the library. What identification makes of a campaign can be kept, and
diagnosed again after the decision code has changed.
"""

from __future__ import annotations

import hashlib
import itertools
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.effects import Effect, EffectKind, register
from model.pivots import pivot_laws
from model.setup import Setup
from rigdata.campaign import load_campaign
from rigdata.virtual_rig import Instruments, Noise, VirtualRig, VirtualRigError, write_campaign
from tests.studies.diagnosis.bench import FINER, Bench, seed
from tests.studies.diagnosis.other_plans import PLANS, Test
from tests.studies.diagnosis.trials import Trial, sized, summary
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth
from tpjb_ident.diagnose.campaign import Measured, diagnose_measured, measure_campaign
from tpjb_ident.diagnose.diagnose import ACCURACY
from tpjb_ident.diagnose.forward.forward import Forward, NoEquilibriumError
from tpjb_ident.diagnose.forward.memory import Memory
from tpjb_ident.diagnose.forward.nuisance import Certificates, nuisances
from tpjb_ident.diagnose.observations.observe import observe
from tpjb_ident.diagnose.search.fit import slope
from tpjb_ident.diagnose.search.settings import DiagnoseSettings
from tpjb_ident.diagnose.verdict.closure import closure
from tpjb_ident.dynamic.identify import IdentifySettings

#: An effect that only truths have.
MESH_NAME = "finer_mesh_of_the_truth"
#: Size, in the paper's plan, of what is hidden in campaigns of other plans.
ELSEWHERE = 24.0


@dataclass(frozen=True)
class RawTrial(Trial):
    """A trial as raw volts.

    Attributes
    ----------
    plan : str
        One of `other_plans.PLANS`, or ``"paper"``.
    """

    plan: str = "paper"


@dataclass(frozen=True)
class RawBench:
    """What raw trials share.

    Attributes
    ----------
    bench : Bench
        Of the paper's layout: gives effects their sizes.
    bearing : Bearing
        As drawn.
    memory : Memory
        The model's answers at the baseline, the same for every campaign.
    keep : Path or None
        Folder in which the campaigns are kept.
    """

    bench: Bench = field(repr=False)
    bearing: Bearing = field(repr=False)
    memory: Memory = field(default_factory=Memory, repr=False)
    keep: Path | None = None


def raw_trials(labels: Sequence[str], count: int) -> list[tuple[RawTrial, ...]]:
    """List trials, those together that share a campaign; about `count` of them in all.

    Every round has nothing hidden, d' = 12, the same left out, d' = 6 or 36, and another plan with and without an
    effect; every other round d' = 24, left out too; every eighth round two effects. Noise alternates.
    """
    rounds = _rounds(labels)
    out: list[tuple[RawTrial, ...]] = []
    while sum(map(len, out)) < count:
        out.append(next(rounds))
    return out


def _rounds(labels: Sequence[str]) -> Iterator[tuple[RawTrial, ...]]:
    order = [labels[i] for i in np.random.default_rng(5).permutation(len(labels))]
    plans = sorted(PLANS)
    for i in itertools.count():
        label, again = (order[i % len(order)],), i // len(order)
        other = (order[(7 * i + 3) % len(order)],)
        noise, plan = (1.0, 2.0)[i % 2], plans[i % len(plans)]
        yield (RawTrial("none", noise=noise, number=i),)
        yield tuple(RawTrial(kind, label, 12.0, noise, again) for kind in ("hidden", "left out"))  # type: ignore[arg-type]
        yield (RawTrial("hidden", label, (6.0, 6.0, 36.0)[i % 3], (1.0, 2.0)[(i // 2) % 2], again),)
        if i % 2:
            yield tuple(RawTrial(kind, other, 24.0, 1.0, again) for kind in ("hidden", "left out"))  # type: ignore[arg-type]
        yield (RawTrial("none", number=i // len(plans), plan=plan),)
        yield (RawTrial("hidden", other, ELSEWHERE, 1.0, again, plan=plan),)
        if i % 8 == 7:
            pair = np.random.default_rng([i, 17]).choice(len(labels), 2, replace=False)
            yield (RawTrial("two", tuple(labels[k] for k in sorted(pair)), 12.0, 1.0, i),)


def run_raw_trials(shared: RawBench, group: tuple[RawTrial, ...]) -> list[dict[str, Any]]:
    """Write or find one campaign, identify it, and diagnose it once per trial; rows as of `trials.run_trial`.

    Parameters
    ----------
    shared : RawBench
    group : tuple of RawTrial
        With the same campaign.
    """
    register_truth()
    first = group[0]
    rng = seed("raw", *asdict(replace(first, kind="hidden" if first.truth else "none")).values())
    chosen = [next(c for c in shared.bench.pool if c.label == label) for label in first.truth]
    test = PLANS[first.plan](shared.bearing) if first.plan in PLANS else Test(shared.bearing)
    absent = any(c.fixed.get("pad", 0) > len(test.bearing.pads) for c in chosen)
    effects = None if absent else sized(shared.bench, chosen, replace(first, kind="hidden"), rng)
    blank = [{**asdict(trial), "rung": _rung(trial), "names": tuple(c.name for c in chosen)} for trial in group]
    try:
        rig = None if effects is None else _rig(test, effects, rng, first.noise)
    except VirtualRigError:  # no housing weighs less than nothing
        rig = None
    if effects is None or rig is None:
        return [{**row, "verdict": "unreachable"} for row in blank]
    measured = _measured(rig, test.bearing, shared.keep, "-".join(map(str, asdict(first).values())))
    memory = shared.memory if test.bearing == shared.bearing else None
    return [row | _diagnosed(measured, test.bearing, effects, trial, memory)
            for row, trial in zip(blank, group, strict=True)]  # fmt: skip


def _rung(trial: RawTrial) -> str:
    return "raw volts" if trial.plan == "paper" else f"raw volts, {trial.plan}"


def _diagnosed(
    measured: Measured, bearing: Bearing, effects: tuple[Effect, ...], trial: RawTrial, memory: Memory | None
) -> dict[str, Any]:
    missing = {e.name for e in effects} if trial.kind == "left out" else set()
    settings = DiagnoseSettings(skip=frozenset({MESH_NAME, *missing}), workers=1)
    try:
        diagnosis = diagnose_measured(measured, bearing, settings=settings, memory=memory).diagnosis
    except NoEquilibriumError as error:
        return {"verdict": "no baseline", "reasons": (str(error),)}
    found = diagnosis.found
    row = summary(diagnosis.verdict, effects)
    row |= {"p_before": found.before.structure.p, "p_after": found.after.structure.p}
    row |= {"held_p": found.after.held_p, "scale": found.after.scale}
    closed = closure(diagnosis.problem, found)
    if closed is not None:
        row |= {"closed": closed.closed, "closed_wrong": closed.wrong, "closed_ceiling": closed.ceiling}
    return row


def _measured(rig: VirtualRig, bearing: Bearing, keep: Path | None, name: str) -> Measured:
    """Identify a rig's campaign, written now or kept from before."""
    with tempfile.TemporaryDirectory(dir=_folder(keep)) as folder:
        file = Path(folder) / "campaign.h5"
        kept = file if keep is None else keep / f"{hashlib.sha256(name.encode()).hexdigest()[:20]}.h5"
        if not kept.exists():
            write_campaign(file, rig)
            file.replace(kept)
        # one estimator is enough: the others only tell where they disagree
        return measure_campaign(load_campaign(kept), bearing, estimator=IdentifySettings(methods=()))


def _folder(keep: Path | None) -> Path | None:
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
    return keep


def raw_bench(bench: Bench, bearing: Bearing, keep: Path | None = None) -> RawBench:
    """Prepare raw trials: solve once what every campaign of the paper's plan asks at the baseline."""
    register_truth()
    shared = RawBench(bench, bearing, keep=keep)
    name = asdict(RawTrial("none"))
    rng = seed("raw", *name.values())
    measured = _measured(_rig(Test(bearing), (), rng, 1.0), bearing, keep, "-".join(map(str, name.values())))
    return replace(shared, memory=baseline_memory(measured, bearing, bench))


def baseline_memory(measured: Measured, bearing: Bearing, bench: Bench) -> Memory:
    """What a diagnosis of any campaign with these points asks of the model before it looks at a value."""
    seen = observe(measured.identification, measured.curves, measured.locus, measured.polygon)
    setup = Setup(bearing, pivot_laws("kirk", bearing), accuracy=ACCURACY, instruments=measured.instruments)
    forward = Forward(setup, seen.layout, seen.elements)
    base = forward()
    start = dict(forward.memory.start)
    nuisances(forward, (), base, Certificates())
    for candidate in bench.pool:
        slope(forward.fresh_start(start), (candidate,), np.array([candidate.neutral]), base, 0, 0.5 * candidate.step)
    return Memory(forward.memory.solved, start)


def _rig(test: Test, effects: tuple[Effect, ...], rng: np.random.Generator, noise: float) -> VirtualRig:
    number = int(rng.integers(2**31))
    settings = ModelSettings(effects=(Effect(MESH_NAME), *effects))
    instruments = Instruments.like_paper(len(test.bearing.pads), number).with_drawn_errors(number)
    return VirtualRig(
        truth=rig_truth(_as_built(test.bearing, rng), settings),
        instruments=erring_instruments(instruments, effects),
        plan=test.plan,
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


def register_truth() -> None:
    """Let truths have their finer mesh; diagnoses skip it."""

    def apply(setup: Setup) -> Setup:
        return setup.change(mesh=FINER)

    register(EffectKind(MESH_NAME, "bearing", (), apply))
