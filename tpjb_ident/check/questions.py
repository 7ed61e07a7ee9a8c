"""Every question that the check asks a run: from which answer on it is told, where, in which words, and what to do.

A question compares one number with its limits; which number it is, the other files of this folder say.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rigdata.arrays import BoolArray, FloatArray

_NEVER = math.inf


class Question(NamedTuple):
    """Limits beyond which an answer is a note, a warning, an error; `{names}` are the channels that are asked."""

    limits: tuple[float, float, float]
    place: str
    text: str
    cure: str
    of_channels: bool = False  #: whether it is the channels' nature, in whatever run they serve


_NOTE, _WARNING, _ERROR = (0.0, _NEVER, _NEVER), (_NEVER, 0.0, _NEVER), (_NEVER, _NEVER, 0.0)
_CHANNEL, _CHANNELS, _FORCE, _ANSWER = "channel {names}", "channels {names}", "mean force", "displacement and force"
_CALIBRATION = "Check sensitivity, unit and full_scale of the channels in the manifest"
_WIRING = "Check axis, polarity and cables of the probes (and of the cells)"
_DIFFERS = "differs by {size:.1%} from the other runs at this operating point"
_RUN = "Check this run's channels and set points; leave it out or repeat it"
_TIMES = "Times are used as they are; check the logger"

QUESTIONS = {
    # one channel
    "empty": Question(_ERROR, _CHANNEL, "holds no values at all", "Check the channel's wiring and logger settings"),
    "missing": Question(
        (0.0, 0.01, 0.5),
        _CHANNEL,
        "{missing} of {samples} samples have no value ({size:.1%})",
        "They are left out; repeat the run if they are many",
    ),
    "dead": Question(
        _ERROR,
        _CHANNEL,
        "is dead: it reads {low:g} {unit} throughout",
        "Check sensor, cable and amplifier; repeat the run, or set the channel to ignore",
    ),
    "constant": Question(_NOTE, _CHANNEL, "reads {low:g} {unit} throughout", "Check that it is alive"),
    "stuck": Question(
        (0.0, 0.05, 0.25),
        _CHANNEL,
        "stands still for {longest_flat} samples from sample {flat_start} on ({size:.0%} of the run)",
        "Check sensor and logger; repeat the run if much of it is lost",
    ),
    "clipped": Question(
        (_NEVER, 0.0, 0.05),
        _CHANNEL,
        "{size:.1%} of the samples sit flat at an extreme reading (limits {low:g} and {high:g} {unit}): clipped",
        "Widen the logger's range and repeat the run",
    ),
    "temperature": Question(
        _WARNING, _CHANNEL, "reads from {cold:.0f} to {hot:.0f} degC", "Check sensitivity, zero and wiring"
    ),
    "no noise": Question(_NOTE, "", "the readings show no noise", "Nothing, if the data are computed"),
    # clocks
    "short": Question(_ERROR, "time", "the record holds only {samples} samples", "Export the run again"),
    "short of cycles": Question(
        _WARNING,
        "time",
        "the record holds only {cycles:.1f} cycles of the excitation",
        "Record five cycles at least",
    ),
    "too short": Question(_WARNING, "time", "is too short: {error}", "Record longer"),
    "nyquist": Question(
        _ERROR,
        "time",
        "{rate:g} samples per second cannot show an excitation of {excitation:g} Hz",
        "Check sample_rate, the unit of the time column (ms called s?) and excitation_frequency",
    ),
    "gap": Question(
        (0.0, 0.005, _NEVER),
        "time",
        "{gaps} gaps, about {lost:.0f} samples lost, the longest of {longest:.6g} s after sample {sample}",
        _TIMES,
    ),
    "jitter": Question((0.02, 0.2, _NEVER), "time", "{cause}: steps scatter by {scatter:.0%} of a sample", _TIMES),
    "rate": Question(
        (_NEVER, 0.01, math.log(10.0)),
        "sample rate",
        "the file shows {rate:g} Hz, the manifest states {stated:g} Hz",
        "Check the unit of the time column, and sample_rate",
    ),
    # set points
    "turning": Question(
        (_NEVER, 0.5, _NEVER),
        "speed channel",
        "shows {shown:.3g} Hz in a run without rotation",
        "Check the channel, kind and shaft_speed",
    ),
    "speed": Question(
        (_NEVER, 0.03, 0.1),
        "speed channel",
        "shows {shown:.4g} Hz, shaft_speed says {stated:.4g} Hz",
        "Check shaft_speed and the channel's sensitivity",
    ),
    "rotation": Question(
        _WARNING,
        "force at running speed",
        "shows a force at running speed that goes round {other}, but the shaft is said to turn {stated}",
        "Check rotation in [shaft] or the runs; if it is right, left and right are exchanged: the sign of a cell or "
        "probe along X, or two exchanged cells or probes",
    ),
    "no static force": Question(
        _NOTE, _FORCE, "is none, as of piezo-electric cells", "Nothing; static loads are taken as set"
    ),
    "load size": Question(
        (_NEVER, 0.1, 0.34),
        _FORCE,
        "is {shown:.4g} N, static_load says {stated:.4g} N",
        "Check sensitivity, full_scale and excitation of the cells, and static_load",
    ),
    "load direction": Question(
        (_NEVER, 10.0, 30.0),
        _FORCE,
        "points to {shown:.0f} deg, static_load_direction is {stated:g} deg",
        "Check the cells' axis and polarity, their cables, and static_load_direction",
    ),
    "load ratio": Question(
        _WARNING,
        _FORCE,
        "is {share:+.1%} in size and {turn:+.1f} deg in direction off what the set point and the other runs of the "
        "campaign let one expect",
        "Check static_load and its direction in this run, and the gain of the cells",
    ),
    "no excitation": Question(
        _ERROR,
        "force",
        "the force shows no line at the excitation frequency of {stated:g} Hz",
        "Check excitation_frequency, and whether the actuators ran; repeat the run",
    ),
    "excitation direction": Question(
        (_NEVER, 10.0, 30.0),
        "force",
        "the excitation shows along {shown:.0f} deg, excitation_direction says {stated:g} deg",
        "Check excitation_direction, and the cells' axes and cables",
    ),
    # sizes that no rig can show
    "travel": Question(
        (_NEVER, 1e-3, _NEVER),
        _CHANNEL,
        "the shaft travels by {size:.2g} m, more than a film bearing lets it",
        "Check the sensitivity of the probe, and for loose cables",
    ),
    "still": Question(
        (_NEVER, 1.0, 5.0),
        _CHANNEL,
        "shows {travel:.2g} m of vibration, run-out and noise together: no probe resolves that",
        _CALIBRATION,
    ),
    "no motion": Question(
        (_NEVER, 1.0, 3.0),
        _ANSWER,
        "the shaft moves by {motion:.2g} m at the excitation, a film would let it move further",
        _CALIBRATION,
    ),
    "beyond clearance": Question(
        (_NEVER, 0.0, 1e-3),
        _ANSWER,
        "load over dynamic stiffness is {size:.3g} m: beyond the clearance of a bearing for that load",
        _CALIBRATION,
    ),
    "soft cells": Question(
        (_NEVER, _NEVER, 5e-4),
        "acceleration and force",
        "cells that give way by {size:.2g} m under the static load carry no bearing: the accelerations are too large "
        "for the forces",
        _CALIBRATION,
    ),
    "stiff cells": Question(
        (_NEVER, 1e11, _NEVER),
        "acceleration and force",
        "the housing hardly accelerates for the forces on its cells",
        _CALIBRATION,
    ),
    "weight": Question(
        (_NEVER, _NEVER, 3.0),
        "[housing] mass",
        "a stator of {mass:g} kg weighs {size:.3g} times the largest static load, {load:g} N",
        "Check the mass and its unit",
    ),
    # runs beside one another
    "position": Question(
        _ERROR,
        _CHANNEL,
        "reads {off:+.0f} um on average beside other runs of its kind; the gap voltage is constant within a campaign",
        "Check the probe: moved, wrong sign, wrong sensitivity in this run?",
    ),
    "step": Question(
        _WARNING,
        _CHANNEL,
        "reads {off:+.0f} um on average beside the other runs at this operating point",
        "Check probe and amplifier: moved, or another gain in this run?",
    ),
    "shaft line": Question(
        _WARNING,
        _CHANNEL,
        "shows {size:.2g} times the motion at running speed that it shows in the other runs",
        "Check the range of its amplifier in this run; or the shaft's balance changed",
    ),
    "signs": Question(
        (_NEVER, 0.0, 1.0), _CHANNELS, "answer the force as no film does, to the other side or before it acts", _WIRING
    ),
    "scales": Question(
        (_NEVER, 6.0, _NEVER),
        _CHANNELS,
        "{larger} moves {size:.0f} times more per force than {smaller}; as if one sensitivity were ten times off",
        "Check the sensitivities of the two probes",
    ),
    "disagrees": Question((_NEVER, 0.0, 0.5), _ANSWER, _DIFFERS, _RUN),
    "miswired": Question((_NEVER, 0.0, 0.2), _ANSWER, _DIFFERS, _RUN),
    "gain": Question(
        (_NEVER, 0.0, 0.2),
        _CHANNEL,
        "reads {share:.1%} too {direction} (standard error {error:.1%}) beside the other runs at this operating point",
        "Check this channel's amplifier, range and cable in this run; leave it out or repeat it",
    ),
    "housing": Question(
        _WARNING,
        _CHANNELS,
        "differs by {size:.0%} from what the housing's mount and the other runs foretell",
        "Check polarity, cables and sensitivity of the accelerometers in this run",
    ),
    "duplicate": Question(
        _ERROR,
        "",
        "holds the very samples of run {other} ({file})",
        "One of the two is a copy: find the right file, or delete the run",
    ),
    "shared": Question(
        _NOTE,
        "",
        "shares its record with run {other}, at another excitation frequency",
        "Nothing, if both lines were excited at once",
    ),
    # static tests
    "side": Question(
        (_NEVER, 0.0, 1.0), _CHANNELS, "the shaft does not go to the side to which the load pushes it", _WIRING, True
    ),
    "aside": Question(_ERROR, _CHANNELS, "{what}", _WIRING, True),
    "turned": Question(
        (_NEVER, 12.0, 20.0),
        _CHANNELS,
        "the shaft lies {angle:+.0f} deg from where the load pushes it, as if the probes stood there",
        "Check the axes of the probes (and of the cells)",
        True,
    ),
    "place": Question(
        _WARNING,
        "displacement",
        "the mean position lies {off:.0f} um from where the other directions let one expect it",
        "Check the probes of this run: sign, sensitivity, moved?",
    ),
    "pad": Question(
        _ERROR,
        "pad",
        "pad {pad} is loaded toward {shown:.0f} deg{beside}",
        "One of the runs names the wrong pad: correct it",
    ),
}


def far(distances: FloatArray, least: float, many: float, count: int = 4) -> BoolArray:
    """Which of some values lie further off than the others: by `many` times their median distance, `least` at least.

    None where they are fewer than `count`.
    """
    if len(distances) < count:
        return np.zeros(len(distances), dtype=bool)
    return np.asarray(distances > max(least, many * float(np.median(distances))))
