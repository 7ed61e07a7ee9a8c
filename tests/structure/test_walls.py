"""Who may know whom (docs/design.md), held by parsing every import."""

from __future__ import annotations

import ast
import functools
import re
import sys
import tomllib
from collections.abc import Iterable

import pytest

from tests.structure.sources import OURS, ROOT, SOURCES, Spoken, imports_and_calls, texts

#: Who may not import what. Of rigdata the model takes the files that know nothing of rigs. The guard of the package
#: `model` only looks whether the one found is ours; a bearing may be given as the path of its file (`arguments.py`).
WALLS = (
    (r"rigdata/", r"(model|tpjb_ident)\b"),
    (r"model/", r"tpjb_ident\b|rigdata(?!\.(units|near_names|arrays|problem)\b)"),
    (r"tpjb_ident/(?!(compare|diagnosis|cli)/|model_guard\.py|arguments\.py)", r"model\b"),
    (r"(?!tpjb_ident/report/)", r"matplotlib\b"),
    (r"(?!tpjb_ident/(cli/|__main__\.py))", r"tpjb_ident\.cli\b"),
)


@functools.cache
def imported_modules(source: str) -> frozenset[str]:
    """Every module that `source` imports, at any depth, import_module("literal") included."""
    return modules_of(imports_and_calls(source))


def modules_of(nodes: Iterable[Spoken]) -> frozenset[str]:
    """Every module that these imports and calls import."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            found.add(node.module or "")
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif "import_module" in {getattr(node.func, "attr", ""), getattr(node.func, "id", "")}:
            found.update(a.value for a in node.args if isinstance(a, ast.Constant))
    return frozenset(found)


def breaches(path: str, modules: frozenset[str]) -> list[str]:
    """Imports of the file `path` (relative, with slashes) that go through a wall."""
    forbidden = [what for who, what in WALLS if re.match(who, path)]
    return [f"{path} imports {module}" for module in modules for what in forbidden if re.match(what, module)]


def test_no_import_goes_through_a_wall():
    assert len(SOURCES) > 30
    found = []
    for path, text in texts().items():
        found += breaches(path, imported_modules(text))
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("rigdata/x.py", "import model.units"),
        ("rigdata/readers/x.py", "def f():\n    from tpjb_ident import locus"),
        ("model/x.py", "from rigdata import load_campaign"),
        ("model/x.py", "from rigdata.calibration import Channel"),
        ("model/effects/x.py", "import importlib\nimportlib.import_module('rigdata')"),
        ("model/effects/x.py", "from importlib import import_module\nimport_module('rigdata')"),
        ("tpjb_ident/results/x.py", "from model.bearing import Bearing"),
        ("tpjb_ident/compare/x.py", "import matplotlib.pyplot as plt"),
        ("tpjb_ident/report/x.py", "from tpjb_ident.cli import app"),
    ],
)
def test_a_breach_is_seen(path, source):
    assert breaches(path, imported_modules(source))


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("tpjb_ident/compare/x.py", "from model.predict import predict"),
        ("model/x.py", "from rigdata.units import parse_quantity"),
        ("tpjb_ident/cli/x.py", "from tpjb_ident.cli.command import command"),
        ("tpjb_ident/report/x.py", "from matplotlib.figure import Figure"),
    ],
)
def test_what_is_allowed_is_not_a_breach(path, source):
    assert not breaches(path, imported_modules(source))


def declared_names(requirements):
    return {re.split(r"[<>=\[ ]", d)[0].lower() for d in requirements}


def test_every_third_party_import_is_declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = declared_names(project["dependencies"])
    extras = {name for needed in project["optional-dependencies"].values() for name in declared_names(needed)}
    found, at_top = {}, {}
    for path, text in texts().items():
        for module in imported_modules(text):
            top = module.split(".")[0]
            if top not in sys.stdlib_module_names and top not in OURS and top != "bootstrap":
                found.setdefault(top.lower(), path)
        # what an extra brings may be missing: only functions may import it
        body = [n for n in imports_and_calls(text) if isinstance(n, ast.Import | ast.ImportFrom) and not n.col_offset]
        tops = {m.split(".")[0].lower() for m in modules_of(body)}
        at_top |= dict.fromkeys((tops & extras) - declared, path)
    assert not {top: name for top, name in found.items() if top not in declared | extras}
    assert not at_top
