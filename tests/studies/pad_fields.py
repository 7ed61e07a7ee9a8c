"""The look of the paper's Fig. 2: deformation and temperature of all pads in the middle plane, 5 kN and 1000 rpm.

python tests/studies/pad_fields.py docs/model_pads.svg
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from model.bearing_file import load_bearing
from model.predict import predict
from model.prediction import Prediction
from tests.pad_responses import pad_solid

FILE = Path(__file__).resolve().parents[2] / "model" / "bearings" / "rocker.toml"
LOAD, SPEED = 5000.0, 2 * math.pi * 1000.0 / 60.0
#: How much larger than true deformations are drawn.
MAGNIFIED = 1500.0


def prediction() -> Prediction:
    """The point of Fig. 2."""
    p = predict(load_bearing(FILE), LOAD, -math.pi / 2, SPEED, thermal="tehd")
    if not p.converged:
        raise RuntimeError(f"no equilibrium: {p.status}")
    return p


def draw(p: Prediction, path: Path) -> None:
    from matplotlib.figure import Figure

    bearing, films = p.setup.bearing, p.equilibrium.films
    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    around, along = figure.subplots(1, 2)
    hottest = max(float(f.work.temperature.max()) for f in films)
    mesh = None
    for film in films:
        solid = pad_solid(film.pad, bearing, film.grid.angle, film.grid.z)
        rise = film.work.temperature - p.setup.inlet_temperature
        theta, radius, warmer = solid.pad_temperature(rise)
        bent = np.interp(theta, film.grid.angle, film.bent[:, 0])
        turned = theta + film.pad.pivot_angle
        size = radius[None, :] + MAGNIFIED * bent[:, None]
        mesh = around.pcolormesh(
            1e3 * size * np.cos(turned)[:, None],
            1e3 * size * np.sin(turned)[:, None],
            warmer + p.setup.inlet_temperature,
            shading="gouraud",
            cmap="inferno",
            rasterized=True,
            vmin=p.setup.inlet_temperature,
            vmax=hottest,
        )
        for outline in (radius[0], radius[-1]):
            around.plot(*(1e3 * outline * f(theta + film.pad.pivot_angle) for f in (np.cos, np.sin)), "0.6", lw=0.6)
        middle = 0.85e3 * radius[0]
        around.text(
            middle * math.cos(film.pad.pivot_angle), middle * math.sin(film.pad.pivot_angle),
            f"#{film.number}", ha="center", va="center",
        )  # fmt: skip
        along.plot(
            np.degrees(film.grid.angle),
            1e6 * film.bent[:, 0],
            "-" if film.number < 4 else "--",
            label=f"pad #{film.number}",
        )
    journal = np.linspace(0.0, 2 * math.pi, 200)
    around.plot(*(1e3 * bearing.journal_radius * f(journal) for f in (np.cos, np.sin)), "k", lw=0.8)
    around.set_aspect("equal")
    around.margins(0.04)
    around.set_xlabel("X [mm]")
    around.set_ylabel("Y [mm]")
    around.set_title(f"temperature; deformation {MAGNIFIED:g} times (grey: as drawn)", fontsize=9)
    figure.colorbar(mesh, ax=around, label="temperature [degC]", shrink=0.8)
    along.set_xlabel("angle from the pivot, with rotation [deg]")
    along.set_ylabel("radial deformation of the face, outward [um]")
    along.set_title("middle plane, 5 kN on pad #1, 1000 rpm", fontsize=9)
    along.grid(alpha=0.3)
    along.legend(fontsize=8)
    figure.savefig(path)
    print(f"drawn: {path}; largest deformation {1e6 * max(float(np.abs(f.bent).max()) for f in films):.2f} um")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path, help="file to draw into (svg, png, pdf)")
    draw(prediction(), parser.parse_args().picture)


if __name__ == "__main__":
    main()
