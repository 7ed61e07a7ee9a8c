"""`tpjb simulate`: a bearing file in, a whole campaign of a virtual rig out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from rigdata.near_names import nearest_name
from tpjb_ident.cli.commands.predict import model_settings, operating_points, pivot_choice
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import refuse_impossible, refuse_special
from tpjb_ident.cli.common.options import (
    BearingPath,
    EffectsFile,
    Out,
    PivotChoice,
    Speeds,
    Thermal,
    as_given,
    out_folder,
)
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress
from tpjb_ident.errors import BadInputError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256

PLANS = ("paper", "short")


@guarded
def simulate(
    bearing: BearingPath,
    pivots: PivotChoice = "kirk",
    thermal: Thermal = "adiabatic",
    effects: EffectsFile = None,
    plan: Annotated[str, typer.Option(help="paper (92 runs, as in the reference paper) or short (34 runs).")] = "paper",
    load: Annotated[str | None, typer.Option(help="Loads of the dynamic runs, instead of the plan's.")] = None,
    excitation: Annotated[
        str | None, typer.Option(help="Excitation frequencies, each at every --load [default: 25 Hz].")
    ] = None,
    speed: Speeds = "22 Hz",
    repeats: Annotated[int, typer.Option(min=1, max=100, help="Records per point and direction.")] = 1,
    noise: Annotated[
        float, typer.Option(min=0.0, max=1000.0, help="Channel noise: 1 as on a real rig, 0 no disturbance at all.")
    ] = 1.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(help='A defect: "KIND run=PATTERN channel=NAME value=.. start=.. length=..". Repeatable.'),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same campaign, to the last bit.")] = 0,
    name: Annotated[str, typer.Option(help="Id of the campaign.")] = "virtual",
    layout: Annotated[str, typer.Option("--format", help="hdf5, csv, csv-german, csv-tabbed or csv-bare.")] = "hdf5",
    out: Out = None,
) -> None:
    """Write a whole campaign of a virtual rig.

    Writes campaign.h5 (or the folder campaign), and truth.json beside it.

    The model gives K, C, positions and temperatures; noise, runout, drift, mains, 16-bit steps and glitches are
    those of a real rig. Effects that act on the records (probe_gain, ..) spoil the instruments.
    """
    options = as_given(locals(), "layout") | {"format": layout, "fault": fault or []}
    settings = model_settings(pivot_choice(pivots), thermal, effects)
    refuse_special(bearing)
    from rigdata.virtual_rig import write_campaign

    rig = _rig(bearing, settings, seed, noise, effects)
    rig = replace(rig, campaign=name, plan=_plan(plan, load, excitation, speed, repeats), faults=_faults(fault or []))
    target = out_folder(out, "simulate")
    inputs = {p.name: sha256(p) for p in (bearing, effects, settings.pivots) if isinstance(p, Path)}
    file = "campaign.h5" if layout == "hdf5" else "campaign"
    with output_folder(target, "simulate") as folder:
        with progress("simulating") as show:
            truth = write_campaign(folder / file, rig, layout, progress=lambda done, total, run: show(run, done, total))
        truth.write(folder / "truth.json")
        write_record(folder, target, "simulate", options, inputs)
    print_line(f"{name}: {len(rig.runs())} runs, seed {seed}")
    print_line(f"Results: {target / file}, the truth in {target / 'truth.json'}")


def _rig(bearing: Path, settings: Any, seed: int, noise: float, effects: Path | None) -> Any:
    from model.bearing_file import load_bearing
    from rigdata.virtual_rig import Instruments, Noise, VirtualRig
    from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth

    loaded = load_bearing(bearing)
    refuse_impossible(settings.effects, effects, loaded)
    text = bearing.read_text(encoding="utf-8-sig")
    instruments = Instruments.like_paper(len(loaded.pads), seed)
    return VirtualRig(
        truth=rig_truth(loaded, settings, text),
        instruments=erring_instruments(instruments, settings.effects),
        noise=Noise.like_samples().scaled(noise) if noise > 0 else Noise.none(),
        seed=seed,
    )


def _plan(plan: str, load: str | None, excitation: str | None, speed: str, repeats: int) -> Any:
    from rigdata.virtual_rig import RigPlan

    if plan not in PLANS:
        raise BadInputError(f"--plan: {plan!r} is not known. Use {' or '.join(PLANS)}.")
    chosen = RigPlan.like_paper() if plan == "paper" else RigPlan.short()
    if load is not None or excitation is not None:
        points = operating_points(load or "5 kN", "-90 deg", speed, excitation or "25 Hz")
        chosen = replace(chosen, dynamic=tuple(points))
    return replace(chosen, repeats=repeats)


def _faults(texts: list[str]) -> tuple[Any, ...]:
    from rigdata.virtual_rig import Fault

    return tuple(Fault(**_fault_arguments(text)) for text in texts)


def _fault_arguments(text: str) -> dict[str, Any]:
    """Turn ``"dead run=d-05000-* channel=X1A"`` into keyword arguments of `Fault`."""
    kind, *pairs = text.split() or [""]
    arguments: dict[str, Any] = {"kind": kind}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        known = ("run", "channel", "value", "start", "length", "other")
        if not equals or key not in known:
            near = nearest_name(key, known)
            hint = f"Did you mean {near}=?" if near else f"Use {', '.join(f'{k}=' for k in known)}."
            raise BadInputError(f"--fault {text!r}: {pair!r} is not understood. {hint}")
        arguments[key] = _number(value, text) if key in ("value", "start", "length") else value
    return arguments


def _number(value: str, text: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise BadInputError(f"--fault {text!r}: {value!r} is not a number (SI, without unit).") from None
