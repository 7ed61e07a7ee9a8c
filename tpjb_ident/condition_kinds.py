"""The registry of conditions: every name that a result may say of itself, how grave it is, what it means, what to do.

A new condition is one line here. `tpjb_ident.conditions.Condition` refuses a name that is not listed.
"""

from __future__ import annotations

from dataclasses import dataclass

from rigdata.near_names import nearest_name
from rigdata.problem import Severity


class UnknownConditionError(LookupError):
    """A condition that is not in the registry: a mistake of the code, not of its input."""


@dataclass(frozen=True)
class ConditionKind:
    """What is known of a condition by its name alone."""

    name: str
    severity: Severity
    meaning: str


#: With one of these a number is not to be trusted: the command ends with exit code 3.
ERRORS = {
    "1X on excitation line": "The excitation is on the running speed: unbalance and runout cannot be separated "
    "from it. Excite beside the running speed, or record a keyphasor.",
    "2X on excitation line": "The excitation is on twice the running speed: runout cannot be separated from it. "
    "Excite beside it.",
    "3X on excitation line": "The excitation is on three times the running speed: runout cannot be separated from it. "
    "Excite beside it.",
    "accelerometers-contradict-cells": "The housing's acceleration is not what its springs, the load cells, make of "
    "their force, or, where it floats, not what the probes show: accelerometers are exchanged, dead, late, or have the "
    "wrong sign. Check channels, axes, polarity and delays.",
    "cells-and-accelerometers-out-of-phase": "Between the load cells and the housing on them there is a lag: a device "
    "that records late, or a filter. Damping is wrong by stiffness times that lag. State delay or filter in the "
    "manifest, or filter all channels alike.",
    "baseline-missing": "The campaign measured the rig without its bearing, but not at this frequency: the rig's own "
    "stiffness is still inside. Measure it there too.",
    "film-not-linear": "The film was shaken so hard, by excitation or shaft, that it answers at other frequencies: "
    "K and C of small motion cannot be had from this. Excite less, or balance the shaft.",
    "records-contradicted": "Many records contradict the manifest, or what a film can do: swapped or inverted "
    "channels, loads, clipping. `tpjb check` lists it all.",
    "runs-disagree": "The runs of the point do not belong to one dynamic stiffness: what it leaves of their forces is "
    "far more than load and noise explain. Look at the runs one by one.",
    "most-windows-lost": "More than half of the record's windows gave no phasors. Look at the records.",
    "cells-contradict-set-points": "In all runs the load cells read many times more or less than the set points, "
    "or a load in quite another direction; the coefficients are then off by as much. Check sensitivity, "
    "full_scale, excitation, polarity and axes of the cells.",
    "contact-never-complete": "The shaft never came into full contact: this curve is not the pivot's stiffness.",
    "excitation-too-weak": "At most lines of the band the displacements do not stand clear of their noise: intervals "
    "there cannot hold. Excite harder, record longer, or narrow the band.",
    "fewer-than-two-directions": "All displacements lie along one line; a 2x2 matrix needs two directions. Excite "
    "in another direction too.",
    "ill-conditioned": "The displacement directions are almost parallel, so errors are strongly amplified. Excite "
    "in directions that move the shaft differently.",
    "iteration-limit": "The estimator stopped before it settled.",
    "low-coherence": "Much of the force is not explained by the displacement: noise, or a wrong channel.",
    "many-windows-rejected": "More than 40 % of the windows were rejected as outliers. Look at the records.",
    "negative-damping": "A direct damping came out negative: a film takes energy. Look for a wrong polarity, "
    "swapped channels or a delay.",
    "no-residual": "As many windows as unknowns: the numbers solve them exactly and have no interval. Record more.",
    "no-robust-start": "No robust start was found; outliers may have pulled the answer.",
    "outside-polygon": "Some positions lie outside the clearance polygon, where the shaft cannot be. Check the probes.",
    "point-lost": "None of the runs at an operating point can be used: it has no coefficients.",
    "probes-contradict-clearance": "The probes' readings cannot be lengths in this bearing: a sensitivity is "
    "several times off, and the coefficients with it. Check the sensitivities of the probes, and the bearing "
    "file.",
    "zero-scale": "The residuals are zero: the records are no measurement, or repeat one another exactly.",
}
#: The number holds as far as its interval goes; somebody should look.
WARNINGS = {
    "accelerometers-doubtful": "The housing's acceleration is not what its springs make of the cells' force; it is "
    "too small a part of the force to matter here. Check channels, axes and polarity of the accelerometers.",
    "cells-not-tared": "The load cells read something at no load: a constant in their mean over the campaign's loads. "
    "It was taken off before runs were held against their set points. Tare the cells.",
    "clocks-differ": "Probes and cells were recorded by clocks of different rate; the drift of their phase showed "
    "it and was corrected. How exactly they were started together the records do not tell: state delay and "
    "delay_uncertainty in the manifest.",
    "probes-drift": "Probes read more or less with temperature than the manifest states: the runs of a point differ "
    "with their temperatures. Measure the coefficients and state temperature_coefficient.",
    "slower-channels": "Channels were sampled slower than the export says and filled up by interpolation; what that "
    "does to a sine was taken out. Export them at their own rate.",
    "accelerometer-dead": "An accelerometer reads one value throughout: the housing's inertia along it stays in "
    "the force. Check it, or set the channel to ignore.",
    "calibration-uncertainty-unstated": "The manifest states no calibration uncertainty for some channels; the "
    "intervals hold random errors only for them. State `uncertainty` in the manifest.",
    "cells-against-set-points": "The load cells and the set points disagree alike in all runs: the gain of one or "
    "of the other is off.",
    "deflection-creeps": "In all dry tests alike the deflection goes on within the holds as the load went: a liner, a "
    "joint or a seal creeps. What the holds show of it was taken off; whether the next step ends it they do not show, "
    "and the interval holds both. Step faster, or hold until it stands.",
    "directional-rejection": "Rejected windows gather in some excitation directions: that is how physics looks, "
    "not glitches. Look at these runs before relying on the point.",
    "excitation-not-stated": "The table does not say how fast the shaft was shaken: once a turn was supposed. "
    "State excitation_Hz.",
    "frame-turned": "All sides of the polygon are turned alike: probes or pads stand at other angles than stated.",
    "harmonic on excitation line": "A harmonic of another excitation falls on this one. Excite the two apart.",
    "inertia-not-corrected": "Without accelerometers the housing's inertia stays in the force: small at low "
    "frequency, growing with its square.",
    "irregular": "The pads' clearances differ by more than their errors: worn, damaged or wrongly assembled pads.",
    "large-amplitude": "The vibration is more than 5 % of the clearance, and the film's harmonics do not show that it "
    "is still linear; or it is so large that no film is. Excite less, or check the probes.",
    "load-off-set-point": "The measured load of some runs misses its set point in size or direction.",
    "mains on excitation line": "The excitation is on the mains frequency: pick-up cannot be separated from "
    "signal, and the interval allows for it. Excite beside the mains frequency.",
    "methods-disagree": "Other estimators give another answer beyond both intervals, as they do where glitches or "
    "displacement noise pull them. See estimators.csv.",
    "misfit": "The points scatter more than their noise: something moved during the test.",
    "moves-aside": "The shaft slides far across the pad while it is pressed: only the part along the pad counts, "
    "but look at the pad's fit and at the probes.",
    "no-holds": "The load never stood still, so drift cannot be separated from deflection.",
    "no-instrument": "Neither a command channel nor repeats tell signal from noise over the band: noise on the "
    "displacements lowers H1, noise on the force raises H2, and the intervals reach from one to the other. Record the "
    "command, or excite periodically.",
    "no-reference": "The runs do not state two excitation directions, so they cannot serve as instruments.",
    "no-repeats": "Too few repeats per direction to measure the noise: displacement noise is not corrected for. "
    "Record longer.",
    "nonlinear-amplitude": "The coefficients change with the amplitude of vibration: they hold for this one only.",
    "pads-not-reached": "The sweep never touched some pads; their clearance is unknown.",
    "pivots-disagree": "In the sweep the pivots give another amount than the dry tests say.",
    "probe-gains-differ": "Channels beyond two contradict one another, or the sides of the clearance polygon stand at "
    "other angles than the pads do, as where one probe reads more than the other. Check their sensitivities.",
    "record-damaged": "A record had to be repaired when read, and part of it is lost. Copy it again from the rig.",
    "records-doubtful": "A check of the records found something to look at; `tpjb check` lists it all.",
    "run-gain-off": "In one run a probe or cell reads some per cent more or less than in the others of this "
    "point. Check its amplifier, range and cable there; leave the run out or repeat it.",
    "run-left-out": "A run at this point cannot be used and takes no part; the others stand.",
    "run-without-data": "A run gave no usable window and takes no part.",
    "runs-left-out": "Some runs cannot be used and take no part; the others stand.",
    "runs-refused": "Some static tests cannot be used, or are not what they claim to be; they take no part.",
    "samples-lost": "Many samples of the record were missing or disturbed.",
    "static-load-off": "The measured static load of a run misses its set point.",
    "static-load-turned": "The measured static load of a run, or of all, points elsewhere than its set point says.",
    "tach off set point": "The tachometer contradicts the set point of the speed; the set point was used.",
    "windows-missing": "Parts of the records gave no phasors and take no part.",
}
#: For information.
NOTES = {
    "no-static-force": "The load cells show no static force, as piezo-electric ones: whether runs meet their set "
    "point is not known.",
    "bad-steps": "Some load steps were left out because the record was disturbed there.",
    "contact-incomplete": "At low load the shaft is not fully in contact with this pad; the curve holds above the "
    "load named.",
    "drift-unknown": "No load direction was repeated, so a drift of the probes cannot be separated from a position. "
    "Repeat the first direction at the end.",
    "drive-not-locked": "The excitation's phase drifted between windows; they were turned to one phase first.",
    "excitation off set point": "The excitation was found at another frequency than the manifest says; the found "
    "one was used to fit.",
    "inertia-negligible": "There are no accelerometers; by its mass the housing's inertia is a small part of the "
    "force, also on soft cells.",
    "give-extrapolated": "The sweep pushes with less than the dry tests did: what the pivots give is "
    "extrapolated, and the sweep itself corrects it.",
    "give-from-sweep": "There are no pivot curves: what the pivots give under the push load was extrapolated.",
    "lines-left-out": "Lines of the shaft or the mains are in the band; the bins next to them are left out.",
    "law-undecided": "Several laws fit about equally well; the band holds their difference.",
    "load-off-pad": "The load is off the pad's direction; it was projected.",
    "mains corrected": "Pick-up on the mains frequency was estimated from the other runs and taken off.",
    "no-centre": "Without a clearance run positions count from the probes' zero, not from the bearing centre.",
    "no-physical-law": "No contact law describes the points; a smooth monotone curve stands in.",
    "no-spare-direction": "With two directions only, the interval holds how repeats differ, not how runs do. "
    "Excite in a third direction.",
    "structure-gives": "A compliant structure between bearing and probes bends the displacements of the dry tests; the "
    "curves hold it as well as the pivots.",
    "zero amplitude": "The runs have several amplitudes: K and C were extrapolated to none, where they are those of "
    "small motion.",
    "shaft lines fitted": "The drive turns with the shaft: what the shaft itself brings into the readings (runout, "
    "unbalance) was separated from the motion by the shaft's phase in runs of different directions, and taken off.",
    "speed drifts": "The shaft speed moved during the record; its lines were followed window by window.",
    "unexpected lines": "The records hold lines that the manifest does not explain; they were fitted along.",
}
#: Lines that may stand on the excitation beside those above: higher harmonics, and lines found in the record.
WARNINGS |= {
    f"{line} on excitation line": "Another line is on the excitation and cannot be separated from it. Excite elsewhere."
    for line in (
        *(f"{n}X" for n in range(4, 11)),
        *(f"{kind} {n}" for kind in ("mains", "harmonic") for n in range(2, 11)),
        "found",
    )
}
_BY_SEVERITY: tuple[tuple[Severity, dict[str, str]], ...] = (("error", ERRORS), ("warning", WARNINGS), ("note", NOTES))
#: Every condition by its name.
KINDS = {
    name: ConditionKind(name, severity, meaning) for severity, kinds in _BY_SEVERITY for name, meaning in kinds.items()
}


def condition_kind(name: str) -> ConditionKind:
    """Look a condition up."""
    kind = KINDS.get(str(name))
    if kind is None:
        near = nearest_name(name, KINDS)
        hint = f"Did you mean {near!r}?" if near else "tpjb_ident/condition_kinds.py lists them."
        raise UnknownConditionError(f"condition {str(name)!r} is not known. {hint}")
    return kind
