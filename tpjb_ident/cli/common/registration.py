"""Options that every command has, ``--json`` and ``--quiet``, and the examples under its help."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from tpjb_ident.cli.common.examples import EXAMPLES
from tpjb_ident.cli.common.output import output_of

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document with all results, for other programs.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print warnings and errors only.")]


#: Parameters from which on headings help more than they cost.
MANY = 11
#: Headings of the help with the parameters under them, in their order; others stand under "Options".
HEADINGS = {
    "Arguments": "",
    "Operating points": "load load_direction speed excitation",
    "Model": "bearing pivots thermal effects physics housing_temperature model_tolerance tolerance library",
    "A table in place of records": "coefficients reading_error",
    "Estimation": "method norm lines delay",
    "Tests": "plan locus dry push temperatures repeats noise fault",
    "Options": "",
    "Running": "workers scheduler seed",
    "Output": "name layout plain keep_r window data_sets out as_json quiet help",
}


class Grouped(TyperCommand):
    """A command whose help lists its options under headings, in plain text, where there are many."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then options by heading; what every command has stands last."""
        parameters = self.get_params(ctx)
        groups: dict[str, list[tuple[str, str]]] = {heading: [] for heading in HEADINGS}
        for one in parameters:
            heading = next((h for h, names in HEADINGS.items() if one.name in names.split()), "Options")
            if one.param_type_name == "argument":
                heading = "Arguments"
            elif len(parameters) < MANY:
                heading = "Options"
            if record := one.get_help_record(ctx):
                groups[heading].append(record)
        for heading, records in groups.items():
            if records:
                with formatter.section(heading):
                    formatter.write_dl(records)


def add_command(app: typer.Typer, command: Callable[..., None], name: str | None = None) -> None:
    """Register a command with the common options and its examples.

    Parameters
    ----------
    app : Typer
    command : callable
        Guarded already.
    name : str, optional
        Default: the function's own.
    """
    name = name or command.__name__
    app.command(name, cls=Grouped, epilog=examples_text(name))(with_output_options(command, name))


def with_output_options(command: Callable[..., None], name: str) -> Callable[..., None]:
    """Wrap a command so that it takes ``--json`` and ``--quiet`` after its own options.

    Parameters
    ----------
    command : callable
        Guarded already.
    name : str
        Of the command.
    """

    @functools.wraps(command)
    def wrapper(*args: Any, as_json: bool = False, quiet: bool = False, **kwargs: Any) -> None:
        with output_of(name, as_json, quiet):
            command(*args, **kwargs)

    hints = typing.get_type_hints(command, include_extras=True)
    extra = {"as_json": Json, "quiet": Quiet}
    signature = inspect.signature(command)
    parameters = [p.replace(annotation=hints[p.name]) for p in signature.parameters.values()]
    parameters += [
        inspect.Parameter(n, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=a) for n, a in extra.items()
    ]
    wrapper.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    wrapper.__annotations__ = {**hints, **extra}
    return wrapper


def examples_text(name: str) -> str | None:
    """Examples of a command, as they stand under its help; None if there are none.

    Parameters
    ----------
    name : str
        Of the command.
    """
    lines = EXAMPLES.get(name)
    if not lines:
        return None
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)
