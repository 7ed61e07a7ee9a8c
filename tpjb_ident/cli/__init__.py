"""The `tpjb` command. Nothing else imports this package."""

from __future__ import annotations


def main() -> None:
    """Run the command line; the entry point of `tpjb` and of ``python -m tpjb_ident``."""
    import sys

    try:
        from tpjb_ident.cli.app import app

        app(prog_name="tpjb")
    except KeyboardInterrupt:  # while the libraries are loaded, before any command has begun
        print("tpjb: interrupted: nothing was written.", file=sys.stderr)
        sys.exit(130)
