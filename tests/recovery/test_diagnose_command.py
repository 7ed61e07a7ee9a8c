"""`tpjb diagnose` from the records of a campaign that an independent program made, to the page and the effects file."""

import json
from pathlib import Path

import pandas as pd
import pytest

from tests.command_line import ended, tpjb

SAMPLES = Path(__file__).parents[2].parent / "shared" / "samples"
pytestmark = [pytest.mark.slow, pytest.mark.samples, pytest.mark.skipif(not SAMPLES.is_dir(), reason="no ../shared")]


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("diagnosed") / "out"
    ended(0, "diagnose", SAMPLES / "effect-b.h5", "--workers", 1, "--out", out)
    return out


def test_the_hidden_effect_is_named_with_an_interval_that_holds_it(diagnosed):
    verdict = json.loads((diagnosed / "diagnosis.json").read_text())
    truth = json.loads((SAMPLES / "truth" / "effect-b.json").read_text())["effects"]
    assert verdict["verdict"] == "named"
    assert [effect["name"] for effect in verdict["effects"]] == [effect["name"] for effect in truth]
    (found,) = verdict["effects"]
    true = truth[0]["parameters"]["fraction"]
    given = found["parameters"]["fraction"]
    assert given["lo"] < true < given["hi"]
    assert given["hi"] - given["lo"] < 0.1 * true


def test_the_gap_shrinks_on_points_that_no_fit_has_seen(diagnosed):
    gap = json.loads((diagnosed / "diagnosis.json").read_text())["gap"]
    assert gap["heldout_after"] < 0.5 * gap["heldout_before"]


def test_the_effects_file_is_read_by_predict_and_changes_what_the_cells_show(diagnosed, tmp_path):
    bearing = SAMPLES.parent / "bearings" / "spherical.toml"
    for name, more in (("plain", ()), ("updated", ("--effects", diagnosed / "updated.effects.toml"))):
        ended(0, "predict", bearing, "--thermal", "isothermal", *more, "--out", tmp_path / name)
    plain, updated = (pd.read_csv(tmp_path / name / "prediction.csv").iloc[0] for name in ("plain", "updated"))
    # a share of one cell's force in the other one: kyx shows that share of kxx, or kxy of kyy
    change = abs(updated["kxy_N_per_m"] - plain["kxy_N_per_m"]) / plain["kyy_N_per_m"]
    assert change == pytest.approx(0.035, rel=0.5)


def test_the_page_stands_alone_and_the_record_vouches_for_it(diagnosed):
    page = (diagnosed / "report.html").read_text(encoding="utf-8")
    assert "The load cells hand" in page  # the finding in words, not the effect's name in code
    assert "of each force to the other axis" in page
    assert 'src="http' not in page
    assert list((diagnosed / "figures").glob("*.svg"))
    assert tpjb("verify", diagnosed).exit_code == 0
