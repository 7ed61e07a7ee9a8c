"""Lines and branches that the tests reach, by package, from what `coverage` has gathered.

    coverage run -m pytest -p no:xdist; coverage combine; python tests/studies/coverage_by_package.py [--worst 15]

Functions that numba compiles are not traced: they are left out and counted apart (pyproject.toml, `exclude_also`).
"""

from __future__ import annotations

import argparse
import ast
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

import coverage

ROOT = Path(__file__).resolve().parents[2]
COUNTS = ("num_statements", "covered_lines", "num_branches", "covered_branches")


def summaries(data: Path) -> dict[str, dict[str, Any]]:
    """File relative to the checkout -> what the JSON report says of it."""
    cover = coverage.Coverage(data_file=str(data), config_file=str(ROOT / "pyproject.toml"))
    cover.load()
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "coverage.json"
        cover.json_report(outfile=str(target))
        files = json.loads(target.read_text(encoding="utf-8"))["files"]
    return {Path(name).as_posix(): found for name, found in files.items()}


def package(file: str) -> str:
    """`rigdata/readers/text/csv.py` -> `rigdata/readers`."""
    return file.rpartition("/")[0]


def share(covered: int, all_of_it: int) -> str:
    """In per cent; a dash where there is nothing to cover."""
    return f"{100.0 * covered / all_of_it:5.1f} %" if all_of_it else "-"


def compiled_functions() -> dict[str, int]:
    """File -> how many of its functions numba compiles."""
    found = {}
    for path in sorted((ROOT / "model").rglob("*.py")):
        names = [ast.unparse(d) for n in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
                 if isinstance(n, ast.FunctionDef) for d in n.decorator_list]  # fmt: skip
        if "compiled" in names:
            found[path.relative_to(ROOT).as_posix()] = names.count("compiled")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / ".coverage")
    parser.add_argument("--worst", type=int, default=15, help="files with the most branches and lines not reached")
    given = parser.parse_args()
    files = summaries(given.data)
    totals: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    for file, found in files.items():
        for name in {package(file), file.split("/")[0], "all"}:
            for k, count in enumerate(COUNTS):
                totals[name][k] += found["summary"][count]
    print("| package | lines | covered | branches | covered |\n|---|---|---|---|---|")
    for name in sorted(totals, key=lambda n: (n == "all", n)):
        lines, reached, branches, taken = totals[name]
        print(f"| `{name}` | {lines} | {share(reached, lines)} | {branches} | {share(taken, branches)} |")
    print("\nMost lines and branches not reached:")
    missed = {f: s["summary"]["missing_lines"] + s["summary"]["missing_branches"] for f, s in files.items()}
    for file in sorted(missed, key=lambda f: -missed[f])[: given.worst]:
        print(f"  {missed[file]:4d} {file}: lines {', '.join(map(str, files[file]['missing_lines'][:20]))}")
    print("\nCompiled by numba, not traced:")
    for file, count in compiled_functions().items():
        print(f"  {count:2d} functions in {file}")


if __name__ == "__main__":
    main()
