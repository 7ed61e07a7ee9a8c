"""What a film that is not linear makes of a band: lines that nothing drives tell it, and are no lines of H."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from tests.bands.test_broadband import is_inside, spectra
from tests.rigs import closed_form as cf
from tests.rigs.acquisition import EXACT, Acquisition, write_campaign
from tests.studies.field import marched
from tpjb_ident.bands.film_products import film_products
from tpjb_ident.conditions import untrusted
from tpjb_ident.identification.identify import identify

PADS = marched.CubicFilm(cube=2.0, square=-1.5)
RIG = cf.Rig(
    speed=97.0, shaft_mass=200.0, mass=120.0, seconds=4.0, unbalance=0.004, band=(6.0, 70.0),
    directions=(20.0, 110.0), repeats=2, amplitude=0.02, excitation="multisine",
)  # fmt: skip
ODD = np.arange(7, 70, 2)
SOME_ODD = ODD[ODD % 10 != 5]
STIFFNESS = 2e8


def static_film(numbers, cube, square, seed, orbit=0.0):
    """Runs of a film without damping, 1 Hz apart up to 80 Hz, lines `numbers` driven with random phases."""
    rng, n = np.random.default_rng(seed), 1024
    runs = []
    for along in ([1.0, 0.0], [0.0, 1.0]):
        line = np.zeros(n, complex)
        line[numbers] = np.exp(1j * rng.uniform(0, 6.28, len(numbers)))
        wave = np.fft.ifft(line).real
        motion = 1e-6 * wave / wave.std()
        force = STIFFNESS * motion * (1 + square * motion / 1e-6 + cube * (motion / 1e-6) ** 2 + 2 * cube * orbit**2)
        D, F = (np.fft.fft(values)[1:81, None] * (2 / n) * along for values in (motion, force))
        command = np.broadcast_to(line[1:81, None] * along, (3, 80, 2))
        noise = 1e-6 * np.abs(F).max() * rng.standard_normal((3, 80, 2))
        run = spectra(np.broadcast_to(D, (3, 80, 2)), F + noise, command, period=1.0)
        lines = tuple(replace(line, frequency=float(k + 1)) for k, line in enumerate(run.lines.excitation))
        runs.append(replace(run, lines=replace(run.lines, excitation=lines)))
    return runs


@pytest.mark.parametrize("seed", range(3))
def test_left_out_odd_lines_tell_the_change_of_h_and_the_scatter_of_lines(seed):
    runs = static_film(SOME_ODD, 1e-3, 0.0, seed)
    lines = film_products(runs)
    assert lines.change == pytest.approx(1.3 * 3e-3, rel=0.5)
    driven = runs[0].driven & np.isin(np.arange(1, 81), SOME_ODD)
    off = runs[0].force[0, driven, 0] / runs[0].displacement[0, driven, 0] / STIFFNESS - 1
    assert np.median(lines.scatter[0, driven, 0]) == pytest.approx(1.3 * np.sqrt(2) * np.std(off), rel=0.6)
    assert lines.scatter[0, driven, 1].max() < 0.01 * lines.scatter[0, driven, 0].min()


@pytest.mark.parametrize("seed", range(3))
def test_sums_of_two_scatter_lines_and_stand_in_where_all_odd_lines_are_driven(seed):
    even = film_products(static_film(ODD, 0.0, 0.02, seed))
    assert not even.even
    assert even.change == pytest.approx(1.3 * 3 * 0.75 * 0.02**2, rel=0.5)
    every = film_products(static_film(np.arange(6, 70), 1e-3, 0.02, seed))
    assert every.even
    assert np.median(every.scatter[0, ODD - 1, 0]) > 2 * np.median(even.scatter[0, ODD - 1, 0])


def test_a_linear_film_makes_nothing():
    lines = film_products(static_film(SOME_ODD, 0.0, 0.0, 1))
    assert lines.change < 1e-5
    assert lines.scatter[0, SOME_ODD - 1].max() < 1e-4


def band_of(tmp_path, rig, without="none"):
    """The band of a rig integrated in time with a loaded film that is not linear, the share inside, the half width."""
    channels = tuple(c for c in cf.channels_of(rig) if not c.name.startswith(without))
    campaign = marched.campaign(PADS, rig, channels)
    noise = {q: 0.2 * size for q, size in cf.noise_of(marched.records(PADS, rig)[0]).items()}
    path = write_campaign(tmp_path, campaign, Acquisition(uncertainty=EXACT, noise=noise), [1, 1])
    (band,) = identify(load_campaign(path)).bands
    truth = campaign.truth(5000.0, band.frequencies)
    direct = [0, 3]
    half = np.median(band.half_width()[:, direct] / np.abs(truth.reshape(-1, 4)[:, direct]))
    return band, is_inside(band, truth).mean(), half


@pytest.mark.slow
@pytest.mark.parametrize("tones", ["odd", "some odd"])
@pytest.mark.parametrize("without", ["none", "CMD"])
def test_lines_that_only_the_film_fills_are_none_of_h(tmp_path, tones, without):
    """H of such a line is that of the rig about the film, 100 % off."""
    rig = replace(RIG, tones=tones)
    band, inside, half = band_of(tmp_path, rig, without)
    np.testing.assert_allclose(band.frequencies, cf.tones_of(rig), atol=1e-6)
    assert not untrusted(band.quality)
    assert inside > 0.9
    assert half < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("excitation", ["random", "multisine"])
def test_the_orbit_at_shaft_speed_is_measured_and_is_no_slower_channel(tmp_path, excitation):
    rig = replace(RIG, unbalance=0.06, amplitude=0.003, excitation=excitation)
    band, inside, half = band_of(tmp_path, rig)
    assert "slower-channels" not in [str(condition) for condition in band.quality]
    assert not untrusted(band.quality)
    assert inside > 0.9
    assert half < (0.02 if excitation == "random" else 0.09)


def test_runs_without_a_driven_line_tell_nothing():
    """As after a period of which a part was lost."""
    run = static_film(SOME_ODD, 0.0, 0.0, 1)[0]
    silent = replace(run, disturbed=np.ones(len(run.frequencies), dtype=bool))
    lines = film_products([silent, silent])
    assert np.isnan(lines.change)
    assert np.isnan(lines.scatter).all()
