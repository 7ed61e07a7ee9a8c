"""The wheel holds what it needs: built, installed outside the checkout, and the demo run from it."""

import hashlib
import json
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests import installed_wheel
from tests.installed_wheel import Shipped

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shipped(session_folder) -> Shipped:
    return installed_wheel.shipped(session_folder)


@pytest.fixture(scope="module")
def demo(shipped) -> Path:
    """Output folder of a demo run far from the checkout."""
    return Path(shipped.out)


def test_the_wheel_holds_three_packages_and_their_data(shipped):
    with zipfile.ZipFile(shipped.wheel) as archive:
        names = set(archive.namelist())
        points = next(archive.read(n).decode() for n in names if n.endswith("entry_points.txt"))
    tops = {name.split("/")[0] for name in names}
    assert {t for t in tops if not t.endswith(".dist-info")} == {"rigdata", "model", "tpjb_ident"}
    assert {
        "rigdata/py.typed", "model/py.typed", "tpjb_ident/py.typed", "rigdata/samples/demo.h5",
        "rigdata/samples/demo.truth.json", "model/bearings/rocker.toml", "model/bearings/spherical.toml",
        "tpjb_ident/report/templates/report.html", "tpjb_ident/report/templates/style.css",
        "tpjb_ident/exports/templates/ross.jinja",
    } <= names  # fmt: skip
    assert "tpjb = tpjb_ident.cli:main" in points
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]


def test_the_demo_recovers_its_own_truth(demo):
    truth = json.loads((ROOT / "rigdata" / "samples" / "demo.truth.json").read_text(encoding="utf-8"))
    frame = pd.read_csv(demo / "coefficients.csv").set_index(["static_load_N", "excitation_Hz"])
    inside, n = 0, 0
    for point in truth["points"]:
        row = frame.loc[(point["static_load_N"], point["excitation_Hz"])]
        for i, axis in enumerate("xy"):
            for kind, unit in (("K", "N_per_m"), ("C", "Ns_per_m")):
                name, true = f"{kind.lower()}{axis}{axis}_{unit}", point[kind][i][i]
                assert row[name] == pytest.approx(true, rel=0.01), name
                inside += row[f"{name}_lo"] <= true <= row[f"{name}_hi"]
                n += 1
    assert inside >= 0.9 * n
    assert pd.read_csv(demo / "clearance.csv")["clearance_m"].to_numpy() == pytest.approx(
        truth["clearance_cold_m"], abs=1e-6
    )


def test_the_demo_tells_the_papers_story(demo):
    frame = pd.read_csv(demo / "comparison.csv")
    worst = {
        name: max(np.abs(rows[f"{c}_ratio"] - 1).median() for c in ("kyy_N_per_m", "cxx_Ns_per_m", "cyy_Ns_per_m"))
        for name, rows in frame.groupby("pivots")
    }
    assert worst["measured"] < 0.02
    assert worst["kirk"] > 0.10
    assert worst["rigid"] > worst["kirk"]


def test_the_demo_says_where_its_report_is(shipped, demo):
    assert f"Report: {shipped.report}" in shipped.printed
    text = shipped.report.read_text(encoding="utf-8")
    assert text.count("<svg") == len(list((demo / "figures").glob("*.svg"))) >= 15
    assert "http://" not in text.replace("http://www.w3.org/", "")
    assert "https://" not in text


def test_a_release_is_the_same_bits_twice_and_says_what_it_is_made_of(shipped):
    bill = json.loads(Path(shipped.release, "sbom.cdx.json").read_text(encoding="utf-8"))
    names = {part["name"].lower() for part in bill["components"]}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {requirement.split(">=")[0] for requirement in project["dependencies"]} <= names
    assert all(part["version"] and part["purl"].startswith("pkg:pypi/") for part in bill["components"])
    (digest,) = bill["metadata"]["component"]["hashes"]
    assert digest["content"] == hashlib.sha256(shipped.wheel.read_bytes()).hexdigest()
    assert f"{digest['content']}, the same twice" in shipped.built
