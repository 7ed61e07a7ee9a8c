"""Run the quick tests with the lowest versions that pyproject.toml allows (standard library only).

    python3 .ci/lowest.py [FOLDER] [pytest arguments]

Makes (or completes) an environment in FOLDER, by default a temporary one, with every direct dependency of the package
and of its `test` extra at its lower bound. A bound that does not hold fails here and is to be raised. The oldest Python
allowed is the one to use: the oldest versions have no wheels for newer ones.
"""

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OURS = "tpjb-ident"
#: Old libraries warn of what the newest ones beneath them deprecate; that is not for us to mend.
#: The kept pictures are as the newest matplotlib draws them.
OLD = ("-W", "default::DeprecationWarning", "-W", "default::PendingDeprecationWarning", "-W", "default::FutureWarning",
       "--deselect", "tests/report/test_plots.py::test_picture")  # fmt: skip


def lowest(extras: tuple[str, ...] = ("test",)) -> list[str]:
    """Requirements `name==bound` of the package and these extras, extras within extras unfolded."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    waiting = [*project["dependencies"], *(r for e in extras for r in project["optional-dependencies"][e])]
    found = []
    while waiting:
        requirement = waiting.pop(0)
        name, inner, bound = re.fullmatch(r"([\w.-]+)(?:\[([\w,]+)\])?(?:>=([\w.]+))?", requirement).groups()
        if name == OURS:
            waiting += [r for e in inner.split(",") for r in project["optional-dependencies"][e]]
        elif bound is None:
            raise SystemExit(f"pyproject.toml: '{requirement}' has no lower bound to test.")
        else:
            found.append(f"{name}=={bound}")
    return found


def main(arguments: list[str]) -> int:
    """Make the environment, run the quick tests in it; the exit code of pytest."""
    given = [arguments.pop(0)] if arguments and not arguments[0].startswith("-") else []
    folder = Path(*given) if given else Path(tempfile.mkdtemp(prefix="tpjb-lowest-"))
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    wanted = lowest()
    print(f"{python}: {' '.join(wanted)}", flush=True)
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *wanted], check=True)
    subprocess.run([*pip, "--no-deps", "--editable", ROOT], check=True)
    tests = [python, "-P", "-m", "pytest", "-n", "2", "--dist", "loadfile", "-m", "not slow", *OLD, *arguments]
    return subprocess.run(tests, cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
