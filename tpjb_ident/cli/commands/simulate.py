"""`tpjb simulate`: a bearing file in, a whole campaign of a virtual rig out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from rigdata.near_names import hint
from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.inputs import model_settings, operating_points, pivot_choice, rotation_choice
from tpjb_ident.cli.options import refuse_unknown
from tpjb_ident.errors import BadInputError

PLANS = ("paper", "short")
_NUMBERS = ("value", "start", "length")
FAULT_KEYS = ("run", "channel", "other", *_NUMBERS)


@command(
    "tpjb simulate {ROCKER} --plan short --seed 1",
    'tpjb simulate {ROCKER} --load "5 kN" --excitation "10..50:10 Hz" --fault "dead run=d-* channel=X1A"',
)
def simulate(
    c: Command,
    bearing: Path,
    pivots: str = "kirk",
    thermal: str = "adiabatic",
    effects: Path | None = None,
    plan: str = "paper",
    load: str | None = None,
    excitation: str | None = None,
    speed: str = "22 Hz",
    rotation: str | None = None,
    repeats: int = 1,
    noise: float = 1.0,
    fault: list[str] | None = None,
    seed: int = 0,
    name: str = "virtual",
    layout: str = "hdf5",
) -> None:
    """Write a whole campaign of a virtual rig.

    Writes campaign.h5 (or the folder campaign), and truth.json beside it.

    The model gives K, C, positions and temperatures; noise, runout, drift, mains, 16-bit steps and glitches are
    those of a real rig. Effects that act on the records (probe_gain, ..) spoil the instruments.
    """
    c.options |= {"format": c.options.pop("layout"), "fault": fault or []}
    drawing = c.bearing(bearing)
    settings = model_settings(c, pivot_choice(c), drawing)
    from rigdata.virtual_rig import Fault, Instruments, Noise, RigPlan, VirtualRig, write_campaign
    from tpjb_ident.compare.rig_from_model import erring_instruments, rig_truth

    refuse_unknown(plan, PLANS, "--plan")
    pads = len(drawing.pads)
    tests = RigPlan.like_paper(pads) if plan == "paper" else RigPlan.short(pads)
    points = operating_points(load or "5 kN", "-90 deg", speed, excitation or "25 Hz")
    tests = tests.turning(shaft_speed=points[0].shaft_speed)  # of every run with a shaft that turns
    if load is not None or excitation is not None:
        tests = replace(tests, dynamic=tuple(points))
    tests = replace(tests, repeats=repeats).turning(rotation=rotation_choice(c, drawing))
    largest = max(point.static_load for point in tests.dynamic)
    rig = VirtualRig(
        truth=rig_truth(drawing, settings, bearing.read_text("utf-8-sig")),
        instruments=erring_instruments(Instruments.like_paper(pads, seed, largest), settings.effects),
        noise=Noise.like_samples().scaled(noise) if noise > 0 else Noise.none(),
        seed=seed,
        campaign=name,
        plan=tests,
        faults=tuple(Fault(**_fault_arguments(text)) for text in fault or ()),
    )
    file = "campaign.h5" if layout == "hdf5" else "campaign"
    if (c.target / file).exists():
        c.warn(f"{c.target / file}: the campaign that is there is replaced; --out keeps both.")
    with c.results("simulating") as show:
        truth = write_campaign(c.folder / file, rig, layout, progress=lambda done, total, run: show(run, done, total))
        truth.write(c.folder / "truth.json")
    c.print(f"{name}: {len(rig.runs)} runs, seed {seed}, in {c.target / file}, the truth in truth.json beside it")
    c.next("check", c.target / file)


def _fault_arguments(text: str) -> dict[str, Any]:
    """Turn ``"dead run=d-05000-* channel=X1A"`` into keyword arguments of `Fault`."""
    kind, *pairs = text.split() or [""]
    arguments: dict[str, Any] = {"kind": kind}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or key not in FAULT_KEYS:
            use = hint(key, FAULT_KEYS, "Write KEY=VALUE, with one of")
            raise BadInputError(f"--fault {text!r}: {pair!r} is not understood. {use}")
        try:
            arguments[key] = float(value) if key in _NUMBERS else value
        except ValueError:
            raise BadInputError(f"--fault {text!r}: {value!r} is not a number (SI, without unit).") from None
    return arguments
