"""The conditions of the second field battery: two thirds good data in unusual form, one third bad data.

`wanted` is what an expert expects. *right*: intervals that hold, no error; beside it bounds of a direct coefficient's
error and of the median half-width in % of |h_ii|. *reported*: exit code 3 or 2, or an interval that allows for it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
from scipy.signal import butter, lfilter

from tests.rigs import closed_form as cf
from tests.rigs.acquisition import EXACT, GAP_VOLTS, VOLTS_PER_METRE, Acquisition, Campaign, Channel, Fault
from tests.studies.field import marched as mr

Entries = dict[str, Any]
#: Bounds on good data: ordinary instruments; where records tell less; where a delay is uncertain, or blows are short.
USUAL, WIDER, WIDE = (1.5, 2.0), (3.0, 4.0), (9.0, 16.0)
SMALL: Entries = {
    "film": cf.SMALL, "diameter": 0.05, "clearance": 30e-6, "speed": 10_000 / 60, "loads": (300.0,), "mass": 4.0,
    "springs": (4e7, 5e7), "frequencies": (117.0, 203.0),
}  # fmt: skip
LARGE: Entries = {
    "film": cf.LARGE, "diameter": 0.5, "clearance": 400e-6, "speed": 10.0, "loads": (1.5e5,), "mass": 2600.0,
    "springs": (9e9, 1.1e10), "frequencies": (6.5, 17.0), "seconds": 6.0,
}  # fmt: skip
FLOATING: Entries = {"mount": "floating", "mass": 21.0, "static": False}
HEAVY: Entries = {**FLOATING, "film": cf.HEAVY, "loads": (3000.0,), "mass": 60.0, "frequencies": (25.0, 45.0, 70.0)}
PLAIN: Entries = {"film": cf.PLAIN, "loads": (0.0,)}
NEGATIVE: Entries = {"film": cf.NEGATIVE, "loads": (2000.0,)}
SOFT: Entries = {"springs": (3e7, 4e7), "mass": 60.0}
STANDING: Entries = {"mount": "cells", "static": True, "frequencies": (20.0, 35.0, 55.0, 70.0)}
STIFF: Entries = {"springs": (4e9, 4e9), "mass": 8.0}
BAND: Entries = {"seconds": 6.0, "directions": (20.0, 110.0), "repeats": 2}
MARCHED: Entries = {"speed": 97.0, "shaft_mass": 200.0, "mass": 120.0, "seconds": 3.0, "unbalance": 0.004}
FOUNDATION: Entries = {"foundation": (2000.0, 1.5e8), "frequencies": (25.0, 40.0, 55.0)}
OCVIRK = mr.ShortBearing()
CLOCK_B = ('clock = "B"',)
DRIFT = ('temperature_coefficient = "0.04 %/K"', 'temperature_reference = "40 degC"')
FOR_RUNS = ('[[channels."X1A".for]]', 'runs = ["d-00*", "d-01*", "d-02*", "d-03*"]', 'sensitivity = "7.87 mV/um"')
AT_320: Entries = {"rate": 320.0, "extra": ('sample_rate = "320 Hz"',)}
TIME_2 = (Channel("Time 2", "time", 0.0, rate=250.0, extra=CLOCK_B),)


#: Reading of a probe that gives no volts [m].
NO_VOLTS = GAP_VOLTS / VOLTS_PER_METRE
#: What sensors and loggers do to values v [SI], by name; r is a generator, i the number of the run.
FAULTS: dict[str, Fault] = {
    "dead": lambda v, r, i: 1e-6 * v.std() * r.standard_normal(len(v)),
    "clipped": lambda v, r, i: np.minimum(v, v.mean() + 0.6 * (v.max() - v.mean())),
    "bits": lambda v, r, i: np.where(r.random(len(v)) < 0.002, np.nan, np.round(v / 2e-8) * 2e-8),  # 0.2 % missing
    "rounded": lambda v, r, i: np.round(2 * v) / 2,
    "glitches": lambda v, r, i: v + 12 * v.std() * (r.random(len(v)) < 0.05) * r.choice([-1.0, 1.0], len(v)),
    "few": lambda v, r, i: v + 12 * v.std() * (r.random(len(v)) < 0.01) * r.choice([-1.0, 1.0], len(v)),
    "spikes": lambda v, r, i: v + 10 * v.std() * np.isin(np.arange(len(v)) // 5, r.integers(0, len(v) // 5, 12)),
    "gaps": lambda v, r, i: np.where(np.isin(np.arange(len(v)) // 120, r.integers(0, len(v) // 120, 3)), np.nan, v),
    "slip": lambda v, r, i: np.concatenate([v[: 4400 + 40 * i], v[4408 + 40 * i :], v[-8:]]),  # 8 samples are lost
    "every other": lambda v, r, i: v * (1.15 if i % 2 else 1.0),
    "every third": lambda v, r, i: v * (0.8 if i % 3 == 0 else 1.0),
    "capacitor": lambda v, r, i: (
        NO_VOLTS + lfilter(*butter(1, 1.0, "high", fs=2000.0), np.append(v, v) - v.mean())[-len(v) :]
    ),
    "filter": lambda v, r, i: lfilter(*butter(4, 250.0, fs=2000.0), v - v[0]) + v[0],
    "input": lambda v, r, i: lfilter(*butter(1, 1.0, "high", fs=2000.0), v - v[0]),
    "second four": lambda v, r, i: v * (1.1 if 4 <= i < 8 else 1.0),
    "first four": lambda v, r, i: v * (7.87 / 7.78 if i < 4 else 1.0),
}


@dataclass(frozen=True)
class Condition:
    """One row of the battery."""

    name: str
    wanted: str
    make: Callable[[int], tuple[Campaign, Acquisition]]
    bound: float
    width: float


def rig(name: str, *sensors: tuple[str, Entries], **entries: Any) -> Condition:
    """A rig in closed form; `sensors` are pairs of channels' first letters and what is different with them."""
    wanted, limits = entries.pop("wanted", "right"), entries.pop("limits", USUAL)
    probes, stage = entries.pop("probes", (45.0, 135.0)), entries.pop("stage", 0.0)
    absent, more = entries.pop("without", "none"), entries.pop("more", ())
    setup = entries.pop("setup", {})
    plan = cf.Rig(**entries)

    def make(seed: int) -> tuple[Campaign, Acquisition]:
        channels = tuple(c for c in cf.channels_of(plan, probes, stage) if not c.name.startswith(absent)) + more
        for names, changes in sensors:
            channels = cf.with_entries(channels, names, **changes)
        noise = {"noise": cf.noise_of(plan)}
        return cf.campaign(plan, channels, [seed, crc32(name.encode())]), Acquisition(**noise, **setup)

    return Condition(name, wanted, make, *limits)


def bad(name: str, *sensors: tuple[str, Entries], **entries: Any) -> Condition:
    """A rig in closed form whose data must not pass as right."""
    return rig(name, *sensors, wanted="reported", **entries)


def march(name: str, wanted: str = "right", law: mr.Law = OCVIRK, **entries: Any) -> Condition:
    """A rig integrated in time; its noise hangs on the seed, its motion does not."""
    limits, quiet = entries.pop("limits", USUAL), entries.pop("quiet", 1.0)
    plan = cf.Rig(**{**MARCHED, **entries})

    def make(seed: int) -> tuple[Campaign, Acquisition]:
        campaign = mr.campaign(law, plan, cf.channels_of(plan))
        noise = cf.noise_of(mr.records(law, plan)[0])
        return campaign, Acquisition(noise={q: quiet * size for q, size in noise.items()})

    return Condition(f"marched: {name}", wanted, make, *limits)


def two_axes(x: float, y: float, names: str = "X1A X1B") -> tuple[tuple[str, Entries], ...]:
    """Two channels that really point to x and y deg."""
    first, second = names.split()
    return (first, {"true_axis": x}), (second, {"true_axis": y})


def good_rigs() -> list[Condition]:
    """Other sizes, films, mounts, sensors."""
    planes = ("X1A X1B", 0.03), ("X1C X1D", -0.03)
    planes = [(names, {"plane": z, "extra": (f'plane = "{1000 * z:g} mm"',)}) for names, z in planes]
    return [
        rig("plain sailing"),
        rig("two loads", loads=(3000.0, 6000.0), frequencies=(31.0,)),
        rig("50 mm at 10,000 rpm", **SMALL),
        rig("50 mm at 10,000 rpm, floating", **{**SMALL, **FLOATING, "mass": 2.5}),
        rig("500 mm at 600 rpm", **LARGE),
        rig("probes at 17 and 118 deg, cells at -30", probes=(17.0, 118.0), stage=-30.0),
        rig("three probes", probes=(45.0, 135.0, 270.0)),
        rig("three probes, one 0.6 % off", ("X1A", {"gain": 1.006}), probes=(45.0, 135.0, 0.0), limits=WIDER),
        rig("third probe dead", ("X1C", {"fault": FAULTS["dead"]}), probes=(45.0, 135.0, 270.0)),
        rig("two planes, tilt, stated", *planes, probes=(45.0, 135.0) * 2, tilt=2.0),
        rig("no static load, cross-coupled", limits=WIDER, **PLAIN),
        rig("no static load, cross-coupled, floating", limits=WIDER, **PLAIN, **FLOATING),
        rig("negative direct stiffness", limits=WIDER, **NEGATIVE),
        rig("negative direct stiffness, floating", limits=WIDER, **NEGATIVE, **FLOATING),
        rig("added mass, Re h below zero, floating", limits=WIDER, **HEAVY),
        rig("added mass, mount stated", limits=WIDER, head=('mount = "floating"',), **HEAVY),
        rig("floating", **FLOATING),
        rig("floating, shaft gives 4 %", shaft_compliance=4e-10, **FLOATING),
        rig("floating, cells show the pull", **{**FLOATING, "static": True}),
        rig("floating, light, no accelerometers", without="A1", **{**FLOATING, "mass": 0.4}),
        rig("soft cells", **SOFT),
        rig("foundation with a resonance of 44 Hz", **FOUNDATION),
        rig("accelerometers' inputs have a corner of 1 Hz", ("A1", {"fault": FAULTS["input"]})),
        rig("the same on soft cells", ("A1", {"fault": FAULTS["input"]}), **SOFT),
        rig("soft cells, added mass, four frequencies", limits=WIDER, **{**HEAVY, **SOFT, **STANDING}),
        rig("stiff cells, no accelerometers", without="A1", **STIFF),
        rig("stiff cells, an accelerometer dead", ("A1H", {"fault": FAULTS["dead"]}), **STIFF),
        rig("heavy shaft between shaker and film", shaft_mass=1400.0, directions=(0.0, 60.0, 120.0)),
        rig("two directions", directions=(10.0, 100.0), repeats=2, limits=WIDER),
        rig("a probe 1 deg off, 1 deg stated", ("X1", {"extra": ('axis_uncertainty = "1 deg"',)}),
            ("X1A", {"true_axis": 46.0}), limits=WIDER),
        rig("cells without a static part", static=False),
        rig("springs beside the film, dry runs", beside=(2e7, 3e7)),
        rig("clearance run in the campaign", with_clearance=True),
    ]  # fmt: skip


def good_records() -> list[Condition]:
    """Good data in unusual form."""
    image, slow = {"frequencies": (37.0, 61.0)}, {"rate": 250.0, "extra": CLOCK_B}
    spline = {"rate": 250.0, "fill": "spline", "fault": FAULTS["rounded"]}
    drift = {"drift": 4e-4, "extra": DRIFT}
    exact = {"uncertainty": EXACT}
    late = {"late": 3e-4, "extra": ('delay_uncertainty = "0.3 ms"',)}
    return [
        rig("cells at 320 Hz in columns of their own", ("L1", AT_320), **image),
        rig("cells and accelerometers at 250 Hz, own times", ("L1 A1", slow), more=TIME_2, **image),
        rig("the same as csv", ("L1 A1", slow), more=TIME_2, setup={"form": "csv", "time_digits": 5}, **image),
        rig("cells from 320 Hz, linear", ("L1", {"rate": 320.0, "fill": "linear"}), **image),
        rig("probes from 400 Hz, held", ("X1", {"rate": 400.0, "fill": "hold"}), **image),
        rig("cells from 250 Hz, spline, rounded", ("L1", spline), **image),
        rig("cells from 160 Hz, linear", ("L1", {"rate": 160.0, "fill": "linear"}), frequencies=(13.0, 29.0)),
        rig("16-bit steps, 0.2 % missing", ("X1", {"fault": FAULTS["bits"]})),
        rig("German csv, times of 4 digits", setup={"form": "csv", "time_digits": 4}, seconds=3.0),
        rig("second clock, 100 ppm, stated", ("L1 A1", {"ppm": 100.0, "extra": CLOCK_B}), seconds=6.0),
        rig("probes' clock -300 ppm, stated", ("X1", {"ppm": -300.0, "extra": CLOCK_B}), seconds=6.0),
        rig("cells late by 0.3 ms, +-0.3 ms stated", ("L1", late), limits=WIDE),
        rig("accelerometers late by 0.3 ms, +-0.3 ms stated", ("A1", late)),
        rig("probes late by 0.4 ms, stated", ("X1", {"late": 4e-4, "extra": ('delay = "0.4 ms"',)})),
        rig("probes behind capacitors", ("X1", {"fault": FAULTS["capacitor"]}), limits=WIDE, setup=exact),
        rig("a probe drifts by 0.04 %/K, stated", ("X1A", drift), temperatures=(30.0, 60.0)),
        rig("described twice, for some runs", ("X1A", {"extra": FOR_RUNS, "fault": FAULTS["first four"]})),
        rig("shaft turns clockwise", head=("[shaft]", 'rotation = "clockwise"')),
        rig("cells not tared", ("L1H", {"zero": 160.0}), loads=(3000.0, 5000.0, 8000.0), frequencies=(25.0,)),
        rig("5 % isolated bad readings in a probe", ("X1B", {"fault": FAULTS["glitches"]})),
        rig("5 % bad readings in a cell and a probe", ("X1A L1V", {"fault": FAULTS["glitches"]})),
        rig("spikes in the cells", ("L1", {"fault": FAULTS["spikes"]})),
        rig("dropouts in the probes", ("X1", {"fault": FAULTS["gaps"]})),
        rig("drive real at 25.13 Hz for 25", detune=0.13),
        rig("drive starts at 40 %", share=(0.4, 1.0)),
        rig("drive on from 30 to 80 %, floating", share=(0.3, 0.8), **FLOATING),
        rig("drive steps to 40 % in mid record, other phase", switch=0.4),
        rig("drive steps to 180 % in mid record, floating", switch=1.8, **FLOATING),
        rig("drive wanders by 0.06 Hz", wander=0.06),
        rig("drive wanders by 0.15 Hz, 6 s", wander=0.15, seconds=6.0),
        rig("a line 0.35 Hz below the drive", lines=((24.65, 0.4), (44.65, 0.4)), seconds=6.0),
        rig("a line 0.4 Hz above the drive, floating", lines=((25.4, 0.3), (45.4, 0.3)), **FLOATING),
        rig("shaft at twice the drive", speed=64.0, frequencies=(32.0, 45.0), unbalance=0.8),
        rig("mains at twice the drive", setup={"hum": {"displacement": 2e-7, "force": 20.0}}),
        rig("whirl at 0.47 X, 1.2 Hz beside the drive", speed=50.0, lines=((23.8, 1.5),)),
        rig("1X of 6 % of the clearance, linear film", unbalance=4.0),
    ]  # fmt: skip


def good_bands() -> list[Condition]:
    """Excited over a band."""
    random, tones = {**BAND, "excitation": "random"}, {**BAND, "excitation": "multisine"}
    idle = ("CMDY", {"noise": 3.0})
    blows = {**FLOATING, **BAND, "excitation": "impact", "band": (8.0, 120.0)}
    return [
        rig("random", **random),
        rig("random, one command at rest", idle, **{**random, "directions": (0.0, 90.0)}),
        rig("random, quiet first and last second", share=(0.17, 0.83), **random),
        rig("random, no power from 40 to 60 Hz", notch=(40.0, 60.0), **random),
        rig("random over two thirds of the stated band", notch=(62.0, 91.0), **random),
        rig("random, floating, added mass", limits=WIDER, **{**HEAVY, **random}),
        rig("random, soft cells, accelerometers' corner of 1 Hz", ("A1", {"fault": FAULTS["input"]}), **SOFT, **random),
        rig("random, no command", without="CMD", limits=WIDER, **random),
        rig("random, cells at 320 Hz in columns of their own", ("L1", AT_320), **random),
        rig("multi-sine, cells and accelerometers at 320 Hz", ("L1 A1", AT_320), **tones),
        rig("random, 1 % bad readings in a probe", ("X1B", {"fault": FAULTS["few"]}), limits=WIDER, **random),
        rig("random, foundation", **{**random, "foundation": (2000.0, 4e8)}),
        rig("multi-sine that starts late", share=(0.4, 1.0), **tones),
        rig("sweep with quiet parts", share=(0.15, 0.8), **{**BAND, "excitation": "sweep"}),
        rig("multi-sine", **tones),
        rig("multi-sine, one command at rest", idle, **{**tones, "directions": (0.0, 90.0)}),
        rig("multi-sine, times of 4 digits", setup={"rate": 2048.0, "time_digits": 4}, **tones),
        rig("multi-sine, tones beside the mains", setup={"hum": {"force": 15.0}}, **tones),
        rig("multi-sine, odd lines, some left out", tones="some odd", **tones),
        rig("multi-sine, 500 mm", **{**LARGE, **tones, "band": (4.0, 30.0)}),
        rig("blows in both senses, floating", ("X1 L1", {"noise": 0.2}), limits=WIDE, **blows),
    ]


def marched_rigs() -> list[Condition]:
    """Films that are not linear: small motion must be right, large motion told."""
    fast = {**SMALL, "shaft_mass": 14.0, "mass": 9.0, "springs": (1e8, 1e8), "frequencies": (61.0, 97.0)}
    hung = {"mount": "floating", "mass": 90.0}
    curved, cubic, pads = mr.CubicFilm(square=-2.0), mr.CubicFilm(cube=3.0), mr.CubicFilm(cube=2.0, square=-1.5)
    band = {**BAND, "band": (6.0, 70.0), "seconds": 4.0}
    random, tones, blows = ({**band, "excitation": name} for name in ("random", "multisine", "impact"))
    quiet: Entries = {"quiet": 0.2, "limits": WIDER}
    return [
        march("short bearing"),
        march("short bearing, floating", **hung),
        march("short bearing, 50 mm, 10,000 rpm", law=mr.ShortBearing(30e-6, 10_000 / 60, 100.0), **fast),
        march("cross-coupled, no static load", law=mr.CubicFilm(cf.PLAIN, cube=1.0), loads=(0.0,), limits=WIDER),
        march("like pads", law=pads),
        march("like pads, floating", law=pads, **hung),
        march("drive starts at 35 %", law=pads, share=(0.35, 1.0)),
        march("drive steps down in mid record", law=pads, switch=0.4),
        march("drive wanders", law=pads, wander=0.08),
        march("multi-sine, 0.2 % rms", law=pads, amplitude=0.002, quiet=0.2, limits=WIDER, **tones),
        march("random, 0.3 % rms", law=pads, amplitude=0.003, quiet=0.2, limits=WIDER, **random),
        march("blows in both senses, 2 %", law=curved, amplitude=0.02, quiet=0.1, limits=WIDE, **blows),
        march("odd multi-sine, 2 % rms", law=pads, amplitude=0.02, tones="odd", **quiet, **tones),
        march("odd multi-sine, some left out, 2 % rms", law=pads, amplitude=0.02, tones="some odd", **quiet, **tones),
        march("multi-sine, 1X of 3 %", law=pads, amplitude=0.003, unbalance=0.03, **quiet, **tones),
        march("random, 1X of 6 %", law=pads, amplitude=0.003, unbalance=0.06, **quiet, **random),
        march("short bearing, random, 1X of 10 %", "reported", amplitude=0.003, unbalance=0.1, quiet=0.2, **random),
        march("short bearing, sine of 3 %", "reported", amplitude=0.03),
        march("sine of 12 %", "reported", pads, amplitude=0.12),
        march("short bearing, sine of 20 %, floating", "reported", amplitude=0.2, **hung),
        march("symmetric film, sine of 20 %", "reported", cubic, amplitude=0.2),
        march("symmetric film, 1X of 12 %", "reported", cubic, unbalance=0.12, amplitude=0.01),
        march("1X of 10 %", "reported", pads, unbalance=0.1, amplitude=0.01),
        march("multi-sine of one phase set, 3 % rms", "reported", pads, amplitude=0.03, **tones),
        march("symmetric film, multi-sine, 6 % rms", "reported", cubic, amplitude=0.06, **tones),
        march("blows in one sense, 6 %", "reported", curved, amplitude=0.06, senses=(1.0,), quiet=0.2, **blows),
        march("random, 8 % rms", "reported", pads, amplitude=0.08, **random),
        march("short bearing, random, 8 % rms", "reported", amplitude=0.08, **random),
        march("whirl", "reported", speed=150.0, law=mr.ShortBearing(speed=150.0), loads=(800.0,)),
    ]


def bad_data() -> list[Condition]:
    """Faults of sensors, wiring, devices, plans."""
    inverted, square = {"gain": -1.0}, {"probes": (0.0, 90.0)}
    warming = {"temperatures": (20.0, 60.0), "frequencies": (25.0,)}
    loud = {"hum": {"force": 40.0, "displacement": 5e-7}}
    filtered, random = {"fault": FAULTS["filter"]}, {**BAND, "excitation": "random"}
    return [
        bad("probes at 45 deg described at 0, clearance run", *two_axes(45, 135), with_clearance=True, **square),
        bad("probes 30 deg off, clearance run", *two_axes(75, 165), with_clearance=True),
        bad("probes 30 deg off, a third one contradicts", *two_axes(75, 165), probes=(45.0, 135.0, 270.0)),
        bad("probes exchanged", *two_axes(90, 0), **square),
        bad("probes exchanged, floating", *two_axes(90, 0), **square, **FLOATING),
        bad("both probes see one axis", ("X1B", {"true_axis": 45.0})),
        bad("one probe inverted", ("X1B", inverted), **square),
        bad("both probes inverted", ("X1", inverted)),
        bad("both probes inverted, floating, no static load", ("X1", inverted), **PLAIN, **FLOATING),
        bad("cells inverted", ("L1", inverted)),
        bad("cells read twice as much", ("L1", {"gain": 2.0})),
        bad("probes' sensitivity ten times off, clearance run", ("X1", {"gain": 10.0}), with_clearance=True),
        bad("a cell dead", ("L1H", {"fault": FAULTS["dead"]})),
        bad("a probe clipped", ("X1A", {"fault": FAULTS["clipped"]})),
        bad("a probe's gain 15 % up in every other run", ("X1A", {"fault": FAULTS["every other"]})),
        bad("a cell's gain 20 % down in every third run", ("L1V", {"fault": FAULTS["every third"]})),
        bad("runs differ by 15 %", stiffness_scatter=0.15),
        bad("a probe 10 % up at one of four frequencies", ("X1A", {"fault": FAULTS["second four"]}), **STANDING),
        bad("a probe drifts by 0.1 %/K, not stated", ("X1A", {"drift": 1e-3}), repeats=2, **warming),
        bad("no accelerometers, floating and heavy", without="A1", **HEAVY),
        bad("no accelerometers, soft cells", without="A1", **SOFT),
        bad("housing of 45 kg stated as 30, soft cells", stated_mass=30.0, **{**SOFT, **STANDING, "mass": 45.0}),
        bad("the same, random", stated_mass=30.0, **{**SOFT, **BAND, "mass": 45.0, "excitation": "random"}),
        bad("accelerometers inverted, floating", ("A1", inverted), **HEAVY),
        bad("accelerometers exchanged, soft cells", *two_axes(90, 0, "A1H A1V"), **SOFT),
        bad(
            "floating, the shaft's pedestal resonates",
            head=('mount = "floating"',),
            limits=WIDER,
            **{**FLOATING, "foundation": (2000.0, 6e8), "frequencies": (25.0, 60.0)},
        ),
        bad("accelerometers inverted, foundation", ("A1", inverted), **FOUNDATION),
        bad("accelerometers exchanged, foundation", *two_axes(90, 0, "A1H A1V"), **FOUNDATION),
        bad("accelerometers late by 2 ms, floating", ("A1", {"late": 2e-3}), **HEAVY),
        bad("cells late by 1 ms, soft, not stated", ("L1", {"late": 1e-3}), **SOFT),
        bad("probes late by 1 ms, floating, not stated", ("X1", {"late": 1e-3}), **HEAVY),
        bad("cells' clock 300 ppm, not stated", ("L1 A1", {"ppm": 300.0}), seconds=6.0),
        bad("cells lose 8 samples in each record", ("L1 A1", {"fault": FAULTS["slip"]})),
        bad("probes behind a filter that is not stated", ("X1", filtered)),
        bad("probes behind a filter, random", ("X1", filtered), **random),
        bad("probes behind a filter, multi-sine", ("X1", filtered), **{**random, "excitation": "multisine"}),
        bad("probes 15 deg off", *two_axes(60, 150)),
        bad("mass of a floating stator stated in lb", stated_mass=46.3, frequencies=(25.0, 45.0, 70.0), **FLOATING),
        bad("rate stated as 2.5 kHz", setup={"nominal_rate": 2500.0}),
        bad("one direction", directions=(30.0,), repeats=4),
        bad("drive on 1X", speed=25.0, unbalance=0.5, frequencies=(25.0,)),
        bad("mains on the only line", setup=loud, frequencies=(50.0,)),
        bad("drive far below the noise", amplitude=2e-6),
    ]


def conditions() -> list[Condition]:
    """Every condition."""
    return good_rigs() + good_records() + good_bands() + marched_rigs() + bad_data()
