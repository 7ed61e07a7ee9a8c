"""The command line: commands by name. Heavy imports stay inside the commands, so that help is instant."""

import importlib
from typing import Annotated, Any

import typer

from tpjb_ident.cli.command import COMMANDS

#: What is written outside --out.
_CACHES = (
    "Results go into --out. Outside it only caches are kept: pad solutions in the user's cache folder (at most 200 "
    "MB), the model's machine code beside the program (35 MB). The variable TPJB_CACHE names another folder for both; "
    "TPJB_CACHE=off keeps no pad solutions."
)
# plain help: the markup renderer costs more start-up time than all the rest together
app = typer.Typer(
    name="tpjb",
    help="Identify, predict and compare the dynamic coefficients of tilting-pad journal bearings.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog=_CACHES,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from tpjb_ident import __version__

        typer.echo(f"tpjb-ident {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.", callback=_version)] = False,
) -> None:
    pass


#: Files of this folder, in the order of the help.
_IN_ORDER = (
    "init show check identify pivot locus predict compare diagnose plan simulate demo export view watch verify rerun"
)
for name in _IN_ORDER.split():
    importlib.import_module(f"tpjb_ident.cli.commands.{name}")
    function: Any = COMMANDS[name]
    lines = "\n".join(f"  {example}" for example in function.examples)
    app.command(name, epilog=f"\b\nExamples:\n{lines}")(function)
