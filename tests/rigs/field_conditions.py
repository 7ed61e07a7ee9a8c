"""The rows of the battery: what a rig elsewhere has, and what becomes of the coefficients there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import bessel, butter, freqs

from tests.rigs.campaign_file import plans_of
from tests.rigs.closed_form_bearing import Bearing
from tests.rigs.field_rig import CHANNELS, Device, Plan, Rig

CELLS, PROBES, ACCELEROMETERS = (
    tuple(n for n, (q, _) in CHANNELS.items() if q == quantity)
    for quantity in ("force", "displacement", "acceleration")
)
NO_ACCELEROMETERS = (*PROBES, *CELLS)


@dataclass(frozen=True)
class Row:
    """One condition: rig, runs, what the manifest says more, and what shall become of it ("right" or "told")."""

    name: str
    rig: Rig
    plans: Sequence[Plan] = field(default_factory=plans_of)
    extra: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    wish: str = "right"


def devices(names: Sequence[str], device: Device) -> dict[str, Device]:
    """The same device on several channels."""
    return dict.fromkeys(names, device)


def filtered(design: Callable, order: int, corner: float) -> Callable[[float], complex]:
    """Response of an analogue low-pass over frequency [Hz]."""
    norm = {"norm": "mag"} if design is bessel else {}
    b, a = design(order, 2 * np.pi * corner, analog=True, **norm)
    return lambda f: complex(freqs(b, a, [2 * np.pi * f])[1][0])


def stated(names: Sequence[str], **keys: str) -> dict[str, dict[str, str]]:
    """The same keys for several channels of the manifest."""
    return {name: {k: f'"{v}"' for k, v in keys.items()} for name in names}


def _clipped(share: float, only: str = "") -> Callable:
    def reading(values: np.ndarray, run: str, rng: np.random.Generator) -> np.ndarray:
        middle = np.median(values)
        edge = share * np.quantile(np.abs(values - middle), 0.995)
        return np.clip(values, middle - edge, middle + edge) if only in run else values

    return reading


def _lost(share: float) -> Callable:
    def reading(values: np.ndarray, run: str, rng: np.random.Generator) -> np.ndarray:
        values = values.copy()
        values[int(len(values) * (1 - share)) :] = np.nan
        return values

    return reading


def _glitched(count: int, size: float) -> Callable:
    def reading(values: np.ndarray, run: str, rng: np.random.Generator) -> np.ndarray:
        values = values.copy()
        for start in rng.integers(0, len(values) - 40, count):
            values[start : start + rng.integers(3, 40)] += size * rng.choice([-1, 1])
        return values

    return reading


def _quantised(step: float) -> Callable:
    return lambda values, run, rng: np.round(values / step) * step


def rows() -> list[Row]:
    """All conditions, clean ones first."""
    return [*_clean(), *_clocks(), *_lines(), *_channels(), *_loads(), *_samples()]


def _clean() -> list[Row]:
    base = Rig()
    seven = plans_of(loads=(5000.0,), frequencies=(10, 20, 25, 30, 40, 50, 60))
    return [
        Row("clean, three loads", base),
        Row("clean, seven frequencies", base, seven),
        Row("clean, one load", base, plans_of(loads=(5000.0,))),
        Row("clean, no accelerometers, stiff cells", replace(base, channels=NO_ACCELEROMETERS, housing_mass=1.0)),
        Row("clean, 16-bit steps", replace(base, devices={
            **devices(PROBES, Device(reading=_quantised(15e-9))), **devices(CELLS, Device(reading=_quantised(0.6)))})),
        Row("clean, half the noise in steps", replace(base, noise=0.2, devices={
            **devices(PROBES, Device(reading=_quantised(50e-9))), **devices(CELLS, Device(reading=_quantised(4.0)))})),
        Row("clean, ten times the noise", replace(base, noise=10.0)),
        Row("clean, glitches", replace(base, devices=devices(("D1", "F2"), Device(reading=_glitched(3, 2e-5))))),
        Row("clean, 60 Hz mains, off the line", replace(base, mains=60.0)),
        Row("clean, cells with 1 % loss", replace(base, cell_loss=0.01)),
        Row("clean, four directions, two loads", base, plans_of(loads=(4000.0, 6000.0), directions=4)),
        Row("clean, 10 s at 1 kHz", replace(base, rate=1000.0, seconds=10.0), plans_of(loads=(3000.0, 6000.0))),
        Row("clean, 3 % of clearance", replace(base, bearing=Bearing(second=3.0, third=5.0), amplitude=0.1)),
    ]  # fmt: skip


def _clocks() -> list[Row]:
    long = replace(Rig(), seconds=30.0, rate=1000.0)
    few = plans_of(loads=(5000.0,))
    seven = plans_of(loads=(5000.0,), frequencies=(10, 20, 25, 30, 40, 50, 60))
    bare = replace(Rig(), channels=NO_ACCELEROMETERS, housing_mass=1.0)
    found = [
        Row(f"cells' clock {ppm:g} ppm off, 30 s", replace(long, devices=devices(CELLS, Device(ppm * 1e-6))), few)
        for ppm in (20, 50, 100, 300)
    ]
    found += [
        Row(f"cells' clock {ppm:g} ppm off, 3 s", replace(Rig(), devices=devices(CELLS, Device(ppm * 1e-6))))
        for ppm in (100, 300)
    ]
    found += [
        Row(f"cells at {slow:g} Hz, interpolated", replace(Rig(), devices=devices(CELLS, Device(slow=slow))))
        for slow in (150.0, 300.0, 500.0, 600.0)
    ]
    found.append(Row("cells at 250 Hz, held", replace(Rig(), devices=devices(CELLS, Device(slow=250.0, hold=True)))))
    late = {lag: devices(CELLS, Device(lag=lag)) for lag in (1e-4, 3e-4, 1e-3)}
    slack = Device(response=filtered(bessel, 4, 200.0))
    bessel4 = stated(CELLS, filter="bessel 4 low 200 Hz")
    butter2 = Device(response=filtered(butter, 2, 400.0))
    found += [Row(f"cells {1e3 * lag:g} ms late, accelerometers", replace(Rig(), devices=d)) for lag, d in late.items()]
    found += [
        Row("cells 0.3 ms late, none stated, no accelerometers, seven frequencies",
            replace(bare, devices=late[3e-4], bearing=Bearing(M=((0, 0), (0, 0)))), seven, wish="told"),
        Row("cells 1 ms late, delay stated", replace(bare, devices=late[1e-3]), extra=stated(CELLS, delay="1 ms")),
        Row("cells 0.1 ms late, uncertainty 0.1 ms stated", replace(bare, devices=late[1e-4]),
            extra=stated(CELLS, delay_uncertainty="0.1 ms")),
        Row("Bessel 200 Hz on cells, accelerometers", replace(Rig(), devices=devices(CELLS, slack)), wish="told"),
        Row("Bessel 200 Hz on cells, seven frequencies", replace(Rig(), devices=devices(CELLS, slack)), seven,
            wish="told"),
        Row("Bessel 200 Hz on cells, filter stated", replace(Rig(), devices=devices(CELLS, slack)), extra=bessel4),
        Row("Butterworth 400 Hz on probes, filter stated", replace(Rig(), devices=devices(PROBES, butter2)),
            extra=stated(PROBES, filter="butterworth 2 low 400 Hz")),
    ]  # fmt: skip
    return found


def _lines() -> list[Row]:
    base = Rig()
    on_60 = plans_of(loads=(2500.0, 5000.0, 8750.0), frequencies=(60.0,))
    both = plans_of(loads=(5000.0, 8750.0), frequencies=(25.0, 60.0))
    strong = {"displacement": 0.3e-6, "force": 10.0}
    found = [
        Row("drive at 25.3 Hz, set point 25", replace(base, real_frequency=25.3)),
        Row("drive at 25.05 Hz, set point 25", replace(base, real_frequency=25.05)),
        Row("60 Hz mains on the only line", replace(base, mains=60.0, pickup=strong), on_60, wish="told"),
        Row("60 Hz mains on a line, seen elsewhere", replace(base, mains=60.0, pickup=strong), both),
        Row("60 Hz mains stated, on a line", replace(base, mains=60.0, pickup=strong), both,
            {"acquisition": {"mains": '"60 Hz"'}}),
        Row("60 Hz mains on the cells", replace(base, mains=60.0, pickup={"displacement": 0.0, "force": 60.0}), both),
        Row("50 Hz mains on a 50 Hz line, only one", replace(base, pickup=strong),
            plans_of(loads=(2500.0, 5000.0, 8750.0), frequencies=(50.0,)), wish="told"),
    ]  # fmt: skip
    turning = replace(base, locked=True, runout=(6e-6, 2e-6, 1e-6))
    found += [
        Row(f"drive locked to {n}X", turning, plans_of(frequencies=(22.0 * n,)), wish="told" if n == 1 else "right")
        for n in (1, 2, 3)
    ]
    found += [
        Row(f"drive locked to {n}X, keyphasor", replace(turning, keyphasor=True), plans_of(frequencies=(22.0 * n,)))
        for n in (1, 2, 3)
    ]
    found += [
        Row("drive locked to 1X, keyphasor, two directions", replace(turning, keyphasor=True),
            plans_of(frequencies=(22.0,), directions=2, repeats=2), wish="told"),
        Row("1X on the line, not locked", replace(base, shaft=25.0), wish="told"),
        Row("1X on the line, not locked, keyphasor", replace(base, shaft=25.0, keyphasor=True)),
        Row("1X half a Hz beside the line", replace(base, shaft=24.5)),
        Row("speed drifts 0.1 Hz, 2 s", replace(base, speed_drift=0.1, seconds=2.0)),
        Row("speed drifts 0.3 Hz, 2 s", replace(base, speed_drift=0.3, seconds=2.0)),
        Row("speed drifts 0.6 Hz, 1.5 s", replace(base, speed_drift=0.6, seconds=1.5)),
        Row("speed drifts 0.4 Hz, 10 s", replace(base, speed_drift=0.4, seconds=10.0, rate=1000.0),
            plans_of(loads=(5000.0,))),
    ]  # fmt: skip
    return found


def _channels() -> list[Row]:
    base = Rig()
    soft = replace(base, cell_stiffness=(5e7, 7e7), housing_mass=120.0)
    at_60 = plans_of(loads=(2500.0, 5000.0, 8750.0), frequencies=(60.0,))
    swapped = {"A1": Device(source="A2"), "A2": Device(source="A1")}
    return [
        Row("a probe clipped at half", replace(base, devices={"D1": Device(reading=_clipped(0.5))}), wish="told"),
        Row("a cell clipped at 0.7", replace(base, devices={"F2": Device(reading=_clipped(0.7))}), wish="told"),
        Row("a cell clipped in one run of each point",
            replace(base, devices={"F2": Device(reading=_clipped(0.7, "-25-2-"))})),
        Row("soft cells, 60 Hz, as it should be", soft, at_60),
        Row("accelerometers swapped", replace(soft, devices=swapped), at_60, wish="told"),
        Row("accelerometers 1 ms late", replace(soft, devices=devices(ACCELEROMETERS, Device(lag=1e-3))), at_60,
            wish="told"),
        Row("accelerometers of wrong sign", replace(soft, devices=devices(ACCELEROMETERS, Device(gain=-1.0))), at_60,
            wish="told"),
        Row("one accelerometer of wrong sign", replace(soft, devices={"A2": Device(gain=-1.0)}), at_60, wish="told"),
        Row("accelerometers 5 % off, 5 % stated", replace(soft, devices=devices(ACCELEROMETERS, Device(gain=1.05))),
            at_60, stated(ACCELEROMETERS, uncertainty="5 %")),
        Row("housing mass 5 % off, 5 % stated", replace(soft, devices=devices(ACCELEROMETERS, Device(gain=1.05))),
            at_60, {"housing": {"mass_uncertainty": '"6 kg"'}}),
        Row("a probe turned 1 deg, 1 deg stated", replace(base, devices={"D1": Device(turn=np.radians(1.0))}),
            extra=stated(PROBES, axis_uncertainty="1 deg")),
        Row("a probe 2 % off, 2 % stated", replace(base, devices={"D2": Device(gain=1.02)}),
            extra=stated(PROBES, uncertainty="2 %")),
        Row("half the windows lost", replace(base, devices={"D1": Device(reading=_lost(0.5))})),
        Row("three quarters of the windows lost", replace(base, devices={"D1": Device(reading=_lost(0.75))})),
    ]  # fmt: skip


def _loads() -> list[Row]:
    base = Rig()
    film = Bearing(second=3.0, third=5.0)
    untared = {"F1": Device(zero=120.0), "F2": Device(zero=300.0)}
    amplitudes = plans_of(loads=(5000.0,), amplitudes=(0.3, 0.6, 1.0))
    return [
        Row("cells not tared, three loads", replace(base, devices=untared)),
        Row("cells not tared, one load", replace(base, devices=untared), plans_of(loads=(5000.0,))),
        Row("piezo cells", replace(base, static=False)),
        Row("piezo cells, one load", replace(base, static=False), plans_of(loads=(5000.0,))),
        Row("amplitude 8 % of clearance", replace(base, bearing=film, amplitude=0.35), plans_of(loads=(5000.0,)),
            wish="told"),
        Row("amplitude 20 % of clearance", replace(base, bearing=film, amplitude=0.9), plans_of(loads=(5000.0,)),
            wish="told"),
        Row("amplitude 40 % of clearance", replace(base, bearing=film, amplitude=2.0), plans_of(loads=(5000.0,)),
            wish="told"),
        Row("three amplitudes up to 8 %", replace(base, bearing=film, amplitude=0.35), amplitudes),
        Row("a stiffness beside the film, dry test in the campaign", replace(base, baseline=(2e7, 3e7)),
            [*plans_of(), *(replace(p, id=f"b-{p.id}", load=500.0, dry=True) for p in plans_of(loads=(500.0,)))]),
        Row("a stiffness beside the film, dry test at 40 Hz only", replace(base, baseline=(2e7, 3e7)),
            [*plans_of(), *(replace(p, id=f"b-{p.id}", load=500.0, frequency=40.0, dry=True)
                            for p in plans_of(loads=(500.0,)))], wish="told"),
        Row("runs differ by 20 %", replace(base, gain_by_run=0.2), wish="told"),
    ]  # fmt: skip


def _samples() -> list[Row]:
    base = Rig()
    found = [Row(f"one load, {n} directions", base, plans_of(loads=(5000.0,), directions=n)) for n in (3, 4, 5, 8)]
    found += [
        Row(f"{n} runs that differ by 2 %", replace(base, gain_by_run=0.02), plans_of(loads=(5000.0,), directions=n))
        for n in (3, 4, 5, 6)
    ]
    seven = plans_of(loads=(5000.0,), frequencies=(10, 20, 25, 30, 40, 60), directions=3)
    found.append(Row("true K-C bearing, 3 directions, 1.2 s",
                     replace(base, seconds=1.2, miss=(0, 0), bearing=Bearing(M=((0, 0), (0, 0)))), seven))  # fmt: skip
    return found
