"""Four probes tell one vector: what one of them adds is seen, and stands in the uncertainty of their mean."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from rigdata.calibration import Channel
from tpjb_ident.check import redundant_channels
from tpjb_ident.check.lines import band_lines
from tpjb_ident.check.redundant_channels import inconsistent_channels, widened

AXES = {"PXA": 45.0, "PYA": 135.0, "PXB": 45.0, "PYB": 135.0}


@dataclass(frozen=True)
class Lines:
    phasor: np.ndarray


@dataclass(frozen=True)
class Seen:
    """A run as the check leaves it, as far as is asked here."""

    lines: Lines
    channels: tuple[Channel, ...] = field(default=())

    @property
    def phasors(self):
        return self.lines.phasor[None]

    def pick(self, quantity):
        return [i for i, c in enumerate(self.channels) if c.quantity == quantity]


def channel(name, axis, uncertainty):
    return Channel(name=name, quantity="displacement", unit="um", axis=np.radians(axis), uncertainty=uncertainty)


def runs(gains=(1.0, 1.0, 1.0, 1.0), noise=1e-9, n=8, uncertainty=0.005, seed=0, axes=None):
    axes = AXES if axes is None else axes
    rng = np.random.default_rng(seed)
    channels = tuple(channel(name, a, uncertainty) for name, a in axes.items())
    turned = np.radians(list(axes.values()))
    directions = np.stack([np.cos(turned), np.sin(turned)], axis=1)
    made = []
    for _ in range(n):
        vector = 5e-6 * (rng.standard_normal(2) + 1j * rng.standard_normal(2))
        shown = directions @ vector * np.asarray(gains[: len(axes)])
        made.append(Seen(Lines(shown + noise * (rng.standard_normal(len(axes)) + 0j)), channels))
    return made


@pytest.fixture(autouse=True)
def every_run_is_excited(monkeypatch):
    monkeypatch.setattr(redundant_channels, "excited", lambda seen: True)


@pytest.mark.parametrize(
    ("gains", "how"),
    [
        ((1.0, 1.0, 1.0, 1.0), {}),
        ((1.008, 1.0, 0.995, 1.0), {}),
        ((1.03, 1.0, 1.0, 1.0), {"noise": 1e-6, "n": 4}),
        ((1.5, 1.0), {"axes": {"X": 0.0, "Y": 90.0}}),
    ],
    ids=["alike", "within what is stated", "scatter is no gain", "two probes have nothing to be held against"],
)
def test_probes_that_agree_are_not_apart(gains, how):
    assert inconsistent_channels(runs(gains, **how)) == ()


@pytest.mark.parametrize(
    ("gains", "parts", "tolerance", "says"),
    [
        ((1.05, 1.0, 1.0, 1.0), (0.025, 0.0), 1e-3, "PXA reads 4.9% more at the excitation than PXB"),
        ((1.05, 1.0, 1.0, 0.92), (0.025, 0.04), 3e-3, "PYA reads 8.3% more at the excitation than PYB"),
    ],
    ids=["one pair", "two pairs"],
)
def test_a_difference_is_halved_between_the_two_planes(gains, parts, tolerance, says):
    (apart,) = inconsistent_channels(runs(gains, noise=0.0))
    assert -apart.gains == pytest.approx([*parts, -parts[0], -parts[1]], abs=tolerance)
    assert apart.sentence().startswith(says)


def test_the_widened_interval_of_the_mean_holds_either_end():
    """The mean is off by half the difference where one probe alone is wrong."""
    (apart,) = inconsistent_channels(runs((1.05, 1.0, 1.0, 1.0), noise=0.0))
    channels = {c.name: c for c in runs()[0].channels}
    wide = widened(channels, apart.uncertainty())
    of_the_mean = 0.5 * np.hypot(wide["PXA"].uncertainty, wide["PXB"].uncertainty)
    assert 1.96 * of_the_mean > 0.025
    assert 1.96 * of_the_mean < 0.035
    assert wide["PYA"].uncertainty == pytest.approx(0.005, abs=1e-3)


def test_three_probes_are_held_against_each_other():
    (apart,) = inconsistent_channels(runs((1.1, 1.0, 1.0), axes={"A": 0.0, "B": 120.0, "C": 240.0}))
    assert apart.sentence().startswith("A reads")


@pytest.mark.parametrize("gain", [1.0, 1.06])
def test_planes_of_probes_are_held_against_each_other_over_a_band(gain):
    rng = np.random.default_rng(5)
    rate, n, axes = 1000.0, 8000, np.radians(list(AXES.values()))
    channels = [channel(name, a, 0.005) for name, a in AXES.items()] + [Channel("F", "force", unit="N", axis=0.0)]
    made = []
    for _ in range(2):
        t = np.arange(n) / rate
        shape = sosfiltfilt(butter(4, (10, 100), "band", fs=rate, output="sos"), rng.standard_normal((2, n)))
        probes = np.stack([np.cos(axes), np.sin(axes)], axis=1) @ shape * np.array([1, 1, gain, 1])[:, None]
        probes += 0.01 * rng.standard_normal(probes.shape) + np.cos(2 * np.pi * 22 * t + np.arange(4)[:, None])
        values = np.concatenate([probes, shape[:1] + 0.01 * rng.standard_normal((1, n))]).T
        run = SimpleNamespace(band=(12.0, 90.0), sample_rate=rate)
        rows, _ = band_lines(run, values, [4], [22.0])
        made += [Seen(Lines(row), tuple(channels)) for row in rows]
    found = inconsistent_channels(made)
    assert [a.quantity for a in found] == ([] if gain == 1.0 else ["displacement"])
    if found:
        assert found[0].names[int(np.argmin(found[0].gains))] in ("PXA", "PXB")
