"""`tpjb predict`: a bearing file and operating points in, coefficients, positions and pad data out."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigdata.near_names import nearest_name
from tpjb_ident.cli.common.errors import guarded
from tpjb_ident.cli.common.inputs import refuse_impossible, refuse_special
from tpjb_ident.cli.common.options import (
    BearingPath,
    EffectsFile,
    LoadDirections,
    Loads,
    Out,
    PivotChoice,
    Speeds,
    Thermal,
    as_given,
    out_folder,
    refuse_unknown,
)
from tpjb_ident.cli.common.quantities import MAX_VALUES, parse_value, parse_values
from tpjb_ident.cli.common.run_record import write_record
from tpjb_ident.cli.common.terminal import print_line, progress, table
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.runtime.output_folder import output_folder
from tpjb_ident.runtime.provenance import sha256
from tpjb_ident.runtime.tables import write_table

if TYPE_CHECKING:
    from model.options import Options

#: Name on the command line: what it does.
PHYSICS = {
    "conduction": "pads conduct the film's heat away",
    "journal": "the journal passes heat from hot films to cold ones",
    "growth": "clearances follow the temperatures of journal, housing and pads",
    "jfo": "mass-conserving cavitation",
    "perturbed-heat": "in the dynamics the films' temperature and viscosity follow the motion",
    "perturbed-bending": "in the dynamics pads that deform (tehd, thd) bend with the motion",
    "axial-tilt": "pads on spheres follow a shaft that leans (effect misalignment)",
    "turbulence": "films turn turbulent above a local Reynolds number of 500 to 1,000 (Ng and Pan)",
}
Physics = Annotated[
    str | None,
    typer.Option("--physics", metavar="NAMES", help=f'Beyond the paper\'s model: some of "{", ".join(PHYSICS)}".'),
]
HousingTemperature = Annotated[
    str | None,
    typer.Option(help='With growth: mean temperature of the housing, "48 degC" [default: the oil supply\'s].'),
]
NAMED_PIVOTS = ("rigid", "kirk", "kirk-secant")
THERMAL = ("isothermal", "adiabatic", "tehd", "thd")


def parse_physics(names: str | None, housing: str | None) -> Options:
    """Read `--physics` and `--housing-temperature`."""
    chosen = [part.strip() for part in (names or "").split(",") if part.strip()]
    for name in chosen:
        refuse_unknown(name, PHYSICS, "--physics", several=True)
    if housing is not None and "growth" not in chosen:
        raise BadInputError("--housing-temperature: means nothing without growth. Add --physics growth.")
    from model.growth import Growth
    from model.options import CAVITATION, Options

    if "jfo" in chosen and "jfo" not in CAVITATION:
        raise BadInputError(f"--physics: this model has no cavitation 'jfo', only {', '.join(CAVITATION)}.")
    if "jfo" in chosen and "turbulence" in chosen:
        raise BadInputError("--physics: a turbulent film does not conserve mass where it ruptures. Leave out jfo.")
    growth = None
    if "growth" in chosen:
        at = None if housing is None else parse_value(housing, "temperature", "--housing-temperature")
        try:
            growth = Growth(housing=at)
        except ValueError as error:
            raise BadInputError(f"--housing-temperature: {error}.") from error
    return Options(
        conduction="conduction" in chosen,
        isothermal_journal="journal" in chosen,
        growth=growth,
        cavitation="jfo" if "jfo" in chosen else "swift-stieber",
        turbulence="ng-pan" if "turbulence" in chosen else "none",
        perturbed_heat="perturbed-heat" in chosen,
        perturbed_bending="perturbed-bending" in chosen,
        axial_tilt="axial-tilt" in chosen,
    )


@guarded
def predict(
    bearing: BearingPath,
    load: Loads = "5 kN",
    load_direction: LoadDirections = "-90 deg",
    speed: Speeds = "22 Hz",
    excitation: Annotated[
        str | None, typer.Option(help='Excitation frequencies: "10..50:10 Hz" [default: synchronous].')
    ] = None,
    pivots: PivotChoice = "kirk",
    thermal: Thermal = "adiabatic",
    effects: EffectsFile = None,
    physics: Physics = None,
    housing_temperature: HousingTemperature = None,
    out: Out = None,
) -> None:
    """Predict coefficients, shaft position and pad data.

    Lists and ranges carry units: "2.5 kN, 5 kN", "2.5, 5 kN", "2.5..8.75:1.25 kN" (from..to:step). Every
    combination of load, direction, speed and excitation is predicted. Writes prediction.csv and .parquet.
    """
    options = as_given(locals()) | {"excitation": excitation or "synchronous"}
    points = operating_points(load, load_direction, speed, excitation)
    choice = pivot_choice(pivots)
    settings = replace(model_settings(choice, thermal, effects), options=parse_physics(physics, housing_temperature))
    refuse_special(bearing)
    from model.bearing_file import load_bearing
    from tpjb_ident.compare.measured_pivots import refuse_counted_twice
    from tpjb_ident.compare.predictions import predict_points, prediction_frame

    refuse_counted_twice(choice, settings.effects, effects)
    loaded = load_bearing(bearing)
    refuse_impossible(settings.effects, effects, loaded)
    target = out_folder(out, "predict")
    inputs = {p.name: sha256(p) for p in (bearing, effects, choice) if isinstance(p, Path)}
    with output_folder(target, "predict") as folder:
        with progress("predicting") as show:
            frame = prediction_frame(predict_points(loaded, points, settings, show))
        write_table(folder, "prediction", frame)
        write_record(folder, target, "predict", options, inputs)
    _show_predictions(frame, loaded.name)
    print_line(f"Results: {target}")
    bad = int((~frame["converged"]).sum())
    if bad:
        raise NotTrustedError(
            f"{bad} of {len(frame)} points did not converge; their status says why, their values are NaN."
        )
    rough = float(frame["mesh_error"].max())
    if rough > 0.05:
        raise NotTrustedError(f"the mesh error reaches {100 * rough:.0f} % of a direct coefficient.")


def operating_points(load: str, load_direction: str, speed: str, excitation: str | None) -> list[Any]:
    """Every combination of the four options as `OperatingPoint`, SI."""
    loads = parse_values(load, "force", "--load")
    directions = parse_values(load_direction, "angle", "--load-direction")
    speeds = parse_values(speed, "speed", "--speed")
    frequencies = parse_values(excitation, "speed", "--excitation") if excitation else (0.0,)
    _positive(loads, "--load", "Give the direction of the load with --load-direction.")
    _positive(speeds, "--speed", "The shaft turns counter-clockwise.")
    if excitation:
        _positive(frequencies, "--excitation", "Leave the option out for synchronous coefficients.")
    if len(loads) * len(directions) * len(speeds) * len(frequencies) > MAX_VALUES:
        raise BadInputError(f"more than {MAX_VALUES} operating points. Take larger steps.")
    from rigdata.operating_point import OperatingPoint

    return [OperatingPoint(*one) for one in itertools.product(loads, directions, speeds, frequencies)]


def _positive(values: tuple[float, ...], option: str, cure: str) -> None:
    if min(values) <= 0:
        raise BadInputError(f"{option}: must be positive. {cure}")


def pivot_choice(text: str) -> str | float | Path:
    """What --pivots means: a name, a stiffness [N/m], or the path of a file."""
    if text in NAMED_PIVOTS:
        return text
    path = Path(text)
    if path.is_file():
        return path
    if text[:1].isdigit():
        return parse_value(text, "stiffness", "--pivots")
    near = nearest_name(text, NAMED_PIVOTS)
    hint = f"Did you mean {near!r}?" if near else "Use rigid, kirk, kirk-secant, a pivots.toml or a stiffness."
    raise BadInputError(f"--pivots: {text!r} is no such file and no pivot model. {hint}")


def model_settings(pivots: Any, thermal: str, effects: Path | None) -> Any:
    """Build `ModelSettings` from options."""
    refuse_unknown(thermal, THERMAL, "--thermal")
    from tpjb_ident.compare.predictions import ModelSettings

    refuse_special(effects)
    chosen: tuple = ()
    if effects is not None:
        from model.effects import load_effects

        chosen = load_effects(effects)
    return ModelSettings(pivots, thermal, chosen)


def _show_predictions(frame: Any, name: str) -> None:
    """Print the direct coefficients, at most 20 rows."""
    columns = ["load kN", "dir deg", "speed Hz", "exc. Hz", "kxx MN/m", "kyy MN/m", "cxx kNs/m", "cyy kNs/m",
               "h_min µm"]  # fmt: skip
    rows = [
        [f"{r.static_load_N / 1e3:g}", f"{r.static_load_direction_deg:g}", f"{r.shaft_speed_Hz:g}",
         f"{r.excitation_Hz:g}", f"{r.kxx_N_per_m / 1e6:.1f}", f"{r.kyy_N_per_m / 1e6:.1f}",
         f"{r.cxx_Ns_per_m / 1e3:.1f}", f"{r.cyy_Ns_per_m / 1e3:.1f}", f"{r.min_film_m * 1e6:.1f}"]
        for r in frame.head(20).itertuples()
    ]  # fmt: skip
    table(name, columns, rows)
    if len(frame) > 20:
        print_line(f"... and {len(frame) - 20} more rows in prediction.csv")
