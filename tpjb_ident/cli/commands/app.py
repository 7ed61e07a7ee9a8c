"""The command line: commands by name. Heavy imports stay inside the commands, so that help is instant."""

from __future__ import annotations

from typing import Annotated

import typer

from tpjb_ident.cli.commands.check import check
from tpjb_ident.cli.commands.compare import compare
from tpjb_ident.cli.commands.demo import demo
from tpjb_ident.cli.commands.diagnose import diagnose
from tpjb_ident.cli.commands.export import export
from tpjb_ident.cli.commands.identify import identify
from tpjb_ident.cli.commands.init import init
from tpjb_ident.cli.commands.locus import locus
from tpjb_ident.cli.commands.pivot import pivot
from tpjb_ident.cli.commands.plan import plan
from tpjb_ident.cli.commands.predict import predict
from tpjb_ident.cli.commands.rerun import rerun
from tpjb_ident.cli.commands.show import show
from tpjb_ident.cli.commands.simulate import simulate
from tpjb_ident.cli.commands.verify import verify
from tpjb_ident.cli.commands.view import view
from tpjb_ident.cli.commands.watch import watch
from tpjb_ident.cli.options import GroupedHelp

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


_COMMANDS = (
    init, show, check, identify, pivot, locus, predict, compare, diagnose, plan, simulate, demo, export, view,
    watch, verify, rerun,
)  # fmt: skip
for command in _COMMANDS:
    lines = "\n".join(f"  {example}" for example in command.examples)  # type: ignore[attr-defined]
    app.command(command.__name__, cls=GroupedHelp, epilog=f"\b\nExamples:\n{lines}")(command)
