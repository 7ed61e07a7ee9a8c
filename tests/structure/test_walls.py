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

#: Files of rigdata that know nothing of rigs: the model imports them, and only them.
GROUND = ("rigdata.units", "rigdata.near_names", "rigdata.arrays", "rigdata.problem")
#: The guard only looks whether the `model` found is ours; a bearing may be given as the path of its file.
MAY_IMPORT_MODEL = ("compare", "diagnosis", "cli", "model_guard.py", "arguments.py")


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
    parts = path.split("/")
    if parts[0] == "model":
        modules = frozenset(m for m in modules if ".".join(m.split(".")[:2]) not in GROUND)
    tops = {m.split(".")[0] for m in modules}
    found = []
    if parts[0] in ("rigdata", "model"):
        others = {"rigdata", "model", "tpjb_ident"} - {parts[0]}
        found += [f"{path} imports {top}" for top in sorted(tops & others)]
    elif parts[1] not in MAY_IMPORT_MODEL and "model" in tops:
        found.append(f"{path} imports model")
    if parts[:2] != ["tpjb_ident", "report"] and "matplotlib" in tops:
        found.append(f"{path} imports matplotlib")
    inside_cli = parts[:2] in (["tpjb_ident", "cli"], ["tpjb_ident", "__main__.py"])
    if not inside_cli and any(m == "tpjb_ident.cli" or m.startswith("tpjb_ident.cli.") for m in modules):
        found.append(f"{path} imports the command line")
    return found


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


#: Distributions that are imported by another name.
IMPORTED_AS = {"pillow": "pil"}


def declared_names(requirements):
    names = {re.split(r"[<>=\[ ]", d)[0].lower() for d in requirements}
    return {IMPORTED_AS.get(name, name) for name in names}


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
