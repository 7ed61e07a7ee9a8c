"""The examples in docstrings run as they stand, and what a user calls or implements has one.

An example is given `np`, `ti`, and the paths `demo` (the bundled campaign) and `rocker` (a bearing file).
"""

import ast
import doctest
import functools
import importlib
import os
from collections.abc import Iterator

import numpy as np
import pytest

import tpjb_ident as ti
from tests.command_line import coarse_pictures
from tests.structure.sources import ROOT, texts
from tests.structure.test_docstrings import definitions, handed_on

#: Faces without an example; this number may only fall.
WITHOUT_EXAMPLE = 0
#: What `docs/plots.md` and the readers' own tests show.
SHOWN_ELSEWHERE = ("tpjb_ident/report/plots/", "tpjb_ident/exports/", "rigdata/readers/formats/", "model/effects/")
#: What was asked, and the answer.
ANSWERS: dict[str, object] = {}


def described() -> Iterator[tuple[str, str, str]]:
    """File, name and docstring of everything at the top of a file, and of the public methods of faces."""
    for path, name, node, face in definitions():
        text = ast.get_docstring(node, clean=False) or ""
        if face or ">>>" in text:
            yield path, name, text


@pytest.fixture(scope="module", autouse=True)
def computed_once():
    """What several examples and pages ask of the demo alike (K and C, static tests, comparison) is computed once."""
    from tpjb_ident.compare import comparison, static_tests
    from tpjb_ident.diagnosis import campaign, from_python
    from tpjb_ident.identification import identify

    def once(function):
        @functools.wraps(function)
        def answer(*given, **named):
            asked = [part for part in (*given, *named.values()) if part not in (None, campaign.Baseline())]
            asked = [part for part in asked if not callable(part)]  # whom to tell of the progress
            asked = [os.path.realpath(part.path) if hasattr(part, "path") else part for part in asked]
            key = f"{function.__name__} {asked}"
            if key not in ANSWERS:
                ANSWERS[key] = function(*given, **named)
            return ANSWERS[key]

        return answer

    with coarse_pictures(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)  # as `tests.command_line` has it
        for name, module in (("identify", identify), ("measure_static", static_tests)):
            patch.setattr(module, name, once(getattr(module, name)))
            patch.setattr(campaign, name, getattr(module, name))
        patch.setattr(comparison, "compare_campaign", once(comparison.compare_campaign))
        shared = once(campaign.diagnose_campaign)
        for module in (campaign, from_python):
            patch.setattr(module, "diagnose_campaign", shared)
        yield


FILES = [path for path, text in texts().items() if ">>> " in text]


def runs(path: str, name: str) -> str:
    """Run an example as it stands, that of the module for no name; what it gave in place of what it shows."""
    module = importlib.import_module(path.removesuffix(".py").removesuffix("/__init__").replace("/", "."))
    shown = functools.reduce(getattr, name.split(".") if name else (), module)
    given = {
        "np": np,
        "ti": ti,
        "demo": ROOT / "rigdata/samples/demo.h5",
        "rocker": ROOT / "model/bearings/rocker.toml",
    }
    parsed = doctest.DocTestParser().get_doctest(
        getattr(shown, "fget", shown).__doc__ or "", {**vars(module), **given}, name, path, 0
    )
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE, verbose=False)
    runner.run(parsed, out=report.append)
    return "".join(report)


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES)
def test_examples_run(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [name for path, name, text in described() if path == file and ">>>" in text]
    assert [report for name in ["", *names] if (report := runs(file, name))] == []


def test_faces_have_an_example():
    public = {name for _, name in handed_on()}
    without = []
    for path, name, text in described():
        if "." in name or name not in public or path.startswith(SHOWN_ELSEWHERE) or name.endswith("Error"):
            continue
        if ">>>" not in text:
            without.append(f"{path}:{name}")
    assert len(without) <= WITHOUT_EXAMPLE, "\n".join(without)
