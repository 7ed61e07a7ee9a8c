"""The command line: commands by name. Heavy imports stay inside the commands, so that help is instant."""

import importlib
from collections import Counter
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from tpjb_ident.cli.command import COMMANDS, Command

#: What is written outside --out.
_CACHES = (
    "Results go into --out. Outside it only caches are kept: pad solutions in the user's cache folder (at most 200 "
    "MB), the model's machine code beside the program (35 MB). The variable TPJB_CACHE names another folder for both; "
    "TPJB_CACHE=off keeps no pad solutions."
)


class _Program(TyperGroup):
    """All commands; words that cannot be read end in one message with its cure and, with --json, a document."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        self.words = tuple(args)
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except Exception as error:
            if not hasattr(error, "format_message"):
                raise
            path = (getattr(error, "ctx", None) or ctx).command_path
            as_json = "--json" in self.words
            c = Command(path.partition(" ")[2], {}, silent=as_json)
            c.say("error", f"{error.format_message().removesuffix('.')} (`{path} -h` tells what can be typed).")
            if as_json:
                c.print_document(2)
            raise typer.Exit(2) from error


class _OneCommand(TyperCommand):
    """One command; an option that takes one value and is there twice is refused, not taken as it is there last."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        if not ctx.resilient_parsing:
            *_, order = self.make_parser(ctx).parse_args(list(args))
            for parameter, times in Counter(order).items():
                if times > 1 and not (parameter.multiple or getattr(parameter, "is_flag", False)):
                    ctx.fail(f"{parameter.opts[0]}: {times} times. Give it once, several values in one text.")
        return super().parse_args(ctx, args)


# plain help: the markup renderer costs more start-up time than all the rest together
app = typer.Typer(
    name="tpjb",
    cls=_Program,
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
    app.command(name, cls=_OneCommand, epilog=f"\b\nExamples:\n{lines}")(function)
