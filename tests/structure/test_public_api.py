"""`import tpjb_ident as ti`: everything promised is there, nothing heavy is loaded, a foreign `model` is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tpjb_ident as ti
from tpjb_ident.errors import TpjbError

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


def test_the_names_are_the_public_ones_only():
    assert set(dir(ti)) == set(ti.__all__)


@pytest.mark.slow
@pytest.mark.parametrize("first", ["", "import tpjb_ident.diagnosis.comparison.fit, tpjb_ident.exports.formats\n"])
def test_a_package_that_bears_the_name_of_a_function_is_called_whatever_was_imported_first(first):
    code = (
        f"import inspect\n{first}import tpjb_ident as ti\n"
        "first = lambda function: list(inspect.signature(function).parameters)[:2]\n"
        "print(first(ti.diagnose), first(ti.export))\n"
        "try:\n    ti.diagnose(5)\nexcept ValueError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines() == [
        "['campaign', 'bearing'] ['source', 'to']",
        "diagnose: campaign: must be a Campaign or the path of one, got int.",
    ], done.stderr


@pytest.mark.slow
def test_a_path_does_where_a_campaign_is_wanted(small_campaign):
    result = ti.identify(str(small_campaign), ti.IdentifySettings(method="ols"))
    assert repr(result).startswith("<Identification: ")
    assert len(repr(result)) < 120
    assert "MN/m" in result.summary()
    assert "kxx, MN/m" in result._repr_html_()
    assert result.to_dataframe()["kxx_N_per_m"].notna().all()
    with pytest.raises(ValueError, match="identify: campaign: must be a Campaign or the path of one, got int"):
        ti.identify(5)


def test_a_path_does_where_a_bearing_is_wanted(rocker_file):
    found = ti.predict(str(rocker_file), load=5000.0, speed=138.0, excitation=157.0, thermal="isothermal")
    assert found.converged
    with pytest.raises(ValueError, match="bearing: must be a Bearing or the path of a bearing file, got int"):
        ti.predict(5, load=5000.0, speed=138.0)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: ti.load_bearing(3), "load_bearing: source: must be a path, got int"),
        (lambda: ti.load_campaign(3), "load_campaign: path: must be a path, got int"),
        (lambda: ti.load_effects(3), "load_effects: path: must be a path, got int"),
        (lambda: ti.load_pivots(3), "load_pivots: path: must be a path, got int"),
        (lambda: ti.pivot_table(4), "pivot_table: curves: must hold what fit_pivots gives, got int"),
        (lambda: ti.write_pivots("p.toml", [4], "x"), "write_pivots: curves: must hold what fit_pivots gives, got int"),
        (lambda: ti.write_report(3, 4), "write_report: folder: must be a path, got int"),
        (lambda: ti.write_report("r", 4), "write_report: comparison: must be what compare_campaign gives, got int"),
        (lambda: ti.export(3, "csv", "r"), "source: must be a result, a table or the path of one, got int"),
    ],
)
def test_what_cannot_be_taken_is_refused_in_our_own_words(call, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TpjbError, match=says):
        call()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_an_open_campaign_is_checked_as_its_path_is(small_campaign):
    assert ti.check_campaign(ti.load_campaign(small_campaign)) == ti.check_campaign(small_campaign)


def test_a_plan_from_python(rocker_file):
    import math

    point = ti.OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 2 * math.pi * 25)
    with pytest.raises(ValueError, match="no dynamic runs"):
        ti.plan(rocker_file, [])
    assert point.excitation_hz == 25.0


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("r_matrix", (3, 4)), ("diagnose", (3,)), ("export", (3, "csv", "x")), ("check_campaign", (3,)),
        ("estimate_dynamic_stiffness", (np.eye(2), np.eye(2), -1.0)), ("load_pivots", (3,)), ("plan", (3, ())),
        ("predict", ("model/bearings/rocker.toml", 5000.0)), ("identify", (3,)),
    ],
)  # fmt: skip
def test_what_is_refused_begins_with_the_name_of_the_function_once(name, arguments):
    with pytest.raises(ValueError, match=rf"^{name}: (?!{name})"):
        getattr(ti, name)(*arguments)
