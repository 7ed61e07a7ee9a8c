"""Options that every command has, ``--json`` and ``--quiet``, and the examples under its help."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from tpjb_ident.cli.common.output import output_of

DEMO = "rigdata/samples/demo.h5"
ROCKER = "model/bearings/rocker.toml"

EXAMPLES: dict[str, tuple[str, ...]] = {
    "check": (f"tpjb check {DEMO}", f"tpjb check {DEMO} --json > findings.json"),
    "compare": (f"tpjb compare {DEMO}", f'tpjb compare {DEMO} --pivots "kirk, measured" --thermal tehd'),
    "demo": ("tpjb demo", "tpjb demo --out /tmp/look"),
    "diagnose": (f"tpjb diagnose {DEMO}", f"tpjb diagnose {DEMO} --pivots measured --out found"),
    "export": (
        "tpjb export tpjb-identify-out --to ross",
        "tpjb export tpjb-predict-out --to excel",
        f"tpjb export {DEMO} --to mat",
    ),
    "identify": (f"tpjb identify {DEMO}", f"tpjb identify {DEMO} --method rlm --norm tukey --out rlm"),
    "init": ("tpjb init exports", "tpjb init exports --bearing rocker.toml"),
    "locus": (f"tpjb locus {DEMO}",),
    "pivot": (f"tpjb pivot {DEMO}",),
    "plan": (
        f"tpjb plan {ROCKER}",
        f'tpjb plan {ROCKER} --load "5, 10 kN" --excitation "20..60:10 Hz" --locus 0',
    ),
    "predict": (
        f'tpjb predict {ROCKER} --load "2.5..8.75:1.25 kN" --excitation "25 Hz"',
        f'tpjb predict {ROCKER} --pivots rigid --speed "1000, 2000, 3000 rpm"',
        f"tpjb predict {ROCKER} --pivots tpjb-pivot-out/pivots.toml --thermal tehd",
    ),
    "show": (
        f"tpjb show {DEMO}",
        f"tpjb show {DEMO} --run d-05000-25-01 --picture",
        "tpjb show exports/run1.csv",
    ),
    "simulate": (
        f"tpjb simulate {ROCKER} --plan short --seed 1",
        f'tpjb simulate {ROCKER} --load "5 kN" --excitation "10..50:10 Hz" --fault "dead run=d-* channel=X1A"',
    ),
    "verify": ("tpjb verify tpjb-identify-out", "tpjb verify tpjb-identify-out --input campaigns/rocker-A"),
    "watch": ("tpjb watch records", 'tpjb watch records --once --within "3 %"'),
    "view": (f"tpjb view {DEMO}", "tpjb view tpjb-compare-out"),
}


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


def add_command(app: typer.Typer, command: Callable[..., None]) -> None:
    """Register a command with the common options and its examples."""
    name = command.__name__
    app.command(name, cls=Grouped, epilog=_examples_text(name))(_with_output_options(command, name))


def _with_output_options(command: Callable[..., None], name: str) -> Callable[..., None]:
    """Wrap a command so that it takes ``--json`` and ``--quiet`` after its own options."""

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


def _examples_text(name: str) -> str | None:
    """Examples of a command, as they stand under its help; None if there are none."""
    lines = EXAMPLES.get(name)
    if not lines:
        return None
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)
