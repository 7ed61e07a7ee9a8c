"""The wheel holds what it needs: built, installed outside the checkout, and the demo run from it."""

import hashlib
import json
import os
import shutil
import site
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


def call(*command, **options):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def release(tmp_path_factory):
    """Folder of a release, which is built twice and compared, and what was printed of it."""
    folder = tmp_path_factory.mktemp("release")
    return folder, call(sys.executable, ROOT / ".ci" / "release.py", folder)


@pytest.fixture(scope="module")
def wheel(release):
    (path,) = release[0].glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Python of a fresh environment with the wheel in it, the dependencies lent by this one."""
    folder = tmp_path_factory.mktemp("fresh")
    call(sys.executable, "-m", "venv", "--without-pip", folder / "venv")
    python = folder / "venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    home = call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    # .pth lines add these folders, but not the .pth files in them: the editable checkout stays out
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), *site.getsitepackages()}
    Path(home, "lent.pth").write_text("\n".join(sorted(lent)) + "\n")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(home)
    # what was compiled of the same sources: half a minute to compile again; its stamp is of their text, not their place
    for code in [*ROOT.glob("model/**/*.nbi"), *ROOT.glob("model/**/*.nbc")]:
        kept = Path(home, code.relative_to(ROOT))
        kept.parent.mkdir(exist_ok=True)
        shutil.copy(code, kept)
    return python


def test_the_wheel_holds_three_packages_and_their_data(wheel):
    with zipfile.ZipFile(wheel) as archive:
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


@pytest.fixture(scope="module")
def demo(installed, tmp_path_factory):
    """Output folder of a demo run far from the checkout, and what it printed."""
    folder = tmp_path_factory.mktemp("elsewhere")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    place = call(installed, "-c", "import tpjb_ident; print(tpjb_ident.__file__)", cwd=folder, env=environment)
    assert str(ROOT) not in place
    printed = call(installed, "-m", "tpjb_ident", "demo", "--out", folder / "out", cwd=folder, env=environment)
    return folder / "out", printed


def test_the_demo_recovers_its_own_truth(demo):
    out, _ = demo
    truth = json.loads((ROOT / "rigdata" / "samples" / "demo.truth.json").read_text(encoding="utf-8"))
    frame = pd.read_csv(out / "coefficients.csv").set_index(["static_load_N", "excitation_Hz"])
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
    assert pd.read_csv(out / "clearance.csv")["clearance_m"].to_numpy() == pytest.approx(
        truth["clearance_cold_m"], abs=1e-6
    )


def test_the_demo_tells_the_papers_story(demo):
    out, _ = demo
    frame = pd.read_csv(out / "comparison.csv")
    worst = {
        name: max(np.abs(rows[f"{c}_ratio"] - 1).median() for c in ("kyy_N_per_m", "cxx_Ns_per_m", "cyy_Ns_per_m"))
        for name, rows in frame.groupby("pivots")
    }
    assert worst["measured"] < 0.02
    assert worst["kirk"] > 0.10
    assert worst["rigid"] > worst["kirk"]


def test_the_demo_says_where_its_report_is(demo):
    out, printed = demo
    assert f"Report: {out / 'report.html'}" in printed
    text = (out / "report.html").read_text(encoding="utf-8")
    assert text.count("<svg") == len(list((out / "figures").glob("*.svg"))) >= 15
    assert "http://" not in text.replace("http://www.w3.org/", "")
    assert "https://" not in text


def test_a_release_is_the_same_bits_twice_and_says_what_it_is_made_of(release, wheel):
    folder, printed = release
    bill = json.loads((folder / "sbom.cdx.json").read_text(encoding="utf-8"))
    names = {part["name"].lower() for part in bill["components"]}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {requirement.split(">=")[0] for requirement in project["dependencies"]} <= names
    assert all(part["version"] and part["purl"].startswith("pkg:pypi/") for part in bill["components"])
    (digest,) = bill["metadata"]["component"]["hashes"]
    assert digest["content"] == hashlib.sha256(wheel.read_bytes()).hexdigest()
    assert f"{digest['content']}, the same twice" in printed
