"""Mutants of interval limits: does a test notice when a limit is computed on the wrong side, or not at all?

    python -m tests.studies.limit_mutants [--only FILE] [--write]

Each mutant changes one expression of one file in a copy of the checkout and runs the tests nearest to it; it is killed
where one of them fails. The tests are first run on the copy as it is, so that a failure is the mutant's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from tests.studies.results import report, study_parser, table

ROOT = Path(__file__).resolve().parents[2]


class Mutant(NamedTuple):
    """One change: file, expression, what it becomes."""

    file: str
    before: str
    after: str


_IDENTIFIED = "tpjb_ident/results/identification.py"
_STIFFNESS = "tpjb_ident/estimators/stiffness.py"
_BANDS = "tpjb_ident/results/band_result.py"
_MODELS = "tpjb_ident/results/frequency_model.py"
_PIVOTS = "tpjb_ident/pivot/curve.py"
_PIVOT_TABLE = "tpjb_ident/pivot/tables.py"
_DIFFERENCE = "tpjb_ident/compare/difference.py"
_COMPARISON = "tpjb_ident/compare/comparison.py"
_EFFECTS = "tpjb_ident/diagnosis/verdict/decide.py"
_EXPORTS = "tpjb_ident/exports/formats.py"
#: Tests nearest to each file, the cheap ones first.
TESTS = {
    _IDENTIFIED: ("tests/runtime/test_intervals.py", "-k", "points"),
    _STIFFNESS: ("tests/identification/test_joints.py",),
    _BANDS: ("tests/runtime/test_intervals.py", "-k", "bands"),
    _MODELS: ("tests/runtime/test_intervals.py",),
    _PIVOTS: ("tests/pivot/test_tables.py",),
    _PIVOT_TABLE: ("tests/pivot/test_tables.py",),
    _DIFFERENCE: ("tests/compare/test_difference.py", "-m", "not slow"),
    _COMPARISON: ("tests/compare/test_tables_of_coefficients.py", "-m", "not slow"),
    _EFFECTS: ("tests/diagnosis/test_limits_of_effects.py",),
    _EXPORTS: ("tests/exports/test_export.py", "-m", "not slow", "-k", "mirror"),
}
MUTANTS = (
    Mutant(_IDENTIFIED, '_lo"] = (value - half[i])', '_lo"] = (value + half[i])'),
    Mutant(_IDENTIFIED, '_lo"] = (value - half[i])', '_lo"] = (value - random[i])'),
    Mutant(_IDENTIFIED, '_hi"] = (value + half[i])', '_hi"] = (value - half[i])'),
    Mutant(_IDENTIFIED, '_hi"] = (value + half[i]) * factor', '_hi"] = value * factor'),
    Mutant(_STIFFNESS, "Interval(self.vector - half", "Interval(self.vector + half"),
    Mutant(_STIFFNESS, "self.vector + half)", "self.vector - half)"),
    Mutant(_STIFFNESS, "np.hypot(random, calibration)", "random"),
    Mutant(_BANDS, '_lo": value - half[i], f', '_lo": value + half[i], f'),
    Mutant(_BANDS, '_hi": value + half[i]}', '_hi": value - half[i]}'),
    Mutant(_MODELS, "value - half, value + half,", "value + half, value + half,"),
    Mutant(_MODELS, "value - half, value + half,", "value - half, value - half,"),
    Mutant(_PIVOTS, "centre * np.exp(-half)", "centre * np.exp(half)"),
    Mutant(_PIVOTS, "np.asarray(centre * np.exp(half))", "np.asarray(centre * np.exp(-half))"),
    Mutant(_PIVOT_TABLE, 'f"{TANGENT}_lo": lo', 'f"{TANGENT}_lo": hi'),
    Mutant(_PIVOT_TABLE, 'f"{SECANT}_lo": secant_lo', 'f"{SECANT}_lo": secant_hi'),
    Mutant(_DIFFERENCE, "difference - half, difference + half", "difference + half, difference + half"),
    Mutant(_DIFFERENCE, "difference - half, difference + half", "difference - half, difference - half"),
    Mutant(_COMPARISON, "= values[name], low, high", "= values[name], high, low"),
    Mutant(_EFFECTS, "value[p.name] - s", "value[p.name] + s"),
    Mutant(_EFFECTS, "min(ends), max(ends)", "max(ends), max(ends)"),
    Mutant(_EXPORTS, 'zip(ENDS, ("", "_hi", "_lo")', 'zip(ENDS, ("", "_lo", "_hi")'),
)  # fmt: skip


def passes(folder: Path, file: str) -> bool:
    """Whether the tests of a file pass in a copy of the checkout."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-P", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *TESTS[file]]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True).returncode == 0


def outcome(folder: Path, mutant: Mutant) -> str:
    """Apply a mutant, run its tests, and take it back."""
    path = folder / mutant.file
    text = path.read_text(encoding="utf-8")
    if mutant.before not in text:
        return "not found"
    path.write_text(text.replace(mutant.before, mutant.after, 1), encoding="utf-8")
    try:
        return "survived" if passes(folder, mutant.file) else "killed"
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> None:
    given = study_parser(__doc__, only="").parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "checkout"
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(".git", "build", ".venv", "__pycache__"))
        rows = []
        for file in (file for file in TESTS if given.only in file):
            whole = passes(folder, file)
            for mutant in (m for m in MUTANTS if m.file == file):
                answer = outcome(folder, mutant) if whole else "tests fail as they are"
                rows.append((f"`{file}`", f"`{mutant.before}`", f"`{mutant.after}`", answer))
                print(*rows[-1], flush=True)
    report(given, "limits", table(("file", "expression", "becomes", "outcome"), rows))


if __name__ == "__main__":
    main()
