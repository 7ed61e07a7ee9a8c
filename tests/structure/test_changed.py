"""`python3 tests --changed`: what lies above a change is run, what does not is not."""

import subprocess
import sys

import pytest

from tests.changed import ROOT, TOPS, ImportGraph, changed_files, chosen, lying_above

SOURCES = {
    "rigdata/__init__.py": '_HOMES = {"load": "reader"}\ndef __getattr__(name):\n    pass\n',
    "rigdata/reader.py": "from rigdata.units import SI\n",
    "rigdata/units.py": "SI = 1\n",
    "rigdata/other.py": 'TABLE = "limits.csv"\n',
    "rigdata/limits.csv": "1\n",
    "model/__init__.py": "",
    "model/effects/__init__.py": "",
    "model/effects/gain.py": "",
    "model/registry.py": 'import importlib\nimportlib.import_module(f"model.effects.{name}")\n',
    "tests/conftest.py": "@pytest.fixture\ndef campaign():\n    from rigdata import other\n",
    "tests/a/test_lazy.py": "import rigdata\nrigdata.load()\n",
    "tests/a/test_deep.py": "def test():\n    from rigdata.units import SI\n",
    "tests/a/test_fixture.py": "def test(campaign):\n    pass\n",
    "tests/a/test_string.py": 'CODE = "import rigdata.other"\n',
    "tests/a/test_registry.py": "import model.registry\n",
    "tests/a/test_alone.py": "import math\n",
    "tests/structure/test_rules.py": "",
}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A checkout of a few sources."""
    root = tmp_path_factory.mktemp("checkout")
    for name, text in SOURCES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize(
    ("changed", "above"),
    [
        ("rigdata/units.py", "lazy deep"),
        ("rigdata/reader.py", "lazy"),
        ("rigdata/other.py", "fixture string"),
        ("rigdata/limits.csv", "fixture string lazy deep"),  # the folder's files too
        ("model/effects/gain.py", "registry"),
        ("tests/a/test_alone.py", "alone"),
        ("rigdata/gone.py", ""),
        ("README.md", ""),
    ],
)
def test_what_lies_above_a_change_is_run_and_nothing_else(small, changed, above):
    expected = {f"tests/a/test_{name}.py" for name in above.split()} | {"tests/structure/test_rules.py"}
    assert set(lying_above([changed], small)) == expected


@pytest.mark.parametrize("changed", ["pyproject.toml", "tests/conftest.py"])
def test_what_may_change_every_test_runs_every_test(small, changed):
    assert lying_above([changed, "rigdata/units.py"], small) == ["tests"]


def test_no_change_runs_nothing(small, monkeypatch):
    assert lying_above([], small) == []
    monkeypatch.setattr("tests.changed.changed_files", lambda revision: [])
    with pytest.raises(SystemExit, match="nothing changed"):
        chosen(["--changed"])


def test_the_revision_and_pytest_s_arguments_are_told_apart(monkeypatch):
    asked = []
    monkeypatch.setattr("tests.changed.changed_files", lambda revision: asked.append(revision) or ["pyproject.toml"])
    assert chosen(["-x", "--changed", "main~2", "-q"]) == ["-x", "tests", "-q"]
    assert chosen(["--changed", "-q"]) == ["tests", "-q"]
    assert asked == ["main~2", "HEAD"]


def test_changed_deleted_and_new_files_are_listed(tmp_path):
    def git(*words):
        subprocess.run(["git", "-c", "user.name=n", "-c", "user.email=e", *words], cwd=tmp_path, check=True,
                       capture_output=True)  # fmt: skip

    for name in ("kept", "edited", "deleted"):
        (tmp_path / name).write_text("1\n")
    git("init")
    git("add", ".")
    git("commit", "-m", "first")
    (tmp_path / "edited").write_text("2\n")
    (tmp_path / "deleted").unlink()
    (tmp_path / "new").write_text("1\n")
    assert changed_files("HEAD", tmp_path) == ["deleted", "edited", "new"]


@pytest.mark.slow
def test_the_graph_knows_whatever_a_command_really_imports():
    """Modules of ours that Python has loaded after the commands were imported: the graph must lead to each."""
    entries = ("identification.identify", "compare.comparison", "diagnosis.diagnose", "cli.commands.app")
    heart = [f"tpjb_ident.{name}" for name in entries]
    code = f"import sys, {', '.join(heart)}\nprint(*sorted(m for m in sys.modules if m.split('.')[0] in {TOPS}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    graph = ImportGraph()
    tops = {graph.modules[name] for name in heart}
    loaded = done.stdout.split()
    assert len(loaded) > 200
    for module in loaded:
        assert graph.above([graph.modules[module]]) & tops, module
