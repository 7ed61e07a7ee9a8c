"""`import tpjb_ident as ti`: all that is promised is there and prints itself in a line, nothing heavy is loaded."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tpjb_ident as ti
from model.bearing_file import load_bearing
from model.errors import ModelError
from model.predict import predict
from rigdata import OperatingPoint
from tests.good_campaigns import BEARINGS
from tests.report.plot_cases import curve, locus, polygon
from tpjb_ident.columns import place_of
from tpjb_ident.errors import TpjbError

ROOT = Path(__file__).parents[2]
_NAMES = """
    estimate_dynamic_stiffness r_matrix load_campaign load_bearing predict Effect load_pivots load_effects identify
    fit_pivots measure_locus measure_clearance compare_campaign check_campaign write_report
"""
PROMISED = _NAMES.split()


def said_by(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)


@pytest.mark.parametrize("name", PROMISED)
def test_promised_names_are_there(name):
    assert callable(getattr(ti, name))
    assert name in dir(ti)


def test_an_unknown_name_gets_the_nearest():
    with pytest.raises(AttributeError, match="did you mean 'load_campaign'"):
        _ = ti.load_campain


HELP = "from tpjb_ident.cli import main; sys.argv = ['tpjb', '--help']\ntry: main()\nexcept SystemExit: pass"


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("import tpjb_ident", "numpy pandas matplotlib numba model rigdata"),
        ("import rigdata; assert 'load_campaign' in dir(rigdata)", "numpy pandas pyarrow h5py pint scipy"),
        pytest.param("import model.predict, model.film.models", "numba scipy pandas", marks=pytest.mark.slow),
        (HELP, "numpy pandas matplotlib pint numba h5py"),
    ],
)
def test_imports_and_help_load_nothing_heavy(code, heavy):
    done = said_by(f"import sys\n{code}\nprint([m for m in {heavy.split()} if m in sys.modules])")
    assert done.stdout.splitlines()[-1:] == ["[]"], done.stderr


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
    done = said_by(code)
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
    done = said_by(code)
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
    assert ti.check_campaign(ti.load_campaign(small_campaign)) == ti.check_campaign(small_campaign)


def test_a_path_does_where_a_bearing_is_wanted(rocker_file):
    assert ti.predict(str(rocker_file), load=5000.0, speed=138.0, excitation=157.0, thermal="isothermal").converged


DEMO = str(ROOT / "rigdata" / "samples" / "demo.h5")
ROCKER = str(ROOT / "model" / "bearings" / "rocker.toml")


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
        (lambda: ti.export(3, "csv", "r"), "export: source: must be a result, a table or the path of one, got int"),
        (lambda: ti.export(ROCKER, "ros", "r"), "export: format 'ros' is not known. Did you mean 'ross'"),
        (lambda: ti.export(ti.load_bearing(ROCKER), "ross", ROCKER), f"export: {ROCKER}: File exists. Give a place"),
        (lambda: ti.write_pivots("/none/x.toml", [curve()], "x"), "write_pivots: /none/x.toml: No such file or "),
        (
            lambda: ti.fit_pivots(DEMO, "kirk"),
            "fit_pivots: pivot_angles: must hold the direction of every pad .*, got str",
        ),
        (lambda: ti.fit_pivots(DEMO, [np.zeros(2)]), "fit_pivots: pivot_angles: must hold the direction of every pad"),
        (lambda: ti.load_bearing(""), "load_bearing: .: is a folder. Give the path of a"),
        (lambda: ti.identify(5), "identify: campaign: must be a Campaign or the path of one, got int"),
        (lambda: ti.predict(5, load=5e3, speed=138.0), "predict: bearing: must be a Bearing or the path of"),
        (lambda: ti.predict(ROCKER, 5000.0), "predict: speed is missing"),
        (lambda: ti.predict(ROCKER, 5e3, speed=138.0, pivots=None), "predict: pivots: need 5 pivot laws"),
        (lambda: ti.plan(ROCKER, []), "plan: .*no dynamic runs"),
        (lambda: ti.plan(3, ()), "plan: "),
        (lambda: ti.r_matrix(3, 4), "r_matrix: "),
        (lambda: ti.diagnose(3), "diagnose: "),
        (lambda: ti.check_campaign(3), "check_campaign: "),
        (lambda: ti.estimate_dynamic_stiffness(np.eye(2), np.eye(2), -1.0), "estimate_dynamic_stiffness: "),
    ],
)
def test_what_cannot_be_taken_is_refused_in_our_own_words(call, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((TpjbError, ModelError), match=f"^{says}") as caught:
        call()
    name, _, rest = str(caught.value).partition(": ")
    assert not rest.startswith(name)  # it stands there once
    assert not list(tmp_path.iterdir())


POINT = OperatingPoint(5000.0, -math.pi / 2, 2 * math.pi * 22, 2 * math.pi * 25)
BEARING = load_bearing(BEARINGS / "rocker.toml")
SHOWN = (
    "Rocker-backed five-pad bearing: 5 pads, 99.86 x 69.6 mm, Cb 80 um, preload 0.385 (pad #1), rocker pivots, "
    "oil ISO VG 46 at 40 degC"
)


@pytest.mark.parametrize(
    ("printed", "text"),
    [
        (str(BEARING), SHOWN),
        (repr(BEARING), f"<Bearing: {SHOWN}>"),
        (str(BEARING.pads[0]), "pad at -90 deg, 63.5 deg of arc, Cb 80 um, preload 0.385"),
        (repr(ti.IdentifySettings()), "IdentifySettings()"),
        (repr(ti.IdentifySettings(method="ols")), "IdentifySettings(method='ols')"),
        (repr(ti.CompareSettings(thermal="tehd")), "CompareSettings(thermal='tehd')"),
        (str(POINT), "5000 N at -90 deg, shaft 22 Hz, excited at 25 Hz"),
        (place_of(4448.2216, 47.0), "4.448 kN, 47 Hz"),
        (str(OperatingPoint(500.0)), "500 N at -90 deg, shaft at rest"),
    ],
)
def test_bearings_pads_points_and_what_was_changed_of_settings(printed, text):
    assert printed == text


def test_a_bearing_without_pads():
    assert "0 pads" in str(BEARING.with_pads(()))


def test_positions_and_curves_are_one_line_and_a_table_in_a_notebook():
    for result in (polygon(), locus(), curve(1)):
        assert repr(result).startswith(f"<{type(result).__name__}: ")
        assert "\n" not in repr(result)
        assert "µm" in result._repr_html_() or "MN/m" in result._repr_html_()
        assert len(result.to_dataframe())


def test_campaigns_runs_points_and_records_in_the_units_of_a_rig(small_campaign):
    campaign = ti.load_campaign(small_campaign)
    assert repr(campaign).startswith("<Campaign ")
    assert len(repr(campaign)) < 140
    run = campaign.of_kind("dynamic")[0]
    assert repr(run).startswith(f"<Run {run.id}: dynamic, ")
    assert repr(run.point) == f"<OperatingPoint: {run.point}>"
    assert repr(run.record("X1A")).startswith("<Record X1A: displacement at 45 deg, ")
    assert "1.57" not in repr(run)


def test_prediction():
    p = predict(BEARING, 5000.0, speed=2 * math.pi * 22, thermal="isothermal")
    assert str(p).startswith("5000 N at -90 deg, 22 Hz: shaft at (")
    assert f"thinnest film {1e6 * p.min_film:.3g} um" in str(p)
    assert str(p).endswith("all well")
    table = p.to_dataframe()
    assert len(table) == np.size(p.excitation)
    assert table["kyy_N_per_m"][0] == np.ravel(p.kyy)[0]
    assert table["shaft_speed_Hz"][0] == pytest.approx(22.0)
