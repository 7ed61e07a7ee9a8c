"""No source of ours unpickles, evaluates, starts a shell or speaks to the network; exceptions are named one by one."""

from __future__ import annotations

import ast

import pytest

from tests.structure.sources import SOURCES, imports_and_calls, texts

#: Modules that run what they read, or reach out of the machine.
MODULES = {
    "pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "code", "codeop", "ctypes", "yaml",
    "socket", "ssl", "http", "urllib", "urllib3", "requests", "httpx", "aiohttp", "ftplib", "smtplib", "telnetlib",
    "xmlrpc", "socketserver", "asyncio",
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


def dangers(source: str) -> list[str]:
    """What `source` does that a reader of strangers' files must not."""
    found = []
    for node in imports_and_calls(source):
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name.split(".")[0] in MODULES | {"subprocess"}]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in MODULES | {"subprocess"}:
            found.append(str(node.module))
        elif isinstance(node, ast.Call):
            found += _dangerous_call(node)
    return found


def _dangerous_call(node: ast.Call) -> list[str]:
    found = []
    if isinstance(node.func, ast.Name) and node.func.id in CALLS:
        found.append(node.func.id)
    if isinstance(node.func, ast.Attribute):
        owner = node.func.value.id if isinstance(node.func.value, ast.Name) else ""
        if (owner, node.func.attr) in ATTRIBUTES:
            found.append(f"{owner}.{node.func.attr}")
        if node.func.attr in {"eval", "query"} and owner not in {"self"}:
            found.append(f".{node.func.attr}")
        if node.func.attr == "load" and owner in {"np", "numpy"}:
            allow = [k.value for k in node.keywords if k.arg == "allow_pickle"]
            if not (allow and isinstance(allow[0], ast.Constant) and allow[0].value is False):
                found.append("np.load without allow_pickle=False")
    for keyword in node.keywords:
        value = getattr(keyword.value, "value", None)
        if (keyword.arg, value) in {("shell", True), ("allow_pickle", True)}:
            found.append(f"{keyword.arg}=True")
    return found


def test_no_source_runs_what_it_reads():
    assert len(SOURCES) > 30
    found = {path: set(dangers(text)) for path, text in texts().items()}
    assert not {name: more for name, seen in found.items() if (more := seen - ALLOWED.get(name, set()))}


@pytest.mark.parametrize(
    "source",
    [
        "import pickle", "from urllib.request import urlopen", "eval(x)", "exec(x)", "import os\nos.system(x)",
        "import numpy as np\nnp.load(x)", "np.load(x, allow_pickle=True)", "pd.read_pickle(x)", "frame.query(x)",
        "f(shell=True)", "import subprocess", "import http.server", "__import__(x)",
    ],
)  # fmt: skip
def test_a_danger_is_seen(source):
    assert dangers(source)


@pytest.mark.parametrize("source", ["import json", "np.load(x, allow_pickle=False)", "a.evaluate(b)", "import tomllib"])
def test_what_is_harmless_is_none(source):
    assert not dangers(source)


WRITING = {"write_text", "write_bytes", "unlink", "rename", "replace_file", "rmtree", "touch"}


def test_raw_data_are_opened_for_reading_only():
    """In rigdata nothing but the virtual rig opens a file to write, or an HDF5 file other than with "r"."""
    found = []
    for path, text in texts().items():
        if not path.startswith("rigdata/") or path.startswith("rigdata/virtual_rig/"):
            continue
        for node in (node for node in imports_and_calls(text) if isinstance(node, ast.Call)):
            function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            given = [*node.args, *(keyword.value for keyword in node.keywords)]
            values = [a.value for a in given if isinstance(a, ast.Constant) and isinstance(a.value, str)]
            modes = [value for value in values if value and value.strip("rwaxbt+") == ""]
            opens_to_write = function in {"open", "File"} and any(set(mode) & set("wax+") for mode in modes)
            if function in WRITING or opens_to_write:
                found.append(f"{path}:{node.lineno} {function}")
    assert not found
