"""What no source may do: import through a wall, run what it reads, swallow a warning, write among raw data.

Who may know whom is told in docs/design.md; exceptions are named one by one.
"""

import ast
import functools
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator

import pytest

from tests.structure.sources import OURS, ROOT, SOURCES, Spoken, imports_and_calls, texts

#: Who may not import what. Of rigdata the model takes the files that know nothing of rigs. The guard of the package
#: `model` only looks whether the one found is ours; a bearing may be given as the path of its file (`arguments.py`).
WALLS = (
    (r"rigdata/", r"(model|tpjb_ident)\b"),
    (r"model/", r"tpjb_ident\b|rigdata(?!\.(units|near_names|arrays|problem)\b)"),
    (r"tpjb_ident/(?!(compare|diagnosis|cli)/|model_guard\.py|arguments\.py)", r"model\b"),
    (r"(?!tpjb_ident/report/)", r"matplotlib\b"),
    (r"", r"matplotlib\.pyplot\b"),  # its figures are global, and stay
    (r"(?!tpjb_ident/(cli/|__main__\.py))", r"tpjb_ident\.cli\b"),
    (r"", r"tests\b"),
)
#: Modules that run what they read, or reach out of the machine.
MODULES = {
    "pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "code", "codeop", "ctypes", "yaml",
    "socket", "ssl", "http", "urllib", "urllib3", "requests", "httpx", "aiohttp", "ftplib", "smtplib", "telnetlib",
    "xmlrpc", "socketserver", "asyncio", "subprocess",
}  # fmt: skip
CALLS = {"eval", "exec", "__import__", "breakpoint", "input"}
ATTRIBUTES = {
    ("os", "system"), ("os", "popen"), ("os", "startfile"), ("pd", "read_pickle"), ("pandas", "read_pickle"),
    ("np", "fromregex"), ("numexpr", "evaluate"),
}  # fmt: skip
#: file: what it may do, and why.
ALLOWED = {
    "rigdata/readers/formats/sandbox.py": {"subprocess"},  # this interpreter, to read files that crash libraries
    "tpjb_ident/runtime/executors.py": {"pickle"},  # what its own processes send each other, never a file
    "tpjb_ident/runtime/threads.py": {"ctypes"},  # OpenBLAS as numpy has loaded it, to say how many threads it takes
}
WRITING = {"write_text", "write_bytes", "unlink", "rename", "replace_file", "rmtree", "touch"}


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
            found.add(node.module or "")
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif "import_module" in {getattr(node.func, "attr", ""), getattr(node.func, "id", "")}:
            found.update(a.value for a in node.args if isinstance(a, ast.Constant))
    return frozenset(found)


def calls(text: str) -> Iterator[tuple[ast.Call, str, str, list[object]]]:
    """Every call: whose function it is, the function, and the constants that it is given."""
    for node in imports_and_calls(text):
        if isinstance(node, ast.Call):
            function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            owner = getattr(node.func.value, "id", "?") if isinstance(node.func, ast.Attribute) else ""
            given = (*node.args, *(keyword.value for keyword in node.keywords))
            yield node, owner, function, [a.value for a in given if isinstance(a, ast.Constant)]


def through_walls(path: str, text: str) -> list[str]:
    """Imports of a file that go through a wall."""
    forbidden = [what for who, what in WALLS if re.match(who, path)]
    return [module for module in imported_modules(text) for what in forbidden if re.match(what, module)]


def dangers(path: str, text: str) -> list[str]:
    """What a reader of strangers' files must not do."""
    found = [module.split(".")[0] for module in imported_modules(text) if module.split(".")[0] in MODULES]
    for node, owner, function, _ in calls(text):
        if (not owner and function in CALLS) or (owner, function) in ATTRIBUTES:
            found.append(function)
        if function in {"eval", "query"} and owner not in {"", "self"}:
            found.append(f".{function}")
        stated = {(keyword.arg, getattr(keyword.value, "value", None)) for keyword in node.keywords}
        if function == "load" and owner in {"np", "numpy"} and ("allow_pickle", False) not in stated:
            found.append("np.load without allow_pickle=False")
        found += [f"{name}=True" for name in ("shell", "allow_pickle") if (name, True) in stated]
    return [danger for danger in found if danger not in ALLOWED.get(path, ())]


def swallowed(path: str, text: str) -> list[str]:
    """Warnings, or exceptions of arithmetic, that are silenced without a word of the reason."""
    if not any(word in text for word in ("filter", "seterr", "errstate")):  # it need not be parsed
        return []
    lines, found = text.splitlines(), []
    for node, _, function, constants in calls(text):
        if function in ("simplefilter", "filterwarnings", "seterr") and "ignore" in constants:
            found.append(f"line {node.lineno}: {function}")
        if function == "errstate" and "#" not in lines[node.lineno - 1]:
            found.append(f"line {node.lineno}: errstate without a reason")
    return found


def writes(path: str, text: str) -> list[str]:
    """In rigdata nothing but the virtual rig opens a file to write, or an HDF5 file other than with "r"."""
    if not path.startswith("rigdata/") or path.startswith("rigdata/virtual_rig/"):
        return []
    found = []
    for node, _, function, constants in calls(text):
        modes = [word for word in constants if isinstance(word, str) and word and word.strip("rwaxbt+") == ""]
        opens_to_write = function in {"open", "File"} and any(set(mode) & set("wax+") for mode in modes)
        if function in WRITING or opens_to_write:
            found.append(f"line {node.lineno}: {function}")
    return found


RULES = (through_walls, dangers, swallowed, writes)


@pytest.mark.parametrize("rule", RULES)
def test_no_source_breaks_a_rule(rule: Callable[[str, str], list[str]]):
    assert len(SOURCES) > 30
    assert {path: found for path, text in texts().items() if (found := rule(path, text))} == {}


THROUGH_WALLS = (
    ("rigdata/x.py", "import model.units"),
    ("rigdata/readers/x.py", "def f():\n    from tpjb_ident import locus"),
    ("model/x.py", "from rigdata import load_campaign"),
    ("model/x.py", "from rigdata.calibration import Channel"),
    ("model/effects/x.py", "import importlib\nimportlib.import_module('rigdata')"),
    ("model/effects/x.py", "from importlib import import_module\nimport_module('rigdata')"),
    ("tpjb_ident/results/x.py", "from model.bearing import Bearing"),
    ("tpjb_ident/compare/x.py", "import matplotlib.pyplot as plt"),
    ("tpjb_ident/report/x.py", "from tpjb_ident.cli import app"),
    ("tpjb_ident/report/x.py", "from matplotlib import pyplot"),
    ("model/x.py", "from tests.manifests import PROBE"),
)
DANGERS = (
    "import pickle", "from urllib.request import urlopen", "eval(x)", "exec(x)", "import os\nos.system(x)",
    "import numpy as np\nnp.load(x)", "np.load(x, allow_pickle=True)", "pd.read_pickle(x)", "frame.query(x)",
    "f(shell=True)", "import subprocess", "import http.server", "__import__(x)", "frame.iloc[0].query(x)",
)  # fmt: skip
SWALLOWED = (
    "import warnings\nwarnings.simplefilter('ignore')",
    "warnings.filterwarnings('ignore', category=RuntimeWarning)",
    "warnings.filterwarnings(action='ignore')",
    "np.seterr(all='ignore')",
    "with np.errstate(divide='ignore'):\n    pass",
)
WRITES = ("path.write_text(x)", "open(x, 'w')", "h5py.File(x, 'r+')")
BREACHES = [
    *((through_walls, *breach) for breach in THROUGH_WALLS),
    *((dangers, "x.py", source) for source in DANGERS),
    *((swallowed, "x.py", source) for source in SWALLOWED),
    *((writes, "rigdata/x.py", source) for source in WRITES),
]


@pytest.mark.parametrize(("rule", "path", "source"), BREACHES)
def test_a_breach_is_seen(rule, path, source):
    assert rule(path, source)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("tpjb_ident/compare/x.py", "from model.predict import predict"),
        ("model/x.py", "from rigdata.units import parse_quantity"),
        ("tpjb_ident/cli/x.py", "from tpjb_ident.cli.command import command"),
        ("tpjb_ident/report/x.py", "from matplotlib.figure import Figure"),
        ("x.py", "import json"),
        ("x.py", "np.load(x, allow_pickle=False)"),
        ("x.py", "a.evaluate(b)"),
        ("rigdata/x.py", "h5py.File(x, 'r')"),
    ],
)
def test_what_is_harmless_breaks_none(path, source):
    assert [rule(path, source) for rule in RULES] == [[]] * len(RULES)


def declared_names(requirements):
    return {re.split(r"[<>=\[ ]", d)[0].lower() for d in requirements}


def test_every_third_party_import_is_declared_and_the_wheel_holds_the_three_packages():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == list(OURS)
    declared = declared_names(project["project"]["dependencies"])
    extras = {n for needed in project["project"]["optional-dependencies"].values() for n in declared_names(needed)}
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


def test_what_the_mutation_score_takes_exists():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mutmut"]
    named = {*project["only_mutate"], *project["pytest_add_cli_args_test_selection"]}
    assert {name for name in named if not list(ROOT.glob(name))} == set()
