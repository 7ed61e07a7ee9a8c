"""``python3 tpjb_ident demo`` sets up .venv and runs there; ``python -m tpjb_ident`` is the command line."""

# The lines before the version check must parse on any Python, so that an old one gets a sentence, not a traceback.
import os
import sys

if sys.version_info < (3, 11):
    sys.exit(
        "tpjb-ident needs Python 3.11 or newer; this is %d.%d (%s).\n"
        "Install one from python.org or your package manager and run, for instance: python3.12 tpjb_ident demo"
        % (sys.version_info[0], sys.version_info[1], sys.executable)
    )


def _run_as_folder():  # type: () -> None
    """Leave this folder off the path (its module names are common words) and go on in the checkout's environment."""
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != here]
    bootstrap_folder = os.path.join(os.path.dirname(here), ".ci")
    if os.path.exists(os.path.join(bootstrap_folder, "bootstrap.py")):
        sys.path.insert(0, bootstrap_folder)
        import bootstrap

        bootstrap.run("tpjb_ident", sys.argv[1:], ("view", "formats"))
    sys.path.insert(0, os.path.dirname(here))  # the folder of an installed copy: nothing to set up


if __name__ == "__main__":
    if not __package__:
        _run_as_folder()
    from tpjb_ident.cli import main

    main()
