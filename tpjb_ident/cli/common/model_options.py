"""`--physics`: names of what the model does beyond the paper's, as `model.options.Options`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from tpjb_ident.cli.common.options import refuse_unknown
from tpjb_ident.cli.common.quantities import parse_value
from tpjb_ident.errors import BadInputError

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


def parse_physics(names: str | None, housing: str | None) -> Any:
    """Read `--physics` and `--housing-temperature`.

    Parameters
    ----------
    names : str, optional
        Option --physics.
    housing : str, optional
        Option --housing-temperature.

    Returns
    -------
    Options

    Raises
    ------
    BadInputError
        Unknown name, or a housing temperature without growth.
    """
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
