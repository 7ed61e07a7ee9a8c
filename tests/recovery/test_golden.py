"""Sample campaigns, which an independent program made, by the commands. What `tpjb identify` says of nine of them: of
three against their truth, of all against a known commit; what `tpjb diagnose` says of one, to its page.

The golden values pin the code against itself, in units of its standard deviations: a change of layout must not move a
coefficient, its interval or a flag. A change of method may: `python -m tests.recovery.test_golden` writes the values
anew, and the commit says why.
"""

import csv
import functools
import json
import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command_line import ended, tpjb
from tests.good_campaigns import SAMPLES, SHARED, sample

GOLDEN = Path(__file__).parent / "data" / "golden.json"
POINT = ("static_load_N", "static_load_direction_deg", "excitation_Hz")
#: Largest shift of a coefficient over its standard error, and of an interval's half width over itself.
SHIFT, WIDTH = 1e-3, 1e-3

pytestmark = [pytest.mark.slow, pytest.mark.samples]


@functools.cache
def identified(name: str) -> tuple[list[dict[str, str]], float]:
    """Rows of a sample campaign's table of coefficients, and the processor time that they took [s]."""
    with tempfile.TemporaryDirectory() as folder:
        out, began = Path(folder) / "out", time.process_time()
        result = tpjb("identify", sample(name), "--workers", 1, "--out", out)
        assert result.exit_code in (0, 3), result.output
        rows = list(csv.DictReader((out / "coefficients.csv").read_text(encoding="utf-8").splitlines()))
    return rows, time.process_time() - began


def summarised(name: str) -> list[dict]:
    """Coefficients, standard errors, half widths and flags of every point of a sample campaign."""
    points = []
    for row in identified(name)[0]:
        columns = [column for column in row if column.endswith(("_N_per_m", "_Ns_per_m"))]
        widths = [(float(row[f"{c}_hi"]) - float(row[f"{c}_lo"])) / 2 for c in columns]
        point = {
            "point": [float(row[name]) for name in POINT],
            "value": [float(row[c]) for c in columns],
            "se": [float(row[f"{c}_se"]) for c in columns],
            "half_width": widths,
            "quality": row["quality"],
            "rejected": int(row["n_windows_rejected"]),
        }
        points.append(point)
    return points


def errors_of(row: dict[str, str], truth: dict) -> tuple[list[float], list[bool], list[bool]]:
    """Errors of the direct coefficients; whether the interval of each, and its random part, hold the truth."""
    direct, inside, by_chance = [], [], []
    for kind, unit in (("K", "N_per_m"), ("C", "Ns_per_m")):
        for i, first in enumerate("xy"):
            for j, second in enumerate("xy"):
                name, true = f"{kind.lower()}{first}{second}_{unit}", truth[kind][i][j]
                value = float(row[name])
                direct += [abs(value / true - 1)] if i == j else []
                inside.append(float(row[f"{name}_lo"]) <= true <= float(row[f"{name}_hi"]))
                by_chance.append(abs(value - true) <= float(row[f"{name}_random95"]))
    return direct, inside, by_chance


@pytest.mark.parametrize("name", ["rocker-baseline", "rocker-measured-pivots", "spherical-baseline"])
def test_coefficients_and_intervals_hold_the_truth(name):
    true = json.loads((SAMPLES / "truth" / f"{name}.json").read_text(encoding="utf-8"))["points"]
    truths = {(p["static_load_N"], p["excitation_Hz"]): p for p in true}
    rows, seconds = identified(name)
    assert seconds < 20  # 2-4 s on an idle core; a busy one that shares its units takes twice that
    assert len(rows) == len(truths)
    total, random = [], []
    for row in rows:
        line = float(row["excitation_Hz"])
        direct, inside, by_chance = errors_of(row, truths[float(row["static_load_N"]), line])
        mains = math.isclose(line, 50.0)
        assert max(direct) < (0.03 if mains else 0.01)
        assert ("mains on excitation line" in row["quality"]) == mains
        total += inside
        random += by_chance
    assert np.mean(total) >= 0.95
    assert np.mean(random) >= 0.88


@pytest.mark.parametrize("name", sorted(json.loads(GOLDEN.read_text(encoding="utf-8"))))
def test_coefficients_intervals_and_flags_stay(name):
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))[name]
    points = summarised(name)
    for part in ("point", "quality", "rejected"):
        assert [p[part] for p in points] == [p[part] for p in golden]
    for now, then in zip(points, golden, strict=True):
        shift = (np.array(now["value"]) - then["value"]) / then["se"]
        assert np.abs(shift).max() < SHIFT
        for part in ("se", "half_width"):
            np.testing.assert_allclose(now[part], then[part], rtol=WIDTH)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("diagnosed") / "out"
    ended(0, "diagnose", sample("effect-b"), "--workers", 1, "--out", out)
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


def test_two_effects_past_a_jump_of_stiffness_and_damping_are_named(tmp_path):
    # growth of 9 um empties pads: a search that ends before that jump finds neither
    ended(0, "diagnose", sample("mixture-b"), "--workers", 1, "--out", tmp_path / "out")
    verdict = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    sizes = dict[str, dict[str, float]]()
    for effect in verdict["effects"]:
        sizes |= effect["parameters"]
    assert {effect["name"] for effect in verdict["effects"]} == {"thermal_growth", "oil_viscosity"}
    assert sizes["clearance_change"]["lo"] < 9e-6 < sizes["clearance_change"]["hi"]
    assert sizes["factor"]["lo"] < 0.88 < sizes["factor"]["hi"]


def test_the_gap_shrinks_on_points_that_no_fit_has_seen(diagnosed):
    gap = json.loads((diagnosed / "diagnosis.json").read_text())["gap"]
    assert gap["heldout_after"] < 0.5 * gap["heldout_before"]


def test_the_effects_file_is_read_by_predict_and_changes_what_the_cells_show(diagnosed, tmp_path):
    bearing = SHARED / "bearings" / "spherical.toml"
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


def rewrite() -> None:
    """Write the values of this checkout, seven digits each."""
    names = json.loads(GOLDEN.read_text(encoding="utf-8"))
    blocks = []
    for name in names:
        points = summarised(name)
        for point in points:
            for part in ("value", "se", "half_width"):
                point[part] = [float(f"{number:.7g}") for number in point[part]]
        lines = ",\n".join(f"  {json.dumps(point)}" for point in points)
        blocks.append(f' "{name}": [\n{lines}\n ]')
    GOLDEN.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(rewrite())
