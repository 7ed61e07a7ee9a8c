"""Mutation score of the files that the numbers depend on: a small change in the source, do the tests notice?

    python tests/benchmarks/mutation_score.py [--mutants 40] [--seed 1] [FILE ...]

A mutant changes one operator, comparison, constant, condition or return value, drawn by the seed from all places of
the file. Each runs the tests of its file (`TESTS`, without the slow ones) in a process forked from one that has the
libraries loaded. Survivors are listed with their line: they are a missing test or an equal program.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.machinery
import json
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
UNIT = "tests/unit/"
#: Source: the tests that are its own.
TESTS = {
    "rigdata/calibration.py": (UNIT + "test_rigdata_calibration.py", UNIT + "test_rigdata_manifest.py"),
    "tpjb_ident/dynamic/errors_in_variables.py": (UNIT + "test_dynamic_estimate.py",),
    "tpjb_ident/dynamic/mm.py": (UNIT + "test_dynamic_estimate.py",),
    "tpjb_ident/dynamic/rlm.py": (UNIT + "test_dynamic_estimate.py",),
    "tpjb_ident/pivot/law_fit.py": (UNIT + "test_pivot_laws.py", UNIT + "test_pivot_curve.py"),
    "tpjb_ident/pivot/projection.py": (UNIT + "test_pivot_projection.py",),
}
#: Seconds of wall time after which a mutant counts as noticed: it does not end.
LONGEST = 240.0
_ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
               ast.MatMult: ast.Mult, ast.FloorDiv: ast.Div, ast.Mod: ast.Mult}  # fmt: skip
_COMPARE = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
            ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One changed program: the line, what was changed, the tree."""

    line: int
    what: str
    tree: ast.Module


def mutants(source: str) -> list[Mutant]:
    """Every mutant of `source`, docstrings and annotations left alone."""
    tree = ast.parse(source)
    count = len(_places(tree))
    found = []
    for index in range(count):
        changed = copy.deepcopy(tree)
        node, what, change = _places(changed)[index]
        change()
        found.append(Mutant(node.lineno, what, ast.fix_missing_locations(changed)))
    return found


def _places(tree: ast.Module) -> list[tuple[Any, str, Callable[[], None]]]:
    """Node, description and the change itself, for every place that can be changed."""
    found: list[tuple[Any, str, Callable[[], None]]] = []
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for statement in function.body:
            for node in ast.walk(statement):
                if not isinstance(statement, ast.FunctionDef):
                    _add(found, node)
    return found


def _add(found: list[tuple[Any, str, Callable[[], None]]], node: Any) -> None:
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        new = _ARITHMETIC[type(node.op)]
        found.append((node, f"{type(node.op).__name__} -> {new.__name__}", lambda: setattr(node, "op", new())))
    elif isinstance(node, ast.Compare):
        other = _COMPARE[type(node.ops[0])]
        what = f"{type(node.ops[0]).__name__} -> {other.__name__}"
        found.append((node, what, lambda: node.ops.__setitem__(0, other())))
    elif isinstance(node, ast.BoolOp):
        swap = ast.Or if isinstance(node.op, ast.And) else ast.And
        found.append((node, f"-> {swap.__name__}", lambda: setattr(node, "op", swap())))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        found.append((node, f"no {type(node.op).__name__}", lambda: setattr(node, "op", ast.UAdd()) if isinstance(
            node.op, ast.USub) else setattr(node, "operand", ast.UnaryOp(ast.Not(), node.operand))))  # fmt: skip
    elif isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        new_value = node.value + 1 if node.value in (0, 1) else node.value * 2
        found.append((node, f"{node.value} -> {new_value}", lambda: setattr(node, "value", new_value)))
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        found.append((node, f"{node.value} -> {not node.value}", lambda: setattr(node, "value", not node.value)))
    elif isinstance(node, (ast.If, ast.IfExp, ast.While)):
        found.append((node, "condition negated", lambda: setattr(node, "test", ast.UnaryOp(ast.Not(), node.test))))
    elif isinstance(node, ast.Return) and node.value is not None:
        found.append((node, "returns None", lambda: setattr(node, "value", ast.Constant(None))))


class _Loader(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives one module the mutant's code."""

    def __init__(self, name: str, path: Path, tree: ast.Module) -> None:
        self.name, self.path, self.tree = name, path, tree

    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        return importlib.machinery.ModuleSpec(name, self, origin=str(self.path)) if name == self.name else None

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = str(self.path)
        exec(compile(self.tree, str(self.path), "exec"), module.__dict__)


def noticed(file: str, mutant: Mutant | None, tests: tuple[str, ...]) -> bool:
    """Whether the tests fail on the mutant (None: on the source as it is)."""
    child = os.fork()
    if child:
        until = time.time() + LONGEST
        while time.time() < until:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status != 0
            time.sleep(0.05)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return True
    code = 1
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        os.chdir(ROOT)
        if mutant is not None:
            name = file.removesuffix(".py").replace("/", ".")
            sys.meta_path.insert(0, _Loader(name, ROOT / file, mutant.tree))
        import pytest

        options = [
            "-x",
            "-q",
            "--no-header",
            "-p",
            "no:xdist",
            "-p",
            "no:cacheprovider",
            "-m",
            "not slow and not samples",
        ]
        code = int(pytest.main([*options, *tests]))
    finally:
        os._exit(code)


def score(file: str, count: int, seed: int) -> dict[str, Any]:
    """Try `count` mutants of a file."""
    tests = TESTS[file]
    if noticed(file, None, tests):
        raise SystemExit(f"{file}: its tests fail without any mutant")
    every = mutants((ROOT / file).read_text(encoding="utf-8"))
    drawn = random.Random(f"{seed}-{file}").sample(every, min(count, len(every)))
    survivors = [f"line {m.line}: {m.what}" for m in drawn if not noticed(file, m, tests)]
    killed = len(drawn) - len(survivors)
    return {"file": file, "of": len(every), "tried": len(drawn), "killed": killed,
            "score": round(killed / len(drawn), 3), "survivors": survivors}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", choices=[*TESTS, []])
    parser.add_argument("--mutants", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    import pandas  # noqa: F401
    import scipy.optimize
    import scipy.stats  # noqa: F401
    import statsmodels.api  # noqa: F401

    for file in given.files or TESTS:
        print(json.dumps(score(file, given.mutants, given.seed), indent=1), flush=True)


if __name__ == "__main__":
    main()
