"""Mutation score of the files that the numbers depend on: a small change in the source, do the tests notice?

    python tests/studies/mutation_score.py [--mutants 0] [--seed 1] [--out FILE] [--again FILE] [FILE ...]

All mutants of `mutation_operators.py` (or a number of them, drawn by the seed) against the quick tests that reach them
(`mutation_trial.py`). Survivors are listed with their line: a missing test, or an equal program. Equal programs are
listed by hand with the reason in `mutation_equal.toml` and left out of the denominator. `--again` tries the survivors
of an earlier record only, after new tests (`--tests`) or with a larger `--budget`, and keeps what was killed then.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import random
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import mutation_operators
import mutation_trial
import pytest

ROOT = mutation_trial.ROOT
UNIT = "tests/unit/"
_DYNAMIC = (
    UNIT + "test_dynamic_*.py",
    UNIT + "test_load_direction.py",
    UNIT + "test_tables.py",
    UNIT + "test_run_store.py",
)
_PIVOT = (UNIT + "test_pivot_*.py", UNIT + "test_virtual_rig_dry.py", "tests/recovery/test_pivot_recovery.py")
_ESTIMATOR = (UNIT + "test_dynamic_estimate.py", UNIT + "test_dynamic_exact_limits.py")
#: Folder or file: the tests that are asked; of several that fit, the longest name counts.
TESTS = {
    "rigdata/calibration.py": (UNIT + "test_rigdata_calibration.py", UNIT + "test_rigdata_manifest.py"),
    "tpjb_ident/dynamic": _DYNAMIC,
    "tpjb_ident/dynamic/estimators/errors_in_variables.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/mm.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/ols.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/r_matrix.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/rlm.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/robust_constants.py": _ESTIMATOR,
    "tpjb_ident/dynamic/estimators/uncertainty.py": _ESTIMATOR,
    "tpjb_ident/pivot": _PIVOT,
}


def targets() -> list[str]:
    """All files that are scored."""
    found = (str(f.relative_to(ROOT)) for name in TESTS for f in _sources(ROOT / name) if f.name != "__init__.py")
    return list(dict.fromkeys(found))


def _sources(place: Path) -> list[Path]:
    return [place] if place.suffix == ".py" else sorted(place.glob("*.py"))


def tests_of(files: list[str]) -> list[str]:
    """Test files for these sources."""
    own = [TESTS[max((n for n in TESTS if file.startswith(n)), key=len)] for file in files]
    patterns = dict.fromkeys(test for tests in own for test in tests)
    return [str(p.relative_to(ROOT)) for pattern in patterns for p in sorted(ROOT.glob(pattern))]


def equal_programs() -> dict[tuple[str, str, str], str]:
    """(file, source line, what) -> reason."""
    listed = tomllib.loads((Path(__file__).parent / "mutation_equal.toml").read_text(encoding="utf-8"))
    return {(file, m["line"], what): m["why"] for file, rows in listed.items() for m in rows for what in m["what"]}


def figures(verdict: mutation_trial.Verdict) -> dict[str, Any]:
    """What is reported of a file."""
    killed, survived = len(verdict.killed), len(verdict.survived)
    return {
        "file": verdict.file,
        "mutants": killed + survived + len(verdict.equal),
        "killed": killed,
        "equal": len(verdict.equal),
        "unreached": verdict.unreached,
        "score": round(killed / max(killed + survived, 1), 3),
        "seconds": round(verdict.seconds),
        "survivors": verdict.survived,
    }


def earlier(record: Path) -> dict[str, dict[str, Any]]:
    """File -> its last verdict in a record."""
    rows = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    return {row["file"]: row["all"] for row in rows}


def number(told: str) -> int:
    """Number of a mutant in its file, from what is told of it."""
    return int(told[1:].split()[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--mutants", type=int, default=0, help="how many per file; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, default=mutation_trial.BUDGET, help="seconds of tests for a mutant")
    parser.add_argument("--tests", nargs="+", help="other test files than those of `TESTS`")
    parser.add_argument("--again", type=Path, help="record of which the survivors are tried once more")
    parser.add_argument("--out", type=Path, help="one line of JSON per file, added to")
    given = parser.parse_args()
    os.chdir(ROOT)
    before = {} if given.again is None else earlier(given.again)
    files = given.files or list(before) or targets()

    def chosen(file: str, every: list[mutation_operators.Mutant]) -> list[mutation_operators.Mutant]:
        if file in before:
            left = {number(told) for told in before[file]["survived"]}
            return [m for m in every if m.number in left]
        return (
            random.Random(f"{given.seed}-{file}").sample(every, given.mutants)
            if 0 < given.mutants < len(every)
            else every
        )

    terminal = os.fdopen(os.dup(1), "w")

    def say(verdict: mutation_trial.Verdict) -> None:
        if verdict.file in before:
            if before[verdict.file]["source"] != verdict.source:
                raise pytest.UsageError(f"{verdict.file} has changed since {given.again}")
            verdict.killed = before[verdict.file]["killed"] + verdict.killed
            verdict.equal = before[verdict.file]["equal"] + verdict.equal
        told = figures(verdict)
        print(json.dumps(told, indent=1), file=terminal, flush=True)
        if given.out:
            with given.out.open("a", encoding="utf-8") as sink:
                sink.write(json.dumps(told | {"all": dataclasses.asdict(verdict)}) + "\n")

    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        trial = mutation_trial.Trial(files, equal_programs(), chosen, say, given.budget)
        options = ["-q", "--no-header", "-p", "no:xdist", "-p", "no:cacheprovider", "--tb=no", "--assert=plain",
                   f"--basetemp={scratch}/tests", "-m", "not slow and not samples"]  # fmt: skip
        sys.exit(int(pytest.main([*options, *(given.tests or tests_of(files))], plugins=[trial])))


if __name__ == "__main__":
    main()
