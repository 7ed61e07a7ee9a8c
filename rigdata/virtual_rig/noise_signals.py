"""Noise as time series: white, 1/f, mains and drift of all channels of one run at once."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len

from rigdata.arrays import FloatArray
from rigdata.virtual_rig.instruments import Sensor
from rigdata.virtual_rig.noise import ChannelNoise, Noise, stream


def channel_noise(sensors: tuple[Sensor, ...], noise: Noise, time: FloatArray, seed: int, run: str) -> FloatArray:
    """Noise of each sensor over `time` (n,) [s] -> (n_sensors, n), in the SI unit of its quantity.

    Parameters
    ----------
    sensors : tuple of Sensor
    noise : Noise
    time : (n,) ndarray
        [s]
    seed : int
        Of the random numbers.
    run : str
        Run id.
    """
    kinds: list[ChannelNoise] = [getattr(noise, sensor.quantity) for sensor in sensors]
    amounts = np.array([[k.white, k.flicker, k.mains, k.drift] for k in kinds]).T[..., None]
    white, pink, mains, drift = amounts
    n = len(time)
    rate = (n - 1) / (time[-1] - time[0]) if n > 1 else 1.0
    rng = stream(seed, run, "noise")
    out = white * rng.standard_normal((len(sensors), n))
    out += pink * flicker(rng, len(sensors), n, rate)
    out += drift * slow_drift(rng, len(sensors), time)
    if np.any(mains):
        out += mains * pick_up(noise, [s.name for s in sensors], time, seed, run)
    return out


def flicker(rng: np.random.Generator, rows: int, n: int, rate: float) -> FloatArray:
    """1/f noise (rows, n) of amplitude density 1 per sqrt(Hz) at 1 Hz.

    Shaped in the frequency domain over twice the length and cut, because one period of a periodic series would
    end where it began, which drift does not.

    Parameters
    ----------
    rng : numpy.random.Generator
    rows : int
        Signals.
    n : int
        Samples.
    rate : float
        [Hz]
    """
    length = next_fast_len(2 * n, real=True)
    frequency = np.arange(1, length // 2 + 1) * rate / length
    # one-sided density S(f) = 1/f; a line of the rfft has E|Z|^2 = S rate length / 2
    size = np.sqrt(rate * length / frequency) / 2
    spectrum = np.zeros((rows, length // 2 + 1), dtype=complex)
    spectrum[:, 1:] = size * (rng.standard_normal((rows, len(size), 2)) @ np.array([1.0, 1j]))
    return irfft(spectrum, n=length)[:, :n]


def slow_drift(rng: np.random.Generator, rows: int, time: FloatArray) -> FloatArray:
    """Slow monotone drift (rows, n), zero in the mean, with a standard deviation of 1 from start to end.

    Parameters
    ----------
    rng : numpy.random.Generator
    rows : int
        Signals.
    time : (n,) ndarray
        [s]
    """
    share = np.linspace(-0.5, 0.5, len(time))
    size = rng.standard_normal((rows, 1))
    bend = rng.uniform(-1.0, 1.0, (rows, 1))
    return size * (share + bend * (share**2 - np.mean(share**2)))


def pick_up(noise: Noise, names: list[str], time: FloatArray, seed: int, run: str) -> FloatArray:
    """Mains pick-up (n_sensors, n) of amplitude about 1.

    How the channels pick it up belongs to the cabling, the same in the whole campaign; the phase of the mains
    at the start of a record is chance.

    Parameters
    ----------
    noise : Noise
    names : list of str
        Channel names.
    time : (n,) ndarray
        [s]
    seed : int
        Of the random numbers.
    run : str
        Run id.
    """
    rng = stream(seed, run, "mains")
    frequency = noise.mains_frequency + noise.mains_scatter * rng.standard_normal()
    start = rng.uniform(0, 2 * np.pi)
    out = np.zeros((len(names), len(time)))
    for row, name in enumerate(names):
        cabling = stream(seed, name, "mains")
        strength = cabling.uniform(0.9, 1.1)
        for order, share in enumerate((1.0, *noise.mains_harmonics), 1):
            phase = order * start + cabling.uniform(0, 2 * np.pi)
            out[row] += strength * share * np.cos(2 * np.pi * order * frequency * time + phase)
    return out
