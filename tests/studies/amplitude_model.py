"""What a large motion does to K and C: the journal vibrates by 5 to 40 % of the clearance, the pads follow in time.

    python tests/studies/amplitude_model.py [--load 5000] [--frequency 22]

Isothermal films that rupture, rigid pivots, pads without mass: at every instant no film has a moment about its pivot,
which gives the rate of each pad's tilt; midpoint rule, 96 steps a period, the third period counts. Force over
displacement at the excitation frequency against the perturbation of the same equilibrium.
"""

from __future__ import annotations

import argparse
import copy
import math
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.compilation import compiled
from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import _active_set, _integrate, _source, _thickness, conductances
from model.film.slopes import derivatives
from model.predict import predict
from model.prediction import Prediction
from model.statics.pad_film import PadFilm

STEPS, PERIODS = 96, 3
ROCKER = Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml"


def film_force(film: PadFilm, now: tuple[float, float], rates: tuple[float, float], speed: float) -> np.ndarray:
    """Radial and tangential force, and the derivative of the latter by db/dt."""
    radial, tangential, slope = _squeezed(film.grid, film.work, (film.pad.pad_clearance, *now), rates, speed)
    if not np.isfinite(radial):
        raise ArithmeticError("the rupture line does not settle")
    return np.array([radial, tangential, slope])


@compiled
def _squeezed(
    grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], rates: tuple[float, float], speed: float
) -> tuple[float, float, float]:
    clearance, a, b = wedge
    _thickness(grid, work, clearance, a, b)
    gx, gz = conductances(grid, work, clearance, a, b)
    source = _source(grid, work, clearance, a, b, speed)
    for i in range(source.shape[0]):
        closing = rates[0] * grid.cos[i] + rates[1] * grid.sin[i]
        for j in range(source.shape[1]):
            source[i, j] += work.density[i, j] * grid.dx * grid.height[j] * closing
    if _active_set(grid, work, gx, gz, source) < 0:
        return np.nan, np.nan, np.nan
    derivatives(grid, work, wedge, (gx, gz))
    force, _, damping = _integrate(grid, work, grid.area)
    return force[0], force[1], damping[1, 1]


def followed(
    film: PadFilm, b: float, journal: tuple[np.ndarray, np.ndarray], speed: float, rate: float
) -> tuple[float, float]:
    """Rate of the wedge at which the film has no moment, and the radial force there."""
    position, velocity = journal
    a = film.preload_distance + float(film.normal @ position)
    approach = float(film.normal @ velocity)
    for _ in range(8):
        radial, tangential, slope = film_force(film, (a, b), (approach, rate), speed)
        if not abs(slope) > 0.0:  # ruptured all over: nothing turns the pad
            return rate, radial
        step = tangential / slope
        rate -= step
        if abs(step) < 1e-5 * max(abs(rate), 1e-6):
            break
    return rate, radial


def harmonics(p: Prediction, motion: np.ndarray, omega: float, most: int = 1) -> np.ndarray:
    """Phasors of the films' force [N] for a motion Re(motion exp(i omega t)) [m]: at omega, 2 omega, ... (most, 2)."""
    films = [f for f in p.equilibrium.films if f.forces is not None]
    rest, speed = p.equilibrium.position, p.equilibrium.surface_speed
    # the solution's arrays are kept: films are followed on copies
    films = copy.deepcopy(films)
    wedges = [f.approach(rest)[1] for f in films]
    rates, dt = [0.0] * len(films), 2 * math.pi / omega / STEPS
    total = np.zeros((most, 2), complex)

    def journal(t: float) -> tuple[np.ndarray, np.ndarray]:
        turned = motion * np.exp(1j * omega * t)
        return rest + turned.real, (1j * omega * turned).real

    for n in range(STEPS * PERIODS):
        force = np.zeros(2)
        for k, film in enumerate(films):
            rate, radial = followed(film, wedges[k], journal(n * dt), speed, rates[k])
            force += radial * film.normal
            half = wedges[k] + 0.5 * dt * rate
            rates[k], _ = followed(film, half, journal((n + 0.5) * dt), speed, rate)
            wedges[k] += dt * rates[k]
        if n >= STEPS * (PERIODS - 1):
            turns = np.exp(-1j * omega * n * dt * np.arange(1, most + 1))
            total += turns[:, None] * force * 2.0 / STEPS
    return total


def impedance(p: Prediction, amplitude: float, axis: int, omega: float) -> np.ndarray:
    """Column of h by a motion along X (0) or Y (1) of this amplitude [m]."""
    return harmonics(p, amplitude * np.eye(2)[axis], omega)[0] / amplitude


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--load", type=float, default=5000.0)
    parser.add_argument("--frequency", type=float, default=22.0)
    chosen = parser.parse_args()
    omega = 2 * math.pi * chosen.frequency
    bearing = load_bearing(ROCKER)
    clearance = bearing.pads[0].assembled_clearance
    print("| amplitude / Cb | kxx | kyy | cxx | cyy |\n|---|---|---|---|---|")
    for share in (0.01, 0.05, 0.1, 0.2, 0.3, 0.4):
        cells = []
        p = predict(bearing, chosen.load, speed=omega, thermal="isothermal", pivots="rigid", mesh=(40, 4))
        for axis in range(2):
            try:
                h = impedance(p, share * clearance, axis, omega)[axis]
            except (ArithmeticError, ZeroDivisionError):
                h = complex(math.nan, math.nan)
            cells.append((h.real / p.h[axis, axis].real - 1.0, h.imag / p.h[axis, axis].imag - 1.0))
        (kx, cx), (ky, cy) = cells
        print(f"| {share:.0%} | {kx:+.1%} | {ky:+.1%} | {cx:+.1%} | {cy:+.1%} |", flush=True)


if __name__ == "__main__":
    main()
