"""Dry tests in closed form that owe nothing to the virtual rig: free ways, loads that wander, noise, ramps."""

import itertools
from dataclasses import dataclass

import h5py
import numpy as np
import pytest

import tpjb_ident as ti
from rigdata.problem import RigDataError
from tests.manifests import PROBES_AND_CELLS, manifest

ANGLES = (-90.0, -18.0, 54.0, 126.0, 198.0)
UPPER = (54.0, 126.0)
CLEARANCE = 80e-6
AT = np.array([2000.0, 3000.0, 5000.0])


@dataclass(frozen=True)
class Stairs:
    """A load in steps toward each pad, from none at all."""

    hold: float = 0.8  #: [s]
    wander: float = 0.0  #: of the load within its holds, share
    leak: float = 0.0  #: of the load over a hold, share
    noise: float = 5e-8  #: of a probe's sample [m]
    cell_noise: float = 4.0  #: [N]
    way: float = 25e-6  #: that the shaft travels to an upper pad within some ten newtons [m]
    held: bool = True
    friction: float = 0.0  #: share of the load that the pivot's seat holds back
    unloads: bool = False  #: a second run of every pad, down from the top
    unit: str = ""  #: that the file states for the probes
    rate: float = 500.0  #: [Hz]
    walk: float = 0.0  #: of a probe's zero [m/sqrt(s)]
    point: bool = False  #: whether the pivots are contacts of points alone


def deflection(pad: int, load: np.ndarray) -> np.ndarray:
    """A stiff part and a soft one that stiffens [m]; pads differ."""
    return (0.8 + 0.1 * pad) * (load / 9e8 + 1e-8 * np.sqrt(load))


def stiffness(pad: int, load: np.ndarray) -> np.ndarray:
    """DW / d delta [N/m]."""
    return 1 / ((0.8 + 0.1 * pad) * (1 / 9e8 + 0.5e-8 / np.sqrt(load)))


def course(stairs: Stairs, rng: np.random.Generator) -> np.ndarray:
    """Load over time [N]."""
    levels = [0.0, 250.0, 500.0, *np.arange(1000.0, 6001.0, 500.0)]
    time = np.arange(round(stairs.rate * stairs.hold)) / stairs.rate
    parts = [np.zeros(len(time))]
    for below, above in itertools.pairwise(levels):
        swing = stairs.wander * np.sin(2 * np.pi * 0.37 * time + rng.uniform(0, 6.28))
        hold = above * (1 + swing - stairs.leak * time / stairs.hold)
        parts += [np.linspace(below, above, 150), hold] if stairs.held else [np.linspace(below, above, 400)]
    return np.concatenate(parts)


def reaching(load: np.ndarray, friction: float) -> np.ndarray:
    """What reaches the pivot [N]: a share of the load is held back against its way; up from nothing before."""
    pressed = np.empty_like(load)
    at = load[0] * (1 - friction)
    for k, force in enumerate(load):
        at = min(max(at, force * (1 - friction)), force * (1 + friction))
        pressed[k] = at
    return pressed


def write(path, stairs: Stairs, seed: int) -> None:
    """Five runs, one a pad, or ten."""
    rng = np.random.default_rng(seed)
    described = []
    runs = list(itertools.product(enumerate(ANGLES, start=1), (1, -1) if stairs.unloads else (1,)))
    with h5py.File(path, "w") as file:
        for (pad, angle), way in runs:
            load = course(stairs, rng)[::way]
            travelled = np.minimum(load / 40.0, 1.0) if angle in UPPER else 1.0
            pressed = reaching(load, stairs.friction)
            moved = 5e-8 * pressed ** (2 / 3) if stairs.point else deflection(pad, pressed)
            place = CLEARANCE + moved - stairs.way * (1 - travelled)
            toward = np.radians(angle + rng.standard_normal())
            unit = np.array([[np.cos(toward)], [np.sin(toward)]])
            probes = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2) @ (unit * place)
            probes += stairs.noise * rng.standard_normal(probes.shape)
            if stairs.walk:
                steps = rng.standard_normal(probes.shape) / np.sqrt(stairs.rate)
                probes += stairs.walk * np.cumsum(steps, axis=1)
            cells = unit * load + stairs.cell_noise * rng.standard_normal(probes.shape)
            name = f"p-{pad}{'-down' if way < 0 else ''}"
            described.append({"id": name, "kind": "dry_pivot", "pad": pad, "static_load_direction": f"{angle:g} deg"})
            group = file.create_group(f"runs/{name}")
            for channel, values in zip(PROBES_AND_CELLS, (*(1e6 * probes), *cells)):
                group.create_dataset(channel, data=values)
            if stairs.unit:
                group["PX"].attrs["unit"] = stairs.unit
        rate = {"sample_rate": f"{stairs.rate:g} Hz"}
        file.attrs["manifest"] = manifest(PROBES_AND_CELLS, *described, acquisition=rate)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stairs", "within"),
    [
        (Stairs(), 0.02),
        (Stairs(way=60e-6), 0.02),
        (Stairs(hold=2.0, wander=0.02), 0.02),
        (Stairs(hold=1.5, leak=0.03), 0.02),
        (Stairs(noise=4e-7), 0.08),
    ],
)
def test_curves_are_the_pivots_and_nothing_creeps(tmp_path, stairs, within):
    write(tmp_path / "stairs.h5", stairs, 7)
    curves = ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES))
    for curve in curves:
        np.testing.assert_allclose(curve.stiffness(AT), stiffness(curve.pad, AT), rtol=within)
        assert "deflection-creeps" not in curve.status
        assert curve.valid_from < 1500.0
        assert ("contact-incomplete" in curve.status) or curve.angle not in np.radians(UPPER)


@pytest.mark.slow
def test_a_ramp_behind_a_free_way_has_no_holds(tmp_path):
    write(tmp_path / "stairs.h5", Stairs(held=False), 7)
    curves = ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES))
    for curve in curves[2:4]:
        assert "no-holds" in curve.status
        np.testing.assert_allclose(curve.stiffness(AT), stiffness(curve.pad, AT), rtol=0.05)


@pytest.mark.slow
def test_a_contact_that_is_softest_at_no_load_at_all_is_one(tmp_path):
    """Averages of the first ramp, over a law that bends, were taken for a contact that is incomplete below 280 N."""
    write(tmp_path / "stairs.h5", Stairs(point=True, noise=2e-8, cell_noise=0.4, way=0.0), 7)
    for curve in ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES)):
        assert curve.law.name == "hertz-point"
        assert not {"contact-incomplete", "no-physical-law"} & set(curve.status)
        np.testing.assert_allclose(curve.stiffness(AT), 1.5 / 5e-8 * np.cbrt(AT), rtol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(("rest", "within"), [(0.8, 0.05), (2.0, 0.012)])
def test_the_noise_of_ramps_is_learnt_from_the_rest_before_them(tmp_path, rest, within):
    """About the whole ramps a spline's misfit was taken for noise: errors three times as large, half of the bands off.

    A rest of 0.8 s has one block more than a curve has columns.
    """
    errors, spread = [], []
    for seed in (1, 2):
        write(tmp_path / f"{seed}.h5", Stairs(held=False, hold=rest), seed)
        for curve in ti.fit_pivots(ti.load_campaign(tmp_path / f"{seed}.h5"), np.radians(ANGLES)):
            errors.append(np.log(curve.stiffness(AT) / stiffness(curve.pad, AT)))
            spread.append(curve.relative_stiffness_se(AT))
    assert np.abs(errors).max() < within
    assert np.mean(np.abs(errors) < 1.96 * np.array(spread)) >= 0.75


@pytest.mark.slow
def test_a_run_that_begins_at_the_top_begins_where_friction_still_holds_the_loading(tmp_path):
    """Its first hold was taken for one of unloading: the curves were 30 % wrong at their lower end."""
    write(tmp_path / "stairs.h5", Stairs(friction=0.004, unloads=True, way=0.0), 7)
    curves = ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES))
    for curve in curves:
        assert curve.runs == (f"p-{curve.pad}", f"p-{curve.pad}-down")
        np.testing.assert_allclose(curve.stiffness(AT), stiffness(curve.pad, AT), rtol=0.02)
        assert curve.valid_from < 100.0
        assert "bad-steps" not in curve.status


@pytest.mark.slow
def test_bands_hold_a_probe_that_wanders_through_holds_of_a_minute(tmp_path):
    """Some 0.6 um over a quarter of an hour, a tenth of the deflection: nearly all bands hold it, and are no wider."""
    write(tmp_path / "stairs.h5", Stairs(hold=60.0, rate=20.0, walk=2e-8, way=0.0), 7)
    curves = ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES))
    errors = np.array([np.log(curve.stiffness(AT) / stiffness(curve.pad, AT)) for curve in curves])
    spread = np.array([curve.relative_stiffness_se(AT) for curve in curves])
    assert np.abs(errors / spread).max() < 3.0
    assert np.mean(np.abs(errors) < 1.96 * spread) >= 0.8
    assert np.median(spread) < 2.0 * np.sqrt(np.mean(errors**2)) < 0.1


def test_a_file_of_another_unit_than_the_manifest_states_is_refused(tmp_path):
    """`check` called it an error, and the curve was a thousandth of the pivot's deflection."""
    write(tmp_path / "stairs.h5", Stairs(unit="mm"), 7)
    with pytest.raises(RigDataError, match="the file states 'mm', the manifest unit = 'um'"):
        ti.fit_pivots(ti.load_campaign(tmp_path / "stairs.h5"), np.radians(ANGLES))
