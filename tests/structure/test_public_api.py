"""`import tpjb_ident as ti`: everything promised is there, nothing heavy is loaded, a foreign `model` is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import tpjb_ident as ti

ROOT = Path(__file__).parents[2]
PROMISED = [
    "estimate_dynamic_stiffness",
    "r_matrix",
    "load_campaign",
    "load_bearing",
    "predict",
    "Effect",
    "load_pivots",
    "load_effects",
    "identify",
    "fit_pivots",
    "measure_locus",
    "measure_clearance",
    "compare_campaign",
    "check_campaign",
    "write_report",
]


@pytest.mark.parametrize("name", PROMISED)
def test_promised_names_are_there(name):
    assert callable(getattr(ti, name))
    assert name in dir(ti)


def test_an_unknown_name_gets_the_nearest():
    with pytest.raises(AttributeError, match="did you mean 'load_campaign'"):
        _ = ti.load_campain


def test_import_is_light():
    code = (
        "import sys, tpjb_ident\n"
        "print([m for m in ('numpy', 'pandas', 'matplotlib', 'numba', 'model', 'rigdata') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("form", ["package", "module", "namespace"])
def test_another_model_on_the_path_is_refused_by_name(tmp_path, form):
    if form == "module":
        (tmp_path / "model.py").write_text("x = 1\n")
    else:
        (tmp_path / "model").mkdir()
        (tmp_path / "model" / ("__init__.py" if form == "package" else "notes.txt")).write_text("")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        f"sys.path[:] = [p for p in sys.path if p != {str(ROOT)!r}] + [{str(ROOT)!r}]\n"
        "import tpjb_ident as ti\n"
        "ti.load_bearing"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    if form == "namespace":  # a regular package anywhere on the path beats a bare folder: nothing is hidden
        assert done.returncode == 0, done.stderr
    else:
        assert "another package named 'model'" in done.stderr
        assert str(tmp_path) in done.stderr
