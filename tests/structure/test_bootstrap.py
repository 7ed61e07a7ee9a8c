"""One-command set-up: what it says on old Pythons, what it installs with, when it does nothing."""

import ast
import functools
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ENTRIES = ("tpjb_ident/__main__.py", "tests/__main__.py")


@pytest.fixture
def bootstrap(tmp_path, monkeypatch):
    """A copy of the bootstrap in a checkout of its own."""
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "bootstrap.py", tmp_path / ".ci")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    spec = importlib.util.spec_from_file_location("bootstrap_copy", tmp_path / ".ci" / "bootstrap.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def made(bootstrap, monkeypatch):
    """How often a ready environment was made again."""
    bootstrap.PYTHON.parent.mkdir(parents=True)
    bootstrap.PYTHON.write_text("")
    bootstrap.MARKER.write_text(json.dumps({"key": bootstrap._key(), "extras": ["test"]}))
    calls = []
    monkeypatch.setattr(bootstrap, "_make", calls.append)
    return calls


@pytest.mark.parametrize("entry", ENTRIES)
def test_old_pythons_can_parse_the_entries(entry):
    ast.parse((ROOT / entry).read_text(encoding="utf-8"), feature_version=(3, 6))
    (ROOT / entry).read_text(encoding="ascii")


@functools.cache
def working(version: str) -> str | None:
    """Path of an interpreter of that name, if it starts."""
    old = shutil.which(version)
    return old if old and subprocess.run([old, "-c", "pass"], capture_output=True).returncode == 0 else None


@pytest.mark.slow
@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("version", ["python2", "python3.6", "python3.8", "python3.10"])
def test_an_old_python_gets_a_sentence(entry, version):
    old = working(version)
    if old is None:
        pytest.skip(f"no {version} on this machine")
    done = subprocess.run([old, str(ROOT / entry)], capture_output=True, text=True)
    assert done.returncode == 1
    assert "needs Python 3.11 or newer" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("change", ["nothing", "pyproject", "extras", "python", "marker"])
def test_it_is_made_again_when_something_changed_and_left_alone_otherwise(bootstrap, made, change):
    if change == "pyproject":
        (bootstrap.ROOT / "pyproject.toml").write_text("[project]\n")
    elif change == "python":
        bootstrap.PYTHON.unlink()
    elif change == "marker":
        bootstrap.MARKER.write_text("{")
    assert bootstrap.ensure({"test", "lint"} if change == "extras" else {"test"}) == bootstrap.PYTHON
    assert len(made) == (change != "nothing")


@pytest.mark.parametrize(
    ("works", "uv", "expected"),
    [
        ("venv pip", None, "{venv} -m pip install --no-compile"),
        ("ensurepip", None, "{venv} -m pip install --no-compile"),
        ("host pip", None, "{host} -m pip --python {venv} install --no-compile"),
        ("", "/usr/bin/uv", "/usr/bin/uv pip install --python {venv}"),
        ("", None, None),
    ],
)
def test_whatever_the_machine_has_is_used(bootstrap, monkeypatch, works, uv, expected):
    venv, host = str(bootstrap.PYTHON), sys.executable

    names = {
        (venv, "-m", "pip", "--version"): "venv pip",
        (venv, "-m", "ensurepip", "--default-pip"): "ensurepip",
        (host, "-m", "pip", "--python", venv, "--version"): "host pip",
    }
    monkeypatch.setattr(bootstrap, "_works", lambda *command: names.get(command, "other") == works)
    monkeypatch.setattr(bootstrap.shutil, "which", lambda name: uv if name == "uv" else None)
    if expected is None:
        with pytest.raises(bootstrap.SetupError, match="apt install python3-venv"):
            bootstrap._installer()
    else:
        assert " ".join(bootstrap._installer()) == expected.format(venv=venv, host=host)


@pytest.mark.parametrize(
    ("log", "says"),
    [
        ("WARNING: Retrying ... NewConnectionError: ...\nERROR: No matching distribution", "PyPI cannot be reached"),
        ("error: Failed to fetch: `https://...`", "PyPI cannot be reached"),
        ("Collecting x\nERROR: No space left on device\nnote: x", "No space left on device"),
    ],
)
def test_the_cause_is_named(bootstrap, log, says):
    assert says in bootstrap._cause(log)


def test_a_failed_installation_ends_in_one_message_and_no_marker(bootstrap, monkeypatch):
    monkeypatch.setattr(bootstrap, "_make_venv", lambda ours: bootstrap.VENV.mkdir())
    script = "print('ERROR: it did not work'); raise SystemExit(1)"
    monkeypatch.setattr(bootstrap, "_installer", lambda: [sys.executable, "-c", script])
    with pytest.raises(bootstrap.SetupError, match="it did not work") as caught:
        bootstrap.ensure()
    assert str(bootstrap.LOG) in str(caught.value)
    assert not bootstrap.MARKER.exists()


def test_settings_of_the_shell_do_not_send_it_elsewhere(bootstrap, monkeypatch):
    for name in ("PYTHONPATH", "PIP_TARGET", "PIP_USER"):
        monkeypatch.setenv(name, "/elsewhere")
    environment = bootstrap._environment()
    assert not {"PYTHONPATH", "PIP_TARGET", "PIP_USER"} & set(environment)
    assert environment["PATH"] == os.environ["PATH"]


def test_somebody_elses_old_environment_is_not_cleared(bootstrap, monkeypatch):
    bootstrap.PYTHON.parent.mkdir(parents=True)
    bootstrap.PYTHON.write_text("")
    monkeypatch.setattr(bootstrap, "_version_of", lambda python: (3, 9))
    with pytest.raises(bootstrap.SetupError, match=r"holds Python 3\.9"):
        bootstrap._make_venv(ours=False)
    assert bootstrap.PYTHON.exists()
