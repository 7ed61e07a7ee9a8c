"""`tpjb predict`: a bearing file and operating points in, coefficients, positions and pad data out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rigdata.units import ZERO_CELSIUS
from tpjb_ident.cli.command import Command, command
from tpjb_ident.cli.identification import DIRECT, POINT
from tpjb_ident.cli.inputs import model_settings, operating_points, parse_value, pivot_choice, rotation_choice
from tpjb_ident.cli.options import choices, known_names
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.rounding import counted
from tpjb_ident.runtime.executors import background_job, forks

if TYPE_CHECKING:
    from model.options import Options

#: Points that take less time than pandas to load.
FEW = 20
#: Share of a direct coefficient from which the mesh is too coarse.
_COARSE = 0.05


@command(
    'tpjb predict {ROCKER} --load "2.5..8.75:1.25 kN" --excitation "25 Hz"',
    'tpjb predict {ROCKER} --pivots rigid --speed "1000, 2000, 3000 rpm"',
    "tpjb predict {ROCKER} --pivots tpjb-pivot-out/pivots.toml --thermal tehd",
)
def predict(
    c: Command,
    bearing: Path,
    load: str = "5 kN",
    load_direction: str = "-90 deg",
    speed: str = "22 Hz",
    rotation: str | None = None,
    excitation: str | None = None,
    pivots: str = "kirk",
    thermal: str = "adiabatic",
    effects: Path | None = None,
    physics: str | None = None,
    housing_temperature: str | None = None,
) -> None:
    """Predict coefficients, shaft position and pad data.

    Lists and ranges carry units: "2.5 kN, 5 kN", "2.5, 5 kN", "2.5..8.75:1.25 kN" (from..to:step). Every
    combination of load, direction, speed and excitation is predicted. Writes prediction.csv and .parquet.
    """
    c.options["excitation"] = excitation or "synchronous"
    drawing = c.bearing(bearing)
    settings = model_settings(c, pivot_choice(c), drawing)
    settings = replace(settings, options=parse_physics(physics, housing_temperature))
    points = operating_points(load, load_direction, speed, excitation, rotation_choice(c, drawing))
    from tpjb_ident.compare.predictions import predict_points

    with c.results():
        rows = None
        if len(points) <= FEW and forks():  # solved in a copy of this process while pandas loads here: 0.7 of the time
            with background_job(predict_points, drawing, points, settings) as job, c.progress("predicting"):
                import pandas as pd
                import pyarrow.parquet  # noqa: F401  (what the table is written with)

                rows = job()
        if rows is None:
            with c.progress("predicting") as show:
                rows = predict_points(drawing, points, settings, show)
        import pandas as pd

        frame = pd.DataFrame(rows)
        c.table("prediction", frame)
    bad = (~frame["converged"]).sum()
    state = f"{bad} did NOT converge" if bad else "all converged"
    c.print(f"{drawing.name}: {counted(len(frame), 'operating point')}, {state}.")
    c.next("export", c.target, "--to", "ross")
    c.show_frame(drawing.name, frame, f"{POINT} {DIRECT} min_film_m status", "prediction.csv")
    if bad:  # whether the bearing carries the load at all
        c.next("predict", bearing, "--load", load, "--speed", speed, "--pivots", "rigid", "--thermal", "isothermal")
        raise NotTrustedError(
            f"{bad} of {len(frame)} points did not converge; their status says why, their values are NaN."
        )
    mesh_error = frame["mesh_error"].max()
    if mesh_error > _COARSE:
        raise NotTrustedError(f"the mesh error reaches {100 * mesh_error:.0f} % of a direct coefficient.")


def parse_physics(names: str | None, housing: str | None) -> Options:
    """Read `--physics` and `--housing-temperature`."""
    chosen = known_names(names, choices("physics"), "--physics") if names else ()
    if housing is not None and "growth" not in chosen:
        raise BadInputError("--housing-temperature: means nothing without growth. Add --physics growth.")
    from model.growth import Growth
    from model.options import Options

    temperature = None
    if housing is not None:  # the model counts in degC
        temperature = round(parse_value(housing, "temperature", "--housing-temperature") - ZERO_CELSIUS, 9)
    try:
        return Options(
            conduction="conduction" in chosen,
            isothermal_journal="journal" in chosen,
            growth=Growth(housing=temperature) if "growth" in chosen else None,
            cavitation="jfo" if "jfo" in chosen else "swift-stieber",
            turbulence="ng-pan" if "turbulence" in chosen else "none",
            perturbed_heat="perturbed-heat" in chosen,
            perturbed_bending="perturbed-bending" in chosen,
            axial_tilt="axial-tilt" in chosen,
        )
    except ValueError as error:
        raise BadInputError(f"--physics {names}: {error}. Take one of them out, or another temperature.") from error
