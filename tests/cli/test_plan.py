"""`tpjb plan` at the command line."""

import csv
import json
from pathlib import Path

import pytest

from tests.command_line import tpjb

ROCKER = Path(__file__).parents[2] / "model" / "bearings" / "rocker.toml"


@pytest.mark.slow
def test_plan_tells_floor_and_look_alikes_of_a_thin_campaign(tmp_path):
    result = tpjb(
        "plan", ROCKER, "--load", "5 kN", "--excitation", "25 Hz", "--locus", 0, "--no-dry", "--push", 0,
        "--no-temperatures", "--data-sets", "--out", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "out" / "plan.json").read_text(encoding="utf-8"))
    assert data["schema"] == "tpjb-plan/1"
    assert ["oil_viscosity", "supply_temperature"] in data["confusable"]
    assert {"effect", "parameter", "unit", "seen_from", "mistaken_for"} <= set(data["effects"][0])
    with (tmp_path / "out" / "isolability.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][1:] == [row[0] for row in rows[1:]]
    with (tmp_path / "out" / "data_sets.csv").open(encoding="utf-8", newline="") as file:
        sets = list(csv.DictReader(file))
    assert [row["data_set"] for row in sets] == list("ABCDE")
    for name in ("isolability", *(f"isolability_{x}" for x in "ABCDE")):
        assert (tmp_path / "out" / f"{name}.parquet").exists()
        assert (tmp_path / "out" / "figures" / f"{name.replace('_', '-')}.svg").exists()
    numbers = [int(row["numbers"]) for row in sets]
    assert numbers == [4, 8, 8, 8, 16]  # two direct coefficients of K and C; all of h; nothing static; a second speed
    assert int(sets[4]["detectable_nuisances_free"]) >= int(sets[0]["detectable_nuisances_free"])
    assert int(sets[0]["detectable_nuisances_free"]) <= int(sets[0]["detectable_nuisances_known"])


def test_plan_without_dynamic_tests_is_refused(tmp_path):
    result = tpjb("plan", ROCKER, "--load", "abc", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert not (tmp_path / "out").exists()
