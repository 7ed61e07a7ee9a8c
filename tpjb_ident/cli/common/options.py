"""Options and arguments that several commands share, and their order in the help."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from rigdata.near_names import nearest_name
from rigdata.operating_point import ROTATIONS
from tpjb_ident.errors import BadInputError

#: Bundled files that the examples use, from the folder of the sources.
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"


def one_of(*names: str) -> Callable[[str], list[str]]:
    """Complete a half-typed value to the names it may become."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names if name.startswith(incomplete)]

    return complete


_CAMPAIGN = typer.Argument(metavar="CAMPAIGN", help="Campaign: a folder with campaign.toml, or one HDF5 file.")
CampaignPath = Annotated[Path, _CAMPAIGN]
MaybeCampaign = Annotated[Path | None, _CAMPAIGN]
Coefficients = Annotated[
    Path | None,
    typer.Option("--coefficients", metavar="TABLE.csv", help="Instead of a campaign: K, C as in coefficients.csv."),
]
ReadingError = Annotated[
    str | None, typer.Option("--reading-error", metavar="SHARE", help="How far values of the table hold, such as 5%.")
]
BearingPath = Annotated[Path, typer.Argument(metavar="BEARING.toml", help="Bearing file (tpjb-bearing/1).")]
BearingOption = Annotated[
    Path | None,
    typer.Option("--bearing", metavar="FILE", help="Bearing file [default: the one that the campaign names]."),
]
Thermal = Annotated[
    str,
    typer.Option(
        "--thermal",
        help="isothermal, adiabatic, tehd (pads bend) or thd (heat as it goes: what leaves a pad is there for the next "
        "one, lambda 1, unless the effect hot_oil_carryover says less; the file's clearances hold at 20 degC).",
        autocompletion=one_of("isothermal", "adiabatic", "tehd", "thd"),
    ),
]
PivotChoice = Annotated[
    str, typer.Option("--pivots", help='rigid, kirk, kirk-secant, a pivots.toml, or a stiffness ("5e8 N/m").')
]
Loads = Annotated[str, typer.Option("--load", help='Static loads per bearing: "2.5 kN, 5 kN" or "2.5..8.75:1.25 kN".')]
LoadDirections = Annotated[str, typer.Option("--load-direction", help="Where the load pushes the shaft, from +X.")]
Speeds = Annotated[str, typer.Option("--speed", help='Shaft speeds: "22 Hz" or "1320 rpm".')]
Rotation = Annotated[
    str | None,
    typer.Option(
        "--rotation",
        help="Which way the shaft turns [default: the bearing file's, else counter-clockwise].",
        autocompletion=one_of(*ROTATIONS),
    ),
]
EffectsFile = Annotated[
    Path | None, typer.Option("--effects", metavar="FILE", help="Effects file: what the baseline model lacks.")
]
Method = Annotated[
    str,
    typer.Option(
        "--method",
        help="Estimator of coefficients.csv: mm-eiv, mm, rlm, ols or iv.",
        autocompletion=one_of("mm-eiv", "mm", "rlm", "ols", "iv"),
    ),
]
Norm = Annotated[
    str | None,
    typer.Option(
        "--norm",
        help="Norm of --method rlm: huber, tukey, hampel, ...",
        autocompletion=one_of("huber", "tukey", "hampel", "andrew", "ramsay", "trimmed"),
    ),
]
Lines = Annotated[
    str | None,
    typer.Option("--lines", metavar="LIST", help='Excitation lines that every record holds: "20, 25, 30 Hz".'),
]
Delays = Annotated[
    list[str] | None,
    typer.Option("--delay", metavar="QUANTITY=TIME", help="Known lateness of channels, as force=0.2ms; repeatable."),
]
WorkerCount = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", min=1, help="Processes [default: one per core where it pays]."),
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler to work on, such as tcp://host:8786."),
]


def named(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as a report shows them: files by their names."""
    return {name: getattr(value, "name", value) for name, value in options.items()}


def refuse_unknown(value: str, known: Iterable[str], option: str, several: bool = False) -> None:
    """Let a known name pass; answer another with the nearest."""
    names = tuple(known)
    if value not in names:
        near = nearest_name(value, names)
        hint = f"Did you mean {near!r}?" if near else f"Use {'some' if several else 'one'} of {', '.join(names)}."
        raise BadInputError(f"{option}: {value!r} is not known. {hint}")


#: Parameters from which on headings help more than they cost.
_MANY = 11
#: Headings of the help with the parameters under them, in their order; others stand under "Options".
_HEADINGS = {
    "Arguments": "",
    "Operating points": "load load_direction speed rotation excitation",
    "Model": "bearing pivots thermal effects physics housing_temperature model_tolerance tolerance library",
    "A table in place of records": "coefficients reading_error",
    "Estimation": "method norm lines delay",
    "Tests": "plan locus dry push temperatures repeats noise fault",
    "Options": "",
    "Running": "workers scheduler seed",
    "Output": "name layout plain keep_r window data_sets out as_json units quiet help",
}


class GroupedHelp(TyperCommand):
    """A command whose help lists its options under headings, in plain text, where there are many."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then options by heading; what every command has stands last."""
        parameters = self.get_params(ctx)
        groups: dict[str, list[tuple[str, str]]] = {heading: [] for heading in _HEADINGS}
        for parameter in parameters:
            heading = next((h for h, names in _HEADINGS.items() if parameter.name in names.split()), "Options")
            if parameter.param_type_name == "argument":
                heading = "Arguments"
            elif len(parameters) < _MANY:
                heading = "Options"
            if record := parameter.get_help_record(ctx):
                groups[heading].append(record)
        for heading, records in groups.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)
