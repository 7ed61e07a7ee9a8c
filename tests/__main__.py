"""``python3 tests [--quick] [--changed [REV]] [pytest arguments]``: set up .venv and run the test suite there.

--quick leaves out what is marked slow; --changed runs what lies above the files that differ from REV (default: HEAD).
"""

# The lines before the version check must parse on any Python, so that an old one gets a sentence, not a traceback.
import os
import sys

if sys.version_info < (3, 11):
    sys.exit(
        "tpjb-ident needs Python 3.11 or newer; this is %d.%d (%s).\n"
        "Install one from python.org or your package manager and run, for instance: python3.12 tests"
        % (sys.version_info[0], sys.version_info[1], sys.executable)
    )

if __name__ == "__main__":
    here = os.path.dirname(os.path.abspath(__file__))
    root = os.path.dirname(here)
    sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != here]
    sys.path.insert(0, os.path.join(root, ".ci"))
    import bootstrap

    os.chdir(root)  # pytest finds its settings and testpaths here
    # two workers, each with one thread: what the reference machine has
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    arguments = sys.argv[1:]
    if "--quick" in arguments:
        arguments = ["-m", "not slow"] + [a for a in arguments if a != "--quick"]
    if "--changed" in arguments:
        sys.path.insert(0, root)
        from tests.changed import chosen

        arguments = chosen(arguments)
    if not any(a.startswith(("-n", "--numprocesses")) for a in arguments):
        arguments = ["-n", "2", "--dist", "loadfile"] + arguments  # noqa: RUF005 (parses on old Pythons)
    bootstrap.run("pytest", arguments)
